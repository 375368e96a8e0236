"""Interface between a controller's own protocol and the gateway: another kind of controller is one more file.

A driver does no I/O. It turns bytes into events and commands into bytes. Only the driver knows degrees,
millimetres, words and codes: above it everything is SI.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Protocol, TypeAlias

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


ControllerEvent: TypeAlias = JointsReceived | StatusReceived | Refused | MalformedReceived | UnknownReceived

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
    """Command to move by joint offsets, one a joint [rad] or [m], from the actual positions."""

    offsets: tuple[float, ...]


ControllerCommand: TypeAlias = (
    Home | Hold | Resume | Reset | Stop | Trace | Speed | MoveAbsolute | MoveRelative
)


class Driver(Protocol):
    """Driver of a controller's protocol, without I/O. One driver serves consecutive connections."""

    @property
    def units_received(self) -> int:
        """Number of well-formed units so far; one unit may give several events, or none."""
        ...

    @property
    def refusals_received(self) -> int:
        """Number of these units that hold only refusals, so do not show that the arm's state is received."""
        ...

    @property
    def can_stop(self) -> bool:
        """True if the driver has a stop unit for the controller; a test at the site proves that it works."""
        ...

    @property
    def can_jog(self) -> bool:
        """True if `Reset` gives a held motion up without a latch, and a new target replaces a running motion.

        The arm must go on smoothly from where it is, without a stop between the targets.
        """
        ...

    def connected(self) -> None:
        """Discard the unfinished unit, because a new connection begins or bytes were discarded."""
        ...

    def receive(self, data: bytes) -> Sequence[ControllerEvent]:
        """Return the events of the next bytes, split anywhere; invalid bytes give a MalformedReceived."""
        ...

    def encode(self, *commands: ControllerCommand) -> bytes:
        """Encode commands that the controller executes in order, all or none.

        Raises:
            CommandError: If the protocol cannot express them (wrong joint count, number not finite).
        """
        ...
