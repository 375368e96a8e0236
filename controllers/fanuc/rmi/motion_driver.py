"""Driver of FANUC controllers that also moves the robot.

    channel        port                          carries        sent
    -----------    ---------------------------   ------------   ------------------------------------------
    snpx           that of the site file         reading        questions, as without motion
    rmi            16001                         nothing        FRC_Connect
    rmi_session    that of FRC_Connect's answer  motion, stop   FRC_Initialize, one FRC_JointMotionJRep,
                                                                FRC_Abort, FRC_Disconnect

The driver connects to RMI while the robot is controlled, and to send a stop that is pending. Each motion is
one program, which the driver starts and ends:

    NONE --command--> SENT --answer--> RUNS --answer--> ENDING --answer to FRC_Abort--> NONE
          FRC_Initialize   the instruction    FRC_Abort

- Between motions the controller has no program of the gateway. A program that runs then is another client's.
- During a motion the driver reads the state by SNPX only. It cannot ask by RMI: the controller refuses a
  command until it has answered the previous one.
- If a state or an answer is not as expected, the driver sends FRC_Abort, and the gateway latches a stop.
- The driver sends each motion once. It repeats FRC_Abort until the controller has ended the program.
"""

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum, auto
from typing import Any

import numpy as np

from controllers.fanuc import codes as fanuc_codes
from controllers.fanuc.axes import FanucSettings
from controllers.fanuc.driver import SNPX, SnpxDriver
from controllers.fanuc.rmi import messages as rmi
from controllers.fanuc.rmi.messages import Answer, LineStream
from controllers.fanuc.srtp import Answer as Packet
from controllers.fanuc.srtp import Question
from protocol_gateway.driver_parts.hexadecimal import hexadecimal
from protocol_gateway.driver_parts.one_motion import FIRST_PERCENT, OneMotion, Phase, prepared
from protocol_gateway.driver_parts.polling import Asked
from protocol_gateway.driver_parts.rest import Rest
from protocol_gateway.seam import (
    NOTHING,
    Activity,
    AlarmReceived,
    Carries,
    Channel,
    Close,
    ControllerCommand,
    ControllerEvent,
    Effect,
    Effects,
    FateUnknown,
    JointsReceived,
    MalformedReceived,
    Mode,
    MoveAbsolute,
    Open,
    Report,
    Reset,
    Send,
    SetTimer,
    Severity,
    Signal,
    SignalsReceived,
    Speed,
    StatusReceived,
    Stop,
    StopEnds,
)
from protocol_gateway.seam.errors import GatewaySettingsError, NotReadyError
from robomesh import reason_codes as codes
from robomesh.reasons import Reason
from robots.kinematics.joints import JointType

RMI = Channel(name="rmi", carries=NOTHING)
SESSION = Channel(name="rmi_session", carries=Carries.MOTION | Carries.STOP)

ANSWER_S = 5.0
"""Time for the answer to a command: FRC_Initialize creates a program, FRC_Abort waits for its end."""
SILENT_S = 5.0
"""A motion without an answer is given up after the arm has been still for this long."""
_STATE_VALID_S = 0.7
_BLIND_S = 1.2
_WATCH_S = 0.2
_LATE_S = 0.1
_RETRY_S = 2.0
_JOIN_S = 3.0
_LEAVE_S = 1.0
_REOPEN_S = 0.05
_AGAIN_S = 0.05
_ENDED_S = 0.3
# [rad] or [m]
_STILL = 1e-3
_RMI_SENDS_HZ = 20.0
_TOOL = Signal("tool.number")


class _Line(Enum):
    """State of the connections of RMI."""

    CLOSED = auto()
    CONNECTING = auto()
    JOINING = auto()
    OPEN = auto()
    LEAVING = auto()
    LOST = auto()


# Timers of a session.
_OF_SESSION = ("connect", "join", "leave", "initialize", "abort", "again", "watch")


@dataclass
class _Sent:
    """Data of a motion that was commanded.

    Attributes:
        instruction: Its message.
        start: Positions that it was checked from [rad] or [m].
        tool: Number of the active tool then.
        sent_s: Time of its message [s].
    """

    instruction: bytes
    start: tuple[float, ...]
    tool: object
    sent_s: float = float("-inf")


class FanucMotionDriver(SnpxDriver):
    """Driver of SNPX and RMI (`protocol_gateway.seam.FollowsControl`).

    Raises:
        GatewaySettingsError: As `SnpxDriver`, or if joints or their rate are not declared.
    """

    ports = frozenset({RMI.name, SESSION.name})

    def __init__(
        self,
        joint_types: Sequence[JointType],
        codes: Mapping[int, str],
        *,
        relay: Callable[[bytes, bool, Hashable], None] | None = None,
        options: object = None,
    ) -> None:
        super().__init__(joint_types, codes, relay=relay, options=options)
        if (problem := self._settings.motion_problem) is not None:
            raise GatewaySettingsError(f"fanuc {problem}")
        self.capabilities = replace(
            self.capabilities,
            commands=frozenset({MoveAbsolute, Speed, Stop, Reset}),
            stop_ends=StopEnds.OURS,
            first_speed_percent=FIRST_PERCENT,
            dies_with_link=False,
            experimental=True,
            stop_means="FRC_Abort of RMI",
        )
        self.requests_a_second += _RMI_SENDS_HZ
        self._controlled = False
        # A stop that could not be sent; it may be one from before the gateway's start.
        self._stop_owed = False
        self._running = False
        self._forget()

    def _forget(self) -> None:
        self._line = _Line.CLOSED
        self._lines = LineStream()
        # RMI is connected again later, after a refusal.
        self._retries_later = False
        self._motion: OneMotion[_Sent] = OneMotion()
        self._initialize_open = self._abort_open = False
        self._percent = FIRST_PERCENT
        self._rest = Rest([_STILL] * len(self._axes.used))
        self._forget_state()

    def _forget_state(self) -> None:
        self._rest.forget()
        self._status_s = self._asked_s = float("-inf")
        self._status: StatusReceived | None = None
        self._tool: object = None

    # -------------------------------------------------------------------------- seam

    def started(self, now_s: float) -> Effects:
        """Connect to SNPX, and to RMI if a stop is pending."""
        self._forget()
        self._running = True
        return (*super().started(now_s), *self._settle(now_s))

    def controlled(self, taken: bool, now_s: float) -> Effects:
        """Connect to RMI while the robot is controlled."""
        self._controlled, self._percent = taken, FIRST_PERCENT
        return self._settle(now_s)

    def opened(self, channel: Channel, now_s: float) -> Effects:
        """Greet."""
        if channel is SNPX:
            return super().opened(channel, now_s)
        self._lines = LineStream()
        if channel is RMI:
            return (SetTimer(now_s + ANSWER_S, "connect"), Send(RMI, rmi.connect()))
        if self._line is not _Line.JOINING:
            # The port of an earlier session, after this one was lost.
            return (Close(SESSION),)
        self._line = _Line.OPEN
        joined = SetTimer(None, "join")
        if self._stop_owed:
            self._motion.leave()
            return (joined, *self._abort(now_s))
        return (joined, *self._settle(now_s))

    def received(self, channel: Channel, data: bytes, now_s: float) -> Effects:
        """Take the next bytes."""
        if channel is SNPX:
            effects = [*super().received(channel, data, now_s)]
            return (*effects, *self._follow(now_s))
        effects = []
        for line in self._lines.receive(data):
            try:
                answer = rmi.read(line)
            except ValueError as error:
                effects.append(Report([MalformedReceived(0, hexadecimal(line), f"RMI: {error}")], 0))
            else:
                effects += self._on_connect(answer, now_s) if channel is RMI else self._on(answer, now_s)
        if self._lines.broken:
            effects += self._leave(channel, "its lines are too long", now_s)
        return (*effects, *self._settle(now_s))

    def skipped(self, channel: Channel, now_s: float) -> Effects:
        """Read SNPX on; connect RMI again, which cannot be read from its middle."""
        if channel is SNPX:
            return super().skipped(channel, now_s)
        return self._leave(channel, "it sent far too much", now_s)

    def closed(self, channel: Channel, now_s: float) -> Effects:
        """Handle a lost connection."""
        if channel is SNPX:
            self._forget_state()
            self._percent = FIRST_PERCENT
            effects = [*super().closed(channel, now_s)]
            if self._motion.sent:
                effects += self._give_up(fanuc_codes.STATE_OLD(), now_s)
            return effects
        if channel is RMI:
            return (SetTimer(None, "connect"),)
        if self._line in (_Line.OPEN, _Line.LEAVING):
            return self._lost(now_s)
        return ()

    def timer_ended(self, ended: Mapping[str, float], now_s: float) -> Effects:
        """Handle the timers that have expired."""
        effects: list[Effect] = []
        # A late gateway has unread messages.
        late = now_s - min(ended.values(), default=now_s) > _LATE_S
        self._retries_later = self._retries_later and "retry" not in ended
        if "" in ended:
            effects += super().timer_ended(ended, now_s)
        if "reopen" in ended and self._line is _Line.LOST:
            self._line = _Line.CLOSED
            effects += [Close(RMI), Close(SESSION)]
        if "connect" in ended:
            effects += self._leave(RMI, "it does not answer", now_s)
        if "join" in ended:
            effects += self._leave(SESSION, "its session cannot be joined", now_s)
        if "leave" in ended:
            self._line = _Line.CLOSED
            effects.append(Close(SESSION))
        if "initialize" in ended or "abort" in ended:
            effects += self._unanswered(now_s, late=late)
        if "again" in ended and self._line is _Line.OPEN and not self._abort_open:
            effects += self._abort(now_s)
        if "watch" in ended and self._motion.sent:
            effects += self._watch(now_s, late=late)
        return (*effects, *self._settle(now_s))

    # ------------------------------------------------------------------- connections

    def _settle(self, now_s: float) -> Effects:
        """Connect to RMI or disconnect."""
        if not self._running:
            return ()
        wanted = self._controlled or self._stop_owed or self._motion.phase is not Phase.NONE
        if wanted and self._line is _Line.CLOSED:
            if self._retries_later:
                return ()
            self._line = _Line.CONNECTING
            return (Open(RMI, rmi.PORT),)
        if wanted:
            return ()
        if self._line in (_Line.CONNECTING, _Line.JOINING):
            self._line = _Line.CLOSED
            return (SetTimer(None, "connect"), SetTimer(None, "join"), Close(RMI), Close(SESSION))
        if self._line is _Line.OPEN:
            self._line = _Line.LEAVING
            return (SetTimer(now_s + _LEAVE_S, "leave"), Send(SESSION, rmi.disconnect()))
        return ()

    def _leave(self, channel: Channel, why: str, now_s: float) -> Effects:
        """Close an unusable connection and schedule a retry."""
        self._line, self._retries_later = _Line.CLOSED, True
        timers = (SetTimer(None, "reopen"), SetTimer(now_s + _RETRY_S, "retry"))
        return (*timers, *self._given_up(), Close(channel, why))

    def _lost(self, now_s: float) -> Effects:
        """Handle a lost connection."""
        self._line = _Line.LOST
        # Before the channel connects to the old session's port again.
        return (SetTimer(now_s + _REOPEN_S, "reopen"), *self._given_up())

    def _given_up(self) -> Effects:
        """Forget what the session had open: RMI_MOVE may continue."""
        was_open = self._motion.sent is not None
        self._stop_owed |= self._motion.phase is not Phase.NONE
        effects: list[Effect] = [SetTimer(None, name) for name in _OF_SESSION]
        self._initialize_open = self._abort_open = False
        self._motion.end()
        if was_open:
            self._rest.prove_again()
            effects.append(FateUnknown(fanuc_codes.CONNECTION_LOST()))
        return effects

    def _on_connect(self, answer: Answer, now_s: float) -> Effects:
        if answer.name != rmi.CONNECT or self._line is not _Line.CONNECTING:
            return ()
        if answer.error:
            return self._leave(RMI, answer.problem, now_s)
        self._line = _Line.JOINING
        timers = (SetTimer(None, "connect"), SetTimer(now_s + _JOIN_S, "join"))
        return (*timers, Close(RMI), Open(SESSION, answer.port))

    # ------------------------------------------------------------------------ answers

    def _on(self, answer: Answer, now_s: float) -> Effects:
        """Handle a message of the session."""
        runs = self._motion.phase is Phase.RUNS
        match answer.name:
            case rmi.INITIALIZE if self._initialize_open:
                return (SetTimer(None, "initialize"), *self._on_initialized(answer, now_s))
            case rmi.JOINT_MOTION if runs and answer.sequence == rmi.FIRST_SEQUENCE:
                if answer.error:
                    return self._give_up(_refused(answer), now_s)
                self._motion.arrive()
                return self._abort(now_s)
            case rmi.ABORT if self._abort_open:
                return (SetTimer(None, "abort"), *self._on_aborted(answer, now_s))
            case rmi.SYSTEM_FAULT if self._motion.sent:
                return self._give_up(fanuc_codes.SYSTEM_FAULT(), now_s)
            case rmi.DISCONNECT if self._line is _Line.LEAVING:
                self._line = _Line.CLOSED
                return (SetTimer(None, "leave"), Close(SESSION))
        return ()

    def _on_initialized(self, answer: Answer, now_s: float) -> Effects:
        self._initialize_open = False
        if (motion := self._motion.sent) is None:
            # Stopped during the initialization: an earlier abort has not ended this program.
            return () if self._abort_open else self._abort(now_s)
        if answer.error:
            return self._give_up(_refused(answer), now_s)
        if (problem := self._problem(now_s, motion)) is not None:
            return self._give_up(problem, now_s)
        if now_s - min(self._rest.positions_s, self._status_s) > _BLIND_S:
            return self._give_up(fanuc_codes.STATE_OLD(), now_s)
        if not self._rest.near(motion.start):
            return self._give_up(fanuc_codes.MOVED_BEFORE(), now_s)
        if (extra := self._extra_axes()) is not None:
            return self._give_up(extra, now_s)
        self._motion.begin()
        motion.sent_s = now_s
        return (Send(SESSION, motion.instruction),)

    def _on_aborted(self, answer: Answer, now_s: float) -> Effects:
        self._abort_open = False
        if answer.error == rmi.WAIT_FOR_COMMAND:
            return (SetTimer(now_s + _AGAIN_S, "again"),)
        if answer.error and answer.error not in rmi.NOT_RUNNING:
            text = f"the controller has not ended RMI_MOVE: {answer.problem}"
            report = Report([AlarmReceived(Severity.ERROR, text)], 0)
            return (SetTimer(now_s + _LEAVE_S, "again"), report)
        if not self._initialize_open:
            self._motion.end()
            self._stop_owed = False
        return ()

    def _unanswered(self, now_s: float, *, late: bool) -> Effects:
        if late:
            return (SetTimer(now_s + _LATE_S, "initialize" if self._initialize_open else "abort"),)
        why = fanuc_codes.NO_ANSWER(name=rmi.INITIALIZE)
        fate = (FateUnknown(why),) if self._motion.sent else ()
        self._motion.leave()
        # A new session, in which the abort that is owed can be sent.
        return (*self._leave(SESSION, "it does not answer", now_s), *fate)

    # ------------------------------------------------------------------------- motion

    def _report(self, asked: Asked[Question], answer: Packet, packet: bytes, now_s: float) -> Report:
        """Store the state, and report an idle arm only after proof of rest."""
        report = super()._report(asked, answer, packet, now_s)
        return replace(report, events=[self._noted(each, asked.at_s, now_s) for each in report.events])

    def _noted(self, event: ControllerEvent, asked_s: float, now_s: float) -> ControllerEvent:
        match event:
            case JointsReceived(positions):
                self._rest.at(positions, now_s)
            case SignalsReceived(values):
                self._tool = next((value for signal, value in values if signal == _TOOL), self._tool)
            case StatusReceived():
                self._status, self._status_s, self._asked_s = event, now_s, asked_s
                runs = self._motion.phase not in (Phase.NONE, Phase.LEFT)
                return replace(event, activity=self._rest.reported(event.activity, now_s, runs=runs))
        return event

    def _follow(self, now_s: float) -> Effects:
        """Check the open motion against the newest state; abort it after an error."""
        if self._motion.sent is None:
            return ()
        problem = self._problem(now_s, self._motion.sent)
        return () if problem is None else self._give_up(problem, now_s)

    def _problem(self, now_s: float, motion: _Sent) -> Reason | None:
        """Return the reason to abort the open motion; None: there is no reason."""
        status = self._status
        if status is None:
            return fanuc_codes.STATE_OLD()
        if status.activity not in (Activity.IDLE, Activity.MOVING):
            return fanuc_codes.ARM_STOPPED(
                activity="unknown" if status.activity is None else status.activity.value
            )
        if status.mode is not Mode.REMOTE:
            return fanuc_codes.WENT_LOCAL()
        if self._tool != motion.tool:
            return fanuc_codes.TOOL_CHANGED()
        if self._motion.phase is Phase.RUNS:
            if status.activity is Activity.IDLE and self._asked_s > motion.sent_s + _ENDED_S:
                return fanuc_codes.LOST_PROGRAM()
            since_s = max(motion.sent_s, self._rest.since_s or motion.sent_s)
            if now_s - since_s > SILENT_S:
                return fanuc_codes.NO_ANSWER(name=rmi.JOINT_MOTION)
        return None

    def _watch(self, now_s: float, *, late: bool) -> Effects:
        if now_s - min(self._rest.positions_s, self._status_s) > _BLIND_S and not late:
            return self._give_up(fanuc_codes.STATE_OLD(), now_s)
        return (SetTimer(now_s + _WATCH_S, "watch"),)

    def _give_up(self, why: Reason, now_s: float) -> Effects:
        """End the motion, and have a stop latched."""
        return (*self._end(now_s), FateUnknown(why))

    def _end(self, now_s: float) -> Effects:
        """Abort the program of the gateway."""
        at_rest = self._status is not None and self._status.activity is Activity.IDLE
        if self._motion.phase is not Phase.NONE or not at_rest:
            self._rest.prove_again()
        watched = SetTimer(None, "watch")
        if self._line is not _Line.OPEN:
            return (watched,)
        self._motion.leave()
        return (watched,) if self._abort_open else (watched, *self._abort(now_s))

    def _abort(self, now_s: float) -> Effects:
        self._abort_open = True
        timers = (SetTimer(now_s + ANSWER_S, "abort"), SetTimer(None, "again"))
        return (*timers, Send(SESSION, rmi.abort()))

    # ----------------------------------------------------------------------- commands

    def prepare(self, *commands: ControllerCommand) -> tuple[ControllerCommand, ...]:
        """Return commands that can be sent; at most one motion, as the last one.

        Raises:
            CommandError: If they cannot be expressed.
        """
        return prepared(commands, len(self._axes.used))

    def command(self, prepared: Sequence[ControllerCommand], now_s: float) -> Effects:
        """Send what `prepare` returned.

        Raises:
            NotReadyError: If a motion cannot be sent now.
        """
        effects: list[Effect] = []
        percent, resets = self._percent, False
        for command in prepared:
            match command:
                case Stop():
                    effects += self._stop_arm(now_s)
                case Speed(new_percent):
                    percent = new_percent
                case MoveAbsolute(target):
                    effects += self._move(target, percent, now_s)
                case Reset():
                    resets = self._line is not _Line.OPEN
        self._percent = percent
        if resets:
            # It clears the gateway's latch only, and cancels a stop that was not delivered: after the motion
            # beside it, which may be refused.
            self._stop_owed = False
        return (*effects, *self._settle(now_s))

    def _stop_arm(self, now_s: float) -> Effects:
        """Abort the motion immediately."""
        sent = self._end(now_s)
        if self._line is _Line.OPEN:
            return sent
        self._stop_owed = True
        # It fails: the stop is sent again as soon as the session is connected.
        return (*self._settle(now_s), Send(SESSION, rmi.abort()))

    def _move(self, target: Sequence[float], percent: float, now_s: float) -> Effects:
        if (obstacle := self._obstacle(now_s)) is not None:
            raise NotReadyError(obstacle)
        assert self._rest.positions is not None
        speed = max(1, int(self._settings.speed_percent * percent / 100.0))
        axes = self._axes.values(np.array(target))
        instruction = rmi.joint_motion(rmi.FIRST_SEQUENCE, axes, percent=speed)
        self._motion.send(_Sent(instruction, self._rest.positions, self._tool))
        self._initialize_open = True
        timers = (SetTimer(now_s + ANSWER_S, "initialize"), SetTimer(now_s + _WATCH_S, "watch"))
        return (*timers, Send(SESSION, rmi.initialize(self._settings.group)))

    def _obstacle(self, now_s: float) -> Reason | None:
        """Return the reason to refuse a motion; None: it can be sent."""
        status = self._status
        if self._motion.phase is not Phase.NONE:
            return fanuc_codes.MOVES()
        if status is None or self._rest.positions is None:
            return fanuc_codes.STATE_OLD()
        if now_s - min(self._rest.positions_s, self._status_s) > _STATE_VALID_S:
            return fanuc_codes.STATE_OLD()
        match status.mode:
            case None:
                return codes.CONTROLLER_MODE_UNKNOWN()
            case Mode.LOCAL:
                return codes.CONTROLLER_LOCAL()
        if status.activity is Activity.MOVING:
            return fanuc_codes.OTHER_PROGRAM()
        if status.activity is not Activity.IDLE:
            return fanuc_codes.ARM_STOPPED(
                activity="unknown" if status.activity is None else status.activity.value
            )
        if (extra := self._extra_axes()) is not None:
            return extra
        return None if self._line is _Line.OPEN else fanuc_codes.NOT_CONNECTED()

    def _extra_axes(self) -> Reason | None:
        """Return the refusal of a motion that would move other axes too; None: there are none.

        The instruction has a value for each axis.
        """
        extra = ", ".join(map(str, self._other_than_joints(self._axes_read)))
        return fanuc_codes.EXTRA_AXES(axes=extra) if extra else None


def _refused(answer: Answer) -> Reason:
    return fanuc_codes.REFUSED(name=answer.name, problem=answer.problem)


def fanuc_driver(joint_types: Sequence[JointType], codes: Mapping[int, str], **given: Any) -> SnpxDriver:
    """Create the driver that only reads, unless the site file declares motion."""
    options = given["options"]
    moves = isinstance(options, FanucSettings) and options.motion
    return (FanucMotionDriver if moves else SnpxDriver)(joint_types, codes, **given)
