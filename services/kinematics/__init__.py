"""What an arm is, where its parts are, what it is near to: a thin service over `robots`."""

from services.kinematics.kinematics import serve
from services.kinematics.settings import RobotSettings, Settings

__all__ = ["RobotSettings", "Settings", "serve"]
