"""Interface between a controller's own protocol and the gateway. A driver for each protocol implements it.

A driver does no I/O and reads no clock. It is told what happens on its channels, and returns effects, which
the link performs in order:

    told                                     effects
    ---------------------------------------  ------------------------------------------------------
    started, opened, received, skipped,      Open, Close: keep a channel connected, or end it
      closed, timer_ended, command,          Send: write whole bytes to a channel now
      controlled (`FollowsControl`)
                                             SetTimer: tell the driver when a time has come
                                             Report: what the controller reported
                                             FateUnknown: latch a stop

Only the driver knows degrees, millimetres, words and codes: above it everything is SI. Times are seconds on
the gateway's monotonic clock, unless named as the controller's.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum, Flag, auto
from typing import Protocol, TypeAlias, get_args, runtime_checkable

from robomesh.reasons import Reason

# ------------------------------------------------------------ events from a controller


class Activity(Enum):
    """Activity that a controller reports."""

    IDLE = "idle"
    MOVING = "moving"
    HOMING = "homing"
    HOLDING = "holding"
    STOPPED = "stopped"
    FAULT = "fault"


class Mode(Enum):
    """Source that may move the arm: the network (remote) or the operator at the controller (local)."""

    REMOTE = "remote"
    LOCAL = "local"


@dataclass(frozen=True, slots=True)
class JointsReceived:
    """Joint positions from the controller.

    Attributes:
        positions: One a joint [rad] or [m].
        velocities: One a joint [rad/s] or [m/s]; None: not reported.
        controller_time_s: Seconds on the controller's own clock; None: not reported.
    """

    positions: tuple[float, ...]
    velocities: tuple[float, ...] | None = None
    controller_time_s: float | None = None


@dataclass(frozen=True, slots=True)
class StatusReceived:
    """Status that the controller reports; None: not reported, and shown as unknown."""

    activity: Activity | None = None
    mode: Mode | None = None
    homed: bool | None = None
    trace: bool | None = None
    controller_time_s: float | None = None

    @property
    def values(self) -> tuple[Activity | Mode | bool | None, ...]:
        """All values without the time."""
        return self.activity, self.mode, self.homed, self.trace


def homed_by_nature(activity: Activity | None) -> bool | None:
    """Return whether an arm with absolute encoders is homed; None: unknown.

    A controller that has lost the position, or its mastering, reports a fault.
    """
    return None if activity is Activity.FAULT else True


@dataclass(frozen=True, slots=True)
class Refused:
    """Refusal by the controller of the gateway's unit (or of the connection: number 1)."""

    number: int
    text: str


@dataclass(frozen=True, slots=True)
class MalformedReceived:
    """Bytes that are not a valid unit; nothing in them was used.

    Attributes:
        offset: Position of their first byte in the connection's stream.
        text: The bytes as printable text, shortened.
        reason: Description of the error.
        joint_count: Both numbers of joints, if the unit has another number than the robot, so the
            controller's data are unusable.
    """

    offset: int
    text: str
    reason: str
    joint_count: Reason | None = None


@dataclass(frozen=True, slots=True)
class UnknownReceived:
    """Record that the driver does not know: published raw, without any effect.

    Attributes:
        raw: The bytes of the whole unit that contains it.
        controller_time_s: Seconds on the controller's own clock; None: not reported.
    """

    type: str
    items: tuple[str, ...]
    raw: bytes
    controller_time_s: float | None = None


class Severity(Enum):
    """Severity of a controller's alarm or message."""

    INFO = "info"
    WARNING = "warning"
    ERROR = "error"


@dataclass(frozen=True, slots=True)
class AlarmReceived:
    """Alarm or message of the controller.

    Attributes:
        text: On one line, as the controller words it.
        number: The controller's own number or code of it; empty: it has none.
    """

    severity: Severity
    text: str
    number: str = ""


_SIGNAL_NAME = re.compile(r"[a-z][a-z0-9_]*(\.[a-z0-9_]+)*")
_LONGEST_NAME = 64
SignalValue: TypeAlias = float | bool | str


@dataclass(frozen=True, slots=True)
class Signal:
    """Name and unit of a signal: a value other than joints that a controller reports.

    Drivers make one for each value once, not for each report.

    Attributes:
        name: Lower-case words with dots between them, from the list in docs/signals.md where it has one:
            "io.digital_in.3", "payload.mass".
        unit: SI unit as it is shown ("A", "°C", "N·m"); empty: none.
        joint: Number of its joint from 0: the joint's name follows the first word, so "joint.current"
            becomes "joint.waist.current". None: of no joint.

    Raises:
        ValueError: If the name is invalid.
    """

    name: str
    unit: str = ""
    joint: int | None = None

    def __post_init__(self) -> None:
        if len(self.name) > _LONGEST_NAME or not _SIGNAL_NAME.fullmatch(self.name):
            raise ValueError(
                f"signal {self.name!r}: lower-case words with dots between them are right, "
                f"at most {_LONGEST_NAME} characters"
            )

    def __hash__(self) -> int:
        # A string keeps its hash; the generated method would compute three for each look-up.
        return hash(self.name)


@dataclass(frozen=True, slots=True)
class SignalsReceived:
    """Values of signals: all or a part of them; the others keep their values.

    The gateway publishes at most 10 messages a second, and changes of texts and booleans sooner. A driver of
    a controller that sends faster reports no more often, except for such changes.

    Attributes:
        values: Numbers in the signal's unit, booleans, texts. None, or a number that is not finite: not
            reported any longer.
        controller_time_s: Seconds on the controller's own clock; None: not reported.
        valid_for_s: Time after which a value that was not reported again is unknown [s].
    """

    values: Sequence[tuple[Signal, SignalValue | None]]
    controller_time_s: float | None = None
    valid_for_s: float = 3.0


class Recovery(Enum):
    """Action that brings a controller back after its own stop or fault. It resumes no motion."""

    UNLOCK_PROTECTIVE_STOP = "unlock_protective_stop"
    CLOSE_SAFETY_POPUP = "close_safety_popup"
    RESTART_SAFETY = "restart_safety"
    POWER_ON = "power_on"
    BRAKE_RELEASE = "brake_release"
    SERVO_ON = "servo_on"
    RESET_ALARM = "reset_alarm"


@dataclass(frozen=True, slots=True)
class RecoverAnswered:
    """Answer of the controller to `Recover`, or the lack of one. Only the state shows the effect.

    Attributes:
        accepted: The controller has taken it; None: unknown.
        answer: The controller's words, or the reason for the missing answer.
    """

    recovery: Recovery
    accepted: bool | None
    answer: str


@dataclass(frozen=True, slots=True)
class SoftwareReceived:
    """Version of the controller's software, in its own words: what was proven on another one is unproven."""

    version: str


@dataclass(frozen=True, slots=True)
class AxesUndeclared:
    """The controller has axes that the site file does not know, which may move the arm or carry it.

    Meanwhile the robot is read-only, and its joints are unproven.

    Attributes:
        why: Their names, and what to do; None: there are none.
    """

    why: Reason | None


@dataclass(frozen=True, slots=True)
class MotionImpossible:
    """The driver cannot move the arm with this controller, for example because of its software's version.

    Meanwhile the robot is read-only.

    Attributes:
        why: The reason; None: it can.
    """

    why: Reason | None


ControllerEvent: TypeAlias = (
    JointsReceived
    | StatusReceived
    | Refused
    | MalformedReceived
    | UnknownReceived
    | AlarmReceived
    | SignalsReceived
    | SoftwareReceived
    | AxesUndeclared
    | MotionImpossible
    | RecoverAnswered
)

# -------------------------------------------------------------- commands to a controller


@dataclass(frozen=True, slots=True)
class Home:
    """Command to perform the homing motion."""


@dataclass(frozen=True, slots=True)
class Hold:
    """Command to come to rest and keep the motion for `Resume`."""


@dataclass(frozen=True, slots=True)
class Resume:
    """Command to continue the held motion."""


@dataclass(frozen=True, slots=True)
class Reset:
    """Command to clear a stop."""


@dataclass(frozen=True, slots=True)
class Stop:
    """Command to come to rest, discard every motion, and refuse motion until `Reset`."""


@dataclass(frozen=True, slots=True)
class Trace:
    """Command to turn capture on or off."""

    on: bool


@dataclass(frozen=True, slots=True)
class Speed:
    """Command to set the speed of motions, 1 to 100 percent."""

    percent: float


@dataclass(frozen=True, slots=True)
class MoveAbsolute:
    """Command to move to joint positions, one a joint [rad] or [m]."""

    positions: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class MoveRelative:
    """Command to move by joint offsets, one a joint [rad] or [m], from the actual positions.

    For a driver without it, the gateway computes the target and sends `MoveAbsolute`.
    """

    offsets: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Recover:
    """Command to bring the controller back after its own stop or fault, sent for an operator's request only.

    The gateway has verified that the site file allows it, that the arm rests and nothing is on hold. The
    driver sends it once, never repeats it, and reports `RecoverAnswered`.
    """

    recovery: Recovery


ControllerCommand: TypeAlias = (
    Home | Hold | Resume | Reset | Stop | Trace | Speed | MoveAbsolute | MoveRelative | Recover
)

COMMANDS: frozenset[type[ControllerCommand]] = frozenset(get_args(ControllerCommand)) - {Recover}
"""All that a driver declares in `commands`; `Recover` has `recoveries`."""


class StopEnds(Enum):
    """Motion that a driver's `Stop` ends."""

    OURS = "ours"
    ANY = "any"


@dataclass(frozen=True, slots=True, kw_only=True)
class Capabilities:
    """Capabilities of a driver with its controller. Other commands are refused with a code, and not offered.

    Attributes:
        commands: Commands that `encode` takes; empty: the driver only reads.
        stop_ends: Whose motion `Stop` ends, unless `StopDepends` says it; a test at the site proves that it
            works.
        jogs: `Reset` gives a held motion up without a latch, and a new target replaces a running motion: the
            arm goes on smoothly from where it is, without a stop between the targets.
        absolute: The arm has absolute encoders: it is homed by nature.
        first_speed_percent: Speed of motions when an operator takes control, because it is sent with each
            motion (`FollowsControl`); None: the controller keeps its speed.
        dies_with_link: Whether the controller itself ends a motion when the gateway or its link is gone;
            None: unknown.
        no_joints: Reason for missing joint positions; None: the driver reports them.
        reports_pose: It reports the tool's pose that the controller computes (signals "tool.pose.*"), so that
            the joints of a real arm are unproven until `robomesh robot verify` has compared them.
        joint_mapping: The site file's declarations by which it converts joints, in any form: with others,
            the joints are unproven again.
        can_be_moved: Another key of the site file would let the driver move the arm.
        experimental: Its commands were never tried on a real controller.
        stop_means: How its `Stop` is sent, which a proof of the stop names; empty: in one way only.
        recoveries: Actions of `Recover`. Each is off unless the site file allows it.
        slow_hz: Positions a second, if they are too few to follow the arm: the robot is marked as slow. None:
            they are not.
    """

    commands: frozenset[type[ControllerCommand]]
    stop_ends: StopEnds = StopEnds.ANY
    jogs: bool = False
    absolute: bool = False
    first_speed_percent: float | None = None
    dies_with_link: bool | None = None
    no_joints: Reason | None = None
    reports_pose: bool = False
    joint_mapping: str = ""
    can_be_moved: bool = False
    experimental: bool = False
    stop_means: str = ""
    recoveries: frozenset[Recovery] = frozenset()
    slow_hz: float | None = None


# ------------------------------------------------------------------------ effects


class Carries(Flag):
    """Functions that depend on a channel."""

    READING = auto()
    MOTION = auto()
    STOP = auto()


ALL = Carries.READING | Carries.MOTION | Carries.STOP
"""All of it: a protocol with a single channel."""
NOTHING = Carries(0)
"""An addition to another channel."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Channel:
    """One of a driver's connections to the controller.

    Attributes:
        name: Its name in the site file's `ports`, and in events.
        carries: What needs it. The robot is shown as disconnected while no channel that carries READING is
            open, so an addition to another channel carries nothing.
        datagrams: UDP instead of TCP; `received` gets each datagram by itself.
        program: Module that reads the controller in a process of its own, because a library owns its sockets;
            empty: there is none. `received` gets what it prints. It has no input, so `Send` fails.
        brief: The driver opens it again and again, each time for one file: its connections are not counted,
            and their ends not reported.
    """

    name: str
    carries: Carries
    datagrams: bool = False
    program: str = ""
    brief: bool = False


@dataclass(frozen=True, slots=True)
class Open:
    """Connect a channel, and connect it again after it was lost, with growing pauses, until `Close`.

    Attributes:
        port: Port of the controller's host, unless the site file's `ports` has another one; None: that of
            the site file's `controller`.
        settings: What a channel's program is started with, besides host and port.
    """

    channel: Channel
    port: int | None = None
    settings: str = ""


@dataclass(frozen=True, slots=True)
class Close:
    """End a channel, and do not connect it again.

    Attributes:
        why: Description of the error in the controller's bytes, shown as the reason; empty: no error.
    """

    channel: Channel
    why: str = ""


@dataclass(frozen=True, slots=True)
class Send:
    """Write whole bytes to a channel now. Nothing waits in the gateway, so nothing precedes a stop.

    Attributes:
        alternative: Another `Send` of the same command has the same purpose, as a second way to stop: the
            command fails only if all of them fail. Otherwise the first failure ends the command.
    """

    channel: Channel
    data: bytes
    alternative: bool = False


@dataclass(frozen=True, slots=True)
class SetTimer:
    """Call `timer_ended` at a time [s]; it replaces the timer before. None: clear the timer."""

    at_s: float | None


@dataclass(frozen=True, slots=True)
class Report:
    """Report of a controller, from the bytes of one read.

    Attributes:
        units: Number of well-formed units; one may give several events, or none.
        refusals: Number of these units that hold only refusals, so do not show that the arm's state is
            received.
        asked_s: Time of the question that they answer, on the gateway's clock. The values are of some moment
            since then, so they are stamped with the middle; None: they were not asked for.
        lost: Number of questions that were not answered in time.
    """

    events: Sequence[ControllerEvent]
    units: int
    refusals: int = 0
    asked_s: float | None = None
    lost: int = 0


@dataclass(frozen=True, slots=True)
class FateUnknown:
    """Latch a stop in the gateway: the outcome of a motion, or the present motion of the arm, is unknown.

    The driver has already done what it can by itself, and never sends the motion again.
    """

    why: Reason


Effect: TypeAlias = Open | Close | Send | SetTimer | Report | FateUnknown
Effects: TypeAlias = Sequence[Effect]


@runtime_checkable
class FollowsControl(Protocol):
    """Addition to `Driver` that receives the state of control."""

    def controlled(self, taken: bool, now_s: float) -> Effects:
        """Handle the begin of control by an operator, also after another one, or its end.

        The stop of a lost lease precedes it.
        """
        ...


@runtime_checkable
class StopDepends(Protocol):
    """Addition to `Driver` whose stop depends on the state of the controller, such as its mode."""

    def stop_ends_now(self, now_s: float) -> StopEnds | None:
        """Return whose motion `Stop` ends now; None: the controller refuses it, or that is not known.

        It is asked only while a channel that carries STOP is connected.
        """
        ...


class Driver(Protocol):
    """Driver of a controller's protocol, without I/O.

    `FollowsControl` and `StopDepends` add methods that it may have.
    """

    @property
    def ports(self) -> frozenset[str]:
        """Names of the channels with a port of their own, which the site file's `ports` may replace."""
        ...

    @property
    def requests_a_second(self) -> float:
        """Most `Send` effects a second that are not the answer to `command`: greetings and questions.

        The link sends no more: 0 means that nothing is ever sent unasked. Those beside `FateUnknown` do not
        count.
        """
        ...

    @property
    def capabilities(self) -> Capabilities:
        """Capabilities of the driver, which never change."""
        ...

    def started(self, now_s: float) -> Effects:
        """Begin, usually with `Open`; called again after a failure of the gateway for this robot."""
        ...

    def opened(self, channel: Channel, now_s: float) -> Effects:
        """Begin a new connection: discard unfinished units and open questions, and greet."""
        ...

    def received(self, channel: Channel, data: bytes, now_s: float) -> Effects:
        """Read the next bytes, split anywhere, or a datagram; invalid ones give a MalformedReceived."""
        ...

    def skipped(self, channel: Channel, now_s: float) -> Effects:
        """Go on after bytes were discarded, because the controller sent far too much."""
        ...

    def closed(self, channel: Channel, now_s: float) -> Effects:
        """Note that a connection has ended, or that an attempt to connect failed."""
        ...

    def timer_ended(self, now_s: float) -> Effects:
        """Do what the timer was set for."""
        ...

    def encode(self, *commands: ControllerCommand) -> bytes:
        """Encode commands that the controller executes in order, all or none.

        Raises:
            CommandError: If the protocol cannot express them (wrong joint count, number not finite).
        """
        ...

    def command(self, encoded: bytes, now_s: float) -> Effects:
        """Send what `encode` returned.

        Raises:
            NotReadyError: If the driver sends nothing now; never for `Stop`.
        """
        ...
