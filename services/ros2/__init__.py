"""The mesh for ROS 2: its topics in the wire form of rmw_zenoh, no bridge between."""

from services.ros2.service import serve
from services.ros2.settings import Settings

__all__ = ["Settings", "serve"]
