"""Steps of a planned program, and results of its check."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from robomesh import reason_codes as codes
from robomesh.reasons import Reason
from robots.kinematics.joints import FloatArray

# Largest deviation of the tool from a line that is approximated by joint moves.
LINE_M = 0.001
LINE_DEG = 0.5

INTERPOLATION = codes.CHECK_INTERPOLATION(line_mm=LINE_M * 1000, line_deg=LINE_DEG)


class StepKind(StrEnum):
    """The command of a step."""

    HOME = "home"
    MOVE = "move"
    SPEED = "speed"
    WAIT = "wait"
    TRACE = "trace"


@dataclass(frozen=True, eq=False, kw_only=True)
class Step:
    """One command, or a wait.

    Attributes:
        line: The program's line, from 1.
        target: HOME and MOVE: (n,) end of the motion [rad] or [m].
        percent: SPEED: percentage of the joints' maximum speeds, 1 to 100.
        seconds: WAIT: duration.
        on: TRACE: on or off.
        along_line: MOVE: part of a straight line of the tool.
        tool_speed: HOME and MOVE: the program's limit of the tool's speed [m/s].
    """

    line: int
    kind: StepKind
    target: FloatArray | None = None
    percent: float | None = None
    seconds: float | None = None
    on: bool | None = None
    along_line: bool = False
    tool_speed: float | None = None


class ViolationKind(StrEnum):
    """The kind of a violation."""

    PROGRAM = "program"
    LIMIT = "limit"
    SPEED = "speed"
    SINGULARITY = "singularity"
    COLLISION = "collision"
    CLEARANCE = "clearance"
    UNREACHABLE = "unreachable"


@dataclass(frozen=True, eq=False, kw_only=True)
class Violation:
    """A violation in a program, with its duration.

    Attributes:
        line: The program's line, from 1; 0 for the start position.
        time_s, until_s: Since the program's start.
        pair: Two names "<robot>/<link>" or "<fixture>"; empty for other kinds.
        points: (k, 3) in the site's frame [m]: nearest points of the pair, or the unreachable position.
        distance_m: The smallest distance; 0 if the pair touches; None for other kinds.
        reason: Code and parameters, in degrees and millimetres.
        refuses: Whether a gateway that requires checks refuses the motion; otherwise this is a warning.
    """

    line: int
    time_s: float = 0.0
    until_s: float = 0.0
    kind: ViolationKind
    pair: tuple[str, ...] = ()
    points: FloatArray
    distance_m: float | None = None
    reason: Reason
    refuses: bool = True

    @property
    def text(self) -> str:
        """The reason's sentence."""
        return self.reason.text


@dataclass(frozen=True, eq=False)
class Plan:
    """The steps of a program, with repeats unrolled and lines cut.

    Attributes:
        violations: Why the plan ends before the program: an unreachable pose, too many steps.
        notes: Parts of the program that the plan leaves out.
    """

    steps: tuple[Step, ...]
    violations: tuple[Violation, ...] = ()
    notes: tuple[Reason, ...] = ()


@dataclass(frozen=True, eq=False)
class SampledPath:
    """Samples of a motion, the first at its start and the last at its end.

    Attributes:
        times_s: (m,) from the start.
        joint_positions: (m, n) [rad] or [m].
        tool_positions: (m, 3) in the base frame [m].
        tool_speeds: (m,) [m/s].
        clearances: (m,) distance to the nearest obstacle [m]; infinite without obstacles. Far from all
            obstacles, only some samples are measured and the others interpolated.
        lines: (m,) the program's lines.
    """

    times_s: FloatArray
    joint_positions: FloatArray
    tool_positions: FloatArray
    tool_speeds: FloatArray
    clearances: FloatArray
    lines: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class CheckReport:
    """All findings of the check of a plan.

    Attributes:
        ok: There is no violation.
        duration_s: Total of the motions, homing's rest and the waits.
        interpolation: The assumed interpolation of the controller.
        notes: Gaps in the check's coverage.
        durations_s: Duration of each step.
        alone: Only self-collisions were checked: the cell has no floor, no fixture and no other robot.
    """

    ok: bool
    duration_s: float
    violations: tuple[Violation, ...]
    steps: tuple[Step, ...]
    interpolation: Reason
    notes: tuple[Reason, ...]
    path: SampledPath
    durations_s: tuple[float, ...] = ()
    alone: bool = False

    @property
    def refused(self) -> bool:
        """True if a gateway that requires checks refuses the motion: a violation is not only a warning."""
        return any(violation.refuses for violation in self.violations)
