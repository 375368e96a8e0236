"""What the kinematics service is told at its start."""

from dataclasses import dataclass

from robomesh.quotas import DEFAULT_QUOTAS, Quotas
from robots.cells import CellDescription


@dataclass(frozen=True, kw_only=True)
class RobotSettings:
    """A robot of the site.

    Attributes:
        place: Itself, and what it is checked against; robots that share one are followed together.
        cell: The site file's name for it; empty for a robot alone.
        stale_after_s: Older than this, its positions tell nobody else where it is.
    """

    name: str
    place: CellDescription
    cell: str = ""
    simulated: bool = False
    stale_after_s: float = 1.0


@dataclass(frozen=True, kw_only=True)
class Settings:
    """The robots of a site, and what each asker may have of their kinematics."""

    site: str
    robots: tuple[RobotSettings, ...]
    quotas: Quotas = DEFAULT_QUOTAS
