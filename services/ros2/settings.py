"""Settings of the ROS 2 service."""

import os
from dataclasses import dataclass, field
from pathlib import Path

from robomesh.contract.keys import is_replay


def _cache() -> Path:
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "robomesh" / "ros2-meshes"


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of the ROS 2 service.

    Attributes:
        domain: ROS_DOMAIN_ID of the ROS 2 nodes.
        robots: Robots to publish, as `robot` or `site/robot`; empty for all of the mesh.
        site: Site of the service's presence; empty for the first site found.
        metrics: Host and port of the Prometheus endpoint; None for none.
        node: Name of the node in the ROS graph.
        shapes: Folder for the shape files that `/robot_description` names.
    """

    domain: int = 0
    robots: tuple[str, ...] = ()
    site: str = ""
    metrics: tuple[str, int] | None = None
    node: str = "robomesh"
    shapes: Path = field(default_factory=_cache)

    def wants(self, site: str, robot: str) -> bool:
        """Return whether to publish a robot to ROS 2; replays only if the settings name them."""
        if not self.robots:
            return not is_replay(robot)
        return robot in self.robots or f"{site}/{robot}" in self.robots
