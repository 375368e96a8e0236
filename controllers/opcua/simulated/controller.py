"""Simulated controller behind the server: arm, program and safety. No I/O; time is an argument."""

import math
from collections.abc import Collection, Iterator, Mapping

from controllers.simulated.demo import DemoProgram
from controllers.simulated.fault_table import displacement
from robots.descriptions.description import RobotDescription
from robots.kinematics.joints import FloatArray, JointType, joints_of

PROGRAM = "DEMO"
MANUAL, EXTERNAL = 1, 4
"""Values of OperationalMode: manual with reduced speed, automatic external."""
_SPEED = 0.6
_REST_CELSIUS, _WARMING = 30.0, 8.0


class OpcUaController:
    """State of one simulated controller.

    Args:
        tour: Targets [rad] or [m] of the running program; None: no program is loaded.
    """

    def __init__(self, description: RobotDescription, *, tour: Iterator[FloatArray] | None) -> None:
        self._joints = joints_of(description)
        self._program = DemoProgram(self._joints, tour, speed=_SPEED)
        self._loaded = tour is not None
        # Degrees and millimetres, as most controllers report.
        self._factors = [180.0 / math.pi if each is JointType.ROTARY else 1e3 for each in self._joints.types]

    def tick(self, now_s: float) -> None:
        """Begin the next motion of the program if the current one has ended."""
        self._program.tick(now_s)

    def protective_stop(self, now_s: float) -> None:
        """Stop the arm, until `go_on`."""
        self._program.stop(now_s)

    def go_on(self, now_s: float) -> None:
        """End the protective stop."""
        self._program.go_on(now_s)

    def positions(self, now_s: float) -> FloatArray:
        """Return the joint positions [rad] or [m]."""
        return self._program.state(now_s).positions

    def axes(self, now_s: float, active: Collection[str] = ()) -> Mapping[str, float]:
        """Return positions and speeds of the axes [degree] or [mm], by the variables' short names.

        Args:
            active: Of the faults: `jump`.
        """
        state = self._program.state(now_s)
        values: dict[str, float] = {}
        for number, factor in enumerate(self._factors):
            leap = 0.0 if number else displacement(active, now_s)
            values[f"position.{number}"] = float(state.positions[number]) * factor + leap
            values[f"speed.{number}"] = float(state.velocities[number]) * factor
        return values

    def status(self, now_s: float, active: Collection[str] = ()) -> Mapping[str, float | bool | str | int]:
        """Return all other values; temperatures are invented.

        Args:
            active: Of the faults: `local`, `fault`.
        """
        state = self._program.state(now_s)
        warm = {
            f"temperature.{number}": _REST_CELSIUS + round(_WARMING * abs(float(speed)), 1)
            for number, speed in enumerate(state.velocities)
        }
        stopped = "fault" in active
        return {
            "mode": MANUAL if "local" in active else EXTERNAL,
            "protective_stop": stopped,
            "emergency_stop": False,
            "in_control": not stopped,
            "program": PROGRAM if self._loaded else "",
            "loaded": self._loaded,
            **warm,
        }
