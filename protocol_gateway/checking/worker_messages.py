"""Messages between the gateway and its worker process."""

from dataclasses import dataclass
from typing import TypeAlias

from robomesh.reasons import Reason
from robots.descriptions.cells import CellDescription
from robots.programs.jog_steps import Jog
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
class ExtendJog:
    """Request to plan and check the next part of a jog; see `robots.checks.jog.next_part`.

    Attributes:
        origin, measured, last: Joint positions [rad] or [m].
        commanded: Distance of `last` from the origin [m] or [rad].
        others: As of CheckMotion.
        collisions: Collisions end the jog.
        more: Plan a part; otherwise answer only how far the arm is.
    """

    robot: str
    jog: Jog
    origin: Positions
    measured: Positions
    last: Positions
    commanded: float
    others: dict[str, tuple[Positions, ...]]
    collisions: bool
    more: bool = True


@dataclass(frozen=True, kw_only=True)
class Extended:
    """Next part of a jog.

    Attributes:
        target: End of the next motion [rad] or [m]; None: nothing is to be sent now.
        commanded, moved: Distance of the newest target, and of the arm, from the origin [m] or [rad].
        percent: Speed of the motion.
        end: Why the jog cannot go on beyond `commanded`; None: it can.
        uncovered, warnings: As of Checked.
    """

    target: Positions | None
    commanded: float
    moved: float
    percent: float
    end: Reason | None = None
    uncovered: tuple[Reason, ...] = ()
    warnings: tuple[Reason, ...] = ()


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
