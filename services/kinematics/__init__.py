"""What a robot is and where its parts are: a thin service over `robots`."""

from services.kinematics.kinematics import RobotSettings, Settings, serve

__all__ = ["RobotSettings", "Settings", "serve"]
