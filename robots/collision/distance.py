"""Distances of an arm to itself and to the obstacles around it, in one position."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import coal
import numpy as np

from robots.bodies.geometry import TOUCH_M, Body, transform
from robots.bodies.self_collision import nearest_pair, touching_pairs
from robots.collision.cell import Arm, Cell, surroundings_of
from robots.collision.floor import heights_above
from robots.collision.obstacles import Obstacles, least_distances, placed_boxes
from robots.descriptions.cells import FLOOR
from robots.kinematics.joints import FloatArray
from robots.kinematics.model import link_placements


@dataclass(frozen=True, eq=False)
class Nearest:
    """Two bodies and their distance.

    Attributes:
        pair: The bodies: "<robot>/<link>", "<fixture>" or FLOOR.
        distance_m: 0 if they touch.
        points: (3,) the contact point or nearest point on each, in the site's frame [m].
    """

    pair: tuple[str, str]
    distance_m: float
    points: tuple[FloatArray, FloatArray]


class Gauge:
    """Distance measurement of two bodies, with coal's workspace."""

    def __init__(self) -> None:
        self._request = coal.DistanceRequest()
        self._result = coal.DistanceResult()

    def distance(self, one: Body, one_at: Any, other: Body, other_at: Any) -> float:
        """Return the distance of two bodies [m]; 0 if they touch.

        Args:
            one_at, other_at: Coal's form of their placements.
        """
        self._result.clear()
        found = coal.distance(one.geometry, one_at, other.geometry, other_at, self._request, self._result)
        return 0.0 if found <= TOUCH_M else float(found)

    def bound(self, one: Body, one_at: Any, other: Body, other_at: Any) -> float:
        """Return a lower bound of `distance`, from the hulls of two surfaces; 0 only if they touch."""
        if one.hull is not None and other.hull is not None:
            self._result.clear()
            found = coal.distance(one.hull, one_at, other.hull, other_at, self._request, self._result)
            if found > TOUCH_M:
                return float(found)
        return self.distance(one, one_at, other, other_at)

    def points(self, one: Body, one_at: Any, other: Body, other_at: Any) -> tuple[FloatArray, FloatArray]:
        """Return the contact or nearest point (3,) on each of the bodies of the last `distance` call [m]."""
        found = self._result
        if found.min_distance <= TOUCH_M:
            # Coal's distance gives no points for surfaces that touch.
            contact = coal.CollisionResult()
            request = coal.CollisionRequest(coal.CONTACT, 1)
            if coal.collide(one.geometry, one_at, other.geometry, other_at, request, contact):
                found = contact.getContact(0)
        return np.array(found.getNearestPoint1()), np.array(found.getNearestPoint2())

    def nearest(self, some: Obstacles, one: int, others: Obstacles, other: int) -> Nearest:
        """Measure two bodies, given by their numbers."""
        bodies = some.bodies[one], others.bodies[other]
        places = transform(some.placements[one]), transform(others.placements[other])
        distance = self.distance(bodies[0], places[0], bodies[1], places[1])
        points = self.points(bodies[0], places[0], bodies[1], places[1])
        return Nearest((some.names[one], others.names[other]), distance, points)


def nearest_per_pair(found: Iterable[Nearest]) -> tuple[Nearest, ...]:
    """Return the nearest result of each pair, nearest first."""
    pairs: dict[tuple[str, str], Nearest] = {}
    for each in sorted(found, key=lambda each: each.distance_m):
        pairs.setdefault(each.pair, each)
    return tuple(pairs.values())


def arm_obstacles(arm: Arm, positions: FloatArray) -> Obstacles:
    """Return the bodies of an arm with their placements.

    Raises:
        JointCountError: If there is not one value per joint.
    """
    return Obstacles(arm.names, arm.bodies, _placements(arm, positions), arm.moving, arm.bounds)


def _placements(arm: Arm, positions: FloatArray) -> FloatArray:
    """Return the placements of an arm's bodies: (b, 4, 4), body to site [m]."""
    placements: FloatArray = (arm.base_to_site @ link_placements(arm.model, positions))[arm.links]
    return placements


def own_contacts(cell: Cell, robot: str, positions: FloatArray) -> tuple[Nearest, ...]:
    """Return the links of an arm that touch each other, except neighbours and ignored pairs.

    Args:
        positions: (n,) joint positions [rad] or [m].

    Raises:
        JointCountError: If there is not one value per joint.
    """
    arm = cell.arms[robot]
    touching = touching_pairs(arm.own, arm.model, positions)
    return nearest_per_pair(_self_pair(arm, number, 0.0, points) for number, points in touching.items())


def own_nearest(cell: Cell, robot: str, positions: FloatArray) -> Nearest | None:
    """Return the nearest pair of an arm's links; None if no pair is checked.

    Args:
        positions: (n,) joint positions [rad] or [m].

    Raises:
        JointCountError: If there is not one value per joint.
    """
    arm = cell.arms[robot]
    found = nearest_pair(arm.own, arm.model, positions)
    if found is None:
        return None
    if found[1] <= TOUCH_M and (touching := own_contacts(cell, robot, positions)):
        return touching[0]  # coal's distance gives no points for surfaces that touch
    return _self_pair(arm, *found)


def _self_pair(arm: Arm, number: int, distance_m: float, points: tuple[FloatArray, FloatArray]) -> Nearest:
    one, other = arm.own.pairs[number]
    rotation, origin = arm.base_to_site[:3, :3], arm.base_to_site[:3, 3]
    in_site = rotation @ points[0] + origin, rotation @ points[1] + origin
    return Nearest((arm.names[one], arm.names[other]), distance_m, in_site)


def outside_nearest(
    cell: Cell,
    robot: str,
    positions: FloatArray,
    others: Mapping[str, FloatArray],
    *,
    within_m: float | None = None,
) -> tuple[Nearest, ...]:
    """Return the distances of an arm to fixtures and other robots' links; one per pair, nearest first.

    The floor is included if it has a warning distance. Two bodies that do not move (base links and fixtures)
    are not checked against each other.

    Args:
        positions: (n,) joint positions [rad] or [m].
        others: Positions of the other robots of the cell to check against; the rest are left out.
        within_m: Leave out pairs that are farther apart; they cost nothing.

    Raises:
        JointCountError: If there is not one value per joint.
    """
    at, around, least = _distance_bounds(cell, robot, positions, others)
    gauge = Gauge()
    reach = np.inf if within_m is None else within_m
    pairs = np.argwhere((least <= reach) & np.isfinite(least)).tolist()
    measured = [gauge.nearest(at, one, around, other) for one, other in pairs]
    found = nearest_per_pair([*measured, *_above_floor(cell, robot, at)])
    return tuple(each for each in found if each.distance_m <= reach)


def outside_clearance(
    cell: Cell, robot: str, positions: FloatArray, others: Mapping[str, FloatArray]
) -> Nearest | None:
    """Return the first result of `outside_nearest`, faster than all of them; None without obstacles.

    Raises:
        JointCountError: If there is not one value per joint.
    """
    at, around, least = _distance_bounds(cell, robot, positions, others)
    gauge = Gauge()
    found = min(_above_floor(cell, robot, at), key=lambda each: each.distance_m, default=None)
    for number in least.argsort(axis=None).tolist():
        one, other = divmod(number, len(around))
        if least[one, other] >= (np.inf if found is None else found.distance_m):
            break
        measured = gauge.nearest(at, one, around, other)
        if found is None or measured.distance_m < found.distance_m:
            found = measured
    return found


def _above_floor(cell: Cell, robot: str, at: Obstacles) -> list[Nearest]:
    """Return the heights of an arm's moving bodies above the floor; empty without a warning distance."""
    if cell.floor is None or cell.floor.warning_m <= 0.0:
        return []
    found = heights_above(cell.floor, cell.arms[robot], at.placements[None])
    below = found.points[0].copy()
    below[:, 2] = cell.floor.height_m
    return [
        Nearest((at.names[body], FLOOR), max(float(height), 0.0), (point, foot))
        for body, height, point, foot in zip(
            found.bodies.tolist(), found.heights[0], found.points[0], below, strict=True
        )
    ]


def _distance_bounds(
    cell: Cell, robot: str, positions: FloatArray, others: Mapping[str, FloatArray]
) -> tuple[Obstacles, Obstacles, FloatArray]:
    """Return an arm, its obstacles and lower bounds of their distances (a, b): infinite if unchecked."""
    at = arm_obstacles(cell.arms[robot], positions)
    surroundings = surroundings_of(cell, robot, others)
    placements = [_placements(arm, others[arm.name]) for arm in surroundings.arms]
    around = replace(
        surroundings.obstacles, placements=np.concatenate([cell.fixtures.placements, *placements])
    )
    if not len(at) or not len(around):
        return at, around, np.full((len(at), len(around)), np.inf)
    boxes = placed_boxes(around.bounds, around.placements)
    least = least_distances(cell.arms[robot].balls, at.placements, boxes)
    least[~surroundings.checked] = np.inf
    return at, around, least
