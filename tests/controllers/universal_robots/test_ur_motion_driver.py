"""Driver that moves an arm of Universal Robots, event by event, without I/O."""

import random
import struct

import pytest

from controllers.universal_robots.driver import PRIMARY, RTDE, RtdeDriver
from controllers.universal_robots.interfaces import rtde_messages as rtde
from controllers.universal_robots.interfaces.rtde_messages import PackageType, Recipe, package
from controllers.universal_robots.motion_driver import (
    DASHBOARD,
    INPUTS,
    SCRIPTS,
    START_S,
    RtdeMotionDriver,
)
from controllers.universal_robots.motion_script import Progress, Registers, motion_script
from controllers.universal_robots.settings import MotionSettings, UniversalRobotsSettings
from controllers.universal_robots.simulated.fields import INPUTS as INPUT_TYPES
from controllers.universal_robots.simulated.fields import OFFERED
from protocol_gateway.configuration.kinds import driver_maker
from protocol_gateway.link.timers import Timers
from protocol_gateway.seam import (
    Activity,
    AlarmReceived,
    Close,
    FateUnknown,
    Home,
    JointsReceived,
    Mode,
    MotionImpossible,
    MoveAbsolute,
    MoveRelative,
    Open,
    Recover,
    RecoverAnswered,
    Recovery,
    Report,
    Reset,
    Send,
    SetTimer,
    Speed,
    StatusReceived,
    Stop,
    StopEnds,
)
from protocol_gateway.seam.errors import CommandError, NotReadyError
from robots.kinematics.joints import JointType

SIX = (JointType.ROTARY,) * 6
TARGET = (0.1, -1.5, 1.5, 0.0, 0.5, 0.0)
VERSION = (5, 21, 0, 0)


def flat(effects, kind):
    return [each for each in effects if isinstance(each, kind)]


class Arm:
    """A driver on a controller of the test's words."""

    def __init__(self, *, remote=True, version=VERSION, **settings):
        self.now_s = 1000.0
        self.driver = RtdeMotionDriver(
            SIX, {}, options=UniversalRobotsSettings(motion=MotionSettings(**settings))
        )
        self.effects = []
        self.sent = {channel.name: bytearray() for channel in (RTDE, PRIMARY, DASHBOARD, INPUTS, SCRIPTS)}
        self.timers = Timers()
        self.registers = {}
        self.runtime, self.safety, self.tool = 1, 1, (0.0,) * 6
        self._do(self.driver.started(self.now_s))
        for channel in (RTDE, PRIMARY, INPUTS, DASHBOARD):
            self._do(self.driver.opened(channel, self.now_s))
        self.greet(version)
        self.greet_inputs()
        self.receive(DASHBOARD, b"Connected: Universal Robots Dashboard Server\n")
        self.answer(remote)
        if remote:
            self._do(self.driver.opened(SCRIPTS, self.now_s))
        self.state()
        self.effects = []

    def _do(self, effects):
        self.effects += effects
        for effect in effects:
            if isinstance(effect, Send):
                self.sent[effect.channel.name] += effect.data
            if isinstance(effect, SetTimer):
                self.timers.set(effect)
        return effects

    def receive(self, channel, data):
        return self._do(self.driver.received(channel, data, self.now_s))

    def greet(self, version):
        self.receive(RTDE, package(PackageType.PROTOCOL_VERSION, b"\x01"))
        self.receive(RTDE, package(PackageType.URCONTROL_VERSION, struct.pack(">4I", *version)))
        names = self.sent["rtde"][-2048:].split(b"O", 1)[1][8:].decode("latin-1").split(",")
        types = [OFFERED[name] for name in names]
        self.receive(RTDE, package(PackageType.SET_UP_OUTPUTS, b"\x01" + ",".join(types).encode()))
        self.receive(RTDE, package(PackageType.START, b"\x01"))
        self.recipe = Recipe(names, types, 1)

    def greet_inputs(self, types="INT32,INT32"):
        self.receive(INPUTS, package(PackageType.PROTOCOL_VERSION, b"\x01"))
        self.receive(INPUTS, package(PackageType.SET_UP_INPUTS, b"\x07" + types.encode()))
        self.receive(INPUTS, package(PackageType.SET_UP_OUTPUTS, b"\x01DOUBLE"))
        self.receive(INPUTS, package(PackageType.START, b"\x01"))

    def answer(self, remote):
        return self.receive(DASHBOARD, b"true\n" if remote else b"false\n")

    def state(self, **others):
        values = {name: (0 if kind.endswith("INT32") else 0.0) for name, kind in OFFERED.items()}
        values |= {
            name: (0.0,) * 6 if kind == "VECTOR6D" else (0.0,) * 3 if kind == "VECTOR3D" else (253,) * 6
            for name, kind in OFFERED.items()
            if kind.startswith("VECTOR")
        }
        values |= {
            "timestamp": self.now_s,
            "robot_mode": 7,
            "safety_status": self.safety,
            "safety_mode": 1,
            "runtime_state": self.runtime,
            "tcp_offset": self.tool,
            "actual_digital_input_bits": 0,
            "actual_digital_output_bits": 0,
        }
        data = self.recipe.write(values | self.registers | others)
        return self.receive(RTDE, package(PackageType.DATA, data))

    def command(self, *commands):
        return self._do(self.driver.command(self.driver.prepare(*commands), self.now_s))

    def wait(self, seconds, *, states=True):
        """Let time pass: states come 125 times a second, and timers end."""
        end_s = self.now_s + seconds
        effects = []
        while self.now_s < end_s:
            self.now_s += 0.008
            if states:
                effects += self.state()
            if self.timers and self.timers.next_s <= self.now_s:
                effects += self._do(self.driver.timer_ended(self.timers.take(self.now_s), self.now_s))
        return effects

    def late(self, seconds, *, states=True):
        """Let time pass on a busy machine: each timer ends 60 ms late."""
        end_s, effects = self.now_s + seconds, []
        while True:
            if self.timers:
                self.now_s = max(self.now_s, self.timers.next_s) + 0.06
                effects += self._do(self.driver.timer_ended(self.timers.take(self.now_s), self.now_s))
            if states:
                effects += self.state()
            if self.now_s >= end_s:
                return effects

    @property
    def written(self):
        """All values of the inputs so far: permission and beat."""
        data, found = bytes(self.sent["inputs"]), []
        while data:
            length, kind = rtde.HEADER.unpack_from(data)
            if kind == PackageType.DATA:
                found.append(struct.unpack(">ii", data[4:length]))
            data = data[length:]
        return found

    @property
    def number(self):
        return self.written[-1][0]

    def play(self, progress=Progress.MOVING):
        """Let the program run, and hear the newest beat."""
        self.runtime = 2
        go, beat = self.written[-1]
        own = {"output_int_register_24": go, "output_int_register_25": int(progress)}
        self.registers = own | {"output_int_register_26": beat}


def test_capabilities_say_what_it_can_do():
    driver = driver_maker("rtde")(
        SIX, {}, relay=None, options=UniversalRobotsSettings(motion=MotionSettings())
    )
    assert isinstance(driver, RtdeMotionDriver)
    capabilities = driver.capabilities
    assert capabilities.commands == {MoveAbsolute, Speed, Stop, Reset}
    assert (capabilities.absolute, capabilities.dies_with_link, capabilities.jogs) == (True, True, False)
    assert type(driver_maker("rtde")(SIX, {}, relay=None, options=None)) is RtdeDriver


@pytest.mark.parametrize(
    ("commands", "text"),
    [
        ((MoveAbsolute((0.0,) * 5),), "5"),
        ((MoveAbsolute((float("nan"),) * 6),), "finite"),
        ((Speed(float("inf")),), "finite"),
        ((MoveAbsolute(TARGET), MoveAbsolute(TARGET)), "queues none"),
        ((MoveRelative((0.0,) * 6),), "MoveRelative"),
        ((Home(),), "Home"),
    ],
)
def test_what_it_cannot_send_is_refused(commands, text):
    with pytest.raises(CommandError, match=text):
        Arm().driver.prepare(*commands)


def test_a_script_has_finite_numbers_only():
    options = {"speed": 0.5, "acceleration": 1.0, "registers": Registers(first_input=30, first_output=40)}
    text = motion_script(7, TARGET, **options).decode()
    assert "movej([0.100000000, -1.500000000, 1.500000000, 0.000000000, 0.500000000, 0.000000000]" in text
    assert 'rtde_set_watchdog("input_int_register_31", 10, "stop")' in text
    assert "r=0)" in text
    assert len(text) < 2000
    for wrong in ({"speed": float("nan")}, {"speed": 0.0}, {"acceleration": float("inf")}):
        with pytest.raises(ValueError, match="finite"):
            motion_script(7, TARGET, **options | wrong)
    with pytest.raises(ValueError, match="above 0"):
        motion_script(0, TARGET, **options)


def test_a_motion_is_permitted_then_sent_fed_and_forgotten():
    arm = Arm()
    permission, script = flat(arm.command(Speed(50.0), MoveAbsolute(TARGET)), Send)
    assert (permission.channel, script.channel) == (INPUTS, SCRIPTS)
    number = arm.number
    assert number > 0
    assert f"== {number}:".encode() in script.data
    assert b"v=0.523599" in script.data
    before = len(arm.written)
    for _ in range(5):
        arm.play()
        arm.wait(0.1)
    assert 20 <= len(arm.written) - before <= 27
    assert {go for go, _ in arm.written[before:]} == {number}
    arm.play(Progress.DONE)
    arm.runtime = 1
    effects = arm.state()
    assert not flat(effects, FateUnknown)
    assert arm.number == 0
    count = len(arm.written)
    arm.wait(0.3)
    assert len(arm.written) == count
    assert arm.sent["scripts"].count(b"def ") == 1


def test_a_motion_that_is_not_seen_to_start_is_given_up_once():
    arm = Arm()
    arm.command(MoveAbsolute(TARGET))
    assert not flat(arm.wait(START_S - 0.02), FateUnknown)
    (fate,) = flat(arm.wait(0.1), FateUnknown)
    assert fate.why.code == "universal_robots.not_started"
    assert arm.number == 0
    assert not flat(arm.wait(2.0), FateUnknown)
    assert arm.sent["scripts"].count(b"def ") == 1


@pytest.mark.parametrize(
    ("progress", "text"),
    [
        (Progress.MOVING, "ended before its target"),
        (Progress.STOPPED, "ended before its target"),
        (Progress.NOT_BEGUN, "moved nothing"),
    ],
)
def test_a_program_that_ends_before_its_target_is_reported(progress, text):
    arm = Arm()
    arm.command(MoveAbsolute(TARGET))
    arm.play(progress)
    arm.wait(0.1)
    arm.runtime = 1
    effects = arm.wait(0.2)
    alarms = [event for report in flat(effects, Report) for event in report.events]
    (alarm,) = flat(alarms, AlarmReceived)
    assert text in alarm.text
    assert not flat(effects, FateUnknown)


@pytest.mark.parametrize(
    ("change", "code"),
    [
        ({"runtime": 4}, "universal_robots.paused"),
        ({"safety": 3}, "universal_robots.arm_stopped"),
        ({"tool": (0.0, 0.0, 0.1, 0.0, 0.0, 0.0)}, "universal_robots.tool_changed"),
        ({"registers": {"output_int_register_24": 5}}, "universal_robots.lost_program"),
    ],
)
def test_a_state_that_does_not_fit_gives_the_motion_up(change, code):
    arm = Arm()
    arm.command(MoveAbsolute(TARGET))
    arm.play()
    arm.wait(0.05)
    for name, value in change.items():
        setattr(arm, name, value)
    (fate,) = flat(arm.state(), FateUnknown)
    assert fate.why.code == code
    assert arm.number == 0


def test_a_program_that_does_not_hear_the_beats_is_another_one():
    arm = Arm()
    arm.command(MoveAbsolute(TARGET))
    arm.play()
    effects = arm.wait(0.5)
    assert [fate.why.code for fate in flat(effects, FateUnknown)] == ["universal_robots.lost_program"]


def test_without_states_the_beats_end():
    arm = Arm()
    arm.command(MoveAbsolute(TARGET))
    arm.play()
    arm.wait(0.05)
    effects = arm.wait(0.5, states=False)
    assert [fate.why.code for fate in flat(effects, FateUnknown)] == ["universal_robots.state_old"]
    assert arm.number == 0


def test_a_gateway_that_is_always_late_gives_up_too():
    arm = Arm()
    arm.command(MoveAbsolute(TARGET))
    effects = arm.late(2.5 * START_S)
    assert [fate.why.code for fate in flat(effects, FateUnknown)] == ["universal_robots.not_started"]
    arm = Arm()
    arm.command(MoveAbsolute(TARGET))
    arm.play()
    arm.state()
    effects = arm.late(1.0, states=False)
    assert [fate.why.code for fate in flat(effects, FateUnknown)] == ["universal_robots.state_old"]


def test_a_gateway_that_was_late_reads_first_what_has_arrived():
    arm = Arm()
    arm.command(MoveAbsolute(TARGET))
    arm.play()
    arm.state()
    arm.now_s += 0.4
    assert not flat(arm.late(0.0, states=False), FateUnknown)
    arm.play()
    assert not flat(arm.wait(0.05), FateUnknown)


@pytest.mark.parametrize("channel", [RTDE, INPUTS, DASHBOARD])
def test_a_lost_connection_gives_the_motion_up(channel):
    arm = Arm()
    arm.command(MoveAbsolute(TARGET))
    arm.play()
    arm.wait(0.05)
    (fate,) = flat(arm._do(arm.driver.closed(channel, arm.now_s)), FateUnknown)
    assert fate.why.code == "universal_robots.channel_lost"
    with pytest.raises(NotReadyError):
        arm.command(MoveAbsolute(TARGET))


@pytest.mark.parametrize(
    ("prepare", "code"),
    [
        (lambda arm: setattr(arm, "runtime", 2), "universal_robots.other_program"),
        (lambda arm: setattr(arm, "runtime", 4), "universal_robots.other_program"),
        (lambda arm: setattr(arm, "runtime", 0), "universal_robots.other_program"),
        (lambda arm: setattr(arm, "safety", 5), "universal_robots.arm_stopped"),
        (lambda arm: arm.command(MoveAbsolute(TARGET)), "universal_robots.moves"),
        (lambda arm: arm.driver.closed(SCRIPTS, arm.now_s), "controller.mode_unknown"),
        (lambda arm: setattr(arm, "now_s", arm.now_s + 2.0), "controller.mode_unknown"),
    ],
)
def test_a_motion_is_refused_while_it_is_not_known_to_be_alone(prepare, code):
    arm = Arm()
    prepare(arm)
    arm.state()
    before = arm.sent["scripts"].count(b"def ")
    with pytest.raises(NotReadyError) as error:
        arm.command(MoveAbsolute(TARGET))
    assert error.value.reason.code == code
    assert arm.sent["scripts"].count(b"def ") == before


def test_an_old_state_is_no_state():
    arm = Arm()
    arm.now_s += 0.3
    with pytest.raises(NotReadyError) as error:
        arm.command(MoveAbsolute(TARGET))
    assert error.value.reason.code == "universal_robots.state_old"


def test_scripts_have_a_connection_only_in_remote_control_and_a_new_one_after_each_change():
    arm = Arm(remote=False)
    assert not flat(arm.effects, Open)
    statuses = [event for report in flat(arm.state(), Report) for event in report.events]
    assert flat(statuses, StatusReceived)[0].mode is Mode.LOCAL
    # The connections from local control stay restricted: first the dashboard's is opened again.
    arm.wait(0.6)
    effects = arm.answer(True)
    assert [each.channel for each in flat(effects, Close)] == [DASHBOARD]
    assert [each.channel for each in flat(effects, Open)] == [DASHBOARD]
    arm._do(arm.driver.opened(DASHBOARD, arm.now_s))
    arm.receive(DASHBOARD, b"Connected\n")
    assert [each.channel for each in flat(arm.answer(True), Open)] == [SCRIPTS]
    arm._do(arm.driver.opened(SCRIPTS, arm.now_s))
    arm.wait(0.6)
    assert [each.channel for each in flat(arm.answer(False), Close)] == [SCRIPTS]
    with pytest.raises(NotReadyError):
        arm.command(MoveAbsolute(TARGET))


def test_a_stop_uses_each_connection_that_is_there():
    arm = Arm()
    arm.command(MoveAbsolute(TARGET))
    sends = flat(arm.command(Stop()), Send)
    assert [(each.channel, each.alternative) for each in sends] == [(INPUTS, True), (DASHBOARD, True)]
    assert arm.number == 0
    assert sends[1].data == b"stop\n"
    arm.driver.closed(DASHBOARD, arm.now_s)
    assert [each.channel for each in flat(arm.command(Stop()), Send)] == [INPUTS]
    arm.driver.closed(INPUTS, arm.now_s)
    # Without any, the link says why it cannot be sent.
    assert [each.channel for each in flat(arm.command(Stop()), Send)] == [DASHBOARD]
    assert not flat(arm.command(Reset()), Send)


def test_a_stop_ends_programs_of_others_in_remote_control_only():
    arm = Arm()
    assert arm.driver.stop_ends_now(arm.now_s) is StopEnds.ANY
    # The program's own stop needs no mode; its inputs were not lost.
    assert arm.driver.stop_ends_now(arm.now_s + 10.0) is StopEnds.OURS
    arm.wait(0.6)
    arm.answer(False)
    assert arm.driver.stop_ends_now(arm.now_s) is StopEnds.OURS
    arm.driver.closed(INPUTS, arm.now_s)
    assert arm.driver.stop_ends_now(arm.now_s) is None


def test_after_a_stop_the_arm_rests_only_when_every_joint_was_still():
    arm = Arm()
    arm.command(MoveAbsolute(TARGET))
    arm.play()
    arm.wait(0.05)
    arm.command(Stop())
    arm.runtime = 1

    def activity(**others):
        events = flat(arm.state(**others), Report)[0].events
        return flat(events, StatusReceived)[0].activity

    for number in range(10):
        arm.now_s += 0.01
        assert activity(actual_q=(0.01 * number, 0, 0, 0, 0, 0)) is Activity.MOVING
    for _ in range(45):
        arm.now_s += 0.01
        assert activity(actual_q=(0.09, 0, 0, 0, 0, 0)) is Activity.MOVING
    arm.now_s += 0.1
    assert activity(actual_q=(0.09, 0, 0, 0, 0, 0)) is Activity.IDLE


def test_rest_after_a_stop_is_shown_only_by_states_since_then():
    arm = Arm()
    arm.wait(1.0)
    arm.command(MoveAbsolute(TARGET))
    arm.command(Stop())
    arm.now_s += 0.01
    statuses = [event for report in flat(arm.state(), Report) for event in report.events]
    assert flat(statuses, StatusReceived)[0].activity is Activity.MOVING
    arm.wait(0.5)
    arm.now_s += 0.01
    statuses = [event for report in flat(arm.state(), Report) for event in report.events]
    assert flat(statuses, StatusReceived)[0].activity is Activity.IDLE


def test_a_question_precedes_the_stop_that_follows_from_the_same_timer():
    """Its answer would be taken for that of the stop."""
    arm = Arm()
    arm.command(MoveAbsolute(TARGET))
    effects = arm.wait(0.52)
    (fate,) = flat(effects, FateUnknown)
    question = Send(DASHBOARD, b"is in remote control\n")
    assert effects.index(question) < effects.index(fate)


@pytest.mark.parametrize("line", [b"\xa0true\n", b"true\x85\n", b"\x1ctrue\n"])
def test_an_answer_next_to_other_bytes_is_none(line):
    arm = Arm()
    arm.wait(0.52)
    arm.receive(DASHBOARD, line)
    arm.state()
    with pytest.raises(NotReadyError) as error:
        arm.command(MoveAbsolute(TARGET))
    assert error.value.reason.code == "controller.mode_unknown"


@pytest.mark.parametrize("first", [Stop(), Recover(Recovery.CLOSE_SAFETY_POPUP)])
def test_a_stop_and_a_recovery_are_sent_alone(first):
    with pytest.raises(CommandError, match="alone"):
        Arm().driver.prepare(first, MoveAbsolute(TARGET))


def test_a_refused_stop_is_an_alarm_only_while_a_program_runs():
    arm = Arm()
    arm.command(Stop())
    assert not flat(arm.receive(DASHBOARD, b"Failed to execute: stop\n"), Report)
    arm.runtime = 2
    arm.state()
    arm.command(Stop())
    (report,) = flat(arm.receive(DASHBOARD, b"Command is not allowed\n"), Report)
    assert "has not stopped the program: Command is not allowed" in report.events[0].text


@pytest.mark.parametrize(
    ("types", "name"),
    [("INT32,IN_USE", "input_int_register_25"), ("NOT_FOUND,INT32", "input_int_register_24")],
)
def test_a_register_that_cannot_be_used_is_named(types, name):
    arm = Arm()
    arm.driver.closed(INPUTS, arm.now_s)
    arm._do(arm.driver.opened(INPUTS, arm.now_s))
    arm.receive(INPUTS, package(PackageType.PROTOCOL_VERSION, b"\x01"))
    (close,) = flat(arm.receive(INPUTS, package(PackageType.SET_UP_INPUTS, b"\x00" + types.encode())), Close)
    assert name in close.why
    with pytest.raises(NotReadyError, match=name):
        arm.command(MoveAbsolute(TARGET))
    assert [each.channel for each in flat(arm.wait(2.1), Open)] == [INPUTS]


def test_a_silent_dashboard_is_left_and_opened_again():
    arm = Arm()
    effects = arm.wait(5.0)
    assert [each.channel for each in flat(effects, Close)] == [SCRIPTS, DASHBOARD]
    assert [each.channel for each in flat(effects, Open)] == [DASHBOARD]


def test_unknown_bytes_move_nothing_and_raise_nothing():
    dice = random.Random(18)
    words = (b"true\n", b"false\n", b"Stopped\n", package(PackageType.DATA, b"\x07abc"))
    for _ in range(300):
        arm = Arm()
        arm.sent["scripts"].clear()
        for _ in range(20):
            channel = dice.choice((RTDE, PRIMARY, DASHBOARD, INPUTS, SCRIPTS))
            data = dice.choice((*words, dice.randbytes(dice.randrange(40))))
            arm.receive(channel, data)
            arm.now_s += dice.random() * 0.1
            if dice.random() < 0.2:
                arm.wait(0.03, states=False)
        assert not arm.sent["scripts"]
        assert not flat(arm.effects, FateUnknown)
        assert all(
            not isinstance(event, JointsReceived) for r in flat(arm.effects, Report) for event in r.events
        )


def test_inputs_that_are_used_exist():
    names = Registers(first_input=46, first_output=45)
    assert all(INPUT_TYPES[name] == "INT32" for name in names.inputs)
    assert all(OFFERED[name] == "INT32" for name in names.outputs)


UNLOCK = Recovery.UNLOCK_PROTECTIVE_STOP
FITTING = {
    UNLOCK: {"safety_status": 3},
    Recovery.CLOSE_SAFETY_POPUP: {},
    Recovery.RESTART_SAFETY: {"safety_status": 8, "robot_mode": 3},
    Recovery.POWER_ON: {"robot_mode": 3},
    Recovery.BRAKE_RELEASE: {"robot_mode": 5},
}
WORDS = {
    UNLOCK: (b"unlock protective stop\n", b"Protective stop releasing"),
    Recovery.CLOSE_SAFETY_POPUP: (b"close safety popup\n", b"closing safety popup"),
    Recovery.RESTART_SAFETY: (b"restart safety\n", b"Restarting safety"),
    Recovery.POWER_ON: (b"power on\n", b"Powering on"),
    Recovery.BRAKE_RELEASE: (b"brake release\n", b"Brake releasing"),
}


def in_state(seconds=6.0, *, remote=True, **state):
    """Return an arm after a time in a state of its controller."""
    arm = Arm()
    arm.safety = state.get("safety_status", 1)
    end_s, answered = arm.now_s + seconds, 1
    while arm.now_s < end_s:
        arm.now_s += 0.1
        arm.state(**state)
        if arm.timers and arm.timers.next_s <= arm.now_s:
            arm._do(arm.driver.timer_ended(arm.timers.take(arm.now_s), arm.now_s))
        if arm.sent["dashboard"].count(b"is in remote control") > answered:
            answered += 1
            arm.answer(remote)
    return arm


def answers(effects):
    return [each for effect in flat(effects, Report) for each in effect.events]


@pytest.mark.parametrize("recovery", FITTING)
def test_a_recovery_is_sent_once_and_its_answer_reported(recovery):
    arm = in_state(**FITTING[recovery])
    command, answer = WORDS[recovery]
    assert flat(arm.command(Recover(recovery)), Send) == [Send(DASHBOARD, command)]
    with pytest.raises(NotReadyError, match="has not answered"):
        arm.command(Recover(recovery))
    effects = arm.receive(DASHBOARD, answer + b"\n")
    assert answers(effects) == [RecoverAnswered(recovery, True, answer.decode())]
    assert not flat(effects, Send)
    assert arm.sent["dashboard"].count(command) == 1
    assert recovery in arm.driver.capabilities.recoveries


@pytest.mark.parametrize("recovery", [each for each in FITTING if FITTING[each]])
def test_a_recovery_that_does_not_fit_the_state_is_refused(recovery):
    for state in ({}, *(each for other, each in FITTING.items() if other is not recovery)):
        with pytest.raises(NotReadyError, match="does not fit"):
            in_state(**state).command(Recover(recovery))


def test_a_protective_stop_is_unlocked_after_5_s_as_seen_by_the_driver():
    arm = in_state(4.8, safety_status=3)
    with pytest.raises(NotReadyError, match="seen for 4"):
        arm.command(Recover(UNLOCK))
    arm = in_state(5.1, safety_status=3)
    assert arm.command(Recover(UNLOCK))
    # After a lost connection its begin is not known any longer.
    arm = in_state(5.1, safety_status=3)
    arm._do(arm.driver.closed(RTDE, arm.now_s))
    arm.sent["rtde"].clear()
    arm._do(arm.driver.opened(RTDE, arm.now_s))
    arm.greet(VERSION)
    arm.state(safety_status=3)
    with pytest.raises(NotReadyError, match=r"seen for 0\.0 s only"):
        arm.command(Recover(UNLOCK))


def test_a_recovery_is_refused_while_a_program_runs_or_waits_and_without_state_or_mode():
    arm = in_state(**FITTING[UNLOCK])
    for runtime in (2, 3, 4, 5):
        arm.state(runtime_state=runtime, safety_status=3)
        with pytest.raises(NotReadyError, match="another program runs or waits"):
            arm.command(Recover(UNLOCK))
    arm.state(safety_status=3)
    arm.now_s += 0.3
    with pytest.raises(NotReadyError, match="too old"):
        arm.command(Recover(UNLOCK))
    arm = in_state(**FITTING[UNLOCK], remote=False)
    with pytest.raises(NotReadyError, match="local"):
        arm.command(Recover(UNLOCK))
    arm = in_state(**FITTING[UNLOCK])
    arm._do(arm.driver.closed(DASHBOARD, arm.now_s))
    with pytest.raises(NotReadyError, match="dashboard"):
        arm.command(Recover(UNLOCK))
    assert b"unlock" not in arm.sent["dashboard"]
    with pytest.raises(CommandError, match="Recover"):
        arm.driver.prepare(Recover(Recovery.SERVO_ON))


def test_a_refused_recovery_is_reported_with_the_controller_s_words():
    arm = in_state(**FITTING[UNLOCK])
    arm.command(Recover(UNLOCK))
    effects = arm.receive(DASHBOARD, b"Cannot unlock protective stop until 5s after occurrence.\n")
    (answer,) = answers(effects)
    assert (answer.accepted, answer.answer[:13]) == (False, "Cannot unlock")
    assert arm.command(Recover(UNLOCK))


def test_an_answer_with_other_bytes_is_none_to_a_recovery():
    arm = in_state(**FITTING[UNLOCK])
    arm.command(Recover(UNLOCK))
    (answer,) = answers(arm.receive(DASHBOARD, b"Protective\x00stop releasing\n"))
    assert (answer.accepted, answer.answer) == (False, "Protective stop releasing")


def test_a_recovery_without_an_answer_is_unknown_and_not_sent_again():
    arm = in_state(**FITTING[UNLOCK])
    arm.command(Recover(UNLOCK))
    effects = arm.wait(9.5)
    assert not answers(effects) or not [e for e in answers(effects) if isinstance(e, RecoverAnswered)]
    # A stop does not wait for it.
    assert Send(DASHBOARD, b"stop\n", alternative=True) in arm.command(Stop())
    effects = arm.wait(1.0)
    (answer,) = (each for each in answers(effects) if isinstance(each, RecoverAnswered))
    assert (answer.recovery, answer.accepted) == (UNLOCK, None)
    assert Close(DASHBOARD, "it does not answer") in effects
    arm.wait(5.0)
    assert arm.sent["dashboard"].count(b"unlock") == 1


@pytest.mark.parametrize("lost", ["closed", "started"])
def test_a_connection_that_ends_before_the_answer_leaves_it_unknown(lost):
    arm = in_state(**FITTING[UNLOCK])
    arm.command(Recover(UNLOCK))
    if lost == "closed":
        effects = arm._do(arm.driver.closed(DASHBOARD, arm.now_s))
    else:
        effects = arm._do(arm.driver.started(arm.now_s))
    (answer,) = answers(effects)
    assert (answer.recovery, answer.accepted) == (UNLOCK, None)


def test_nothing_is_recovered_by_itself():
    """Not at the connection, by a reset, by a stop, nor by a motion that is refused."""
    for state in FITTING.values():
        arm = in_state(**state)
        arm.command(Reset())
        arm.command(Stop())
        if state:
            with pytest.raises(NotReadyError):
                arm.command(MoveAbsolute(TARGET))
        arm.wait(1.0)
        assert set(bytes(arm.sent["dashboard"]).splitlines()) <= {b"is in remote control", b"stop"}
        assert not arm.sent["scripts"]


def test_seats_are_taken_only_from_a_controller_whose_version_allows_motion():
    arm = Arm()

    def reconnected(version):
        """Return the channels that are opened and closed for a version, and the reason against motion."""
        arm.effects = []
        arm.sent["rtde"].clear()
        arm._do(arm.driver.closed(RTDE, arm.now_s))
        arm._do(arm.driver.opened(RTDE, arm.now_s))
        arm.greet(version)
        (report,) = [
            each.events[0]
            for each in flat(arm.effects, Report)
            if each.events and isinstance(each.events[0], MotionImpossible)
        ]
        changes = [each.channel.name for kind in (Open, Close) for each in flat(arm.effects, kind)]
        return changes, report.why and report.why.code

    assert reconnected((5, 9, 0, 0)) == ([], None)
    impossible = "universal_robots.software"
    changes, why = reconnected((10, 7, 0, 0))
    assert (sorted(changes), why) == (["dashboard", "inputs", "scripts"], impossible)
    assert reconnected((3, 15, 0, 0)) == ([], impossible)
    with pytest.raises(NotReadyError, match=r"PolyScope 5\.6"):
        arm.command(Recover(Recovery.POWER_ON))
    assert reconnected((5, 9, 0, 0)) == (["dashboard", "inputs"], None)
