"""Does an arm touch itself: pairs of its links, all in one call of Pinocchio's."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
import pinocchio as pin

from robots.collision.bodies import TOUCH_M, Body
from robots.collision.sampling import are_neighbours
from robots.joints import FloatArray
from robots.model import RobotModel, all_positions
from robots.schema import RobotDescription
from robots.tree import Tree

Points = tuple[FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class OwnPairs:
    """Bodies of one arm that are checked against each other.

    Attributes:
        pairs: Numbers of both bodies, in the order of Pinocchio's results.
    """

    pairs: tuple[tuple[int, int], ...]
    geometry: Any
    workspace: Any


def own_pairs(description: RobotDescription, tree: Tree, bodies: Sequence[tuple[int, Body]]) -> OwnPairs:
    """All pairs but those of neighbours (one joint apart), and those that the description leaves out.

    Args:
        bodies: Each with the number of its link.
    """
    geometry = pin.GeometryModel()
    for number, (link_number, body) in enumerate(bodies):
        link = tree.links[link_number]
        geometry.addGeometryObject(
            # Pinocchio counts joints from 1; its 0 is the base.
            pin.GeometryObject(str(number), link.joint + 1, pin.SE3(link.link_to_joint), body.geometry)
        )
    ignored = {frozenset(pair) for pair in description.collision.ignore}
    pairs = []
    for one, other in combinations(range(len(bodies)), 2):
        first, second = tree.links[bodies[one][0]], tree.links[bodies[other][0]]
        if are_neighbours(tree, first.joint, second.joint) or {first.name, second.name} in ignored:
            continue
        pairs.append((one, other))
        geometry.addCollisionPair(pin.CollisionPair(one, other))
    workspace = pin.GeometryData(geometry)
    for request in workspace.collisionRequests:
        request.security_margin = TOUCH_M
        request.enable_contact = True
    return OwnPairs(tuple(pairs), geometry, workspace)


def touching_pairs(own: OwnPairs, model: RobotModel, positions: FloatArray) -> dict[int, Points]:
    """Numbers of the pairs that touch, and where: (3,) on each, in the base frame [m].

    Raises:
        JointCountError: If there is not one value a joint.
    """
    everywhere = all_positions(model, positions)
    if not pin.computeCollisions(
        model._pinocchio, model._workspace, own.geometry, own.workspace, everywhere, False
    ):
        return {}
    return {
        number: _points(result.getContact(0))
        for number, result in enumerate(own.workspace.collisionResults)
        if result.isCollision()
    }


def nearest_pair(own: OwnPairs, model: RobotModel, positions: FloatArray) -> tuple[int, float, Points] | None:
    """Number of the pair that is nearest, its distance [m], and where, as `touching_pairs`; None: no pairs.

    Raises:
        JointCountError: If there is not one value a joint.
    """
    if not own.pairs:
        return None
    everywhere = all_positions(model, positions)
    pin.computeDistances(model._pinocchio, model._workspace, own.geometry, own.workspace, everywhere)
    results = own.workspace.distanceResults
    distances = [result.min_distance for result in results]
    least = min(distances)
    number = distances.index(least)
    return number, least, _points(results[number])


def _points(found: Any) -> Points:
    return np.array(found.getNearestPoint1()), np.array(found.getNearestPoint2())
