"""Does an arm touch itself: pairs of its links, all in one call of Pinocchio's."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from robots.collision.bodies import TOUCH_M, Body
from robots.joints import FloatArray
from robots.model import RobotModel, all_positions
from robots.tree import Tree

Points = tuple[FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class OwnPairs:
    """Bodies of one arm that are checked against each other.

    Attributes:
        pairs: Numbers of both bodies among the arm's, in the order of Pinocchio's results.
        measured: What is checked of each pair: the hulls, or the exact meshes.
    """

    pairs: tuple[tuple[int, int], ...]
    measured: tuple[tuple[Body, Body], ...]
    geometry: Any
    workspace: Any


Pairs = Sequence[tuple[int, int, tuple[Body, Body]]]


def own_pairs(tree: Tree, bodies: Sequence[tuple[int, Body]], pairs: Pairs) -> OwnPairs:
    """The workspace for checks of an arm's own pairs.

    Args:
        bodies: Each with the number of its link.
        pairs: Numbers of two bodies, and what is checked of them: themselves, or their exact meshes.
    """
    geometry = pin.GeometryModel()
    numbers: dict[tuple[int, int], int] = {}

    def added(number: int, body: Body) -> int:
        if (number, id(body)) not in numbers:
            link = tree.links[bodies[number][0]]
            numbers[number, id(body)] = geometry.addGeometryObject(
                # Pinocchio counts joints from 1; its 0 is the base.
                pin.GeometryObject(
                    str(len(numbers)), link.joint + 1, pin.SE3(link.link_to_joint), body.geometry
                )
            )
        return numbers[number, id(body)]

    for one, other, (first, second) in pairs:
        geometry.addCollisionPair(pin.CollisionPair(added(one, first), added(other, second)))
    workspace = pin.GeometryData(geometry)
    for request in workspace.collisionRequests:
        request.security_margin = TOUCH_M
        request.enable_contact = True
    return OwnPairs(
        tuple((one, other) for one, other, _ in pairs),
        tuple(measured for _, _, measured in pairs),
        geometry,
        workspace,
    )


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
