"""Model of the simulated controller: arm, program, alarms and outputs. No I/O; time is an argument.

The program is the demo's tour. Inputs and outputs are invented: they count its motions.
"""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from datetime import datetime

import numpy as np

from controllers.fanuc.axes import Axes
from controllers.fanuc.data import ALARM, AXES, POSITION, TASK, Alarm, alarms
from controllers.fanuc.signals import Operator
from controllers.fanuc.simulated.rmi_program import NAME as RMI_MOVE
from controllers.fanuc.simulated.rmi_program import ProgramStatus, RmiProgram
from controllers.simulated.demo import DemoProgram
from controllers.simulated.fault_table import displacement
from robots.descriptions.description import RobotDescription
from robots.kinematics.joints import FloatArray, joints_of, violations
from robots.kinematics.model import build_model, link_placements, tool_placement
from robots.schema.poses import rotation_rpy

PROGRAM = "DEMO"
SOFTWARE = "V0.00P/00 simulated"
NO_SEVERITY = 128
SERVO_SEVERITY = 54
CANNOT_EXECUTE, SERVO_OFF, PENDANT_ENABLED, PROGRAM_EXISTS = 2556934, 2556935, 2556936, 7015
"""Numbers of RMI's errors."""

_SPEED = 0.6
_MOVED_DEGREES = 12.345
_VALID = 1


class SnpxController:
    """State of one simulated controller with one motion group.

    Args:
        axes: Relation between its axes and the joints.
        group: Number of its motion group.
        tour: Targets [rad] or [m] of the running program; None: none runs.
        servo_on: A restarted controller waits for an operator to switch the servos on.

    Attributes:
        rmi: The program of RMI, which then moves the arm; None: there was none.
        override: General override [%]; it slows the motions of RMI.
        pendant_enabled: The teach pendant is on, so RMI does not work.
    """

    def __init__(
        self,
        description: RobotDescription,
        axes: Axes,
        *,
        group: int,
        tour: Iterator[FloatArray] | None,
        servo_on: bool = True,
    ) -> None:
        self._axes = axes
        self._joints = joints_of(description)
        self._model = build_model(description)
        self._program = DemoProgram(self._joints, tour, speed=_SPEED)
        self._servo_on = servo_on
        self._alarms: list[bytes] = []
        self.rmi: RmiProgram | None = None
        self.override = 100
        self.pendant_enabled = False
        self.tool_number = 1
        self.group = group
        self.registers: dict[int, float] = {1: 12.5}

    # ------------------------------------------------------------------------ behaviour

    def tick(self, now_s: float) -> None:
        """Begin the next motion of the program if the current one has ended."""
        if self.rmi is None:
            self._program.tick(now_s)

    def begin_rmi(self, now_s: float) -> int:
        """Create and start RMI_MOVE; return an error's number, 0: done."""
        if self.rmi is not None and self.rmi.status is not ProgramStatus.ABORTED:
            return PROGRAM_EXISTS
        if self.pendant_enabled:
            return PENDANT_ENABLED
        if not self.servo_ready:
            return SERVO_OFF
        if self.program_runs:
            return CANNOT_EXECUTE
        self.rmi = RmiProgram(self._joints, self.positions(now_s), override=self.override / 100.0)
        return 0

    def set_override(self, percent: int, now_s: float) -> None:
        """Change the general override, as at the pendant."""
        self.override = percent
        if self.rmi is not None:
            self.rmi.set_override(percent / 100.0, now_s)

    def target_of(self, axes: Sequence[float]) -> FloatArray | None:
        """Return joint positions of nine axes [degree] or [mm]; None: beyond the limits."""
        target = np.array(self._axes.positions(axes))
        return None if violations(self._joints, target) else target

    def start_program(self, tour: Iterator[FloatArray], now_s: float) -> None:
        """Start a program from the present position."""
        start = self.positions(now_s)
        self.rmi = None
        self._program = DemoProgram(self._joints, tour, speed=_SPEED, start=start)

    def end_program(self, now_s: float) -> None:
        """End the program."""
        self._program.stop(now_s)

    @property
    def servo_ready(self) -> bool:
        """True if the servos have power and there is no alarm."""
        return self._servo_on and not self._alarms

    @property
    def program_runs(self) -> bool:
        """True if a program other than RMI_MOVE runs."""
        return self.rmi is None and self._program.runs

    def axes(self, now_s: float) -> tuple[float, ...]:
        """Return nine axes [degree] or [mm]."""
        return self._axes.values(self.positions(now_s))

    @property
    def axis_count(self) -> int:
        """Number of its axes without extended ones."""
        return max(self._axes.used) + 1

    @property
    def newest_alarms(self) -> list[Alarm]:
        """Active alarms, the newest first."""
        return alarms(b"".join(self._alarms))

    @property
    def newest_alarm(self) -> str:
        """Code of the newest alarm, such as SRVO-001."""
        return self.newest_alarms[0].number if self._alarms else "No Error"

    def pause_rmi(self, now_s: float, *, fault: bool) -> None:
        """Pause RMI_MOVE, as an operator or a fault does."""
        if self.rmi is not None and self.rmi.pause(now_s):
            self.rmi.reports_fault = fault

    def raise_alarm(self, facility: int, code: int, message: str, now_s: float) -> None:
        """Stop the arm and report a servo alarm until `reset`."""
        self._program.stop(now_s)
        self.pause_rmi(now_s, fault=True)
        time = datetime.now().astimezone().timetuple()[:6]
        self._alarms.insert(0, _alarm(facility, code, SERVO_SEVERITY, time, message, "SERVO"))

    def reset(self, now_s: float) -> None:
        """End all alarms and continue the program."""
        self._alarms = []
        self._program.go_on(now_s)

    # ---------------------------------------------------------------------------- state

    def positions(self, now_s: float) -> FloatArray:
        """Return the joint positions [rad] or [m]."""
        return (self._program if self.rmi is None else self.rmi).state(now_s).positions

    def position(self, now_s: float, active: Collection[str] = ()) -> bytes:
        """Return the current position in the world frame, with the tool.

        Args:
            active: Of the faults: `jump`, `corrupt`, `joints`.
        """
        positions = self.positions(now_s).copy()
        positions[0] += np.radians(displacement(active, now_s))
        axes = [*self._axes.values(positions)]
        if "joints" in active:
            axes[next(each for each in range(AXES) if each not in self._axes.used)] = _MOVED_DEGREES
        pose = self._frame(tool_placement(self._model, positions))
        # The configuration of an upright arm in front of its base: N R U T, without turns.
        return POSITION.pack(*pose, 0, 0, 0, 0, 0, 1, 1, 0, 0, 0, _VALID, *axes, _VALID, 15, 15, 0, 0, 0)

    def tool(self) -> bytes:
        """Return the tool's frame in that of the flange, which is the model's last link."""
        positions = self._joints.home
        flange = link_placements(self._model, positions)[-1]
        frame = self._frame(np.linalg.inv(flange) @ tool_placement(self._model, positions))
        return POSITION.pack(*frame, *(0.0,) * 3, *(0,) * 7, _VALID, *(0.0,) * AXES, *(0,) * 6)

    @staticmethod
    def _frame(placement: FloatArray) -> tuple[float, ...]:
        """Return x, y, z [mm] and w, p, r [degree] of a placement (4, 4)."""
        angles = (math.degrees(each) for each in rotation_rpy(placement[:3, :3]))
        return (*(placement[:3, 3] * 1e3).tolist(), *angles)

    def alarm(self, line: int) -> bytes:
        """Return an active alarm, 1 is the newest; a line without one is empty."""
        if line <= len(self._alarms):
            return self._alarms[line - 1]
        return _alarm(0, 0, NO_SEVERITY, (0,) * 6, "", "")

    def task(self, number: int) -> bytes:
        """Return the state of a task; only the first has a program."""
        if number != 1:
            return bytes(TASK.size)
        if self.rmi is not None:
            state = {ProgramStatus.RUNNING: 2, ProgramStatus.PAUSED: 1, ProgramStatus.ABORTED: 0}[
                self.rmi.status
            ]
            return TASK.pack(RMI_MOVE.encode(), 3, state, b"")
        state = 2 if self._program.runs else 1 if self._alarms else 0
        return TASK.pack(PROGRAM.encode(), 1 + self._program.leg % 16, state, b"")

    def numbers(self) -> Mapping[str, int]:
        """Return integer system variables."""
        return {
            "$MCR.$GENOVERRIDE": self.override,
            f"$MNUFRAMENUM[{self.group}]": 0,
            f"$MNUTOOLNUM[{self.group}]": self.tool_number,
            "$SNPX_PARAM.$VERSION": 2,
            "$SNPX_PARAM.$NUM_ASG": 80,
        }

    def inputs(self) -> int:
        """Return DI and DO, the first in the lowest bit."""
        return self._program.leg % 256

    def operator_outputs(self, active: Collection[str] = ()) -> int:
        """Return UO.

        Args:
            active: Of the faults: `local`.
        """
        local = "local" in active or self.pendant_enabled
        found = 1 << Operator.PENDANT_ENABLED if local else 0
        if self.servo_ready:
            found |= 1 << Operator.SYSTEM_READY
            found |= 0 if local else 1 << Operator.COMMANDS_ENABLED
        status = None if self.rmi is None else self.rmi.status
        if self.program_runs or status is ProgramStatus.RUNNING:
            found |= 1 << Operator.PROGRAM_RUNNING
        if status is ProgramStatus.PAUSED:
            found |= 1 << Operator.PAUSED
        if self._alarms:
            found |= 1 << Operator.FAULT
        return found


def _alarm(
    facility: int, code: int, severity: int, time: tuple[int, ...], message: str, severity_name: str
) -> bytes:
    return ALARM.pack(
        facility, code, 0, 0, severity, *time, message.encode()[:80], b"", severity_name.encode()[:18]
    )
