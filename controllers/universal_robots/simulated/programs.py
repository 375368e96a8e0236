"""Programs of the simulated controller: the demo's tour, or a script; they move its arm. Time is an argument.

A stopped arm brakes on its path with an invented deceleration.
"""

import logging
from collections.abc import Callable, Iterator

from controllers.simulated.demo import DemoProgram
from controllers.universal_robots.interfaces.modes import RuntimeState
from controllers.universal_robots.simulated.line_motion import JointLine, Path, PathMotion
from controllers.universal_robots.simulated.registers import Registers
from controllers.universal_robots.simulated.script.code import Program
from controllers.universal_robots.simulated.script.errors import ScriptError
from controllers.universal_robots.simulated.script.machine import ControllerFunction, Machine
from robots.kinematics.joints import FloatArray, Joints
from robots.kinematics.motion import ArmState

logger = logging.getLogger(__name__)

DEMO = "demo"
_SPEED = 0.6
_LOWEST_SPEED = 0.01
# Of the leading joint when a program is stopped; a real one's is not documented.
STOP_DECELERATION = 15.0
_MOST_SECONDARY = 8
_STEADY_S = 0.5


class Programs:
    """The program that runs, and the arm's motion.

    Args:
        tour: Targets [rad] of the demo, which is loaded and runs; None: none is loaded.
        report_key: Called with the title and the program's name when a program starts or ends.
        report_fault: Called with the line and the text of a script's error.
    """

    def __init__(
        self,
        joints: Joints,
        tour: Iterator[FloatArray] | None,
        registers: Registers,
        *,
        report_key: Callable[[str, str], None],
        report_fault: Callable[[int, str], None],
    ) -> None:
        self._joints = joints
        self._tour = tour
        self._registers = registers
        self._report_key, self._report_fault = report_key, report_fault
        self.functions: dict[str, ControllerFunction] = {}
        self._demo = DemoProgram(joints, tour, speed=_SPEED)
        self._machine: Machine | None = None
        self._secondary: list[Machine] = []
        self._next: Program | None = None
        self._line: PathMotion | None = None
        self._mover = 0
        self._moved_s = float("-inf")
        self._slider = 1.0
        self._demo_runs = tour is not None
        self.state = RuntimeState.PLAYING if tour is not None else RuntimeState.STOPPED
        if tour is not None:
            report_key("PROGRAM_XXX_STARTED", DEMO)

    # ---------------------------------------------------------------- programs

    @property
    def loaded(self) -> str:
        """Name of the program that `play` starts; empty: none."""
        return DEMO if self._tour is not None else ""

    @property
    def line(self) -> int:
        """Line of the program; 0: none runs."""
        if self._machine is not None:
            return self._machine.line
        return 2 + self._demo.leg % 16 if self._demo_runs else 0

    @property
    def leg(self) -> int:
        """Number of the demo's motions so far."""
        return self._demo.leg

    def start(self, program: Program, now_s: float) -> None:
        """Start a script, which replaces the running program unless it is secondary."""
        if program.secondary:
            if len(self._secondary) < _MOST_SECONDARY:
                self._secondary.append(Machine(program, self.functions))
            return
        self.stop(now_s)
        self._next = program

    def play(self, now_s: float) -> bool:
        """Continue a paused program, or start the loaded one; return whether there is one."""
        if self.state is RuntimeState.PAUSED:
            self.state = RuntimeState.PLAYING
            if self._demo_runs:
                self._demo.go_on(now_s)
            elif self._line is not None and self._mover:
                self._line = self._line.resumed(now_s, max(self._slider, _LOWEST_SPEED))
            return True
        if self._tour is None or self.state is not RuntimeState.STOPPED:
            return False
        # From where the arm is.
        self._demo = DemoProgram(self._joints, self._tour, speed=_SPEED, start=self.arm(now_s).positions)
        self._line = None
        self._demo_runs = True
        self.set_speed(self._slider, now_s)
        self.state = RuntimeState.PLAYING
        self._report_key("PROGRAM_XXX_STARTED", DEMO)
        return True

    def pause(self, now_s: float) -> None:
        """Brake, and keep the program."""
        if self.state is RuntimeState.PLAYING:
            self.brake(STOP_DECELERATION, now_s)
            self.state = RuntimeState.PAUSED

    def stop(self, now_s: float) -> None:
        """Brake, and end the program."""
        self._next = None
        if self.state is RuntimeState.STOPPED:
            return
        name = DEMO if self._demo_runs else "" if self._machine is None else self._machine.program.name
        self._machine, self._mover, self._demo_runs = None, 0, False
        self._registers.forget_watchdogs()
        self.brake(STOP_DECELERATION, now_s)
        if self.state is not RuntimeState.STOPPING:
            self._report_key("PROGRAM_XXX_STOPPED", name)
        self.state = RuntimeState.STOPPING

    def tick(self, now_s: float) -> None:
        """Execute the programs to their next waits."""
        if self.moving(now_s):
            self._moved_s = now_s
        for secondary in tuple(self._secondary):
            self._execute(secondary, now_s)
            if secondary.ended:
                self._secondary.remove(secondary)
        if self.state is RuntimeState.STOPPING and not self.moving(now_s):
            self.state = RuntimeState.STOPPED
        if self.state is RuntimeState.STOPPED and self._next is not None:
            program, self._next = self._next, None
            self._rest(now_s)
            self._machine = Machine(program, self.functions)
            self.state = RuntimeState.PLAYING
            self._report_key("PROGRAM_XXX_STARTED", program.name)
        if self.state is not RuntimeState.PLAYING:
            return
        if self._demo_runs:
            self._demo.tick(now_s)
        match self._registers.starved(now_s):
            case "stop":
                logger.warning("a watchdog stops the program")
                self.stop(now_s)
            case "pause":
                logger.warning("a watchdog pauses the program")
                self.pause(now_s)
        if self._machine is not None and self.state is RuntimeState.PLAYING:
            machine = self._machine
            if not self._execute(machine, now_s) or machine.ended:
                self.stop(now_s)
            elif self._mover and not machine.alive(self._mover):
                self._mover = 0  # a killed thread: its motion goes on until another one moves or stops

    def _execute(self, machine: Machine, now_s: float) -> bool:
        """Execute one tick; return False after an error, which is reported."""
        try:
            machine.tick(now_s)
        except ScriptError as error:
            logger.warning("script %s, line %d: %s", machine.program.name, error.line, error.text)
            self._report_fault(error.line, error.text)
            machine.halt()
            return False
        return True

    def is_running(self, machine: Machine) -> bool:
        """Return whether a machine executes the program that may move the arm."""
        return machine is self._machine

    # ------------------------------------------------------------------ the arm

    def arm(self, now_s: float) -> ArmState:
        """Return positions, velocities and accelerations."""
        return self._demo.state(now_s) if self._line is None else self._line.state(now_s)

    def moving(self, now_s: float) -> bool:
        """Return whether the arm moves."""
        return self._demo.moving(now_s) if self._line is None else self._line.moving(now_s)

    def steady(self, now_s: float) -> bool:
        """Return whether the arm has rested for half a second."""
        return not self.moving(now_s) and now_s - self._moved_s >= _STEADY_S

    def set_speed(self, fraction: float, now_s: float) -> None:
        """Set the speed slider, 0 to 1."""
        self._slider = fraction
        self._demo.set_speed(_SPEED * max(fraction, _LOWEST_SPEED), now_s)
        if self._line is not None:
            self._line.scale(max(fraction, _LOWEST_SPEED), now_s)

    def begin_move(self, thread: int, path: Path, *, speed: float, acceleration: float, now_s: float) -> None:
        """Begin a motion of a script's thread.

        Args:
            speed, acceleration: In the path's unit.

        Raises:
            ScriptError: If another thread moves the arm.
        """
        self.take_arm(thread)
        scale = max(self._slider, _LOWEST_SPEED)
        self._line = PathMotion(path, speed=speed, acceleration=acceleration, now_s=now_s, scale=scale)

    def take_arm(self, thread: int) -> None:
        """Give the arm to a script's thread.

        Raises:
            ScriptError: If another thread has it.
        """
        if self._mover not in (0, thread) and self._machine is not None and self._machine.alive(self._mover):
            raise ScriptError("another thread is already controlling the robot")
        self._mover = thread

    def release_arm(self) -> None:
        """Take the arm back: the motion has ended."""
        self._mover = 0

    def brake(self, deceleration: float, now_s: float, *, of_joints: bool = True) -> None:
        """Come to rest on the path.

        Args:
            deceleration: Of the leading joint [rad/s²], or in the path's unit.
        """
        if self._line is None:
            self._demo.stop(now_s)
        elif self._line.moving(now_s) and not self._line.braking:
            self._line.brake(deceleration, now_s, of_joints=of_joints)

    def _rest(self, now_s: float) -> None:
        """Begin a path at rest, from which scripts move."""
        positions = self.arm(now_s).positions
        self._line = PathMotion(JointLine(positions, positions), speed=1.0, acceleration=1.0, now_s=now_s)
