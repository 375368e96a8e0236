"""The robots of one cell that this gateway has: where each is, and where it has been told to go."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass

from robomesh import reason_codes as codes
from robomesh.reasons import Reason


@dataclass(frozen=True)
class Occupancy:
    """What a robot may take up from now on.

    Attributes:
        path: Where it is, then each place that it has been told to go to, in order [rad] or [m].
        unknown: Why it is not known; then `path` is empty. None: it is known.
    """

    path: tuple[tuple[float, ...], ...] = ()
    unknown: Reason | None = None


class CellOccupancy:
    """Robots that can meet.

    Attributes:
        motion_lock: Held from a motion's check until its unit is on the controller's socket. One motion at a
            time is admitted, so the other robots are still where the check assumed them when it begins.
    """

    def __init__(self) -> None:
        self.motion_lock = asyncio.Lock()
        self._robots: dict[str, Callable[[], Occupancy]] = {}

    def add(self, name: str, occupancy: Callable[[], Occupancy]) -> None:
        """Another robot of the cell."""
        self._robots[name] = occupancy

    def others(self, name: str, cell: tuple[str, ...]) -> dict[str, Occupancy]:
        """Where the cell's robots but one are; what no robot of this gateway is, unserved here knows."""
        unserved = Occupancy(unknown=codes.OTHER_NOT_SERVED())
        return {
            other: self._robots[other]() if other in self._robots else unserved
            for other in cell
            if other != name
        }
