"""Positions and commanded paths of the robots of one cell that this gateway serves."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass

from robomesh import reason_codes as codes
from robomesh.reasons import Reason


@dataclass(frozen=True)
class Occupancy:
    """Joint positions that a robot may occupy from now on.

    Attributes:
        path: Its actual positions, then each commanded target in order [rad] or [m].
        unknown: Reason why the path is unknown and `path` is empty; None: it is known.
    """

    path: tuple[tuple[float, ...], ...] = ()
    unknown: Reason | None = None


class CellOccupancy:
    """Occupancy of one cell by its robots.

    Attributes:
        motion_lock: Held from a motion's check until its unit is on the controller's socket. One motion at a
            time is admitted, so the other robots are still where the check assumed them when it begins.
        closed: Reason why no robot of the cell may be controlled or moved now: what stands in the cell
            changes; None: they may.
    """

    def __init__(self) -> None:
        self.motion_lock = asyncio.Lock()
        self.closed: Reason | None = None
        self._robots: dict[str, Callable[[], Occupancy]] = {}

    def add(self, name: str, occupancy: Callable[[], Occupancy]) -> None:
        """Add a robot of the cell."""
        self._robots[name] = occupancy

    def others(self, name: str, cell: tuple[str, ...]) -> dict[str, Occupancy]:
        """Return the occupancy of the cell's other robots, unknown for robots of another gateway."""
        unserved = Occupancy(unknown=codes.OTHER_NOT_SERVED())
        return {
            other: self._robots[other]() if other in self._robots else unserved
            for other in cell
            if other != name
        }
