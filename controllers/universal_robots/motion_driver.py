"""Driver of Universal Robots controllers that also moves the arm.

    channel      port    carries           sent
    ---------    -----   ---------------   -----------------------------------------------------------
    rtde         30004   reading           the greeting, as without motion
    primary      30011   nothing           nothing
    dashboard    29999   stop              the question for remote control twice a second; "stop"; recoveries
    inputs       30004   motion            two registers, 50 times a second while a motion runs
    scripts      30001   motion            the program of a motion

Each motion is one program. The program moves the arm only while the driver writes the motion's number, its
permission, into one register, and a new number, the beat, into the other. If the beats end, the controller
stops the program.

Start: The driver sends a program only in remote control, and only if the newest state shows that no program
runs. A state must show the new program within START_S.

Stop: The driver ends the permission and the beats, and sends "stop" to the dashboard. Either ends the
program. The dashboard does so in remote control only; it then also ends a program of another client.

Error: If a state does not show the motion as expected, or a needed connection ends, the driver ends the
permission and the beats. The controller then stops the arm, and the gateway latches a stop. The driver never
sends a motion again.
"""

import secrets
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from controllers.universal_robots import codes as ur_codes
from controllers.universal_robots.driver import (
    JOINTS,
    OUTPUT_FIELDS,
    RTDE,
    RtdeDriver,
    status_of,
)
from controllers.universal_robots.interfaces.dashboard import RECOVERIES, Dashboard
from controllers.universal_robots.interfaces.inputs import InputsWriter
from controllers.universal_robots.interfaces.modes import (
    RobotMode,
    RuntimeState,
    SafetyMode,
    name_of,
)
from controllers.universal_robots.interfaces.rtde_messages import ControllerVersion
from controllers.universal_robots.interfaces.rtde_reader import RtdeReader
from controllers.universal_robots.interfaces.state import ControllerState
from controllers.universal_robots.motion_script import Progress, Registers, motion_script
from controllers.universal_robots.settings import UniversalRobotsSettings
from protocol_gateway.driver_parts.one_motion import FIRST_PERCENT, OneMotion, Phase, prepared
from protocol_gateway.driver_parts.rest import Rest
from protocol_gateway.seam import (
    AlarmReceived,
    Capabilities,
    Carries,
    Channel,
    Close,
    ControllerCommand,
    Effect,
    Effects,
    FateUnknown,
    Mode,
    MotionImpossible,
    MoveAbsolute,
    Open,
    Recover,
    Recovery,
    Report,
    Reset,
    Send,
    SetTimer,
    Severity,
    Speed,
    StatusReceived,
    Stop,
    StopEnds,
)
from protocol_gateway.seam.errors import NotReadyError
from robomesh import reason_codes as codes
from robomesh.reasons import Reason
from robots.kinematics.joints import JointType

DASHBOARD = Channel(name="dashboard", carries=Carries.STOP)
INPUTS = Channel(name="inputs", carries=Carries.MOTION)
SCRIPTS = Channel(name="scripts", carries=Carries.MOTION)
_OPEN_DASHBOARD, _OPEN_SCRIPTS, _OPEN_INPUTS = Open(DASHBOARD, 29999), Open(SCRIPTS, 30001), Open(INPUTS)

START_S = 0.5
"""Time within which a program must be seen to have started."""
_BEAT_S = 0.02
_ASK_S = 0.5
_ANSWER_WITHIN_S = 2.0
# A controller answers a recovery after its begin, and nothing else before.
_RECOVERY_WITHIN_S = 10.0
UNLOCK_AFTER_S = 5.0
"""Age of a protective stop from which on controllers unlock it."""
_MODE_VALID_S = 1.5
_STATE_VALID_S = 0.2
_BLIND_S = 0.3
_LATE_S = 0.05
_RETRY_S = 2.0
# A program that runs repeats the beats; so many may be on their way.
_MOST_BEATS_BEHIND = 13
# A program may have ended before its last registers are seen.
_ENDED_S = 0.05
_STILL_RAD = 1e-3
_LARGEST_NUMBER = 2**30
_MAY_MOVE = frozenset({SafetyMode.NORMAL, SafetyMode.REDUCED})
_NO_MOTION = 0
_FAULTS = frozenset({SafetyMode.VIOLATION, SafetyMode.FAULT})


@dataclass
class _Sent:
    """Data of a motion that was sent."""

    number: int
    sent_s: float
    tool: object
    stopped_s: float | None = None


class RtdeMotionDriver(RtdeDriver):
    """Driver of RTDE, the primary interface, the dashboard and scripts.

    Raises:
        GatewaySettingsError: As `RtdeDriver`.
    """

    capabilities = Capabilities(
        commands=frozenset({MoveAbsolute, Speed, Stop, Reset}),
        first_speed_percent=FIRST_PERCENT,
        absolute=True,
        dies_with_link=True,
        reports_pose=True,
        experimental=True,
        stop_means="dashboard stop and the program's stopj",
        recoveries=frozenset(RECOVERIES),
    )
    # Beats, questions, greetings.
    requests_a_second = 100.0

    def __init__(
        self,
        joint_types: Sequence[JointType],
        codes: Mapping[int, str],
        *,
        relay: Callable[[bytes, bool, Hashable], None] | None = None,
        options: object = None,
    ) -> None:
        super().__init__(joint_types, codes, relay=relay, options=options)
        motion = self._settings.motion
        assert motion is not None
        self._speed, self._acceleration = motion.speed, motion.acceleration
        self._registers = Registers(first_input=motion.input_registers, first_output=motion.output_registers)
        outputs = self._registers.outputs
        self._reader = RtdeReader(
            self._settings.rate_hz, {**OUTPUT_FIELDS, **dict.fromkeys(outputs, "INT32")}, registers=outputs
        )
        # A number of an earlier gateway, which registers may still hold, does not come again.
        self._number = secrets.randbelow(_LARGEST_NUMBER) + 1
        self._beat = 0
        self._forget()

    def _forget(self) -> None:
        self._inputs = InputsWriter(self._registers.inputs)
        self._dashboard = Dashboard()
        self._opened: set[str] = set()
        # Whether the controller's software allows motion; None: its version is not known yet.
        self._possible: bool | None = None
        self._scripts_wanted = False
        self._reopen: list[Open] = []
        self._state: ControllerState | None = None
        self._state_s = self._excused_s = float("-inf")
        self._motion: OneMotion[_Sent] = OneMotion()
        self._percent = FIRST_PERCENT
        self._rest = Rest([_STILL_RAD] * JOINTS)
        self._protective_s: float | None = None

    # ----------------------------------------------------------------- channels

    def started(self, now_s: float) -> Effects:
        """Connect for reading, and to the dashboard, which can stop; the version decides on the others."""
        self._dashboard.opened()
        unanswered = self._recoveries()
        self._forget()
        return (*unanswered, *super().started(now_s), _OPEN_DASHBOARD)

    def controlled(self, taken: bool, now_s: float) -> Effects:
        """Begin with a low speed."""
        self._percent = FIRST_PERCENT
        return ()

    def opened(self, channel: Channel, now_s: float) -> Effects:
        """Greet."""
        self._opened.add(channel.name)
        if channel is DASHBOARD:
            self._dashboard.opened()
            return (SetTimer(now_s + _ASK_S, "ask"), Send(DASHBOARD, self._dashboard.ask(now_s)))
        if channel is INPUTS:
            return (Send(INPUTS, self._inputs.connected()),)
        if channel is SCRIPTS:
            return ()
        return super().opened(channel, now_s)

    def received(self, channel: Channel, data: bytes, now_s: float) -> Effects:
        """Take the next bytes; what the interface of scripts sends is not needed."""
        if channel is DASHBOARD:
            return self._answered(data, now_s)
        if channel is INPUTS:
            return self._inputs_received(data, now_s)
        if channel is SCRIPTS:
            return ()
        return super().received(channel, data, now_s)

    def _states(self, data: bytes, now_s: float) -> Effects:
        before, effects = self._reader.controller, super()._states(data, now_s)
        version = self._reader.controller
        return effects if version is None or version is before else (*effects, *self._on_version(version))

    def _on_version(self, version: ControllerVersion) -> Effects:
        """Take the interfaces for motion only from a controller with which motion is possible."""
        before, self._possible = self._possible, _moves_with(version)
        effects: list[Effect] = [Report([MotionImpossible(self._software_obstacle())], 0)]
        if self._possible:
            effects += [_OPEN_DASHBOARD] if before is False else []
            return effects if before else [*effects, _OPEN_INPUTS]
        self._reopen = []
        for channel in (DASHBOARD, INPUTS):
            if channel.name in self._opened:
                self._opened.discard(channel.name)
                effects += self._lost(channel)
        channels = {None: (DASHBOARD,), True: (DASHBOARD, INPUTS), False: ()}[before]
        return [*effects, *map(Close, channels)]

    def skipped(self, channel: Channel, now_s: float) -> Effects:
        """Connect again: the stream cannot be read from its middle."""
        if channel is SCRIPTS:
            return ()
        return self._leave(channel, "it sent far too much", now_s)

    def closed(self, channel: Channel, now_s: float) -> Effects:
        """Give a motion up that needs the connection."""
        effects: list[Effect] = []
        if channel.name in self._opened:
            self._opened.discard(channel.name)
            effects += self._lost(channel)
        return effects

    def _lost(self, channel: Channel) -> Effects:
        """Handle the end of a connection."""
        effects: list[Effect] = []
        if channel is RTDE:
            # The next connection may reach another controller, where no speed was set.
            self._percent, self._state, self._protective_s = FIRST_PERCENT, None, None
            self._rest.forget()
        if channel is INPUTS:
            self._inputs.disconnected()
        if channel is DASHBOARD:
            self._dashboard.opened()
            effects += (SetTimer(None, "ask"), *self._recoveries())
        if channel is SCRIPTS:
            # The controller closes it when it changes to local control: the mode must be asked again.
            self._dashboard.remote = None
        if channel in (SCRIPTS, DASHBOARD):
            effects += self._close_scripts()
        if self._motion.sent and channel in (INPUTS, DASHBOARD, RTDE):
            effects += self._give_up(ur_codes.CHANNEL_LOST(name=channel.name))
        return effects

    def _leave(self, channel: Channel, why: str, now_s: float) -> Effects:
        """End a connection that cannot be read or used, and connect again later."""
        self._opened.discard(channel.name)
        if channel not in (DASHBOARD, INPUTS):
            return (*self._lost(channel), *super()._leave(channel, why, now_s))
        self._reopen.append(_OPEN_DASHBOARD if channel is DASHBOARD else _OPEN_INPUTS)
        return (SetTimer(now_s + _RETRY_S, "reopen"), *self._lost(channel), Close(channel, why))

    def timer_ended(self, ended: Mapping[str, float], now_s: float) -> Effects:
        """Beat, ask, and look for what has not happened."""
        effects: list[Effect] = []
        # A late gateway has unread messages.
        late = now_s - min(ended.values(), default=now_s) > _LATE_S
        if "" in ended:
            effects += super().timer_ended(ended, now_s)
        if "reopen" in ended:
            effects += self._reopen
            self._reopen = []
        # First, because FateUnknown sends a stop immediately, and answers have the order of the commands.
        if "ask" in ended and DASHBOARD.name in self._opened:
            effects += self._next_question(now_s)
        motion = self._motion
        if "start" in ended and motion.sent and motion.phase is Phase.SENT:
            if late and now_s < motion.sent.sent_s + 2.0 * START_S:
                effects.append(SetTimer(now_s + _LATE_S, "start"))
            else:
                effects += self._give_up(ur_codes.NOT_STARTED(seconds=START_S))
        if "beat" in ended and motion.sent:
            effects += self._next_beat(motion.sent.number, now_s, late=late)
        return effects

    # ------------------------------------------------------------------ dashboard

    def _next_question(self, now_s: float) -> Effects:
        later = SetTimer(now_s + _ASK_S, "ask")
        dashboard = self._dashboard
        if dashboard.recovery is not None:
            if now_s - dashboard.recovery_s < _RECOVERY_WITHIN_S:
                return (later,)
        elif dashboard.asked_s is None:
            return (later, Send(DASHBOARD, dashboard.ask(now_s)))
        elif now_s - dashboard.asked_s < _ANSWER_WITHIN_S:
            return (later,)
        return self._leave(DASHBOARD, "it does not answer", now_s)

    def _answered(self, data: bytes, now_s: float) -> Effects:
        dashboard = self._dashboard
        dashboard.receive(data, now_s)
        effects: list[Effect] = [*self._recoveries()]
        refusals, dashboard.refusals = dashboard.refusals, []
        if refusals and self._state is not None and self._state.runtime_state != RuntimeState.STOPPED:
            text = f"the dashboard has not stopped the program: {refusals[-1]}"
            effects.append(Report([AlarmReceived(Severity.ERROR, text)], 0))
        if dashboard.lost:
            return (*effects, *self._leave(DASHBOARD, "its answers do not fit", now_s))
        if dashboard.remote is False:
            effects += self._close_scripts()
            if self._motion.sent:
                effects += self._give_up(ur_codes.WENT_LOCAL())
        elif dashboard.remote and dashboard.was_local:
            # Connections from local control stay restricted.
            self._opened.discard(DASHBOARD.name)
            effects += (*self._lost(DASHBOARD), Close(DASHBOARD), _OPEN_DASHBOARD)
        elif dashboard.remote and not self._scripts_wanted:
            self._scripts_wanted = True
            effects.append(_OPEN_SCRIPTS)
        return effects

    def _recoveries(self) -> Effects:
        """Report answers to recoveries."""
        answers, self._dashboard.answers = self._dashboard.answers, []
        return (Report(answers, 0),) if answers else ()

    def _close_scripts(self) -> Effects:
        wanted, self._scripts_wanted = self._scripts_wanted, False
        self._opened.discard(SCRIPTS.name)
        return (Close(SCRIPTS),) if wanted else ()

    def _mode(self, now_s: float) -> Mode | None:
        if now_s - self._dashboard.answered_s > _MODE_VALID_S or self._dashboard.remote is None:
            return None
        return Mode.REMOTE if self._dashboard.remote else Mode.LOCAL

    def stop_ends_now(self, now_s: float) -> StopEnds | None:
        """Return whose motion a stop ends: the dashboard's any program, but in remote control only."""
        if self._mode(now_s) is Mode.REMOTE:
            return StopEnds.ANY
        return StopEnds.OURS if self._inputs.ready else None

    # --------------------------------------------------------------------- inputs

    def _inputs_received(self, data: bytes, now_s: float) -> Effects:
        self._inputs.receive(data)
        effects: list[Effect] = []
        if asked := self._inputs.to_send():
            effects.append(Send(INPUTS, asked))
        if self._inputs.problem:
            effects += self._leave(INPUTS, f"{self._inputs.failed}: {self._inputs.problem}", now_s)
        return effects

    def _next_beat(self, number: int, now_s: float, *, late: bool) -> Effects:
        if now_s - self._state_s > _BLIND_S:
            if not late or self._excused_s == self._state_s:
                return self._give_up(ur_codes.STATE_OLD())
            # Once: what has arrived is read before the next beat.
            self._excused_s = self._state_s
        return (SetTimer(now_s + _BEAT_S, "beat"), self._written(number))

    def _written(self, go: int, *, alternative: bool = False) -> Send:
        """Return the effect that writes the permission and the next beat."""
        self._beat = (self._beat + 1) % _LARGEST_NUMBER
        return Send(INPUTS, self._inputs.values(go, self._beat), alternative)

    # --------------------------------------------------------------------- motion

    def _status(self, state: ControllerState, now_s: float) -> StatusReceived:
        self._rest.at(state.positions, now_s)
        status = status_of(state)
        activity = self._rest.reported(status.activity, now_s)
        return replace(status, activity=activity, mode=self._mode(now_s))

    def _follow(self, state: ControllerState, now_s: float) -> Effects:
        """Follow the motion by a state; give it up if anything is not as expected."""
        self._state, self._state_s = state, now_s
        if state.safety_mode != SafetyMode.PROTECTIVE_STOP:
            self._protective_s = None
        elif self._protective_s is None:
            self._protective_s = now_s
        if (motion := self._motion.sent) is None:
            if state.runtime_state == RuntimeState.STOPPED:
                self._motion.end()
            return ()
        number, progress, beat = (state.registers.get(name) for name in self._registers.outputs)
        if number == motion.number:
            self._motion.begin()
        if (problem := _problem(state, motion)) is not None:
            return self._give_up(problem)
        if number != motion.number:
            # Another program may run. If it goes on, the motion is not seen to start in time.
            begun = self._motion.phase is Phase.RUNS
            return self._give_up(ur_codes.LOST_PROGRAM()) if begun else ()
        if state.runtime_state == RuntimeState.PLAYING:
            motion.stopped_s = None
            behind = (self._beat - (beat or 0)) % _LARGEST_NUMBER
            return self._give_up(ur_codes.LOST_PROGRAM()) if behind > _MOST_BEATS_BEHIND else ()
        if state.runtime_state == RuntimeState.STOPPED:
            motion.stopped_s = now_s if motion.stopped_s is None else motion.stopped_s
            if progress == Progress.DONE or now_s - motion.stopped_s >= _ENDED_S:
                return self._ended(progress)
        return ()

    def _ended(self, progress: int | None) -> Effects:
        """End the motion after the end of its program."""
        self._motion.end()
        effects: list[Effect] = [self._written(_NO_MOTION)] if self._inputs.ready else []
        if progress != Progress.DONE:
            text = "the program of a motion has ended before its target"
            if progress == Progress.NOT_BEGUN:
                text = "the program of a motion found no permission, and has moved nothing"
            effects.append(Report([AlarmReceived(Severity.WARNING, text)], 0))
        return effects

    def _give_up(self, why: Reason) -> Effects:
        """End the permission and the beats of the motion, and have a stop latched."""
        self._await_rest()
        effects: list[Effect] = []
        if self._inputs.ready:
            effects.append(self._written(_NO_MOTION))
        return (*effects, FateUnknown(why))

    def _await_rest(self) -> None:
        """Note that the arm may still move after the end of a motion, until it was seen at rest."""
        self._rest.prove_again(moved=self._motion.sent is not None)
        self._motion.leave()

    # ------------------------------------------------------------------- commands

    def prepare(self, *commands: ControllerCommand) -> tuple[ControllerCommand, ...]:
        """Return commands that can be sent; at most one motion, as the last one.

        Raises:
            CommandError: If they cannot be expressed.
        """
        return prepared(commands, JOINTS, RECOVERIES)

    def command(self, prepared: Sequence[ControllerCommand], now_s: float) -> Effects:
        """Send what `prepare` returned.

        Raises:
            NotReadyError: If a motion or a recovery cannot be sent now.
        """
        effects: list[Effect] = []
        percent = self._percent
        for command in prepared:
            match command:
                case Stop():
                    effects += self._stop()
                case Speed(new_percent):
                    percent = new_percent
                case MoveAbsolute(target):
                    effects += self._move(target, percent, now_s)
                case Recover(recovery):
                    effects.append(self._recover(recovery, now_s))
                # A reset clears the gateway's latch only: nothing is sent to the controller.
        self._percent = percent
        return effects

    def _stop(self) -> Effects:
        """End permission and beats, and the program itself, by the connections that are there."""
        self._await_rest()
        effects: list[Effect] = []
        if self._inputs.ready:
            effects.append(self._written(_NO_MOTION, alternative=True))
        if DASHBOARD.name in self._opened or not effects:
            effects.append(Send(DASHBOARD, self._dashboard.stop(), alternative=True))
        return effects

    def _move(self, target: Sequence[float], percent: float, now_s: float) -> Effects:
        if (obstacle := self._obstacle(now_s)) is not None:
            raise NotReadyError(obstacle)
        assert self._state is not None
        self._number = self._number % _LARGEST_NUMBER + 1
        script = motion_script(
            self._number,
            target,
            speed=self._speed * percent / 100.0,
            acceleration=self._acceleration,
            registers=self._registers,
        )
        self._motion.send(_Sent(self._number, now_s, _tool(self._state)))
        timers = (SetTimer(now_s + _BEAT_S, "beat"), SetTimer(now_s + START_S, "start"))
        return (*timers, self._written(self._number), Send(SCRIPTS, script))

    def _recover(self, recovery: Recovery, now_s: float) -> Send:
        if (obstacle := self._recovery_obstacle(recovery, now_s)) is not None:
            raise NotReadyError(obstacle)
        return Send(DASHBOARD, self._dashboard.recover(recovery, now_s))

    def _recovery_obstacle(self, recovery: Recovery, now_s: float) -> Reason | None:
        """Return why a recovery cannot be sent now; None: it can."""
        state = self._state
        if (obstacle := self._software_obstacle()) is not None:
            return obstacle
        if state is None or now_s - self._state_s > _STATE_VALID_S:
            return ur_codes.STATE_OLD()
        if self._motion.sent:
            return ur_codes.MOVES()
        # A program that waits could go on after the recovery.
        if state.runtime_state != RuntimeState.STOPPED:
            return ur_codes.OTHER_PROGRAM()
        if DASHBOARD.name not in self._opened:
            return ur_codes.CHANNEL_MISSING(name=DASHBOARD.name)
        if self._dashboard.recovery is not None:
            return ur_codes.RECOVERS(recovery=self._dashboard.recovery.value)
        match self._mode(now_s):
            case None:
                return codes.CONTROLLER_MODE_UNKNOWN()
            case Mode.LOCAL:
                return codes.CONTROLLER_LOCAL()
        if not _fits(recovery, state):
            return ur_codes.NOT_NOW(
                recovery=recovery.value,
                safety=_word(SafetyMode, state.safety_mode),
                robot=_word(RobotMode, state.robot_mode),
            )
        seen_s = 0.0 if self._protective_s is None else now_s - self._protective_s
        if recovery is Recovery.UNLOCK_PROTECTIVE_STOP and seen_s < UNLOCK_AFTER_S:
            return ur_codes.STOP_YOUNG(seen=seen_s, seconds=UNLOCK_AFTER_S)
        return None

    def _software_obstacle(self) -> Reason | None:
        """Return why no motion is possible with the controller's software; None: it is, or it is unknown."""
        version = self._reader.controller
        return None if version is None or _moves_with(version) else ur_codes.SOFTWARE(version=version)

    def _obstacle(self, now_s: float) -> Reason | None:
        """Return why no motion can be sent now; None: it can."""
        state, version = self._state, self._reader.controller
        if (obstacle := self._software_obstacle()) is not None:
            return obstacle
        if state is None or version is None or now_s - self._state_s > _STATE_VALID_S:
            return ur_codes.STATE_OLD()
        if lacks := [name for name in self._registers.outputs if name not in state.registers]:
            return ur_codes.REGISTER(name=lacks[0], problem="the controller does not have it")
        if self._inputs.problem:
            return ur_codes.REGISTER(name=self._inputs.failed, problem=self._inputs.problem)
        if self._motion.sent:
            return ur_codes.MOVES()
        # An unknown state of the program, or of the safety system, forbids the motion.
        if state.runtime_state != RuntimeState.STOPPED:
            return ur_codes.OTHER_PROGRAM()
        if (stopped := _stopped(state)) is not None:
            return stopped
        match self._mode(now_s):
            case None:
                return codes.CONTROLLER_MODE_UNKNOWN()
            case Mode.LOCAL:
                return codes.CONTROLLER_LOCAL()
        if not self._inputs.ready:
            return ur_codes.CHANNEL_MISSING(name=INPUTS.name)
        missing = [each.name for each in (SCRIPTS, DASHBOARD) if each.name not in self._opened]
        return ur_codes.CHANNEL_MISSING(name=missing[0]) if missing else None


def _moves_with(version: ControllerVersion) -> bool:
    return version.major == 5 and version.minor >= 6


def _fits(recovery: Recovery, state: ControllerState) -> bool:
    """Return whether the controller is in a state that a recovery is for."""
    match recovery:
        case Recovery.UNLOCK_PROTECTIVE_STOP:
            return state.safety_mode == SafetyMode.PROTECTIVE_STOP
        case Recovery.RESTART_SAFETY:
            return state.safety_mode in _FAULTS
        case Recovery.POWER_ON:
            return state.safety_mode in _MAY_MOVE and state.robot_mode == RobotMode.POWER_OFF
        case Recovery.BRAKE_RELEASE:
            # Without power, a controller would also power the arm on.
            return state.safety_mode in _MAY_MOVE and state.robot_mode == RobotMode.IDLE
    return True


def _tool(state: ControllerState) -> object:
    """Return what a motion was checked with."""
    return state.tool_offset, state.payload_kg, state.payload_centre_m


def _stopped(state: ControllerState) -> Reason | None:
    """Return why the controller does not let the arm move; None: it does."""
    if state.safety_mode not in _MAY_MOVE:
        return ur_codes.ARM_STOPPED(mode=_word(SafetyMode, state.safety_mode))
    if state.robot_mode != RobotMode.RUNNING:
        return ur_codes.ARM_STOPPED(mode=_word(RobotMode, state.robot_mode))
    return None


def _word(kind: type[RobotMode] | type[SafetyMode], mode: int | None) -> str:
    return "unknown" if mode is None else name_of(kind, mode).lower().replace("_", " ")


def _problem(state: ControllerState, motion: _Sent) -> Reason | None:
    """Return why a motion must not go on; None: it may."""
    if (stopped := _stopped(state)) is not None:
        return stopped
    if state.runtime_state in (RuntimeState.PAUSING, RuntimeState.PAUSED, RuntimeState.RESUMING):
        return ur_codes.PAUSED()
    return ur_codes.TOOL_CHANGED() if _tool(state) != motion.tool else None


def rtde_driver(joint_types: Sequence[JointType], codes: Mapping[int, str], **given: Any) -> RtdeDriver:
    """Create the driver that only reads, unless the site file declares motion."""
    options = given["options"]
    moves = isinstance(options, UniversalRobotsSettings) and options.motion is not None
    return (RtdeMotionDriver if moves else RtdeDriver)(joint_types, codes, **given)
