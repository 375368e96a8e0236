"""SNPX driver: stepped question by question, and in a gateway before the simulated controller."""

import contextlib
import math
import re
import struct

import numpy as np
import pytest

from controllers.fanuc.assignments import SystemVariable
from controllers.fanuc.axes import FanucSettings, with_defaults
from controllers.fanuc.driver import SNPX, TIMEOUT_S, SnpxDriver, activity_of, mode_of
from controllers.fanuc.simulated.service import SnpxSettings, serve_snpx
from protocol_gateway.seam import (
    Activity,
    AlarmReceived,
    AxesUndeclared,
    JointsReceived,
    MalformedReceived,
    Mode,
    MoveAbsolute,
    Open,
    Report,
    Send,
    SetTimer,
    Severity,
    SignalsReceived,
    SoftwareReceived,
    StatusReceived,
)
from protocol_gateway.seam.errors import CommandError, GatewaySettingsError
from robomesh import reason_codes as codes
from robomesh.wire.session import open_session
from robots.descriptions.description import load
from robots.kinematics.joints import JointType, joints_of
from robots.kinematics.model import build_model, tool_placement
from robots.schema.poses import axis_rotation
from tests.conftest import last_value, run
from tests.controllers.fanuc.test_snpx import EMPTY_ALARM, alarm, position
from tests.controllers.simulated_site import running
from tests.protocol_gateway.gateway_site import STATE, A, C, gateway, refusal, until
from tests.protocol_gateway.wire import wire

SIX = (JointType.ROTARY,) * 6
FANUC = {"description": "puma560", "protocol": "snpx", "options": with_defaults(None, SIX)}
NOW_S = 100.0
ENABLED, READY, RUNNING, PAUSED, HELD, FAULT, PENDANT = 1, 2, 4, 8, 16, 32, 128
WORDS, OUTPUTS, INPUTS = 0x08, 0x46, 0x48


def task(program="WELD", line=12, state=2):
    return program.encode().ljust(16, b"\0") + struct.pack("<2h", line, state) + bytes(16)


class Stepped:
    """Driver with a test as its controller.

    Attributes:
        content: Bytes of each value that an assignment gives; unknown ones are 0.
        bits: Bits of inputs and outputs, by area.
        events: All that it has reported.
        sent: All that it has sent.
    """

    def __init__(self, **settings):
        settings = {"assignments": "own", "j23": 0} | settings
        self.driver = SnpxDriver(SIX, {}, options=FanucSettings(**settings))
        self.now_s = NOW_S
        self.events, self.reports, self.sent = [], [], []
        self.timer_s = None
        self.answered = 0
        group = settings.get("group", 1)
        self.content = {
            f"POS[G{group}:0]": position(),
            "PRG[1]": task(),
            "ALM[1]": EMPTY_ALARM * 4,
            "$MCR.$GENOVERRIDE": struct.pack("<i", 75),
            "$VERSION": b"V9.40P/23",
            f"$MNUTOOLNUM[{group}]": struct.pack("<i", 1),
        }
        self.bits = {OUTPUTS: (ENABLED | READY) << 6000, INPUTS: 0b101}
        self.table = self.driver._table
        assert self.driver.started(NOW_S) == (Open(SNPX),)
        self.open()

    def open(self):
        self.answered = len(self.sent)
        self.perform(self.driver.opened(SNPX, self.now_s))

    def perform(self, effects):
        for effect in effects:
            match effect:
                case Send(channel, data):
                    assert channel is SNPX
                    self.sent.append(data)
                case SetTimer(at_s):
                    self.timer_s = at_s
                case Report():
                    self.reports.append(effect)
                    self.events += effect.events

    @property
    def question(self):
        """Service, area, first element and count of the last packet; the text of one with a text."""
        data = self.sent[-1]
        if data[31] == 0x80:
            return data[56:].decode()
        return struct.unpack_from("<BBHH", data, 42)

    def receive(self, data):
        """Receive bytes after 4 ms."""
        self.now_s += 0.004
        self.perform(self.driver.received(SNPX, data, self.now_s))

    def answer(self, data=b"", *, kind=None, status=0, number=None):
        """Answer the last question."""
        asked = self.sent[-1]
        if asked == bytes(56):
            self.receive(b"\1" + bytes(55))
            return
        number = asked[2] if number is None else number
        kind = kind or (0xD4 if len(data) <= 6 else 0x94)
        head = struct.pack("<BxBxH", 3, number, 0 if kind != 0x94 else len(data)).ljust(30, b"\0")
        head += struct.pack("<BB8xBB", number, kind, 1, 1) + status.to_bytes(2, "big")
        tail = data.ljust(6, b"\0") + bytes(6) if kind == 0xD4 else bytes(12)
        self.receive(head + tail + (data if kind == 0x94 else b""))

    def memory(self):
        """Return what a healthy controller answers to the last question."""
        if isinstance(self.question, str) or self.sent[-1] == bytes(56):
            return b""
        service, area, first, count = self.question
        if service != 4:
            return b""
        if area != WORDS:
            return (self.bits[area] >> first & (1 << count) - 1).to_bytes(count // 8, "little")
        (block,) = (each for each in self.table.blocks if each.first_word == first + 1)
        data = b""
        for each in block.assignments:
            value = self.content.get(str(each.variable), b"")
            if each.variable is SystemVariable.SNPX_VERSION:
                value = struct.pack("<i", 2 * each.multiply)
            data += value.ljust(2 * each.variable.words, b"\0")
        return data

    def step(self, data=None):
        """Answer the open question as a healthy robot does, or wait for the timer."""
        if len(self.sent) == self.answered:
            self.now_s = max(self.now_s, self.timer_s)
            self.perform(self.driver.timer_ended({}, self.now_s))
            return
        self.answered = len(self.sent)
        self.answer(self.memory() if data is None else data)

    def until(self, which):
        """Answer questions until one for a block, an area or a text is open."""
        for _ in range(500):
            if len(self.sent) > self.answered and self._is(which):
                return
            self.step()
        raise AssertionError(f"{which} is not asked")

    def _is(self, which):
        if isinstance(self.question, str):
            return self.question == which
        service, area, first, _ = self.question
        if service != 4 or self.sent[-1] == bytes(56):
            return False
        blocks = {"position": 0, "state": 1, "alarms": 2}
        if which in blocks:
            return area == WORDS and first + 1 == self.table.blocks[blocks[which]].first_word
        return (area, first) == which

    def give(self, which, data=None, **answer):
        """Answer the next question of a kind; return the events of this answer."""
        self.until(which)
        self.answered = len(self.sent)
        before = len(self.events)
        self.answer(self.memory() if data is None else data, **answer)
        return self.events[before:]

    def give_status(self, bits):
        self.bits[OUTPUTS] = bits << 6000
        return self.give((OUTPUTS, 6000))


def signals(events):
    return {
        signal.name: value
        for event in events
        if isinstance(event, SignalsReceived)
        for signal, value in event.values
    }


def joints(events):
    return [each.positions for each in events if isinstance(each, JointsReceived)]


def test_it_begins_a_session_makes_its_table_and_asks_again_and_again():
    arm = Stepped()
    for _ in range(2000):
        arm.step()
    assert arm.sent[0] == bytes(56)
    assert arm.sent[1][0] == 8
    texts = [each[56:].decode() for each in arm.sent if each[31] == 0x80]
    assert texts == ["CLRASG", *(each.command for each in arm.table.assignments)]
    assert [each[31] for each in arm.sent[2 : 2 + len(texts)]] == [0x80] * len(texts)
    asked = [struct.unpack_from("<BBHH", each, 42) for each in arm.sent[2 + len(texts) :]]
    seconds = arm.now_s - NOW_S
    first = arm.table.position.first_word - 1
    assert asked.count((4, WORDS, first, 52)) / seconds == pytest.approx(20, rel=0.05)
    assert asked.count((4, OUTPUTS, 6000, 24)) / seconds == pytest.approx(5, rel=0.1)
    assert {each[0] for each in asked} == {4}
    assert len(arm.sent) / seconds < arm.driver.requests_a_second
    # The begin alone is within the budget, too.
    assert len(texts) + 2 < arm.driver.requests_a_second


@pytest.mark.parametrize("assignments", ["pendant", None])
def test_unless_the_site_file_says_own_nothing_is_sent_but_questions(assignments):
    arm = Stepped(assignments=assignments)
    for _ in range(500):
        arm.step()
    assert {each[31] for each in arm.sent[1:]} == {0xC0}
    assert bool(joints(arm.events)) is (assignments == "pendant")
    assert any(isinstance(each, StatusReceived) and each.activity for each in arm.events)


@pytest.mark.parametrize("settings", [{"j23": None}, {"assignments": None}])
def test_without_a_declaration_there_are_no_joints_and_a_reason(settings):
    arm = Stepped(**settings)
    for _ in range(300):
        arm.step()
    assert not joints(arm.events)
    assert arm.driver.capabilities.no_joints.code == "joints.axes_undeclared"
    assert Stepped().driver.capabilities.no_joints is None


def test_degrees_are_joints_and_their_moment_is_between_question_and_answer():
    arm = Stepped(j23=1)
    arm.content["POS[G1:0]"] = position(
        (90.0, 10.0, -30.0, 0.0, 0.0, 45.0), (500.0, 0, 800.0, 180.0, 0, 90.0)
    )
    events = arm.give("position")
    assert joints(events) == [pytest.approx([math.radians(each) for each in (90, 10, -20, 0, 0, 45)])]
    found = signals(events)
    assert (found["tool.pose.x"], found["tool.pose.z"]) == pytest.approx((0.5, 0.8))
    vector = np.array([found[f"tool.pose.{axis}"] for axis in ("rx", "ry", "rz")])
    # W 180 and R 90: about x, then about the fixed z.
    expected = axis_rotation(np.array([0.0, 0, 1]), math.pi / 2) @ axis_rotation(
        np.array([1.0, 0, 0]), math.pi
    )
    assert axis_rotation(vector, float(np.linalg.norm(vector))) == pytest.approx(expected, abs=1e-6)
    assert found["snpx.configuration"] == "N R U T, 0, 0, 0"
    assert (arm.reports[-1].units, arm.now_s - arm.reports[-1].asked_s) == (1, pytest.approx(0.004))


@pytest.mark.parametrize("broken", [{"valid": (1, 0)}, {"axes": (math.nan,)}, {"axes": (0, 0, math.inf)}])
def test_a_position_that_is_not_valid_gives_no_joints_and_says_so_once(broken):
    arm = Stepped()
    arm.content["POS[G1:0]"] = position(**broken)
    event, pose = arm.give("position")
    assert "no valid, finite joint position" in event.reason
    assert signals([pose])["tool.pose.x"] == 0.0
    assert not any(isinstance(each, MalformedReceived) for each in arm.give("position"))
    arm.content["POS[G1:0]"] = position()
    assert len(joints(arm.give("position"))) == 1
    arm.content["POS[G1:0]"] = position(valid=(0, 1))
    assert [*signals([*arm.give("position"), *arm.give("position"), *arm.give("position")]).values()][
        -1
    ] is None


@pytest.mark.parametrize(
    ("bits", "activity", "mode"),
    [
        (ENABLED | READY, Activity.IDLE, Mode.REMOTE),
        (READY, Activity.IDLE, None),
        (ENABLED | READY | RUNNING, Activity.MOVING, Mode.REMOTE),
        (READY | PAUSED, Activity.HOLDING, None),
        (READY | RUNNING | HELD, Activity.HOLDING, None),
        (FAULT, Activity.FAULT, None),
        (FAULT | RUNNING | READY, Activity.FAULT, None),
        # An operator may jog the arm with the pendant enabled; the outputs do not say it.
        (PENDANT | READY, None, Mode.LOCAL),
        (PENDANT, Activity.STOPPED, Mode.LOCAL),
        (PENDANT | READY | RUNNING, Activity.MOVING, Mode.LOCAL),
    ],
)
def test_operator_outputs_give_activity_and_mode_and_what_they_do_not_say_is_unknown(bits, activity, mode):
    assert (activity_of(bits), mode_of(bits)) == (activity, mode)
    arm = Stepped()
    event, reported = arm.give_status(bits)
    assert event == StatusReceived(activity, mode, homed=None if activity is Activity.FAULT else True)
    assert signals([reported])["robot.servo"] is bool(bits & READY)


def test_outputs_that_are_all_off_may_not_exist_so_nothing_is_known():
    event, reported = Stepped().give_status(0)
    assert event == StatusReceived()
    assert {*signals([reported]).values()} == {None}


def test_each_alarm_is_reported_once_and_again_after_it_was_reset():
    arm = Stepped()

    def round_of(*alarms):
        arm.content["ALM[1]"] = (b"".join(alarms) + EMPTY_ALARM * 4)[:800]
        return arm.give("alarms")

    stop = alarm()
    warning = alarm("TPIF-104", "Teach pendant is disabled", 0, "WARN", 19, 104)
    assert round_of(stop) == [AlarmReceived(Severity.ERROR, "SRVO-001 Operator panel E-stop", "SRVO-001")]
    assert [(each.number, each.severity) for each in round_of(warning, stop)] == [
        ("TPIF-104", Severity.WARNING)
    ]
    assert round_of(warning, stop) == []
    arm.perform(arm.driver.closed(SNPX, arm.now_s))
    arm.open()
    assert round_of(warning, stop) == []
    assert round_of() == []
    assert [each.number for each in round_of(stop)] == ["SRVO-001"]
    # One that newer ones hide is not new when they are gone.
    newer = [alarm("SRVO-0" + str(number), "X", number=number) for number in range(10, 14)]
    assert len(round_of(*newer)) == 4
    assert round_of(*newer[:3], stop) == []


@pytest.mark.parametrize(
    ("severity", "name", "expected"),
    [
        (0, "", Severity.WARNING),
        (54, "", Severity.ERROR),
        (43, "STOP.G", Severity.ERROR),
        (128, "", Severity.INFO),
        (999, "", Severity.ERROR),
        (54, "WARN", Severity.WARNING),
    ],
)
def test_an_unknown_severity_counts_as_an_error(severity, name, expected):
    arm = Stepped()
    arm.content["ALM[1]"] = alarm(severity=severity, name=name) + EMPTY_ALARM * 3
    (event,) = arm.give("alarms")
    assert event.severity is expected


def test_program_override_frame_tool_and_registers_are_reported():
    arm = Stepped(tools=(1, 3), registers=(5, 9))
    offset = position(pose=(0.0, 0.0, 120.0, 0.0, 0.0, 0.0))[:52]
    arm.content |= {
        "$MNUTOOL[1,1]@1.26": offset,
        "R[5]": struct.pack("<f", 2.5),
        "R[9]": struct.pack("<f", math.nan),
        "$MNUFRAMENUM[1]": struct.pack("<i", 4),
    }
    found = signals(arm.give("state"))
    assert (found["program.name"], found["program.line"], found["program.state"]) == ("WELD", 12, "running")
    assert (found["speed.override"], found["frame.number"], found["tool.number"]) == (75, 4, 1)
    assert found["tool.offset.z"] == pytest.approx(0.12)
    assert found["io.register.5"] == 2.5
    assert [each.version for each in arm.events if isinstance(each, SoftwareReceived)] == ["V9.40P/23"]
    # The frame of tool 3 is not valid, that of tool 2 is not read, tool 0 is the flange.
    for tool, expected in ((3, None), (2, None), (0, 0.0)):
        arm.content["$MNUTOOLNUM[1]"] = struct.pack("<i", tool)
        assert signals(arm.give("state"))["tool.offset.z"] == expected
    arm.content["PRG[1]"] = bytes(36)
    assert signals(arm.give("state"))["program.name"] is None


def test_inputs_and_outputs_have_the_numbers_of_the_pendant():
    arm = Stepped(io=("DI[1-3]", "DI[9-10]", "UO[1-2]", "RO[2]"))
    arm.bits = {INPUTS: 0b10_0000_0101, OUTPUTS: (ENABLED << 6000) | (0b10 << 5000)}
    for _ in range(200):
        arm.step()
    found = signals(arm.events)
    assert [found[f"io.digital_in.{each}"] for each in (1, 2, 3, 9, 10)] == [True, False, True, False, True]
    assert (found["snpx.uo.1"], found["snpx.uo.2"], found["io.tool_out.2"]) == (True, False, True)


def test_a_table_that_another_client_replaced_gives_no_joints_and_is_not_replaced_again():
    arm = Stepped()
    assert joints(arm.give("position"))
    other = position((90.0,)) + struct.pack("<i", 12345)
    assert arm.give("position", other) == []
    assert joints(arm.give("position"))
    assert [arm.give("position", other) for _ in range(2)] == [[], []]
    (event,) = arm.give("position", other)
    assert "keeps one table for all" in event.reason
    before = len(arm.sent)
    arm.perform(arm.driver.closed(SNPX, arm.now_s))
    arm.open()
    for _ in range(300):
        arm.step()
    assert not any(each[31] == 0x80 or each[43] == WORDS for each in arm.sent[before:])
    assert any(isinstance(each, StatusReceived) for each in arm.events[-20:])


def test_words_that_the_pendant_does_not_assign_give_no_joints_until_it_does():
    arm = Stepped(assignments="pendant")
    (event,) = arm.give("position", bytes(104))
    assert "the assignments at the pendant are not those of docs/controllers/fanuc.md" in event.reason
    assert arm.give("position", bytes(104)) == []
    for _ in range(20):
        arm.give("position", bytes(104))
    assert joints(arm.give("position"))


def test_an_assignment_that_the_controller_refuses_is_unknown_and_reported():
    arm = Stepped(registers=(5,))
    at = next(each for each in arm.table.assignments if str(each.variable) == "R[5]")
    (event,) = arm.give(at.command, kind=0xD1)
    assert "refuses the assignment of R[5]" in event.reason
    assert signals(arm.give("state"))["io.register.5"] is None
    assert signals(arm.give("state"))["tool.number"] == 1


def test_a_refused_read_of_inputs_is_not_repeated_and_one_of_the_status_is():
    arm = Stepped(io=("DI[1-8]",))
    (event,) = arm.give((INPUTS, 0), kind=0xD1)
    assert "refuses 8 elements of area 0x48 from 0" in event.reason
    (event,) = arm.give((OUTPUTS, 6000), kind=0xD1)
    assert "0x46" in event.reason
    assert arm.give((OUTPUTS, 6000), kind=0xD1) == []
    count = len(arm.sent)
    for _ in range(300):
        arm.step()
    assert INPUTS not in {each[43] for each in arm.sent[count:]}


def test_a_busy_answer_is_no_state_and_the_rate_is_halved():
    arm = Stepped()
    assert arm.give("position", kind=0xD1, status=0x0700) == []
    assert (arm.reports[-1].units, arm.reports[-1].refusals) == (1, 1)
    arm.until("position")
    begin_s, count = arm.now_s, len(arm.sent)
    while arm.now_s < begin_s + 5.0:
        arm.step()
    asked = [each[46] for each in arm.sent[count:] if each[43] == WORDS]
    assert asked.count(52) / 5.0 == pytest.approx(10, abs=1)


def test_late_doubled_and_malformed_answers_are_not_used():
    arm = Stepped()
    arm.until("position")
    number, data = arm.sent[-1][2], arm.memory()
    before, sent = len(arm.events), len(arm.sent)
    arm.answer(data, number=number - 1)
    assert len(arm.events) == before
    arm.receive(b"\xff" * 60)
    assert isinstance(arm.events[-1], MalformedReceived)
    assert len(arm.sent) == sent
    arm.answer(data[:-2])
    assert "102 bytes of text, 104 were asked for" in arm.events[-1].reason
    arm.give("position")
    assert len(joints(arm.events[before:])) == 1
    sent, before = len(arm.sent), len(arm.events)
    arm.answer(data, number=number)
    assert (len(arm.sent), len(arm.events)) == (sent, before)


def test_a_lost_answer_is_counted_and_the_next_question_follows():
    arm = Stepped()
    arm.until("position")
    sent = len(arm.sent)
    assert arm.timer_s - arm.now_s == pytest.approx(TIMEOUT_S)
    arm.perform(arm.driver.timer_ended({}, arm.timer_s))
    assert arm.reports[-1].lost == 1
    assert len(arm.sent) == sent + 1


@pytest.mark.parametrize("steps", [0, 1, 2, 5])
def test_a_connection_that_does_not_begin_asks_nothing_more(steps):
    arm = Stepped()
    for _ in range(steps):
        arm.step()
    sent = len(arm.sent)
    arm.perform(arm.driver.timer_ended({}, arm.timer_s))
    assert arm.reports[-1].lost == 1
    assert (len(arm.sent), arm.timer_s) == (sent, None)
    arm.open()
    assert arm.sent[-1] == bytes(56)


def test_extra_axes_that_are_not_at_0_are_reported_once():
    arm = Stepped(group=2)
    arm.content["POS[G2:0]"] = position((0, 0, 0, 0, 0, 0, 12.5))
    events = arm.give("position")
    assert AxesUndeclared(codes.AXES_EXTRA(axes="7")) in events
    assert len(joints(events)) == 1
    assert not any(isinstance(each, AxesUndeclared) for each in arm.give("position"))
    arm.content["POS[G2:0]"] = position((0,) * 6)
    assert AxesUndeclared(None) in arm.give("position")
    # The site file says that it neither carries nor moves the arm.
    arm = Stepped(group=2, other_axes=(7,))
    arm.content["POS[G2:0]"] = position((0, 0, 0, 0, 0, 0, 12.5))
    assert not any(isinstance(each, AxesUndeclared) for each in arm.give("position"))


def test_it_refuses_codes_every_command_and_settings_of_another_model():
    with pytest.raises(GatewaySettingsError, match="codes"):
        SnpxDriver(SIX, {2: "ABSOLUTE.DEG"})
    for wrong in ({"axes": (1,)}, {"registers": (0,)}, {"group": 9}, {"io": ("R[1]",)}):
        with pytest.raises(GatewaySettingsError):
            Stepped(**wrong)
    with pytest.raises(CommandError, match="only reads"):
        Stepped().driver.prepare(MoveAbsolute((0.0,) * 6))


# ------------------------------------------------------------------- in a gateway


@contextlib.asynccontextmanager
async def controller(**settings):
    """Run a simulated controller; yield its port."""
    async with running(serve_snpx, SnpxSettings(**settings)) as ports:
        yield ports.snpx


def packets(data):
    """Split what a client sent into packets."""
    data, found = bytes(data), []
    while data:
        end = 56 + int.from_bytes(data[4:6], "little")
        found.append(data[:end])
        data = data[end:]
    return found


async def test_a_controller_with_snpx_is_shown_and_nothing_is_written_but_its_own_assignments(mesh, tmp_path):
    async with (
        controller(demo=True, faults=("fault@4",)) as port,
        wire(port) as relay,
        gateway(mesh, tmp_path, relay.port, **FANUC) as site,
    ):
        await until(lambda: site.controller.activity == STATE.MOVING)
        assert site.controller.mode == STATE.REMOTE
        await site.units(50)
        first, last = (site.seen["joints"][at] for at in (0, -1))
        assert [joint.position for joint in first.joints] != [joint.position for joint in last.joints]
        assert "does not let the gateway move it" in await refusal(site.lease(A.ACQUIRE))
        assert "Not sent" in await refusal(site.command(C.HOME))
        answer = await site.stop(by="wang")
        assert not answer.sent
        await until(lambda: any(each.values["number"] for each in site.events("controller.alarm")))
        event = site.events("controller.alarm")[-1]
        assert (event.values["number"], event.severity) == ("SRVO-001", event.ERROR)
        await until(lambda: site.controller.activity == STATE.FAULT)
        assert 0.0 < site.controller.health.stamp_uncertainty_s < 0.5
        # Proven by a decode of all that was sent.
        found = packets(relay.data)
        assert (found[0], found[1][42:44]) == (bytes(56), b"\x4f\x01")
        texts = [each[56:].decode() for each in found if each[31] == 0x80]
        # A text goes to %G, by the service that writes; everything else reads.
        assert {each[50:54] for each in found if each[31] == 0x80} == {b"\x07\x38\0\0"}
        assert {each[42] for each in found[2:] if each[31] == 0xC0} == {0x04}
        assert {each[31] for each in found[1:]} == {0x80, 0xC0}
        assert all(each[48:] == bytes(8) for each in found if each[31] == 0xC0)
        assert texts[0] == "CLRASG"
        assert all(re.fullmatch(r"SETASG 1\d{4} \d+ \S+ \d+", each) for each in texts[1:])
        assert len(texts) == 1 + len(FANUC["options"].table.assignments)


def test_the_controllers_cartesian_position_is_that_of_its_joints(mesh, tmp_path):
    async def main():
        async with (
            controller() as port,
            gateway(mesh, tmp_path, port, **FANUC) as site,
            open_session(mesh) as session,
        ):
            await until(lambda: site.joints)
            while True:
                message = await last_value(session, site.key("signals"))
                found = {each.name: each.number for each in message.signals}
                if "tool.pose.x" in found:
                    return site.joints, found

    positions, found = run(main())
    description = load("puma560")
    placement = tool_placement(build_model(description), joints_of(description).home)
    assert positions == pytest.approx(joints_of(description).home, abs=1e-6)
    assert [found[f"tool.pose.{axis}"] for axis in "xyz"] == pytest.approx(placement[:3, 3], abs=1e-4)
    vector = np.array([found[f"tool.pose.{axis}"] for axis in ("rx", "ry", "rz")])
    rotation = axis_rotation(vector, float(np.linalg.norm(vector)))
    assert rotation == pytest.approx(placement[:3, :3], abs=1e-4)


async def test_two_clients_of_one_table_do_not_fight_and_show_no_wrong_joints(mesh, tmp_path):
    other = FANUC | {"options": with_defaults(FanucSettings(registers=(1,)), SIX)}
    async with (
        controller(shared=True) as port,
        gateway(mesh, tmp_path / "a", port, **FANUC) as first,
    ):
        await first.units(3)
        async with gateway(mesh, tmp_path / "b", port, up=False, **other):
            await until(lambda: any("keeps one table for all" in each.text for each in first.seen["events"]))
        home = joints_of(load("puma560")).home
        for state in first.seen["joints"]:
            assert [each.position for each in state.joints] == pytest.approx(home, abs=1e-6)


async def test_without_a_declaration_the_robot_is_shown_without_joints_and_says_why(mesh, tmp_path):
    async with (
        controller() as port,
        gateway(mesh, tmp_path, port, **FANUC | {"options": None}) as site,
    ):
        await until(lambda: site.controller.activity == STATE.IDLE)
        assert "declare j23 and assignments" in site.controller.link_text
        assert not site.seen["joints"]
