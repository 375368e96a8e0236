"""The robots of one cell that this gateway has: where each is, and where it has been told to go."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass

from robomesh import reason_codes as codes
from robomesh.reasons import Reason


@dataclass(frozen=True)
class Whereabouts:
    """What a robot may take up from now on.

    Attributes:
        path: Where it is, then each place that it has been told to go to, in order [rad] or [m].
        unknown: Why it is not known; then `path` is empty. None: it is known.
    """

    path: tuple[tuple[float, ...], ...] = ()
    unknown: Reason | None = None


class CellMates:
    """Robots that can meet.

    Attributes:
        turn: Held from a motion's check until it is on its controller's socket: one motion at a time is
            admitted, so what was checked against the others is still so when it begins.
    """

    def __init__(self) -> None:
        self.turn = asyncio.Lock()
        self._robots: dict[str, Callable[[], Whereabouts]] = {}

    def join(self, name: str, whereabouts: Callable[[], Whereabouts]) -> None:
        """Another robot of the cell."""
        self._robots[name] = whereabouts

    def others(self, name: str, cell: tuple[str, ...]) -> dict[str, Whereabouts]:
        """Where the cell's robots but one are; what no robot of this gateway is, nobody here knows."""
        nobody = Whereabouts(unknown=codes.OTHER_NOT_SERVED())
        return {
            other: self._robots[other]() if other in self._robots else nobody
            for other in cell
            if other != name
        }
