"""Signals: what is published of them, and when."""

import json
import math
import re
from pathlib import Path

import pytest

from protocol_gateway.driver_parts.signal_names import SHARED, numbered, of_axes, of_joints
from protocol_gateway.link.timestamping import EventTime
from protocol_gateway.seam import Signal, SignalsReceived
from protocol_gateway.telemetry import set_up_file
from protocol_gateway.telemetry.journal import Journal
from protocol_gateway.telemetry.signals import MOST_SIGNALS, Signals
from tests.controllers.universal_robots.test_rtde_driver import UR, controller
from tests.protocol_gateway.gateway_site import gateway, until

CURRENT = Signal("joint.current", "A", 0)
LOAD = Signal("payload.mass", "kg")
INPUT = Signal("io.digital_in.3")
PROGRAM = Signal("program.name")
START_S = 1000.0
MANUAL = Path(__file__).resolve().parents[2] / "docs" / "signals.md"


class Robot:
    """Signals of a robot, with a publisher that keeps messages and a journal that keeps codes."""

    def __init__(self):
        self.published, self.times_ns, self.codes, self.events = [], [], [], []
        journal = Journal(self, "arm", monotonic_s=lambda: self.now_s)
        self.signals = Signals(self, journal, ["waist", "elbow"])
        self.now_s = START_S

    def put(self, message, *, source_time_ns=None, dated_by=None):
        if source_time_ns is None:
            self.codes.append(message.code)
            self.events.append(message)
            return
        self.published.append({each.name: value(each) for each in message.signals})
        self.times_ns.append(source_time_ns)
        self.last = {each.name: each for each in message.signals}
        assert message.timestamp.ToNanoseconds() == source_time_ns

    def reports(self, *values, after_s=0.0, **more):
        self.now_s += after_s
        self.signals.take(SignalsReceived(values, **more), EventTime(self.now_s, round(self.now_s * 1e9)))

    def waits(self, seconds):
        self.now_s += seconds
        self.signals.publish_due(self.now_s)


def value(signal):
    return getattr(signal, signal.WhichOneof("value"))


@pytest.fixture
def robot():
    return Robot()


def test_a_report_is_published_with_names_units_and_kinds(robot):
    robot.reports((PROGRAM, "weld"), (CURRENT, 1.25), (INPUT, False))
    assert robot.published == [
        {"io.digital_in.3": False, "joint.waist.current": 1.25, "program.name": "weld"}
    ]
    assert [each.unit for each in robot.last.values()] == ["", "A", ""]
    assert [each.WhichOneof("value") for each in robot.last.values()] == ["on", "number", "text"]
    assert robot.times_ns == [round(START_S * 1e9)]


def test_numbers_at_125_hz_are_published_10_times_a_second(robot):
    for number in range(1250):
        robot.reports((CURRENT, float(number)), after_s=0.008)
    assert 99 <= len(robot.published) <= 101


def test_a_boolean_is_published_at_once_but_at_most_50_times_a_second(robot):
    robot.reports((CURRENT, 0.0), (INPUT, False))
    robot.reports((CURRENT, 0.5), (INPUT, False), after_s=0.025)
    assert len(robot.published) == 1
    robot.reports((CURRENT, 0.6), (INPUT, True), after_s=0.001)
    assert robot.published[1:] == [{"io.digital_in.3": True, "joint.waist.current": 0.6}]
    before = len(robot.published)
    for number in range(500):
        robot.reports((INPUT, number % 2 == 1), after_s=0.002)
    assert len(robot.published) - before <= 51


def test_a_change_that_comes_too_soon_is_published_without_a_further_report(robot):
    robot.reports((INPUT, False))
    robot.reports((INPUT, True), after_s=0.001)
    assert len(robot.published) == 1
    robot.waits(0.1)
    assert robot.published[1:] == [{"io.digital_in.3": True}]
    assert robot.times_ns[1] == round((START_S + 0.001) * 1e9)  # the time of the report, not of the message


def test_values_that_stay_the_same_are_published_once_a_second_while_they_are_reported(robot):
    for _ in range(100):
        robot.reports((CURRENT, 1.0), after_s=0.1)
    assert 9 <= len(robot.published) <= 11
    for _ in range(100):
        robot.waits(0.1)
    assert len(robot.published) <= 12  # at most what the last report still had to say


def test_a_part_leaves_the_other_values_as_they_are_with_their_age(robot):
    robot.reports((LOAD, 2.0), valid_for_s=10.0)
    robot.reports((INPUT, True), after_s=1.5)
    assert robot.published[1] == {"io.digital_in.3": True, "payload.mass": 2.0}
    assert not robot.last["io.digital_in.3"].HasField("age_s")
    assert robot.last["payload.mass"].age_s == pytest.approx(1.5)
    robot.reports((LOAD, 2.0), (INPUT, True), after_s=1.5)
    assert not robot.last["payload.mass"].HasField("age_s")


def test_an_unknown_value_is_absent_and_never_zero(robot):
    robot.reports((CURRENT, math.nan), (LOAD, None), (INPUT, False))
    assert robot.published == [{"io.digital_in.3": False}]
    robot.reports((CURRENT, 0.0), after_s=1.0)
    assert robot.published[1] == {"io.digital_in.3": False, "joint.waist.current": 0.0}
    robot.reports((CURRENT, None), after_s=1.0)
    assert robot.published[2] == {"io.digital_in.3": False}


def test_a_value_that_is_not_reported_again_expires(robot):
    robot.reports((LOAD, 2.0), (PROGRAM, "weld"))
    for _ in range(4):
        robot.reports((PROGRAM, "weld"), after_s=1.0)
    assert robot.published[-1] == {"program.name": "weld"}
    assert robot.signals.current(robot.now_s) == {"program.name": ("", "weld")}
    assert robot.signals.current(robot.now_s + 3.0) == {}


def test_nothing_of_a_lost_link_is_published_later(robot):
    robot.reports((INPUT, False))
    robot.reports((INPUT, True), after_s=0.001)
    robot.signals.forget()
    robot.waits(0.1)
    assert len(robot.published) == 1
    robot.reports((PROGRAM, "weld"), after_s=1.0)
    assert robot.published[1] == {"program.name": "weld"}


def test_thousands_of_names_are_cut_off_and_reported_once(robot):
    many = [(Signal(f"io.digital_in.{number}"), True) for number in range(5000)]
    for _ in range(10):
        robot.reports(*many, after_s=1.0)
    assert {len(each) for each in robot.published} == {MOST_SIGNALS}
    assert robot.codes == ["signals.too_many"]
    robot.reports((PROGRAM, "weld"), after_s=4.0)  # the others have expired
    assert robot.published[-1] == {"program.name": "weld"}


def test_a_text_is_one_line_of_at_most_200_characters(robot):
    robot.reports((PROGRAM, "a\nb" + "c" * 1_000_000))
    assert robot.published[0]["program.name"].startswith("a bccc")
    assert len(robot.published[0]["program.name"]) == 200


def test_a_change_of_tool_or_payload_at_the_controller_is_an_event(robot):
    offset, number = Signal("tool.offset.z", "m"), Signal("tool.number")
    force = Signal("tool.force.z", "N")
    robot.reports((LOAD, 1.2), (offset, 0.1), (number, 1), (force, 0.0))
    robot.reports((LOAD, 1.2 + 1e-9), (offset, 0.1), (number, 1), (force, 5.0), after_s=0.1)
    assert robot.codes == []
    robot.reports((LOAD, 2.5), (offset, 0.15), (number, 2), after_s=0.1)
    assert robot.codes == ["controller.payload_changed", "controller.tool_changed"]
    assert robot.events[0].values["changes"] == "payload.mass 1.2 → 2.5 kg"
    assert robot.events[1].values["changes"] == "tool.offset.z 0.1 → 0.15 m, tool.number 1 → 2"
    # Also while the link was lost.
    robot.signals.forget()
    robot.reports((LOAD, 2.5), (offset, 0.1), after_s=1.0)
    assert robot.codes[2:] == ["controller.tool_changed"]
    assert robot.events[2].values["changes"] == "tool.offset.z 0.15 → 0.1 m"


def test_changes_of_the_tool_are_unconfirmed_until_they_are_undone_or_confirmed(robot):
    number = Signal("tool.number")
    robot.reports((LOAD, 1.2), (number, 1))
    assert robot.signals.unconfirmed == ()
    robot.reports((LOAD, 2.5), (number, 2), after_s=0.1)
    robot.signals.forget()
    assert robot.signals.unconfirmed == ("payload.mass 1.2 → 2.5", "tool.number 1 → 2")
    robot.reports((LOAD, 1.2), (number, 3), after_s=0.1)
    assert robot.signals.unconfirmed == ("tool.number 1 → 3",)
    # Unknown is no confirmation.
    robot.reports((number, None), after_s=0.1)
    assert robot.signals.unconfirmed == ("tool.number 1 → 3",)
    robot.signals.confirm()
    assert robot.signals.unconfirmed == ()
    robot.reports((number, 1), after_s=0.1)
    assert robot.signals.unconfirmed == ("tool.number 3 → 1",)


async def test_a_change_of_the_tool_while_no_gateway_ran_is_one_too(mesh, tmp_path):
    path = tmp_path / "hall" / "arm.tool"
    async with controller() as ports:
        settings = {**UR, "ports": {"primary": ports[1]}}
        async with gateway(mesh, tmp_path, ports[0], **settings):
            await until(path.exists)
        kept = json.loads(path.read_text())
        assert kept["payload.mass"] == pytest.approx(1.2)
        path.write_text(json.dumps(kept | {"payload.mass": 3.0}))
        async with gateway(mesh, tmp_path, ports[0], **settings) as site:
            event = await site.event("controller.payload_changed", 0)
            assert event.values["changes"].startswith("payload.mass 3 → ")


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b'{"tool.number": [1]}', b"[" * 50_000, b'{"a": NaN}'])
def test_a_damaged_file_of_what_was_confirmed_is_none(tmp_path, content):
    path = tmp_path / "arm.tool"
    assert set_up_file.read(path) == {}
    path.write_bytes(content)
    assert set_up_file.read(path) == {}
    set_up_file.write(path, {"tool.number": 2, "tool.name": "gripper", "payload.mass": 1.5})
    assert set_up_file.read(path) == {"tool.number": 2, "tool.name": "gripper", "payload.mass": 1.5}


def test_names_of_tools_without_end_are_bounded(robot):
    for number in range(2000):
        robot.signals.forget()
        robot.reports((Signal(f"tool.offset.n{number}", "m"), 1.0), after_s=0.1)
    assert len(robot.signals._setup) <= 256


def test_the_unit_may_change(robot):
    robot.reports((Signal("io.analog_in.0", "V"), 1.0))
    robot.reports((Signal("io.analog_in.0", "A"), 1.0), after_s=0.05)
    assert robot.last["io.analog_in.0"].unit == "A"
    robot.reports((Signal("io.analog_in.0", "V"), 1.0), after_s=0.05)
    assert robot.last["io.analog_in.0"].unit == "V"


def test_a_boolean_and_a_number_are_never_confused(robot):
    robot.reports((INPUT, True))
    robot.reports((INPUT, 1), after_s=0.05)
    assert [robot.last["io.digital_in.3"].WhichOneof("value"), len(robot.published)] == ["number", 2]


@pytest.mark.parametrize("name", ["", "IO.in", "io..in", "io in", "io.", ".io", "io.in\n", "a" * 65])
def test_other_names_are_refused(name):
    with pytest.raises(ValueError, match="lower-case words"):
        Signal(name)


def test_the_manual_has_every_shared_name():
    rows = [line for line in MANUAL.read_text("utf-8").splitlines() if line.startswith("| `")]
    names = [name for row in rows for name in re.findall("`([^`]+)`", row.split("|")[1])]
    assert sorted(names) == sorted(SHARED)


def test_a_vector_a_row_and_all_joints_have_shared_names():
    made = (*of_joints("current", "A", 2), *numbered("io.digital_in", range(8)), *of_axes("tool.force", "N"))
    assert [each.name for each in made[:3]] == ["joint.current", "joint.current", "io.digital_in.0"]
    assert [each.joint for each in made[:3]] == [0, 1, None]
    assert {each.name for each in made[10:]} == {"tool.force.x", "tool.force.y", "tool.force.z"}
