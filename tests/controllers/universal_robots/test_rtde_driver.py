"""RTDE driver: stepped message by message, and in a gateway before the simulated controller."""

import contextlib
import re
import struct

import pytest

from controllers.universal_robots.driver import PRIMARY, RTDE, RtdeDriver, activity_of
from controllers.universal_robots.interfaces.modes import (
    RobotMode,
    RobotStatus,
    RuntimeState,
    SafetyMode,
    SafetyStatus,
)
from controllers.universal_robots.interfaces.state import OUTPUTS, ControllerState
from controllers.universal_robots.signals import signals_of
from controllers.universal_robots.simulated.service import UrSettings, serve_rtde
from protocol_gateway.driver_parts.signal_names import BOOLEAN, SHARED, TEXT
from protocol_gateway.seam import (
    Activity,
    AlarmReceived,
    Close,
    JointsReceived,
    MalformedReceived,
    MoveAbsolute,
    Open,
    Report,
    Send,
    SetTimer,
    Severity,
    SignalsReceived,
    StatusReceived,
)
from protocol_gateway.seam.errors import CommandError, GatewaySettingsError
from robomesh.wire.session import open_session
from robots.descriptions.description import load
from robots.kinematics.joints import JointType
from robots.kinematics.model import build_model, tool_placement
from tests.conftest import last_value
from tests.controllers.simulated_site import running
from tests.ports import free_port
from tests.protocol_gateway.gateway_site import STATE, A, C, gateway, refusal, until
from tests.protocol_gateway.wire import wire

UR = {"description": "puma560", "protocol": "rtde"}
SIX = (JointType.ROTARY,) * 6
NOW_S = 100.0


def package(kind, body=b""):
    return struct.pack(">HB", 3 + len(body), ord(kind)) + body


OFFERED = [
    "timestamp",
    "actual_q",
    "actual_qd",
    "robot_mode",
    "safety_mode",
    "safety_status",
    "runtime_state",
    "actual_digital_input_bits",
    "payload",
]
VERSION = (package("V", b"\x01"), package("v", struct.pack(">4I", 5, 21, 0, 0)))


def types(sent, offered=OFFERED):
    """Return the answer of a controller that has only these fields to a set-up of outputs."""
    names = sent.data[11:].decode().split(",")
    found = [OUTPUTS[name] if name in offered else "NOT_FOUND" for name in names]
    return package("O", b"\x07" + ",".join(found).encode())


def greeting(arm):
    """Let a controller answer the greeting; return what the driver sends."""
    sent = [*arm.opened(RTDE, NOW_S)]
    for answer in VERSION:
        sent += [each for each in arm.received(RTDE, answer, NOW_S) if isinstance(each, Send)]
    while sent[-1].data[2:3] == b"O":
        sent += [each for each in arm.received(RTDE, types(sent[-1]), NOW_S) if isinstance(each, Send)]
    arm.received(RTDE, package("S", b"\x01"), NOW_S)
    return sent


def data(positions=(0.1, 0.2, 0.3, 0.4, 0.5, 0.6), time_s=1.0, safety=1, runtime=1, inputs=0, payload=1.5):
    modes = (RobotMode.RUNNING, safety, safety, runtime)
    values = (time_s, *positions, *(0.0,) * 6, *modes, inputs, payload)
    return package("U", b"\x07" + struct.pack(">13d3iIQd", *values))


def driver():
    return RtdeDriver(SIX, {})


def greeted():
    """Return a driver whose controller has answered the greeting."""
    arm = driver()
    greeting(arm)
    return arm


def report(effects):
    (found,) = [each for each in effects if isinstance(each, Report)]
    return found


def test_it_greets_step_by_step_and_then_sends_nothing():
    arm = driver()
    assert arm.started(NOW_S) == (Open(RTDE), Open(PRIMARY, 30011))
    sent = greeting(arm)
    assert [each.data[2:3] for each in sent] == [b"V", b"v", b"O", b"O", b"S"]
    for number in range(100):
        effects = arm.received(RTDE, data(time_s=1.0 + 0.008 * number), NOW_S)
        assert [type(each) for each in effects] == [Report]


def test_a_state_split_anywhere_gives_joints_and_status_of_the_same_time():
    arm = greeted()
    found = []
    for byte in data(time_s=7.5):
        found += report(arm.received(RTDE, bytes([byte]), NOW_S)).events
    joints, status, signals = found
    assert signals.controller_time_s == 7.5
    assert joints == JointsReceived((0.1, 0.2, 0.3, 0.4, 0.5, 0.6), (0.0,) * 6, 7.5)
    assert status == StatusReceived(Activity.IDLE, None, homed=True, controller_time_s=7.5)


@pytest.mark.parametrize(
    ("state", "activity"),
    [
        ({}, None),
        ({"runtime_state": RuntimeState.STOPPED}, Activity.IDLE),
        ({"runtime_state": RuntimeState.PLAYING}, Activity.MOVING),
        ({"runtime_state": RuntimeState.STOPPING}, Activity.MOVING),
        ({"runtime_state": RuntimeState.PAUSED}, Activity.HOLDING),
        ({"runtime_state": RuntimeState.STOPPED, "robot_mode": RobotMode.POWER_OFF}, Activity.STOPPED),
        ({"runtime_state": RuntimeState.STOPPED, "robot_mode": RobotMode.BACKDRIVE}, Activity.MOVING),
        ({"runtime_state": RuntimeState.PLAYING, "safety_mode": SafetyMode.REDUCED}, Activity.MOVING),
        ({"runtime_state": RuntimeState.PLAYING, "safety_mode": SafetyMode.SAFEGUARD_STOP}, Activity.STOPPED),
        ({"runtime_state": RuntimeState.PAUSED, "safety_mode": SafetyMode.PROTECTIVE_STOP}, Activity.STOPPED),
        ({"runtime_state": RuntimeState.STOPPED, "safety_mode": SafetyMode.FAULT}, Activity.FAULT),
        # A value of newer software is never taken for one that allows motion.
        ({"runtime_state": RuntimeState.STOPPED, "safety_mode": 99}, Activity.STOPPED),
        ({"runtime_state": 77}, Activity.MOVING),
    ],
)
def test_the_activity_forbids_motion_unless_every_word_allows_it(state, activity):
    assert activity_of(ControllerState(timestamp_s=1.0, positions=(0.0,) * 6, **state)) is activity


def test_a_text_of_the_controller_is_an_alarm():
    body = b"\x05Wrist" + b"\x03arm" + b"\x01"
    (event,) = report(greeted().received(RTDE, package("M", body), NOW_S)).events
    assert event == AlarmReceived(Severity.ERROR, "arm: Wrist")


def test_a_value_that_is_no_number_is_malformed_and_gives_no_joints():
    effects = greeted().received(RTDE, data(positions=(float("nan"),) * 6), NOW_S)
    assert [type(each) for each in report(effects).events] == [MalformedReceived]
    assert report(effects).units == 0


def signals(effects):
    """Return the signals that a report has, by their names; None: no report of signals."""
    found = [each for each in report(effects).events if isinstance(each, SignalsReceived)]
    return {signal.name: value for signal, value in found[0].values} if found else None


def test_only_the_outputs_that_the_controller_has_are_signals():
    found = signals(greeted().received(RTDE, data(inputs=1 << 3 | 1 << 17), NOW_S))
    inputs = {name for name, value in found.items() if name.startswith("io.") and value is True}
    assert inputs == {"io.digital_in.3", "io.tool_in.1"}
    modes = {"program.state": "stopped", "robot.mode": "running", "safety.mode": "normal"}
    assert {name: found[name] for name in modes} == modes
    assert found["payload.mass"] == 1.5
    assert len(found) == 18 + len(modes) + 1


def test_signals_are_reported_ten_times_a_second_and_with_each_changed_mode_or_input():
    arm = greeted()
    reported = [
        number
        for number in range(126)
        if signals(arm.received(RTDE, data(time_s=number * 0.008), NOW_S)) is not None
    ]
    assert len(reported) == 10
    assert signals(arm.received(RTDE, data(time_s=1.016, inputs=1), NOW_S))["io.digital_in.0"] is True
    assert signals(arm.received(RTDE, data(time_s=1.024, inputs=1), NOW_S)) is None
    assert signals(arm.received(RTDE, data(time_s=1.032, inputs=1, safety=3), NOW_S)) is not None
    # The controller has restarted.
    assert signals(arm.received(RTDE, data(time_s=0.008, inputs=1, safety=3), NOW_S)) is not None


def test_a_payload_that_is_no_number_is_unknown_and_the_joints_are_shown():
    effects = greeted().received(RTDE, data(payload=float("nan")), NOW_S)
    assert "payload.mass" not in signals(effects)
    assert report(effects).units == 1


def test_every_signal_has_a_shared_name_and_its_unit():
    types, pair = 0b1101, (0.01, 2.0)
    state = ControllerState(
        timestamp_s=1.0,
        positions=(0.0,) * 6,
        **dict.fromkeys(("currents_a", "target_torques", "temperatures_c", "tool_force"), (1.0,) * 6),
        **dict.fromkeys(("tool_offset", "tool_pose"), (0.1,) * 6),
        payload_centre_m=(0.1,) * 3,
        joint_modes=(253,) * 6,
        **dict.fromkeys(("robot_mode", "safety_mode", "runtime_state"), 1),
        **dict.fromkeys(("digital_inputs", "digital_outputs"), 0),
        **dict.fromkeys(("analog_inputs", "analog_outputs", "tool_analog_inputs"), pair),
        **dict.fromkeys(("analog_types", "tool_analog_types"), types),
        **dict.fromkeys(("tool_voltage_v", "script_line"), 12),
        **dict.fromkeys(("tool_current_a", "tool_temperature_c", "payload_kg", "robot_voltage_v"), 1.0),
        **dict.fromkeys(("speed_scaling", "target_speed_fraction", "robot_current_a"), 0.5),
        robot_status=RobotStatus.POWER_ON,
        safety_status=SafetyStatus.NORMAL_MODE,
    )
    found = signals_of(state)
    patterns = {re.compile(name.replace(".", "[.]").replace("*", "[0-9]+")): name for name in SHARED}
    for signal, value in found:
        name = signal.name if signal.joint is None else signal.name.replace(".", f".{signal.joint}.")
        (shared,) = (name_ for pattern, name_ in patterns.items() if pattern.fullmatch(name))
        kind = {str: TEXT, bool: BOOLEAN}.get(type(value))
        if kind is None:
            assert signal.unit in SHARED[shared].split(" or "), name
        else:
            assert (kind, signal.unit) == (SHARED[shared], ""), name
    units = {signal.name: signal.unit for signal, _ in found}
    assert (units["io.analog_in.0"], units["io.analog_in.1"], units["io.analog_out.1"]) == ("V", "A", "V")
    assert len(found) == len({(signal.name, signal.joint) for signal, _ in found}) == 104


def test_a_controller_without_positions_is_left_and_tried_again_later():
    arm = driver()
    arm.opened(RTDE, NOW_S)
    for answer in VERSION:
        (*_, asked) = arm.received(RTDE, answer, NOW_S)
    effects = arm.received(RTDE, types(asked, ["timestamp", "actual_qd"]), NOW_S)
    close, timer = effects[-2:]
    assert close == Close(RTDE, "the controller has no field actual_q")
    assert isinstance(timer, SetTimer)
    assert timer.at_s > NOW_S + 1.0
    assert arm.timer_ended({}, timer.at_s) == (Open(RTDE),)


def message(kind, payload):
    body = struct.pack(">QbB", 1, -2, kind) + payload
    return struct.pack(">iB", 5 + len(body), 20) + body


@pytest.mark.parametrize(
    ("data", "alarm"),
    [
        (
            message(6, struct.pack(">iiiII", 153, 3, 3, 0, 7) + b"too hot"),
            AlarmReceived(Severity.ERROR, "C153A3 too hot", "C153A3"),
        ),
        (
            message(6, struct.pack(">iiiII", 40, 0, 1, 0, 0)),
            AlarmReceived(Severity.INFO, "C40A0", "C40A0"),
        ),
        (
            message(7, struct.pack(">ii", 0, 0) + b"\x13PROGRAM_XXX_STARTEDweld"),
            AlarmReceived(Severity.INFO, "PROGRAM_XXX_STARTED weld"),
        ),
        (
            message(10, struct.pack(">ii", 12, 4) + b"no such name"),
            AlarmReceived(Severity.ERROR, "script, line 12, column 4: no such name"),
        ),
        # For UR's developers.
        (message(6, struct.pack(">iiiII", 1, 0, 0, 0, 0) + b"debug"), None),
    ],
)
def test_messages_of_the_primary_interface_are_alarms(data, alarm):
    arm = greeted()
    arm.opened(PRIMARY, NOW_S)
    effects = [effect for byte in data for effect in arm.received(PRIMARY, bytes([byte]), NOW_S)]
    assert effects == ([] if alarm is None else [Report([alarm], 0)])


def test_a_broken_stream_of_alarms_is_left_alone_and_the_states_go_on():
    arm = greeted()
    arm.opened(PRIMARY, NOW_S)
    report_, close, timer = arm.received(PRIMARY, b"\xff" * 64, NOW_S)
    assert isinstance(report_.events[0], MalformedReceived)
    assert close.channel is PRIMARY
    assert report(arm.received(RTDE, data(), NOW_S)).units == 1
    assert arm.timer_ended({}, timer.at_s) == (Open(PRIMARY, 30011),)


def test_it_refuses_other_robots_codes_and_every_command():
    with pytest.raises(GatewaySettingsError, match="6 rotary joints, this model has 5"):
        RtdeDriver(SIX[:5], {})
    with pytest.raises(GatewaySettingsError, match="codes"):
        RtdeDriver(SIX, {2: "ABSOLUTE.DEG"})
    with pytest.raises(CommandError, match="only reads"):
        driver().prepare(MoveAbsolute((0.0,) * 6))


# ------------------------------------------------------------------- in a gateway


@contextlib.asynccontextmanager
async def controller(**settings):
    """Run a simulated controller; yield its ports of RTDE and of the primary interface."""
    async with whole_controller(**settings) as ports:
        yield ports[:2]


@contextlib.asynccontextmanager
async def whole_controller(**settings):
    """Run a simulated controller; yield its ports: RTDE, primary, scripts, dashboard."""
    async with running(serve_rtde, UrSettings(**settings)) as ports:
        yield ports.rtde, ports.primary, ports.scripts[0], ports.dashboard


async def test_the_controllers_cartesian_position_is_that_of_its_joints(mesh, tmp_path):
    async with (
        controller() as (port, primary),
        gateway(mesh, tmp_path, port, **UR, ports={"primary": primary}) as site,
        open_session(mesh) as session,
    ):
        await until(lambda: site.joints)
        message = await last_value(session, site.key("signals"))
        joints, numbers = site.joints, {each.name: each.number for each in message.signals}
    tool = tool_placement(build_model(load("puma560")), joints)
    assert [numbers[f"tool.pose.{axis}"] for axis in "xyz"] == pytest.approx(tool[:3, 3], abs=1e-6)


async def test_a_controller_with_rtde_is_shown_and_never_commanded(mesh, tmp_path):
    async with (
        controller(demo=True, faults=("fault@4",)) as (port, primary),
        wire(port) as relay,
        wire(primary) as of_primary,
        gateway(mesh, tmp_path, relay.port, **UR, ports={"primary": of_primary.port}) as site,
    ):
        await until(lambda: site.controller.activity == STATE.MOVING)
        assert site.controller.homed == STATE.YES
        assert site.controller.mode == STATE.MODE_UNKNOWN
        await site.units(50)
        first, last = (site.seen["joints"][at] for at in (0, -1))
        assert len(last.joints) == 6
        assert [joint.position for joint in first.joints] != [joint.position for joint in last.joints]
        greeting = relay.data
        assert "does not let the gateway move it" in await refusal(site.lease(A.ACQUIRE))
        assert "Not sent" in await refusal(site.command(C.HOME))
        # A stop is asked for, and is not sent: the answer says so.
        answer = await site.stop(by="wang")
        assert not answer.sent
        await site.units(50)
        assert relay.data == greeting
        assert len(greeting) < 1000
        alarm = await site.event("controller.alarm", -1)
        assert alarm.values["number"] == "C153A0", alarm.text
        await until(lambda: site.controller.activity == STATE.STOPPED)
        assert not of_primary.sent


async def test_a_controller_that_restarts_is_shown_again(mesh, tmp_path):
    async with contextlib.AsyncExitStack() as before, contextlib.AsyncExitStack() as after:
        port, primary = await before.enter_async_context(controller())
        site = await after.enter_async_context(
            gateway(mesh, tmp_path, port, **UR, ports={"primary": primary})
        )
        await before.aclose()
        await until(lambda: site.controller.link == STATE.DOWN)
        await site.event("link.channel_lost", -1)
        addresses = {"listen": f"127.0.0.1:{port}", "primary": f"127.0.0.1:{primary}"}
        await after.enter_async_context(controller(**addresses))
        await until(lambda: site.controller.link == STATE.UP)
        await site.event("link.channel_back", -1)


async def test_without_its_alarms_a_controller_is_shown_and_a_port_of_no_interface_is_refused(mesh, tmp_path):
    async with controller() as (port, primary):
        async with gateway(mesh, tmp_path / "a", port, **UR, ports={"primary": free_port()}) as site:
            lost = await site.event("link.channel_lost", -1)
            assert "primary" in lost.text
            assert site.controller.link == STATE.UP
        with pytest.raises(GatewaySettingsError, match=r"'primery'.*has .*'primary'"):
            async with gateway(mesh, tmp_path / "b", port, **UR, ports={"primery": primary}):
                pass
