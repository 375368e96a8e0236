"""Where the arms of a cell are as far as anybody knows, and how near they are to things."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from robots.collision import Cell, Nearest, outside_clearance, outside_nearest, own_nearest
from robots.joints import FloatArray
from services.kinematics.conditions import far_from


@dataclass(frozen=True, eq=False)
class Near:
    """How near an arm is to things.

    Attributes:
        own: The nearest two of its links; None: it has no such pair.
        outside: The nearest of fixtures and other robots, its own end first; None: nothing is around.
        close: All that is within the arm's warning distance, or nearly, nearest first.
        not_counted: Other robots that are left out: nobody knows where they are now.
    """

    own: Nearest | None
    outside: Nearest | None
    close: tuple[Nearest, ...]
    not_counted: tuple[str, ...]


@dataclass
class _Arm:
    """The newest of an arm.

    Attributes:
        told_at: When its positions came [s].
        seen: What was near, and where everything was then.
    """

    fresh_for_s: float
    positions: FloatArray | None = None
    told_at: float = 0.0
    seen: tuple[tuple[object, ...], Near] | None = None


class Place:
    """The newest positions of a cell's robots. One thread at a time.

    Args:
        fresh_for_s: How long each robot's positions count, by name [s].
        now_s: A clock that never goes back.
    """

    def __init__(self, fresh_for_s: Mapping[str, float], now_s: Callable[[], float]) -> None:
        self._arms = {name: _Arm(seconds) for name, seconds in fresh_for_s.items()}
        self._now_s = now_s

    def take(self, robot: str, positions: FloatArray) -> None:
        """An arm told where it is."""
        arm = self._arms[robot]
        arm.positions, arm.told_at = positions, self._now_s()

    def positions(self, robot: str) -> FloatArray | None:
        """Where an arm is, (n,) [rad] or [m]; None: nobody knows now."""
        arm = self._arms[robot]
        return arm.positions if self._now_s() - arm.told_at <= arm.fresh_for_s else None

    def others(self, robot: str) -> tuple[dict[str, FloatArray], tuple[str, ...]]:
        """Where the other arms are, and the names of those of which nobody knows."""
        known, unknown = {}, []
        for name in self._arms:
            if name == robot:
                continue
            if (positions := self.positions(name)) is None:
                unknown.append(name)
            else:
                known[name] = positions
        return known, tuple(unknown)

    def near(self, cell: Cell, robot: str, positions: FloatArray) -> Near:
        """How near an arm is to things; looked at anew only where something has moved."""
        arm = self._arms[robot]
        others, unknown = self.others(robot)
        where = positions.tobytes(), *((name, there.tobytes()) for name, there in others.items()), unknown
        if arm.seen is None or arm.seen[0] != where:
            was_close = arm.seen is not None and bool(arm.seen[1].close)
            outside, close = _outside(cell, robot, positions, others, was_close=was_close)
            arm.seen = where, Near(own_nearest(cell, robot, positions), outside, close, unknown)
        return arm.seen[1]


def _outside(
    cell: Cell, robot: str, positions: FloatArray, others: Mapping[str, FloatArray], *, was_close: bool
) -> tuple[Nearest | None, tuple[Nearest, ...]]:
    """What is nearest, and all that is close, by one survey where nothing has changed in that."""
    floor = [cell.floor.warning_m] if cell.floor is not None else []
    far = far_from(max([*floor, *(arm.warning_m for arm in cell.arms.values())]))
    close = outside_nearest(cell, robot, positions, others, within_m=far) if was_close else ()
    if close:
        return close[0], close
    nearest = outside_clearance(cell, robot, positions, others)
    if not was_close and nearest is not None and nearest.distance_m <= far:
        close = outside_nearest(cell, robot, positions, others, within_m=far)
    return nearest, close
