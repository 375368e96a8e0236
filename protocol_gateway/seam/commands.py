"""Commands to a controller, as typed values in SI."""

from dataclasses import dataclass
from enum import Enum
from typing import TypeAlias, get_args


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
