"""Settings of the driver of Universal Robots' controllers."""

import math
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class MotionSettings:
    """Settings of motion of an arm of Universal Robots.

    Attributes:
        input_registers: Number of the first of two integer input registers, from 24.
        output_registers: Number of the first of three integer output registers, from 24.
        speed: Of the leading joint at 100 percent [rad/s].
        acceleration: Of the leading joint [rad/s²].
    """

    input_registers: int = 24
    output_registers: int = 24
    speed: float = math.radians(60.0)
    acceleration: float = math.radians(80.0)


@dataclass(frozen=True, kw_only=True)
class UniversalRobotsSettings:
    """Properties of a robot of Universal Robots that the site file declares.

    Attributes:
        rate_hz: States a second; the controller sends at most as many as its control loop has cycles.
        motion: How the gateway moves the arm; None: it only reads.
    """

    rate_hz: float = 125.0
    motion: MotionSettings | None = None
