"""Settings of the kinematics service."""

from dataclasses import dataclass

from robomesh.quotas import DEFAULT_QUOTAS, Quotas
from robots.cells import CellDescription


@dataclass(frozen=True, kw_only=True)
class RobotSettings:
    """A robot of the site.

    Attributes:
        cell_description: The robot and all that it is checked against; robots with the same one share a cell.
        cell: Name of the cell in the site file; empty for a single robot.
        stale_after_s: Age after which the other robots' clearances ignore its positions.
    """

    name: str
    cell_description: CellDescription
    cell: str = ""
    simulated: bool = False
    stale_after_s: float = 1.0


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Robots of a site and the quotas of each client."""

    site: str
    robots: tuple[RobotSettings, ...]
    quotas: Quotas = DEFAULT_QUOTAS
