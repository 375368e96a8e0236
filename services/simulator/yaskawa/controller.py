"""Model of the simulated controller: arm, job, status and alarms. No I/O; time is an argument.

The job is the demo's tour. Torques and inputs are invented: they follow the motion without any dynamics.
"""

from collections.abc import Collection, Iterator
from datetime import datetime

import numpy as np

from protocol_gateway.drivers.yaskawa.axes import Axes
from protocol_gateway.drivers.yaskawa.data import (
    Alarm,
    DataType,
    Job,
    Position,
    Status,
    Status1,
    Status2,
    System,
)
from robots.description import RobotDescription
from robots.joints import FloatArray, joints_of
from robots.model import build_model, tool_placement
from robots.poses import rotation_rpy
from services.simulator.demo import DemoProgram
from services.simulator.fault_table import LEAP

JOB = "DEMO"
AXIS_NAMES = ("S", "L", "U", "R", "B", "T", "E", "W")
NO_ALARM = Alarm(0, 0, 0, "", "")

_SPEED = 0.6
_MOVED_AXIS = 12_345
_INPUTS, _OUTPUTS = 1, 1001


class HsesController:
    """State of one simulated controller.

    Args:
        axes: Relation between its pulses and the joints.
        tour: Targets [rad] or [m] of the running job; None: no job runs.
        servo_on: A restarted controller waits for an operator to switch the servos on.
        axis_count: Values of axes that it sends: 7 as FS100, 8 as later ones.
    """

    def __init__(
        self,
        description: RobotDescription,
        axes: Axes,
        *,
        tour: Iterator[FloatArray] | None,
        servo_on: bool = True,
        axis_count: int = len(AXIS_NAMES),
    ) -> None:
        self._axes = axes
        self._joints = joints_of(description)
        self._model = build_model(description)
        self._model_name = description.name
        self._program = DemoProgram(self._joints, tour, speed=_SPEED)
        self._servo_on = servo_on
        self._axis_count = axis_count
        self._alarms: list[Alarm] = []
        self.history: list[Alarm] = []

    # ------------------------------------------------------------------------ behaviour

    def tick(self, now_s: float) -> None:
        """Begin the next motion of the job if the current one has ended."""
        self._program.tick(now_s)

    def raise_alarm(self, code: int, sub_code: int, name: str, now_s: float) -> None:
        """Stop the arm and report an alarm until `reset`."""
        self._program.stop(now_s)
        alarm = Alarm(code, sub_code, 1, datetime.now().astimezone().strftime("%Y/%m/%d %H:%M"), name)
        self._alarms.insert(0, alarm)
        self.history.insert(0, alarm)

    def reset(self, now_s: float) -> None:
        """End all alarms and continue the job."""
        self._alarms = []
        self._program.go_on(now_s)

    # ---------------------------------------------------------------------------- state

    def positions(self, now_s: float) -> FloatArray:
        """Return the joint positions [rad] or [m]."""
        return self._program.state(now_s).positions

    def position(self, now_s: float, active: Collection[str] = ()) -> Position:
        """Return the position in pulses.

        Args:
            active: Of the faults: `jump`, `joints`.
        """
        positions = self.positions(now_s).copy()
        if "jump" in active and int(now_s) % 2:
            positions[0] += np.radians(LEAP)
        pulses = [*self._axes.pulses(positions)[: self._axis_count]]
        if "joints" in active:
            pulses[self._extra_axis] = _MOVED_AXIS
        return Position(DataType.PULSES, 0, 0, 0, 0, tuple(pulses))

    def pose(self, now_s: float) -> Position:
        """Return the tool's pose in the base frame: position, and angles about the fixed axes x, y, z."""
        placement = tool_placement(self._model, self.positions(now_s))
        angles = np.degrees(rotation_rpy(placement[:3, :3]))
        numbers = [*(placement[:3, 3] * 1e6), *(angles * 1e4)]
        rest = (0,) * (self._axis_count - len(numbers))
        return Position(DataType.BASE, 0, 0, 0, 0, (*(round(float(each)) for each in numbers), *rest))

    @property
    def _extra_axis(self) -> int:
        return next(each for each in range(self._axis_count) if each not in self._axes.used)

    def axis_names(self, active: Collection[str] = ()) -> tuple[str, ...]:
        """Return the names of the axes; empty: there is no such axis."""
        used = {*self._axes.used, *([self._extra_axis] if "joints" in active else ())}
        return tuple(AXIS_NAMES[each] if each in used else "" for each in range(self._axis_count))

    def torques(self, now_s: float) -> tuple[int, ...]:
        """Return invented torques [% of the rated torque]."""
        state = self._program.state(now_s)
        load = np.clip(20.0 * np.sin(state.positions) + 40.0 * state.velocities, -100.0, 100.0)
        found = [0] * self._axis_count
        for axis, value in zip(self._axes.used, load, strict=True):
            found[axis] = round(float(value))
        return tuple(found)

    def status(self, active: Collection[str] = ()) -> Status:
        """Return the status.

        Args:
            active: Of the faults: `local`.
        """
        first = Status1.CONTINUOUS
        first |= Status1.TEACH if "local" in active else Status1.PLAY | Status1.REMOTE
        if self._program.runs:
            first |= Status1.RUNNING
        second = Status2.ALARM if self._alarms else Status2(0)
        if self._servo_on and not self._alarms:
            second |= Status2.SERVO_ON
        return Status(int(first), int(second))

    def alarm(self, number: int) -> Alarm:
        """Return an active alarm, 1 is the newest."""
        return self._alarms[number - 1] if number <= len(self._alarms) else NO_ALARM

    def job(self) -> Job:
        """Return the executing job."""
        return Job(JOB, 1 + self._program.leg % 16, self._program.leg % 16, 10_000)

    def system(self) -> System:
        """Return the system's information; marked as simulated."""
        return System("SIM1.00.00A", self._model_name.upper()[:16], "1.00")

    def io_byte(self, number: int) -> int:
        """Return eight signals."""
        return self._program.leg % 256 if number in (_INPUTS, _OUTPUTS) else 0
