"""Common part of drivers that send one motion at a time: the words of their commands, and their timers."""

import json
from collections.abc import Collection, Sequence
from typing import Any

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


def encode_words(
    commands: Sequence[ControllerCommand], joints: int, recoveries: Collection[Recovery] = ()
) -> bytes:
    """Encode commands for `words_of`; at most one motion, as the last one; a stop or a recovery alone.

    Args:
        joints: Number of the robot's joints.
        recoveries: Those that the driver has.

    Raises:
        CommandError: If they cannot be expressed.
    """
    words: list[tuple[str, object]] = []
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
                words.append(("move", positions))
            case Speed(percent):
                words.append(("speed", percent))
            case Stop():
                words.append(("stop", None))
            case Reset():
                words.append(("reset", None))
            case Recover(recovery) if recovery in recoveries:
                words.append(("recover", recovery.value))
            case _:
                raise CommandError(f"this controller has no {type(command).__name__}")
    try:
        return json.dumps(words, allow_nan=False).encode()
    except ValueError:
        raise CommandError("numbers must be finite") from None


def words_of(encoded: bytes) -> list[tuple[str, Any]]:
    """Return the words "move", "speed", "stop", "reset", "recover" of encoded commands, with their values."""
    return [(word, value) for word, value in json.loads(encoded)]


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
