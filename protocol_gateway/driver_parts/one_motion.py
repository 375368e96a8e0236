"""The state and the commands of drivers that send one motion at a time."""

import math
from collections.abc import Collection, Sequence
from enum import Enum, auto
from typing import Generic, TypeVar

from protocol_gateway.seam.commands import (
    ControllerCommand,
    MoveAbsolute,
    Recover,
    Recovery,
    Reset,
    Speed,
    Stop,
)
from protocol_gateway.seam.errors import CommandError
from robomesh import reason_codes as codes

FIRST_PERCENT = 25.0
"""Speed of motions until an operator sets another one; it is sent with each motion."""

SentT = TypeVar("SentT")


class Phase(Enum):
    """State of a driver's motion; `OneMotion` has the steps."""

    NONE = auto()
    SENT = auto()
    RUNS = auto()
    ENDING = auto()
    LEFT = auto()


class OneMotion(Generic[SentT]):
    """The one motion of a driver.

        phase    the motion                                       steps
        ------   ----------------------------------------------   -------------------------
        NONE     nothing of the gateway's is in the controller    send
        SENT     was sent, or is prepared, and has not begun      begin, end, leave
        RUNS     has begun                                        arrive, end, leave
        ENDING   has arrived; its program has not ended           end, leave
        LEFT     was stopped or given up, and may still go on     end; send, if a driver may

    Attributes:
        phase: Its phase.
        sent: What the driver must remember of an open motion, SENT or RUNS; None: no motion is open.
    """

    def __init__(self, phase: Phase = Phase.NONE) -> None:
        self.phase = phase
        self.sent: SentT | None = None

    def send(self, sent: SentT) -> None:
        """Open a motion."""
        self.phase, self.sent = Phase.SENT, sent

    def begin(self) -> None:
        """Note that the open motion runs."""
        self.phase = Phase.RUNS

    def arrive(self) -> None:
        """Note that the motion is done, and its program is not."""
        self.phase, self.sent = Phase.ENDING, None

    def end(self) -> None:
        """Note that nothing of the gateway's is in the controller any more."""
        self.phase, self.sent = Phase.NONE, None

    def leave(self) -> None:
        """Follow the motion no longer; it may still go on."""
        self.phase, self.sent = Phase.LEFT, None


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
