"""Messages between the gateway and its worker process."""

from dataclasses import dataclass
from typing import TypeAlias

from robomesh.reasons import Reason
from robots.cells import CellDescription
from robots.programs.steps import Step

Positions: TypeAlias = tuple[float, ...]


Cells: TypeAlias = dict[str, CellDescription]


@dataclass(frozen=True)
class ReplaceCells:
    """Request to answer from other cells from now on, by robot; the answer is None."""

    cells: Cells


@dataclass(frozen=True)
class Prepare:
    """Request to prepare a robot's cell, with the shapes of everything in it."""

    robot: str


@dataclass(frozen=True, kw_only=True)
class Prepared:
    """Answer to Prepare.

    Attributes:
        pending: Links of the cell are being processed: ask again.
        problem: Why the robot's motions cannot be checked; None: they can.
    """

    pending: bool = False
    problem: Reason | None = None


@dataclass(frozen=True, kw_only=True)
class CheckMotion:
    """Request to check a motion from `start` through `targets` [rad] or [m].

    Attributes:
        others: Actual positions and commanded path of each other robot of the cell.
    """

    robot: str
    start: Positions
    targets: tuple[Positions, ...]
    others: dict[str, tuple[Positions, ...]]


@dataclass(frozen=True, kw_only=True)
class CheckProgram:
    """Request to check a program that begins at `start`."""

    robot: str
    text: str
    start: Positions
    others: dict[str, tuple[Positions, ...]]


@dataclass(frozen=True, kw_only=True)
class Checked:
    """Result of a check.

    Attributes:
        refusals: Reasons to refuse the motion.
        uncovered: Moving parts of the cell that cannot be checked; also refused if checks are required.
        warnings: Allowed, but close.
        readable: The program could be parsed and planned.
        steps: Steps of a program.
        durations_s: Duration of each step of a program.
    """

    refusals: tuple[Reason, ...] = ()
    uncovered: tuple[Reason, ...] = ()
    warnings: tuple[Reason, ...] = ()
    readable: bool = True
    steps: tuple[Step, ...] = ()
    durations_s: tuple[float, ...] = ()
