"""RMI_MOVE, the program that a controller creates for RMI: joint motions one after the other. No I/O."""

from collections import deque
from dataclasses import dataclass
from enum import IntEnum

from robots.kinematics.joints import FloatArray, Joints
from robots.kinematics.motion import ArmState, Motion

MOST_INSTRUCTIONS = 8
NAME = "RMI_MOVE"


class ProgramStatus(IntEnum):
    """State of the program, as FRC_GetStatus reports it."""

    RUNNING = 0
    PAUSED = 1
    ABORTED = 2


@dataclass(frozen=True, eq=False)
class Instruction:
    """A joint motion.

    Attributes:
        target: (n,) [rad] or [m].
        speed: Fraction of the joints' speeds.
    """

    sequence: int
    target: FloatArray
    speed: float


class RmiProgram:
    """State of the program and its arm.

    Args:
        start: Initial positions (n,) [rad] or [m].
        override: Fraction of the instructions' speeds.

    Attributes:
        expected: Number that the next instruction must have.
        holds: An invalid instruction came: none is taken until FRC_Reset.
        reports_fault: The program was paused by a fault that the client has not been told.
    """

    def __init__(self, joints: Joints, start: FloatArray, *, override: float = 1.0) -> None:
        self._motion = Motion(joints, start.copy())
        self._open: deque[Instruction] = deque()
        self._begun = False
        self._override = override
        self.status = ProgramStatus.RUNNING
        self.expected = 1
        self.holds = False
        self.reports_fault = False

    @property
    def open(self) -> int:
        """Number of instructions that are not executed yet."""
        return len(self._open)

    @property
    def current(self) -> int:
        """Number of the instruction that is executed; 0: none is."""
        return self._open[0].sequence if self._open else 0

    def add(self, instruction: Instruction) -> None:
        """Append an instruction."""
        self._open.append(instruction)
        self.expected = instruction.sequence % (2**31 - 1) + 1

    def tick(self, now_s: float) -> int | None:
        """Return the number of an instruction that is executed now, and begin the next."""
        if self.status is not ProgramStatus.RUNNING or not self._open:
            return None
        if not self._begun:
            self._begin(now_s)
            self._begun = True
        if self._motion.moving(now_s):
            return None
        self._begun = False
        return self._open.popleft().sequence

    def _begin(self, now_s: float) -> None:
        self._motion.move(self._open[0].target, now_s, speed=self._open[0].speed * self._override)

    def set_override(self, fraction: float, now_s: float) -> None:
        """Change the override, also of the motion that runs."""
        self._override = fraction
        if self._begun and self._motion.moving(now_s):
            self._begin(now_s)

    def pause(self, now_s: float) -> bool:
        """Brake and wait; False: the program does not run."""
        if self.status is not ProgramStatus.RUNNING:
            return False
        self._motion.brake(now_s)
        self.status, self._begun = ProgramStatus.PAUSED, False
        return True

    def go_on(self) -> bool:
        """Continue; False: the program is not paused."""
        if self.status is not ProgramStatus.PAUSED:
            return False
        self.status = ProgramStatus.RUNNING
        return True

    def abort(self, now_s: float) -> None:
        """Brake, and discard all instructions."""
        self._motion.brake(now_s)
        self._open.clear()
        self.status = ProgramStatus.ABORTED

    def moving(self, now_s: float) -> bool:
        """Return whether the arm moves."""
        return self._motion.moving(now_s)

    def state(self, now_s: float) -> ArmState:
        """Return positions, velocities and accelerations."""
        return self._motion.state(now_s)
