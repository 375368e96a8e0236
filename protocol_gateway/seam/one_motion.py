"""Check of the commands of drivers that send one motion at a time."""

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
