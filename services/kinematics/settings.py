"""Settings of the kinematics service."""

from dataclasses import dataclass
from typing import Protocol

from robomesh.contract.quotas import DEFAULT_QUOTAS, Quotas
from robomesh.schemas.robomesh_pb2 import CellContent
from robots.descriptions.cells import CellDescription


class CellContents(Protocol):
    """Reader of contents of cells that the gateway publishes. Its methods may block."""

    def content(self, robot: str) -> CellContent:
        """Return the content of a robot's cell at the start."""

    def describe(self, robot: str, content: CellContent) -> tuple[str, CellDescription]:
        """Return a content's version and the cell with it; raise RefusedError if it is invalid."""


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
    """Robots of a site and the quotas of each client.

    Attributes:
        cell_content: Reads what the gateway publishes; None: cells do not change.
    """

    site: str
    robots: tuple[RobotSettings, ...]
    quotas: Quotas = DEFAULT_QUOTAS
    cell_content: CellContents | None = None
