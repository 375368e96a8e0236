"""Common part of drivers that send one motion at a time: the check of their commands, and their timers."""

import math
from collections.abc import Collection, Sequence

from protocol_gateway.errors import CommandError
from protocol_gateway.seam.commands import (
    ControllerCommand,
    MoveAbsolute,
    Recover,
    Recovery,
    Reset,
    Speed,
    Stop,
)
from protocol_gateway.seam.effects import Effects, SetTimer
from robomesh import reason_codes as codes

FIRST_PERCENT = 25.0
"""Speed of motions until an operator sets another one; it is sent with each motion."""


def prepared(
    commands: Sequence[ControllerCommand], joints: int, recoveries: Collection[Recovery] = ()
) -> tuple[ControllerCommand, ...]:
    """Return commands that can be sent: at most one motion, as the last one; a stop or a recovery alone.

    Args:
        joints: Number of the robot's joints.
        recoveries: Those that the driver has.

    Raises:
        CommandError: If they cannot be expressed.
    """
    for place, command in enumerate(commands):
        match command:
            case Stop() | Recover() if len(commands) > 1:
                # What follows may be refused, and nothing would be sent.
                raise CommandError(f"{type(command).__name__} is sent alone, without other commands")
            case MoveAbsolute(positions):
                if len(positions) != joints:
                    raise CommandError(codes.COMMAND_VALUES(count=len(positions), joints=joints))
                if place != len(commands) - 1:
                    raise CommandError("a motion must be the last command: the controller queues none")
                _check_finite(*positions)
            case Speed(percent):
                _check_finite(percent)
            case Stop() | Reset():
                pass
            case Recover(recovery) if recovery in recoveries:
                pass
            case _:
                raise CommandError(f"this controller has no {type(command).__name__}")
    return tuple(commands)


def _check_finite(*numbers: float) -> None:
    if not all(map(math.isfinite, numbers)):
        raise CommandError("numbers must be finite")


class Timers(dict[str, float]):
    """Times at which something is due [s], by name, as the single timer of a driver.

    Args:
        base: Name of the timer that the reading driver below sets.
    """

    def __init__(self, base: str) -> None:
        self._base = base
        self._set_s: float | None = None

    def ended(self, now_s: float) -> dict[str, float]:
        """Remove and return the times that have come; the driver's timer has ended."""
        self._set_s = None
        return {name: self.pop(name) for name, at_s in [*self.items()] if at_s <= now_s}

    def with_timer(self, effects: Effects) -> Effects:
        """Return effects with one timer for all that is due, if its time has changed.

        It is the first effect, because a stop that follows from the others may set another timer.
        """
        for effect in effects:
            if isinstance(effect, SetTimer):
                self.pop(self._base, None)
                if effect.at_s is not None:
                    self[self._base] = effect.at_s
        others = tuple(effect for effect in effects if not isinstance(effect, SetTimer))
        at_s = min(self.values(), default=None)
        if at_s == self._set_s:
            return others
        self._set_s = at_s
        return (SetTimer(at_s), *others)
