"""HSES driver: stepped question by question, and in a gateway before the simulated controller."""

import math
import struct

import pytest

from controllers.yaskawa import codes as hses_codes
from controllers.yaskawa.axes import YaskawaSettings, with_factors
from controllers.yaskawa.data import Status
from controllers.yaskawa.driver import HSES, HsesDriver, activity_of, mode_of
from controllers.yaskawa.simulated.service import HsesSettings, serve_hses
from protocol_gateway.driver_parts.polling import TIMEOUT_S
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
from robots.kinematics.joints import JointType
from tests.controllers.simulated_site import running
from tests.protocol_gateway.gateway_site import STATE, A, C, gateway, refusal, until
from tests.protocol_gateway.wire import wire

YASKAWA = {"description": "puma560", "protocol": "hses", "options": with_factors(None, 6)}
SIX = (JointType.ROTARY,) * 6
NOW_S = 100.0
RUNNING, TEACH, PLAY, REMOTE = 0x08, 0x20, 0x40, 0x80
HELD, ALARM, ERROR, SERVO = 0x02, 0x10, 0x20, 0x40


class Stepped:
    """A driver whose questions a test answers.

    Attributes:
        events: All that it has reported.
        sent: All that it has sent.
    """

    def __init__(self, **settings):
        settings.setdefault("pulses_per_degree", (1000.0,) * 6)
        self.driver = HsesDriver(SIX, {}, options=YaskawaSettings(**settings))
        self.now_s = NOW_S
        self.events, self.reports, self.sent = [], [], []
        self.timer_s = None
        assert self.driver.started(NOW_S) == (Open(HSES),)
        self.perform(self.driver.opened(HSES, NOW_S))

    def perform(self, effects):
        for effect in effects:
            match effect:
                case Send(channel, data):
                    assert channel is HSES
                    self.sent.append(data)
                case SetTimer(at_s):
                    self.timer_s = at_s
                case Report():
                    self.reports.append(effect)
                    self.events += effect.events

    @property
    def question(self):
        """Number, command, instance, attribute and service of the last question."""
        return self.sent[-1][11], *struct.unpack_from("<HHBB", self.sent[-1], 24)

    def answer(self, data=b"", status=0, added=0, number=None):
        """Answer the last question after 4 ms."""
        asked, _, _, _, service = self.question
        number = asked if number is None else number
        head = struct.pack("<4sHHBBBBI8s", b"YERC", 32, len(data), 3, 1, 1, number, 1 << 31, b"99999999")
        sub = struct.pack("<BBBxHH", service + 0x80, status, 1 if added else 0, added, 0)
        self.now_s += 0.004
        self.perform(self.driver.received(HSES, head + sub + data, self.now_s))

    def until(self, command, *, pose=False):
        """Answer what is asked, until a question with a command is open; of positions, pulses or the pose."""
        for _ in range(200):
            _, asked, instance, _, _ = self.question
            if (asked, asked == 0x75 and instance > 100) == (command, pose) and len(
                self.sent
            ) > self.answered:
                return
            self.step()
        raise AssertionError(f"0x{command:X} is not asked")

    answered = 0

    def step(self, data=None):
        """Answer the open question as a healthy robot does, or wait for the timer."""
        if len(self.sent) == self.answered:
            self.now_s = max(self.now_s, self.timer_s)
            self.perform(self.driver.timer_ended({}, self.now_s))
            return
        self.answered = len(self.sent)
        _, command, instance, _, _ = self.question
        if command == 0x74 and instance > 10:
            self.answer(status=0x28)  # it has no base
            return
        healthy = POSE if command == 0x75 and instance > 100 else HEALTHY[command]
        self.answer(healthy if data is None else data)

    def give(self, command, *arguments, pose=False, **options):
        """Answer the next question with a command; return the events of this answer."""
        self.until(command, pose=pose)
        self.answered = len(self.sent)
        before = len(self.events)
        self.answer(*arguments, **options)
        return self.events[before:]


def position(*pulses, data_type=0, tool=0):
    return struct.pack("<5I", data_type, 0, tool, 0, 0) + struct.pack(f"<{len(pulses)}i", *pulses)


def alarm(code, name, sub=0, time="2026/11/26 09:30"):
    return struct.pack("<3I", code, sub, 1) + time.encode() + name.encode().ljust(32, b"\0")


def names(text):
    return b"".join(each.encode().ljust(4, b"\0") for each in text).ljust(32, b"\0")


def status(first=PLAY, second=SERVO):
    return struct.pack("<2I", first, second)


HEALTHY = {
    0x70: alarm(0, "", time="\0" * 16),
    0x72: status(),
    0x73: b"WELD".ljust(32, b"\0") + struct.pack("<3I", 12, 3, 5000),
    0x74: names("SLURBT"),
    0x75: position(0, 0, 0, 0, 0, 0, 0, 0),
    0x77: struct.pack("<8i", 1, -2, 3, 0, 0, 0, 0, 0),
    0x78: b"\x05",
    0x89: b"DS2.07".ljust(24, b"\0") + b"ES0165D".ljust(16, b"\0") + b"12.34\0\0\0",
}
# x 500, y -20, z 30 mm, turned by 90° about z, with tool 3.
POSE = position(500_000, -20_000, 30_000, 0, 0, 900_000, 0, 0, data_type=17, tool=3)
READS = {(0x70, 1), (0x72, 1), (0x73, 1), (0x74, 1), (0x75, 1), (0x77, 1), (0x78, 0x0E), (0x89, 1)}


def signals(events):
    return {
        (signal.name, signal.joint): value
        for event in events
        if isinstance(event, SignalsReceived)
        for signal, value in event.values
    }


def test_it_asks_for_status_system_and_axes_first_and_then_again_and_again():
    arm = Stepped()
    for _ in range(2000):
        arm.step()
    asked = [struct.unpack_from("<H", each, 24)[0] for each in arm.sent]
    assert asked[:3] == [0x72, 0x89, 0x74]
    seconds = arm.now_s - NOW_S
    # Pulses, and twice a second the tool's pose.
    assert asked.count(0x75) / seconds == pytest.approx(22, rel=0.05)
    assert asked.count(0x72) / seconds == pytest.approx(5, rel=0.1)
    # The axes of the robot and of its base.
    assert (asked.count(0x89), asked.count(0x74)) == (1, 2)
    assert len(asked) / seconds < arm.driver.requests_a_second
    assert {(command, each[29]) for command, each in zip(asked, arm.sent, strict=True)} <= READS
    assert {len(each) for each in arm.sent} == {32}
    assert {each[6:8] for each in arm.sent} == {b"\0\0"}


def test_pulses_are_joints_and_their_moment_is_between_question_and_answer():
    arm = Stepped(pulses_per_degree=(1000.0, -500.0, 1000.0, 1000.0, 1000.0, 1000.0))
    (joints, tool) = arm.give(0x75, position(90_000, 45_000, 0, 0, 0, -1_000, 0, 0, tool=2))
    assert joints == JointsReceived(pytest.approx((math.pi / 2, -math.pi / 2, 0, 0, 0, math.radians(-1))))
    assert signals([tool]) == {("tool.number", None): 2}
    assert (arm.reports[-1].units, arm.now_s - arm.reports[-1].asked_s) == (1, pytest.approx(0.004))
    # Seven axes, as FS100 sends them.
    assert arm.give(0x75, position(1_000, 0, 0, 0, 0, 0, 0, tool=2))[0].positions[0] == pytest.approx(
        math.radians(1)
    )


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (position(0, 0, 0, 0, 0, 0, 0, 0, data_type=16), "type 16; pulses, type 0, were asked for"),
        (position(0, 0, 0, 0, 0), "values of axes with 20 bytes"),
        (position(*(0,) * 9), "values of axes with 36 bytes"),
        (b"", "0 bytes"),
    ],
)
def test_data_of_another_kind_or_length_give_no_joints(data, reason):
    (event,) = Stepped().give(0x75, data)
    assert isinstance(event, MalformedReceived)
    assert reason in event.reason


def test_without_factors_no_positions_are_asked_for_and_a_reason_is_given():
    arm = Stepped(pulses_per_degree=())
    for _ in range(500):
        arm.step()
    assert not any(isinstance(each, JointsReceived) for each in arm.events)
    asked = {struct.unpack_from("<HH", each, 24) for each in arm.sent}
    assert {instance for command, instance in asked if command == 0x75} == {101}
    assert arm.driver.capabilities.no_joints.code == "joints.undeclared"
    assert Stepped().driver.capabilities.no_joints is None
    assert any(isinstance(each, StatusReceived) for each in arm.events)


@pytest.mark.parametrize(
    ("first", "second", "activity", "mode"),
    [
        (PLAY, SERVO, Activity.IDLE, Mode.LOCAL),
        (PLAY | REMOTE, SERVO, Activity.IDLE, Mode.REMOTE),
        (REMOTE | RUNNING, SERVO, Activity.MOVING, Mode.REMOTE),
        (PLAY | RUNNING, SERVO | HELD, Activity.HOLDING, Mode.LOCAL),
        (PLAY, 0, Activity.STOPPED, Mode.LOCAL),
        (PLAY | RUNNING, SERVO | ALARM, Activity.FAULT, Mode.LOCAL),
        # An operator may jog the arm in teach mode; the status does not say it.
        (TEACH, SERVO, None, Mode.LOCAL),
        (TEACH, 0, Activity.STOPPED, Mode.LOCAL),
        (0, SERVO, Activity.IDLE, None),
    ],
)
def test_the_status_gives_activity_and_mode_and_what_it_does_not_say_is_unknown(
    first, second, activity, mode
):
    assert (activity_of(Status(first, second)), mode_of(Status(first, second))) == (activity, mode)
    event, _ = Stepped().give(0x72, status(first, second))
    assert event == StatusReceived(activity, mode, homed=None if activity is Activity.FAULT else True)


def test_error_of_which_only_the_display_says_more_is_reported_when_it_appears():
    arm = Stepped()

    def reported(second):
        return [each.text for each in arm.give(0x72, status(PLAY, second)) if isinstance(each, AlarmReceived)]

    said = ["the controller reports an error, which only its own display shows"]
    assert [reported(each) for each in (SERVO, SERVO | ERROR, SERVO | ERROR, SERVO, ERROR)] == [
        *([], said, [], [], said)
    ]


def test_each_alarm_is_reported_once_when_it_appears_and_again_after_it_was_reset():
    arm = Stepped()
    servo, limit = alarm(4315, "COLLISION DETECT", 1), alarm(4414, "EXCESSIVE SEGMENT", 2)

    def round_of(*alarms):
        arm.give(0x72, status(PLAY, ALARM))
        found = []
        for each in [*alarms, *([HEALTHY[0x70]] if len(alarms) < 4 else [])]:
            found += arm.give(0x70, each)
        return found

    assert round_of(servo) == [AlarmReceived(Severity.ERROR, "4315 [1] COLLISION DETECT", "4315")]
    arm.now_s += 1.0
    assert [each.number for each in round_of(limit, servo)] == ["4414"]
    arm.now_s += 1.0
    assert round_of(limit, servo) == []
    # The link was lost, and is back.
    arm.perform(arm.driver.closed(HSES, arm.now_s))
    arm.perform(arm.driver.opened(HSES, arm.now_s))
    arm.answered = len(arm.sent) - 1
    assert round_of(limit, servo) == []
    arm.give(0x72, status())
    arm.now_s += 1.0
    assert [each.number for each in round_of(servo)] == ["4315"]
    arm.now_s += 1.0
    # A controller reports at most four.
    four = [alarm(4000 + number, "X") for number in range(4)]
    assert [each.number for each in round_of(*four)] == ["4000", "4001", "4002", "4003"]


def test_without_an_alarm_in_the_status_no_alarms_are_asked_for():
    arm = Stepped()
    for _ in range(300):
        arm.step()
    assert 0x70 not in {struct.unpack_from("<H", each, 24)[0] for each in arm.sent}


def test_job_load_inputs_and_system_are_reported():
    arm = Stepped(io=(2, 1001, 4001))
    for _ in range(100):
        arm.step()
    found = signals(arm.events)
    assert found["program.name", None] == "WELD"
    assert (found["program.line", None], found["speed.override", None]) == (12, 50.0)
    assert [found["joint.load", each] for each in range(6)] == [1, -2, 3, 0, 0, 0]
    assert (found["io.digital_in.9", None], found["io.digital_in.10", None]) == (True, False)
    assert (found["io.digital_out.3", None], found["hses.io.40012", None]) == (True, True)
    assert (found["robot.mode", None], found["robot.servo", None]) == ("play", True)
    texts = [each.version for each in arm.events if isinstance(each, SoftwareReceived)]
    assert texts == ["DS2.07, model ES0165D"]


def test_the_pose_of_the_tool_is_a_position_and_a_rotation_vector():
    arm = Stepped()
    (event,) = arm.give(0x75, POSE, pose=True)
    found = {signal.name: value for signal, value in event.values}
    assert found.pop("tool.number") == 3
    assert [*found] == [f"tool.pose.{axis}" for axis in ("x", "y", "z", "rx", "ry", "rz")]
    assert [*found.values()] == pytest.approx([0.5, -0.02, 0.03, 0, 0, math.pi / 2])
    # Of the user's frame or the tool: not comparable.
    (event,) = arm.give(0x75, position(0, 0, 0, 0, 0, 0, 0, 0, data_type=19), pose=True)
    assert "a tool's pose of type 19" in event.reason
    assert Stepped(group="S1").driver.capabilities.reports_pose is False


def test_a_read_that_the_controller_does_not_have_is_not_repeated():
    arm = Stepped()
    assert arm.give(0x77, status=0x08) == []
    assert arm.give(0x78, status=0x1F, added=0xA001) == []
    count = len(arm.sent)
    for _ in range(400):
        arm.step()
    later = [struct.unpack_from("<HH", each, 24) for each in arm.sent[count + 1 :]]
    assert 0x77 not in {command for command, _ in later}
    assert len({instance for command, instance in later if command == 0x78}) == 1


def test_a_controller_without_this_group_says_so_once_and_is_asked_on():
    arm = Stepped(group="R2")
    (event,) = arm.give(0x75, status=0x28)
    assert "refuses to report the position of R2: there is no such instance" in event.reason
    assert arm.question[2] in (1, 2, 12)
    assert arm.give(0x75, status=0x28) == []
    assert (arm.reports[-1].units, arm.reports[-1].refusals) == (1, 1)


def test_a_busy_answer_is_no_state_and_the_rate_is_halved():
    arm = Stepped()
    assert arm.give(0x75, status=0x1F, added=0xD8F1) == []
    assert (arm.reports[-1].units, arm.reports[-1].refusals) == (1, 1)
    arm.until(0x75)
    begin_s, count = arm.now_s, len(arm.sent)
    while arm.now_s < begin_s + 5.0:
        arm.step()
    asked = [struct.unpack_from("<H", each, 24)[0] for each in arm.sent[count:]]
    assert asked.count(0x75) / 5.0 == pytest.approx(10, abs=1)


def test_late_doubled_and_foreign_answers_are_not_used():
    arm = Stepped()
    arm.until(0x75)
    number = arm.question[0]
    before = len(arm.events)
    arm.answer(position(*(1000,) * 8), number=(number - 1) % 256)
    assert len(arm.events) == before
    arm.answer(position(*(2000,) * 8))
    assert sum(isinstance(each, JointsReceived) for each in arm.events[before:]) == 1
    sent = len(arm.sent)
    arm.answer(position(*(3000,) * 8), number=number)
    assert sum(isinstance(each, JointsReceived) for each in arm.events[before:]) == 1
    assert len(arm.sent) == sent


def test_a_lost_answer_is_counted_and_the_next_question_follows():
    arm = Stepped()
    arm.until(0x75)
    sent, number = len(arm.sent), arm.question[0]
    assert arm.timer_s - arm.now_s == pytest.approx(TIMEOUT_S)
    arm.perform(arm.driver.timer_ended({}, arm.timer_s))
    assert arm.reports[-1].lost == 1
    assert len(arm.sent) == sent + 1
    assert arm.question[0] == number + 1


def test_extra_axes_are_reported_once_and_missing_ones_give_no_joints():
    arm = Stepped()
    (event,) = arm.give(0x74, names("SLURBTE"))
    assert event == AxesUndeclared(codes.AXES_EXTRA(axes="E"))
    assert isinstance(arm.give(0x75, position(*(0,) * 8))[0], JointsReceived)
    # A controller that does not say the names shows an axis by its pulses.
    arm = Stepped()
    arm.give(0x74, status=0x28)
    events = arm.give(0x75, position(0, 0, 0, 0, 0, 0, 9999, 0))
    assert events[-1] == AxesUndeclared(codes.AXES_EXTRA(axes="7"))
    assert len(arm.give(0x75, position(0, 0, 0, 0, 0, 0, 9999, 0))) == 1
    arm = Stepped()
    arm.give(0x74, names("SLURB"))
    (event,) = arm.give(0x75, position(*(0,) * 8))
    assert "axis 6 is declared, but R1 of the controller has none" in event.reason


def test_axes_that_the_site_file_declares_are_no_others_but_a_base_always_is():
    arm = Stepped(other_axes=(7,))
    assert arm.give(0x74, names("SLURBTE")) == []
    # The second question is for the base.
    (event,) = arm.give(0x74, names("X"))
    assert event == AxesUndeclared(hses_codes.BASE_UNDECLARED(axes="X"))


def test_a_question_without_an_answer_is_asked_again_although_it_is_asked_once():
    arm = Stepped()
    arm.until(0x89)
    arm.answered = len(arm.sent)
    arm.now_s += 0.5  # the answer is lost
    arm.perform(arm.driver.timer_ended({}, arm.now_s))
    (event,) = arm.give(0x89, HEALTHY[0x89])
    assert isinstance(event, SoftwareReceived)


def test_it_refuses_codes_every_command_and_settings_of_another_model():
    with pytest.raises(GatewaySettingsError, match="codes"):
        HsesDriver(SIX, {2: "ABSOLUTE.DEG"})
    with pytest.raises(GatewaySettingsError, match="7 values, but the model has 6 joints"):
        Stepped(pulses_per_degree=(1.0,) * 7)
    with pytest.raises(CommandError, match="only reads"):
        Stepped().driver.prepare(MoveAbsolute((0.0,) * 6))


# ------------------------------------------------------------------- in a gateway


def controller(**settings):
    """Run a simulated controller; yield its port."""
    return running(serve_hses, HsesSettings(**settings))


async def test_a_controller_with_hses_is_shown_and_only_reads_are_sent(mesh, tmp_path):
    async with (
        controller(demo=True, faults=("fault@4",)) as port,
        wire(port, datagrams=True) as relay,
        gateway(mesh, tmp_path, relay.port, **YASKAWA) as site,
    ):
        await until(lambda: site.controller.activity == STATE.MOVING)
        assert site.controller.mode == STATE.REMOTE
        assert site.controller.homed == STATE.YES
        await site.units(50)
        first, last = (site.seen["joints"][at] for at in (0, -1))
        assert [joint.position for joint in first.joints] != [joint.position for joint in last.joints]
        assert "does not let the gateway move it" in await refusal(site.lease(A.ACQUIRE))
        assert "Not sent" in await refusal(site.command(C.HOME))
        answer = await site.stop(by="wang")
        assert not answer.sent
        await until(lambda: any(each.values["number"] for each in site.events("controller.alarm")))
        alarm = site.events("controller.alarm")[-1]
        assert (alarm.values["number"], alarm.severity) == ("4107", alarm.ERROR)
        await until(lambda: site.controller.activity == STATE.FAULT)
        assert 0.0 < site.controller.health.stamp_uncertainty_s < 0.5
        # Proven by a decode of all that was sent: reads without data.
        found = {(*struct.unpack_from("<H", each, 24), each[29]) for each in relay.sent}
        assert found == READS
        assert {(len(each), each[:11], each[12:24], each[30:]) for each in relay.sent} == {
            (32, b"YERC\x20\0\0\0\x03\x01\0", b"\0\0\0\x0099999999", b"\0\0")
        }
        assert site.controller.counters.units_sent <= len(relay.sent)


async def test_lost_late_doubled_and_reordered_answers_give_no_joints_of_another_moment(mesh, tmp_path):
    kept = []

    def disturb(answer):
        """Lose each seventh answer, double each fifth, and send each third once more later."""
        kept.append(answer)
        number = len(kept)
        if number % 7 == 0:
            return []
        later = [kept[-3]] if number > 3 and number % 3 == 0 else []
        return [*later, answer, *([answer] if number % 5 == 0 else []), *later]

    async with (
        controller(demo=True) as port,
        wire(port, datagrams=True) as relay,
        gateway(mesh, tmp_path, relay.port, **YASKAWA) as site,
    ):
        relay.answers = disturb
        await until(lambda: site.controller.counters.units_lost >= 10)
        seen = len(site.seen["joints"])
        positions = sum(len(each) in (84,) for each in kept)
        assert 0 < seen <= positions + 20
        assert site.controller.counters.units_malformed == 0
        assert site.controller.link == STATE.UP


async def test_without_factors_the_robot_is_shown_without_joints_and_says_why(mesh, tmp_path):
    async with (
        controller() as port,
        gateway(mesh, tmp_path, port, **YASKAWA | {"options": None}) as site,
    ):
        await until(lambda: site.controller.activity == STATE.IDLE)
        assert "declare pulses_per_degree" in site.controller.link_text
        assert not site.seen["joints"]
