"""Last known positions of a cell's arms, and their clearances."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass

from robots.collision import Cell, Nearest, outside_clearance, outside_nearest, own_nearest
from robots.kinematics.joints import FloatArray
from services.kinematics.conditions import deadband_end


@dataclass(frozen=True, eq=False)
class Proximity:
    """Clearances of an arm.

    Attributes:
        own: The nearest pair of its links; None if no pair is checked.
        outside: The nearest fixture or other robot, the arm's own end first; None if there is none.
        close: All pairs within the warning distance or its deadband, nearest first.
        not_counted: Other robots that are left out because their positions are unknown.
    """

    own: Nearest | None
    outside: Nearest | None
    close: tuple[Nearest, ...]
    not_counted: tuple[str, ...]


@dataclass
class _Arm:
    """The newest state of an arm.

    Attributes:
        received_at: Receive time of its positions [s].
        unproven: Its joints may not be those of the model: its positions are not used.
        cached: Its last clearances, and the positions that they were computed for.
    """

    fresh_for_s: float
    unproven: bool
    positions: FloatArray | None = None
    received_at: float = 0.0
    cached: tuple[tuple[object, ...], Proximity] | None = None


class CellState:
    """The newest positions of a cell's robots. Not thread-safe.

    Args:
        fresh_for_s: Time until a robot's positions are stale, by name [s].
        now_s: Monotonic clock.
        real: Names of the robots that are not simulated: their joints are unproven until `update_proof`.
    """

    def __init__(
        self, fresh_for_s: Mapping[str, float], now_s: Callable[[], float], *, real: Collection[str] = ()
    ) -> None:
        self._arms = {name: _Arm(seconds, unproven=name in real) for name, seconds in fresh_for_s.items()}
        self._now_s = now_s

    def update(self, robot: str, positions: FloatArray) -> None:
        """Store the positions that an arm reported."""
        arm = self._arms[robot]
        arm.positions, arm.received_at = positions, self._now_s()

    def update_proof(self, robot: str, *, unproven: bool) -> None:
        """Store whether an arm's joints are unproven."""
        self._arms[robot].unproven = unproven

    def is_unproven(self, robot: str) -> bool:
        """Return whether an arm's joints are unproven."""
        return self._arms[robot].unproven

    def positions(self, robot: str) -> FloatArray | None:
        """Return an arm's positions (n,) [rad] or [m]; None if they are unknown, unproven or stale."""
        arm = self._arms[robot]
        if arm.unproven:
            return None
        return arm.positions if self._now_s() - arm.received_at <= arm.fresh_for_s else None

    def others(self, robot: str) -> tuple[dict[str, FloatArray], tuple[str, ...]]:
        """Return the known positions of the other arms, and the names of the arms at unknown positions."""
        known, unknown = {}, []
        for name in self._arms:
            if name == robot:
                continue
            if (positions := self.positions(name)) is None:
                unknown.append(name)
            else:
                known[name] = positions
        return known, tuple(unknown)

    def proximity(self, cell: Cell, robot: str, positions: FloatArray) -> Proximity:
        """Return an arm's clearances; they are computed again only after a robot or the cell has changed."""
        arm = self._arms[robot]
        others, unknown = self.others(robot)
        key = cell, positions.tobytes(), *((name, other.tobytes()) for name, other in others.items()), unknown
        if arm.cached is None or arm.cached[0] != key:
            was_close = arm.cached is not None and bool(arm.cached[1].close)
            outside, close = _outside(cell, robot, positions, others, was_close=was_close)
            arm.cached = key, Proximity(own_nearest(cell, robot, positions), outside, close, unknown)
        return arm.cached[1]


def _outside(
    cell: Cell, robot: str, positions: FloatArray, others: Mapping[str, FloatArray], *, was_close: bool
) -> tuple[Nearest | None, tuple[Nearest, ...]]:
    """Return the nearest outside pair and all close ones.

    `was_close` chooses which query runs first, so that a steady state costs one query.
    """
    floor = [cell.floor.warning_m] if cell.floor is not None else []
    far = deadband_end(max([*floor, *(arm.warning_m for arm in cell.arms.values())]))
    close = outside_nearest(cell, robot, positions, others, within_m=far) if was_close else ()
    if close:
        return close[0], close
    nearest = outside_clearance(cell, robot, positions, others)
    if not was_close and nearest is not None and nearest.distance_m <= far:
        close = outside_nearest(cell, robot, positions, others, within_m=far)
    return nearest, close
