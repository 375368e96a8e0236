"""The site file's part on a robot of Universal Robots."""

import math
from typing import Annotated

from pydantic import Field, StrictBool

from controllers.universal_robots.motion_script import INPUTS, OUTPUTS, REGISTERS
from controllers.universal_robots.settings import MotionSettings, UniversalRobotsSettings
from protocol_gateway.seam.table import Declared, Table

_END = REGISTERS.stop


class UniversalRobots(Table):
    """A robot of Universal Robots (docs/controllers/universal-robots.md); its motion is experimental.

    Attributes:
        rate: States a second; CB3 sends at most 125.
        motion: The gateway moves the robot; otherwise it only reads, and sends nothing but the greeting.
        input_registers: Number of the first of two integer input registers of the controller that no other
            client and no fieldbus uses.
        output_registers: Number of the first of three integer output registers that nothing else uses.
        speed: Speed [deg/s] of the fastest joint at 100 %.
        acceleration: Acceleration [deg/s²] of the fastest joint.
    """

    rate: Annotated[float, Field(ge=1, le=500)] = 125.0
    motion: StrictBool = False
    input_registers: Annotated[int, Field(ge=REGISTERS.start, le=_END - INPUTS, strict=True)] = 24
    output_registers: Annotated[int, Field(ge=REGISTERS.start, le=_END - OUTPUTS, strict=True)] = 24
    speed: Annotated[float, Field(ge=1, le=180)] = 60.0
    acceleration: Annotated[float, Field(ge=1, le=800)] = 80.0

    def options(self, robot: Declared) -> UniversalRobotsSettings:
        """Return the driver's settings."""
        motion = MotionSettings(
            input_registers=self.input_registers,
            output_registers=self.output_registers,
            speed=math.radians(self.speed),
            acceleration=math.radians(self.acceleration),
        )
        return UniversalRobotsSettings(rate_hz=self.rate, motion=motion if self.motion else None)
