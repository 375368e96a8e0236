"""OPC UA driver: told lines, and in a gateway before the simulated controller."""

import contextlib
import itertools
import math

import psutil
import pytest

from controllers.opcua.driver import OPCUA, OpcUaDriver
from controllers.opcua.facts import Item, ItemsFound, Reading, Values, encode
from controllers.opcua.settings import OpcUaJoint, OpcUaSettings, OpcUaSignal, from_text, to_text
from controllers.opcua.units import Unit, number_of
from protocol_gateway.seam import (
    Activity,
    AlarmReceived,
    JointsReceived,
    MalformedReceived,
    Mode,
    MoveAbsolute,
    Open,
    Send,
    Severity,
    SignalsReceived,
    SoftwareReceived,
    StatusReceived,
)
from protocol_gateway.seam.errors import CommandError, GatewaySettingsError
from robots.kinematics.joints import JointType
from tests.controllers.opcua.standard_nodes import keep_standard_nodes
from tests.controllers.simulated_site import running
from tests.ports import free_port
from tests.protocol_gateway.gateway_site import STATE, A, gateway, refusal, until

DEGREE, RADIAN, MILLIMETRE = (Unit(number_of(code), code) for code in ("DD", "C81", "MMT"))
NOW_S, T_S = 100.0, 1.79e9
OPC_UA = {"description": "puma560", "protocol": "opcua", "options": OpcUaSettings(security="none")}


def axes(*units, kind="position", profile=1):
    return [Item(kind, f"Axis_{number}", unit, profile) for number, unit in enumerate(units, 1)]


class Told:
    """A driver that is told facts, of two rotary joints.

    Attributes:
        events: What it reported last.
    """

    def __init__(self, items=None, types=(JointType.ROTARY,) * 2, sampling_s=0.05, **settings):
        self.driver = OpcUaDriver(types, {}, options=OpcUaSettings(**settings))
        self.now_s = NOW_S
        (opened,) = self.driver.started(NOW_S)
        assert isinstance(opened, Open)
        assert from_text(opened.settings).rate_hz == 20.0
        self.driver.opened(OPCUA, NOW_S)
        items = axes(DEGREE, DEGREE) if items is None else items
        self.begin = self.tell(ItemsFound(tuple(items), "server X", sampling_s))

    def tell(self, fact, after_s=0.05):
        self.now_s += after_s
        line = fact if isinstance(fact, bytes) else encode(fact)
        self.events = [
            event for effect in self.driver.received(OPCUA, line, self.now_s) for event in effect.events
        ]
        return self.events

    def values(self, *readings, **options):
        """Tell readings: item, value, and optionally its time after T_S and whether it is good."""
        made = []
        for item, value, *more in readings:
            at_s, good = (*more, *(0.0, True)[len(more) :])
            made.append(Reading(item, value, None if at_s is None else T_S + at_s, good))
        return self.tell(Values(tuple(made)), **options)

    def keep_alive(self, after_s=0.3):
        return self.tell(Values(), after_s)

    @property
    def joints(self):
        return next((each for each in self.events if isinstance(each, JointsReceived)), None)

    @property
    def status(self):
        return next(each for each in self.events if isinstance(each, StatusReceived))

    @property
    def signals(self):
        found = [each for each in self.events if isinstance(each, SignalsReceived)]
        return {(s.name, s.joint): value for each in found for s, value in each.values}


# ---------------------------------------------------------------------------- joints


def test_axes_become_joints_in_si_with_the_newest_source_time():
    told = Told(axes(DEGREE, RADIAN))
    told.values((0, 180.0, 0.0), (1, -1.5, 0.01))
    assert told.joints == JointsReceived((pytest.approx(math.pi), -1.5), None, T_S + 0.01)


def test_axes_are_ordered_by_their_numbers_and_linear_ones_are_in_metres():
    items = [Item("position", name, MILLIMETRE, 3) for name in ("Axis_10", "Axis_2")]
    told = Told(items, types=(JointType.PRISMATIC,) * 2)
    told.values((0, 10.0), (1, 2.0))
    assert told.joints.positions == (pytest.approx(0.002), pytest.approx(0.010))


def test_site_file_names_axes_directions_and_zeros():
    joints = [OpcUaJoint(axis="Axis_2", reversed=True, zero=90.0), OpcUaJoint(node="ns=2;s=J", unit="rad")]
    told = Told([*axes(DEGREE, DEGREE), Item("position", "ns=2;s=J")], joints=joints)
    told.values((0, 1.0), (1, 30.0), (2, 0.5))
    assert told.joints.positions == (pytest.approx(math.radians(60)), 0.5)


@pytest.mark.parametrize(
    ("items", "why"),
    [
        (axes(DEGREE, Unit()), "Axis_2 has no unit (EngineeringUnits): declare unit"),
        (axes(DEGREE, Unit(number_of("KGM"), "kg")), "Axis_2 has the unit 'kg'"),
        (axes(DEGREE, Unit(0, "furlong")), "Axis_2 has the unit 'furlong' (0)"),
        (axes(DEGREE, MILLIMETRE), "Axis_2 is in m, but this joint of the model is rotary"),
        (axes(DEGREE, DEGREE, profile=3), "moves on a linear axis (MotionProfile 3)"),
        (axes(DEGREE), "the server has 1 axes (Axis_1), but the model has 2 joints"),
        (axes(DEGREE, DEGREE, DEGREE), "the server has 3 axes"),
    ],
)
def test_joints_that_are_uncertain_are_not_shown_and_say_why(items, why):
    told = Told(items)
    (warning,) = [e for e in told.begin if isinstance(e, AlarmReceived) and "not shown" in e.text]
    assert why in warning.text
    told.values(*((number, 1.0) for number in range(len(items))))
    assert told.joints is None
    assert why in told.signals["opcua.joints", None]
    told.keep_alive(2.0)
    assert told.joints is None
    assert why in told.signals["opcua.joints", None]


@pytest.mark.parametrize("value", [None, True, "12"])
def test_position_that_is_no_number_gives_no_joints(value):
    told = Told()
    told.values((0, 1.0), (1, value))
    assert told.joints is None
    assert told.signals["opcua.joints", None] == "Axis_2 has no good value"


def test_status_code_that_is_not_good_makes_joints_unknown_until_it_is_good_again():
    told = Told()
    told.values((0, 1.0), (1, 2.0))
    assert told.joints is not None
    told.values((1, 2.0, 0.05, False))
    assert told.joints is None
    assert told.signals["opcua.joints", None] == "Axis_2 has no good value"
    told.keep_alive(5.0)
    assert told.joints is None
    told.values((1, 2.5, 5.1))
    assert told.joints.positions == (math.radians(1.0), math.radians(2.5))


def test_positions_of_different_moments_are_not_joined():
    told = Told(sampling_s=0.05)
    told.values((0, 1.0, 0.0), (1, 2.0, 0.06))
    assert told.joints is None
    assert "times differ by 0.06 s; up to 0.05 s they are one moment" in told.signals["opcua.joints", None]
    # Nothing has changed since, says the keep-alive: they are of its moment.
    told.keep_alive()
    assert told.joints == JointsReceived((math.radians(1.0), math.radians(2.0)))
    # An unchanged axis may have an old time.
    told.values((0, 3.0, 10.0), (1, 2.0, 0.06))
    assert told.joints.positions == (math.radians(3.0), math.radians(2.0))
    assert told.joints.controller_time_s == T_S + 10.0


def test_keep_alive_repeats_joints_without_a_time():
    told = Told()
    told.values((0, 1.0), (1, 2.0))
    told.keep_alive()
    assert told.joints == JointsReceived((math.radians(1.0), math.radians(2.0)))


def test_speeds_are_the_joints_velocities_if_they_are_of_the_same_moment():
    speeds = [Item("speed", f"Axis_{n}", Unit(number_of("E96"), "°/s"), 1) for n in (1, 2)]
    joints = [OpcUaJoint(axis="Axis_1"), OpcUaJoint(axis="Axis_2", reversed=True)]
    told = Told([*axes(DEGREE, DEGREE), *speeds], joints=joints)
    told.values((0, 1.0), (1, 2.0), (2, 180.0), (3, 90.0))
    assert told.joints.velocities == (pytest.approx(math.pi), pytest.approx(-math.pi / 2))
    told.values((0, 2.0, 1.0), (2, 90.0, 2.0))
    assert told.joints.velocities is None
    told.values((2, 90.0, 2.1, False), (0, 3.0, 2.1))
    assert told.joints.velocities is None


# ---------------------------------------------------------------------- status, signals


def test_status_follows_safety_drives_and_motion():
    items = [Item(kind) for kind in ("mode", "emergency_stop", "protective_stop", "in_control", "loaded")]
    told = Told([*axes(DEGREE, DEGREE), *items])
    told.values((0, 1.0), (1, 2.0), (2, 4.0), (3, False), (4, False), (5, True), (6, False))
    assert told.status == StatusReceived(Activity.IDLE, Mode.REMOTE)
    told.values((6, True))  # a program is loaded: it may run, and wait
    assert told.status.activity is None
    told.values((0, 5.0, 1.0))
    assert told.status.activity is Activity.MOVING
    told.keep_alive(1.0)
    assert told.status.activity is None
    for stop in (3, 4):
        told.values((stop, True))
        assert told.status.activity is Activity.STOPPED
        told.values((stop, True, 0.0, False))
        assert told.status.activity is None
    told.values((5, False))
    assert told.status.activity is Activity.STOPPED
    told.values((3, 1.0), (5, 0.0))  # not booleans
    assert told.status.activity is None
    for mode, known in ((0.0, None), (1.0, Mode.LOCAL), (3.0, Mode.LOCAL), (7.0, None), ("4", None)):
        told.values((2, mode))
        assert told.status.mode is known


def test_stop_of_the_safety_system_is_an_alarm_when_it_begins_also_over_connections():
    items = [*axes(DEGREE, DEGREE), *(Item(kind) for kind in ("emergency_stop", "protective_stop"))]
    told = Told(items)

    def alarms():
        return [(each.severity, each.number) for each in told.events if isinstance(each, AlarmReceived)]

    told.values((2, False), (3, False))
    assert alarms() == []
    told.values((3, True))
    assert alarms() == [(Severity.ERROR, "safety.protective_stop")]
    told.values((3, True), (2, True))
    assert alarms() == [(Severity.ERROR, "safety.emergency_stop")]
    told.values((3, True, 0.0, False))  # unknown, so not known to be over
    told.driver.opened(OPCUA, told.now_s)
    told.tell(ItemsFound(tuple(items), "server X", 0.05))
    told.values((2, True), (3, True))
    assert alarms() == []
    told.values((3, False))
    told.values((3, True))
    assert alarms() == [(Severity.ERROR, "safety.protective_stop")]


def test_values_become_signals_with_the_names_of_all_vendors():
    items = [
        *axes(DEGREE, DEGREE),
        Item("motor", "Axis_2", Unit(number_of("KEL"), "K")),
        Item("motor", "Extra/Motor", Unit(number_of("CEL"), "°C")),
        Item("mass", "", Unit(number_of("GRM"), "g")),
        Item("override"),
        Item("mode"),
        Item("program"),
        Item("program"),
        Item("execution"),
        Item("declared", "io.digital_in.3"),
        Item("declared", "cell.pressure", Unit(1, "bar")),
        Item("declared", "cell.path", MILLIMETRE),
    ]
    declared = [
        OpcUaSignal(name="io.digital_in.3", node="i=1"),
        OpcUaSignal(name="cell.pressure", node="i=2", unit="bar"),
        OpcUaSignal(name="cell.path", node="i=3"),
    ]
    told = Told(items, signals=declared)
    given = (300.0, 41.0, 2500.0, 80.0, 4.0, "Weld", "Clean", 2.0, True, 6.5, 1500.0)
    told.values(*((number, value) for number, value in enumerate(given, 2)))
    assert told.signals == {
        ("joint.temperature", 1): pytest.approx(26.85),
        ("opcua.motor_2.temperature", None): 41.0,
        ("payload.mass", None): 2.5,
        ("speed.override", None): 80.0,
        ("robot.mode", None): "automatic external",
        ("program.name", None): "Weld",
        ("opcua.task_2.program", None): "Clean",
        ("program.cycle", None): "step",
        ("io.digital_in.3", None): True,
        ("cell.pressure", None): 6.5,
        ("cell.path", None): 1.5,
        ("opcua.joints", None): "Axis_1 has no good value",
        ("opcua.joints.spread", None): None,
        ("opcua.without_unit", None): None,
    }
    told.values((5, 70.0, 1.0, False))
    assert told.signals == {("speed.override", None): None}
    told.values((6, 9.0))
    assert told.signals == {("robot.mode", None): "unknown 9"}


def test_number_without_a_unit_is_not_shown_in_an_assumed_one():
    """A signal's name promises its unit; OPC 40010-1 itself says that the override is in percent."""
    items = [
        *axes(DEGREE, DEGREE),
        Item("motor", "Axis_2"),
        Item("mass"),
        Item("temperature", "", Unit(number_of("KGM"), "kg")),
        Item("override"),
        Item("declared", "tool.temperature"),
        Item("declared", "joint.waist.current", Unit(0, "mystery")),
        Item("declared", "tool.force.x"),
        Item("declared", "cell.pressure", Unit(0, "bar")),
        Item("declared", "counter.1"),
    ]
    declared = [
        OpcUaSignal(name="tool.temperature", node="i=1"),
        OpcUaSignal(name="joint.waist.current", node="i=2"),
        OpcUaSignal(name="tool.force.x", node="i=3", unit="N"),
        OpcUaSignal(name="cell.pressure", node="i=4"),
        OpcUaSignal(name="counter.1", node="i=5"),
    ]
    told = Told(items, signals=declared)
    told.values(*((number, 7.0) for number in range(2, 11)))
    missing = (
        "temperature of Axis_2, payload.mass, cabinet.temperature, tool.temperature, joint.waist.current"
    )
    assert told.signals == {
        ("joint.temperature", 1): None,
        ("payload.mass", None): None,
        ("cabinet.temperature", None): None,
        ("speed.override", None): 7.0,
        ("tool.temperature", None): None,
        ("joint.waist.current", None): None,
        ("tool.force.x", None): 7.0,
        ("cell.pressure", None): 7.0,
        ("counter.1", None): 7.0,
        ("opcua.joints", None): "Axis_1 has no good value",
        ("opcua.joints.spread", None): None,
        ("opcua.without_unit", None): missing,
    }
    (values,) = [each.values for each in told.events if isinstance(each, SignalsReceived)]
    units = {signal.name: signal.unit for signal, _ in values}
    assert (units["cell.pressure"], units["counter.1"], units["tool.force.x"]) == ("bar", "", "N")


def test_nothing_is_assumed_about_encoders_or_security():
    driver = OpcUaDriver((JointType.ROTARY,), {})
    assert not driver.capabilities.absolute
    assert OpcUaSettings().security == "sign_and_encrypt"


def test_identity_is_reported_once_also_over_connections():
    items = [*axes(DEGREE, DEGREE), Item("model"), Item("software")]
    told = Told(items)
    assert [each.text for each in told.begin] == ["server X"]
    told.values((0, 1.0), (1, 1.0), (2, "R6"))
    told.values((3, "1.2"))
    assert [e.text for e in told.events if isinstance(e, AlarmReceived)] == ["model R6, software 1.2"]
    assert SoftwareReceived("1.2") in told.events
    told.driver.closed(OPCUA, told.now_s)
    told.driver.opened(OPCUA, told.now_s)
    again = told.tell(ItemsFound(tuple(items), "server X", 0.05))
    again += told.values((0, 1.0), (1, 1.0), (2, "R6"), (3, "1.2"))
    assert not [each for each in again if isinstance(each, AlarmReceived)]


# ------------------------------------------------------------------------------ lines


@pytest.mark.parametrize(
    "line",
    [
        b"\n",
        b"{}\n",
        b'{"alive":false}\n',
        b'{"values":[]}\n',
        b'{"values":[[0,1.0,null]]}\n',
        b'{"values":[[true,1.0,null,true]]}\n',
        b'{"values":[[2,1.0,null,true]]}\n',
        b'{"values":[[-1,1.0,null,true]]}\n',
        b'{"values":[[0,[1.0],null,true]]}\n',
        b'{"values":[[0,1.0,1e300,true]]}\n',
        b'{"values":[[0,1.0,NaN,true]]}\n',
        b'{"values":[[0,1.0,null,1]]}\n',
        b'{"found":[],"server":"x","sampling_s":0.05}\n',
        b"[" * 5000 + b"\n",
        b"\xff\xfe\n",
    ],
)
def test_line_that_is_none_is_reported_and_not_used(line):
    told = Told()
    (event,) = told.tell(line)
    assert isinstance(event, MalformedReceived)
    told.values((0, 1.0), (1, 2.0))
    assert told.joints is not None


def test_values_before_the_list_and_lines_without_an_end_are_malformed():
    driver = OpcUaDriver((JointType.ROTARY,), {}, options=OpcUaSettings())
    driver.started(NOW_S)
    driver.opened(OPCUA, NOW_S)
    (report,) = driver.received(OPCUA, b'{"alive":true}\n', NOW_S)
    assert report.units == 0
    assert driver.received(OPCUA, b"x" * (1 << 19), NOW_S) == ()
    (report,) = driver.received(OPCUA, b"x", NOW_S)
    assert isinstance(report.events[0], MalformedReceived)


def test_numbers_that_are_not_finite_are_unknown():
    told = Told()
    told.tell(b'{"values":[[0,NaN,null,true],[1,1e999,null,true]]}\n')
    assert told.joints is None


def test_settings_that_do_not_fit_the_model_are_refused():
    for joints, why in (
        ([OpcUaJoint(axis="a")], "1 are declared, but the model has 2 joints"),
        ([OpcUaJoint(axis="a"), OpcUaJoint()], "either axis or node"),
        ([OpcUaJoint(axis="a"), OpcUaJoint(axis="b", unit="mm")], "unit 'mm' does not fit"),
    ):
        with pytest.raises(GatewaySettingsError, match=why):
            OpcUaDriver((JointType.ROTARY,) * 2, {}, options=OpcUaSettings(joints=joints))
    with pytest.raises(GatewaySettingsError, match="no type codes"):
        OpcUaDriver((JointType.ROTARY,), {1: "X"})


def test_settings_reach_the_process_as_they_are():
    settings = OpcUaSettings(
        security="sign_and_encrypt",
        joints=[OpcUaJoint(node="i=1", unit="mm", reversed=True, zero=2.0)],
        signals=[OpcUaSignal(name="a", node="i=2", unit="bar")],
    )
    assert from_text(to_text(settings)) == settings


def test_driver_commands_nothing_and_sends_nothing():
    told = Told()
    assert not told.driver.capabilities.commands
    assert told.driver.requests_a_second == 0.0
    with pytest.raises(CommandError):
        told.driver.prepare(MoveAbsolute((0.0, 0.0)))
    effects = itertools.chain(
        told.driver.command(b"x", NOW_S),
        told.driver.timer_ended({}, NOW_S),
        told.driver.skipped(OPCUA, NOW_S),
    )
    assert not [each for each in effects if isinstance(each, Send)]


# ----------------------------------------------------------------- before a simulated one


@contextlib.asynccontextmanager
async def controller(**settings):
    """Run a simulated controller; yield its port."""
    from controllers.opcua.simulated.service import OpcUaSimulatorSettings, serve_opcua

    keep_standard_nodes()
    settings.setdefault("listen", f"127.0.0.1:{free_port()}")
    async with running(serve_opcua, OpcUaSimulatorSettings(**settings)) as port:
        yield port


def readers():
    """Return the reading processes of this one."""
    module = "controllers.opcua.reader.process"
    found = []
    for each in psutil.Process().children(recursive=True):
        with contextlib.suppress(psutil.NoSuchProcess):
            if module in each.cmdline():
                found.append(each)
    return found


@pytest.mark.slow
async def test_gateway_shows_the_robot_and_survives_the_end_of_its_reader(mesh, tmp_path):
    async with controller(demo=True) as port, gateway(mesh, tmp_path, port, **OPC_UA) as site:
        await until(lambda: len(site.seen.get("joints", [])) > 20)
        assert site.controller.mode == STATE.REMOTE
        await until(lambda: site.controller.activity == STATE.MOVING)
        assert site.controller.counters.units_lost == 0
        refused = await refusal(site.lease(A.ACQUIRE))
        assert refused
        (reader,) = readers()
        reader.kill()
        await until(lambda: site.controller.link != STATE.UP)
        await until(lambda: site.controller.link == STATE.UP)
        (again,) = readers()
        assert again.pid != reader.pid
        before = len(site.seen["joints"])
        await until(lambda: len(site.seen["joints"]) > before + 5)
    await until(lambda: not readers())
