"""Kinematics service: robot descriptions, frames, clearances and kinematics requests, on top of `robots`."""

from services.kinematics.kinematics import serve
from services.kinematics.settings import RobotSettings, Settings

__all__ = ["RobotSettings", "Settings", "serve"]
