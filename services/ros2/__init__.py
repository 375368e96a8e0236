"""Bridge to ROS 2: publishes the mesh's topics in the wire format of rmw_zenoh."""

from services.ros2.service import serve
from services.ros2.settings import Settings

__all__ = ["Settings", "serve"]
