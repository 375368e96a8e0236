"""Direction, speed and bounds of a jog; imports no planner, as `steps`."""

from dataclasses import dataclass
from math import radians

from robots.kinematics.joints import Joints, JointType
from robots.programs.statements import StepFrame

# Most that may be commanded beyond the measured position: of the tool, of a rotation, or of one joint.
AHEAD_M = 0.010
AHEAD_RAD = radians(2.0)
# Largest tool speed of reduced speed control in ISO 10218-1, and of a rotation.
MOST_M_S = 0.250
MOST_RAD_S = radians(30.0)


@dataclass(frozen=True, kw_only=True)
class Jog:
    """Direction and speed of a jog.

    Attributes:
        frame: Axes of the direction; None: a joint.
        axis: 0 to 2 along, 3 to 5 about the frame's axis; or the joint's number from 0.
        speed: Greatest speed [m/s] or [rad/s]; its sign is the direction.
        tool_speed: Greatest speed of the tool [m/s], whatever moves it.
    """

    frame: StepFrame | None
    axis: int
    speed: float
    tool_speed: float = MOST_M_S

    def turns(self, joints: Joints) -> bool:
        """Return whether its distances are angles [rad], not lengths [m]."""
        if self.frame is None:
            return joints.types[self.axis] is not JointType.PRISMATIC
        return self.axis > 2
