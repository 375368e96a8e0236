"""The seam between a controller's own protocol and the rest: another kind of controller is one more file.

A driver does no I/O. It turns bytes into events and commands into bytes, and it is the only place
that knows degrees, millimetres, words and codes: above it everything is SI.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Protocol, TypeAlias

# ---------------------------------------------------------------- what a controller tells


class Activity(Enum):
    """What a controller says that it is doing."""

    IDLE = "idle"
    MOVING = "moving"
    HOMING = "homing"
    HOLDING = "holding"
    STOPPED = "stopped"
    FAULT = "fault"


class Mode(Enum):
    """Who may move the arm: the network (remote) or the people at the controller (local)."""

    REMOTE = "remote"
    LOCAL = "local"


@dataclass(frozen=True, slots=True)
class JointsReceived:
    """Where the joints are.

    Attributes:
        positions: One a joint [rad] or [m].
        velocities: One a joint [rad/s] or [m/s]; None: the controller does not tell.
        controller_time_s: Seconds on the controller's own clock; None: it does not tell.
    """

    positions: tuple[float, ...]
    velocities: tuple[float, ...] | None = None
    controller_time_s: float | None = None


@dataclass(frozen=True, slots=True)
class StatusReceived:
    """What the controller says about itself; None: it does not tell (unknown is shown, not invented)."""

    activity: Activity | None = None
    mode: Mode | None = None
    homed: bool | None = None
    trace: bool | None = None
    controller_time_s: float | None = None


@dataclass(frozen=True, slots=True)
class Refused:
    """The controller refused a unit of ours (or the connection, number 1)."""

    number: int
    text: str


@dataclass(frozen=True, slots=True)
class MalformedReceived:
    """Bytes that are no unit; nothing in them was taken.

    Attributes:
        offset: Of their first byte in the connection's stream.
        text: The bytes as printable text, cut when long.
        reason: What is wrong with them.
        joint_count: They are a unit, but of a robot with other joints: all that such a controller sends
            is of no use.
    """

    offset: int
    text: str
    reason: str
    joint_count: bool = False


@dataclass(frozen=True, slots=True)
class UnknownReceived:
    """A record that the driver has no meaning for: to be published raw, never acted on.

    Attributes:
        raw: The bytes of the whole unit that it stood in.
        controller_time_s: Seconds on the controller's own clock; None: it does not tell.
    """

    type: str
    items: tuple[str, ...]
    raw: bytes
    controller_time_s: float | None = None


ControllerEvent: TypeAlias = JointsReceived | StatusReceived | Refused | MalformedReceived | UnknownReceived

# ---------------------------------------------------------------- what a controller is told


@dataclass(frozen=True, slots=True)
class Home:
    """Perform the homing motion."""


@dataclass(frozen=True, slots=True)
class Hold:
    """Come to rest, keep the motion for `Resume`."""


@dataclass(frozen=True, slots=True)
class Resume:
    """Go on with what was held."""


@dataclass(frozen=True, slots=True)
class Reset:
    """Clear a stop."""


@dataclass(frozen=True, slots=True)
class Stop:
    """Stop request: come to rest, forget every motion, refuse more until `Reset`."""


@dataclass(frozen=True, slots=True)
class Trace:
    """Turn capture on or off."""

    on: bool


@dataclass(frozen=True, slots=True)
class Speed:
    """Speed of the motions, 1 to 100 percent."""

    percent: float


@dataclass(frozen=True, slots=True)
class MoveAbsolute:
    """Move to joint positions, one a joint [rad] or [m]."""

    positions: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class MoveRelative:
    """Move by joint offsets, one a joint [rad] or [m], from where the arm is."""

    offsets: tuple[float, ...]


ControllerCommand: TypeAlias = (
    Home | Hold | Resume | Reset | Stop | Trace | Speed | MoveAbsolute | MoveRelative
)


class Driver(Protocol):
    """A controller's protocol, without I/O. One driver serves one connection after another."""

    @property
    def units_received(self) -> int:
        """Whole, well-formed units since the driver was made; one unit may give several events, or none."""
        ...

    @property
    def refusals_received(self) -> int:
        """Of these, the units that hold refusals alone: an answer is no sign that the arm's state comes."""
        ...

    @property
    def can_stop(self) -> bool:
        """Whether there is a stop unit for the controller. Whether it is heeded is proven at the site."""
        ...

    def connected(self) -> None:
        """A new connection begins, or bytes were thrown away: forget the unfinished unit before."""
        ...

    def receive(self, data: bytes) -> Sequence[ControllerEvent]:
        """Events of the next bytes, cut anywhere; bad bytes are a MalformedReceived, never an exception."""
        ...

    def encode(self, *commands: ControllerCommand) -> bytes:
        """The bytes that tell the controller commands, to be done in order, all of them or none.

        Raises:
            CommandError: If the protocol cannot say it (wrong joint count, a number that is not finite).
        """
        ...
