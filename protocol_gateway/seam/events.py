"""Events that a controller reports. Everything is SI; only the driver knows the controller's own units."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import TypeAlias

from protocol_gateway.seam.commands import Recovery
from robomesh.reasons import Reason


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
                f"signal {self.name!r}: must be lower-case words with dots between them, "
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
