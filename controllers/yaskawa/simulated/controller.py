"""Model of the simulated controller: arm, job, motions, HOLD, status and alarms. No I/O; time is an argument.

The job is the demo's tour; a held job waits for `start`. It is not known whether a real controller continues
a held motion when HOLD ends, so both can be simulated. Torques and inputs are invented: they follow the
motion without any dynamics.
"""

from collections.abc import Collection, Iterator, Sequence
from datetime import datetime
from enum import IntEnum

import numpy as np

from controllers.simulated.demo import DemoProgram
from controllers.simulated.fault_table import displacement
from controllers.yaskawa.axes import Axes
from controllers.yaskawa.data import (
    Alarm,
    DataType,
    Job,
    Position,
    Status,
    Status1,
    Status2,
    System,
)
from robots.descriptions.description import RobotDescription
from robots.kinematics.joints import FloatArray, joints_of, violations
from robots.kinematics.model import build_model, tool_placement
from robots.kinematics.motion import ArmState, Motion
from robots.schema.poses import rotation_rpy

JOB = "DEMO"
AXIS_NAMES = ("S", "L", "U", "R", "B", "T", "E", "W")
NO_ALARM = Alarm(0, 0, 0, "", "")

_SPEED = 0.6
_MOVED_AXIS = 12_345
_INPUTS, _OUTPUTS = 1, 1001


class Refusal(IntEnum):
    """Code of a refused command, in its answer."""

    VALUE = 0x1012
    LENGTH = 0x1013
    MOVES = 0x2010
    HELD_AT_PENDANT = 0x2020
    HELD_BY_COMMAND = 0x2050
    ALARM = 0x2060
    SERVO_OFF = 0x2070
    MODE = 0x2080
    NOT_REMOTE = 0x2100
    GROUP = 0xB008
    SPEED = 0xB009


class HsesController:
    """State of one simulated controller.

    Args:
        axes: Relation between its pulses and the joints.
        tour: Targets [rad] or [m] of the running job; None: no job runs.
        servo_on: A restarted controller waits for an operator to switch the servos on.
        axis_count: Values of axes that it sends: 7 as FS100, 8 as later ones.
        held_motions_go_on: A held motion goes on when HOLD ends; otherwise it is given up.

    Attributes:
        mode: Bits of the status: remote, play or teach.
        held_at_pendant: HOLD is pressed at the pendant.
        tool: Number of the active tool.
        commands: Executed motions, so far.
    """

    def __init__(
        self,
        description: RobotDescription,
        axes: Axes,
        *,
        tour: Iterator[FloatArray] | None,
        servo_on: bool = True,
        axis_count: int = len(AXIS_NAMES),
        held_motions_go_on: bool = False,
    ) -> None:
        self._axes = axes
        self._joints = joints_of(description)
        self._model = build_model(description)
        self._model_name = description.name
        self._tour = tour
        self._program = DemoProgram(self._joints, tour, speed=_SPEED)
        # The arm, once it was moved by a command.
        self._arm: Motion | None = None
        self._left: tuple[FloatArray, float] | None = None
        self._held_motions_go_on = held_motions_go_on
        self._held = False
        self.held_at_pendant = False
        self.mode = Status1.PLAY | Status1.REMOTE
        self.tool = 0
        self.commands = 0
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
        self._brake(now_s)
        self._left = None
        alarm = Alarm(code, sub_code, 1, datetime.now().astimezone().strftime("%Y/%m/%d %H:%M"), name)
        self._alarms.insert(0, alarm)
        self.history.insert(0, alarm)

    def reset(self, now_s: float) -> None:
        """End all alarms and continue the job."""
        self._alarms = []
        self.start(now_s)

    def start(self, now_s: float) -> None:
        """Continue the job, as START does, unless HOLD is set."""
        if self._tour is None or self._held or self.held_at_pendant:
            return
        if self._arm is None:
            self._program.go_on(now_s)
        else:
            at = self.positions(now_s)
            self._program = DemoProgram(self._joints, self._tour, speed=_SPEED, start=at)
            self._arm = None

    def _brake(self, now_s: float) -> None:
        self._program.stop(now_s)
        if self._arm is not None and self._arm.moving(now_s):
            self._arm.brake(now_s)

    def moves(self, now_s: float) -> bool:
        """Return whether the arm moves."""
        return self._program.moving(now_s) if self._arm is None else self._arm.moving(now_s)

    # ------------------------------------------------------------------------- commands

    def hold(self, on: bool, now_s: float, active: Collection[str] = ()) -> Refusal | None:
        """Set or end the HOLD by command; return the refusal, None: done."""
        if (refusal := self._refuses_commands(active)) is not None:
            return refusal
        if on and not self._held:
            self._brake(now_s)
        self._held = on
        left, self._left = self._left, self._left if on else None
        goes_on = self._held_motions_go_on and self._servo_on and not self.held_at_pendant
        if not on and left is not None and self._arm is not None and goes_on:
            target, speed = self._left = left
            self._arm.move(target, now_s, speed=speed)
        return None

    def press_hold(self, now_s: float) -> None:
        """Hold at the pendant."""
        self.held_at_pendant = True
        self._brake(now_s)

    def servo(self, on: bool, now_s: float, active: Collection[str] = ()) -> Refusal | None:
        """Switch the servos; return the refusal, None: done."""
        if (refusal := self._refuses_commands(active)) is not None:
            return refusal
        self.switch_servos(on, now_s)
        return None

    def switch_servos(self, on: bool, now_s: float) -> None:
        """Switch the servos at the robot, as an emergency stop does; a motion is given up."""
        if not on:
            self._brake(now_s)
            self._left = None
        self._servo_on = on

    def move(
        self, pulses: Sequence[int], percent: float, now_s: float, active: Collection[str] = ()
    ) -> Refusal | None:
        """Move all axes to pulses, eight; return the refusal, None: it moves."""
        if (refusal := self._refuses_motion(now_s, active)) is not None:
            return refusal
        target = np.array(self._axes.positions(pulses))
        if not 0.0 < percent <= 100.0:
            return Refusal.SPEED
        unused = [each for at, each in enumerate(pulses) if at not in self._axes.used]
        if violations(self._joints, target) or any(unused):
            return Refusal.VALUE
        if self._arm is None:
            self._arm = Motion(self._joints, self.positions(now_s))
        self._left = target, percent / 100.0
        self._arm.move(target, now_s, speed=percent / 100.0)
        self.commands += 1
        return None

    def _refuses_commands(self, active: Collection[str]) -> Refusal | None:
        mode = self._mode(active)
        if mode & Status1.TEACH:
            return Refusal.MODE
        return None if mode & Status1.REMOTE else Refusal.NOT_REMOTE

    def _refuses_motion(self, now_s: float, active: Collection[str]) -> Refusal | None:
        if (refusal := self._refuses_commands(active)) is not None:
            return refusal
        if self._alarms:
            return Refusal.ALARM
        if self.held_at_pendant:
            return Refusal.HELD_AT_PENDANT
        if self._held:
            return Refusal.HELD_BY_COMMAND
        if not self._servo_on:
            return Refusal.SERVO_OFF
        return Refusal.MOVES if self._program.runs or self.moves(now_s) else None

    def _mode(self, active: Collection[str]) -> Status1:
        return Status1.TEACH if "local" in active else self.mode

    # ---------------------------------------------------------------------------- state

    def positions(self, now_s: float) -> FloatArray:
        """Return the joint positions [rad] or [m]."""
        return self._arm_state(now_s).positions

    def _arm_state(self, now_s: float) -> ArmState:
        return (self._program if self._arm is None else self._arm).state(now_s)

    def position(self, now_s: float, active: Collection[str] = ()) -> Position:
        """Return the position in pulses.

        Args:
            active: Of the faults: `jump`, `corrupt`, `joints`.
        """
        positions = self.positions(now_s).copy()
        positions[0] += np.radians(displacement(active, now_s))
        pulses = [*self._axes.pulses(positions)[: self._axis_count]]
        if "joints" in active:
            pulses[self._extra_axis] = _MOVED_AXIS
        return Position(DataType.PULSES, 0, self.tool, 0, 0, tuple(pulses))

    def pose(self, now_s: float) -> Position:
        """Return the tool's pose in the base frame: position, and angles about the fixed axes x, y, z."""
        placement = tool_placement(self._model, self.positions(now_s))
        angles = np.degrees(rotation_rpy(placement[:3, :3]))
        numbers = [*(placement[:3, 3] * 1e6), *(angles * 1e4)]
        rest = (0,) * (self._axis_count - len(numbers))
        return Position(DataType.BASE, 0, self.tool, 0, 0, (*(round(float(each)) for each in numbers), *rest))

    @property
    def _extra_axis(self) -> int:
        return next(each for each in range(self._axis_count) if each not in self._axes.used)

    def axis_names(self, active: Collection[str] = ()) -> tuple[str, ...]:
        """Return the names of the axes; empty: there is no such axis."""
        used = {*self._axes.used, *([self._extra_axis] if "joints" in active else ())}
        return tuple(AXIS_NAMES[each] if each in used else "" for each in range(self._axis_count))

    def torques(self, now_s: float) -> tuple[int, ...]:
        """Return invented torques [% of the rated torque]."""
        state = self._arm_state(now_s)
        load = np.clip(20.0 * np.sin(state.positions) + 40.0 * state.velocities, -100.0, 100.0)
        found = [0] * self._axis_count
        for axis, value in zip(self._axes.used, load, strict=True):
            found[axis] = round(float(value))
        return tuple(found)

    def status(self, now_s: float, active: Collection[str] = ()) -> Status:
        """Return the status.

        Args:
            active: Of the faults: `local`.
        """
        first = Status1.CONTINUOUS
        first |= self._mode(active)
        held = self._held or self.held_at_pendant
        if self._program.runs or (self.moves(now_s) and not held):
            first |= Status1.RUNNING
        second = Status2.ALARM if self._alarms else Status2(0)
        if self._held:
            second |= Status2.HELD_BY_COMMAND
        if self.held_at_pendant:
            second |= Status2.HELD_AT_PENDANT
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
