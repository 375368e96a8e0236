"""What the gateway asks its worker process, and what that answers."""

from dataclasses import dataclass
from typing import TypeAlias

from robomesh.reasons import Reason
from robots.cells import CellDescription
from robots.programs.steps import Step

Positions: TypeAlias = tuple[float, ...]


# The answer to Prepare while links of the cell are being studied: ask again.
PENDING = "pending"


@dataclass(frozen=True)
class Prepare:
    """Prepare a robot's cell: the shapes of everything in it.

    The answer is why its motions cannot be checked, empty if they can, or PENDING.
    """

    robot: str


@dataclass(frozen=True, kw_only=True)
class CheckMotion:
    """May a robot go from where it stands through these joint positions [rad] or [m]?

    Attributes:
        others: For each other robot of the cell where it is and where it has been told to go.
    """

    robot: str
    start: Positions
    targets: tuple[Positions, ...]
    others: dict[str, tuple[Positions, ...]]


@dataclass(frozen=True, kw_only=True)
class CheckProgram:
    """May a robot run this program from where it stands?"""

    robot: str
    text: str
    start: Positions
    others: dict[str, tuple[Positions, ...]]


@dataclass(frozen=True, kw_only=True)
class Checked:
    """What a check found.

    Attributes:
        refusals: Why the motion must not be made.
        uncovered: What moves in the cell and cannot be checked: where checks are required, that refuses too.
        warnings: What is close, but allowed.
        readable: The program could be read and planned: it has steps.
        steps: Of a program.
        duration_s: Of a program.
    """

    refusals: tuple[Reason, ...] = ()
    uncovered: tuple[Reason, ...] = ()
    warnings: tuple[Reason, ...] = ()
    readable: bool = True
    steps: tuple[Step, ...] = ()
    duration_s: float = 0.0


Cells: TypeAlias = dict[str, CellDescription]
