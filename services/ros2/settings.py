"""What a bridge to ROS 2 is told."""

import os
from dataclasses import dataclass, field
from pathlib import Path

from robomesh.keys import is_replay


def _cache() -> Path:
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "robomesh" / "ros2-meshes"


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Which part of the mesh ROS 2 sees, and where.

    Attributes:
        domain: ROS_DOMAIN_ID of the nodes that are to see it.
        robots: `robot` or `site/robot`; none: all of the mesh.
        site: Where it is present itself; empty: at the first site that is seen.
        metrics: Host and port at which Prometheus may ask; None: nowhere.
        node: Its name in the ROS graph.
        meshes: Folder for the meshes that `/robot_description` names as files.
    """

    domain: int = 0
    robots: tuple[str, ...] = ()
    site: str = ""
    metrics: tuple[str, int] | None = None
    node: str = "robomesh"
    meshes: Path = field(default_factory=_cache)

    def wants(self, site: str, robot: str) -> bool:
        """Whether ROS 2 is to see a robot; a replay only if it is named."""
        if not self.robots:
            return not is_replay(robot)
        return robot in self.robots or f"{site}/{robot}" in self.robots
