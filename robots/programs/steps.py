"""What a program comes to: steps that a controller takes one after the other; and what a check finds."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from robomesh.reasons import Reason
from robots.joints import FloatArray

# How far the tool may leave the line between the joint moves that stand for it.
LINE_M = 0.001
LINE_DEG = 0.5

INTERPOLATION = (
    "joint moves: straight between the joint positions, all joints in phase, jerk-limited, from rest to "
    "rest; "
    f"lines: joint moves that keep the tool within {LINE_M * 1000:g} mm and {LINE_DEG:g}° of the line, "
    "each from rest to rest; home: a joint move at half of the greatest speeds"
)


class StepKind(StrEnum):
    """What a step asks of the controller."""

    HOME = "home"
    MOVE = "move"
    SPEED = "speed"
    WAIT = "wait"
    TRACE = "trace"


@dataclass(frozen=True, eq=False, kw_only=True)
class Step:
    """One command, or a wait.

    Attributes:
        line: Of the program, from 1.
        target: (n,) where HOME and MOVE end [rad] or [m].
        percent: Of SPEED: of the joints' greatest speeds, 1 to 100.
        seconds: Of WAIT.
        on: Of TRACE.
        along_line: Of MOVE: a part of a line of the tool.
        tool_speed: Of HOME and MOVE: what the program promises that the tool does not exceed [m/s].
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
    """What may be wrong with a program."""

    PROGRAM = "program"
    LIMIT = "limit"
    SPEED = "speed"
    SINGULARITY = "singularity"
    COLLISION = "collision"
    CLEARANCE = "clearance"
    UNREACHABLE = "unreachable"


@dataclass(frozen=True, eq=False, kw_only=True)
class Violation:
    """Something that is wrong with a program, from one moment to another.

    Attributes:
        line: Of the program, from 1; 0: of the start.
        time_s, until_s: From the program's start.
        pair: Two of "<robot>/<link>" and fixtures' names; empty where no two are concerned.
        points: (k, 3) in the site's frame [m]: nearest points of the pair; where on a line.
        distance_m: The smallest; 0: they touch; None where it is no matter of distance.
        reason: What it is, in degrees and millimetres.
        refuses: Whether a gateway that requires checks refuses the motion for it; else it warns.
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
    """The steps of a program, repeats unrolled and lines cut.

    Attributes:
        violations: Why it ends before the program does: a place that cannot be reached, too many steps.
        notes: What of the program it leaves out.
    """

    steps: tuple[Step, ...]
    violations: tuple[Violation, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class SampledPath:
    """A motion at some times, the first at its start and the last at its end.

    Attributes:
        times_s: (m,) from the start.
        joint_positions: (m, n) [rad] or [m].
        tool_positions: (m, 3) in the base frame [m].
        tool_speeds: (m,) [m/s].
        clearances: (m,) to what stands around the arm [m]; infinite where nothing does. Far from everything
            not every sample is measured: those between are interpolated.
        lines: (m,) of the program.
    """

    times_s: FloatArray
    joint_positions: FloatArray
    tool_positions: FloatArray
    tool_speeds: FloatArray
    clearances: FloatArray
    lines: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class CheckResult:
    """What a check found.

    Attributes:
        ok: There is no violation.
        duration_s: Of the motions, of homing's rest and of the waits.
        interpolation: How the controller is assumed to move, in words.
        notes: What the check could not cover, in words.
        alone: Only the arm itself was checked: around it are no floor, no fixture and no other robot.
    """

    ok: bool
    duration_s: float
    violations: tuple[Violation, ...]
    steps: tuple[Step, ...]
    interpolation: str
    notes: tuple[str, ...]
    path: SampledPath
    alone: bool = False

    @property
    def refused(self) -> bool:
        """Whether a gateway that requires checks refuses it: some violation is more than a warning."""
        return any(violation.refuses for violation in self.violations)
