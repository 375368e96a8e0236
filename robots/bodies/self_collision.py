"""Self-collision of an arm: all pairs of its links in one call of Pinocchio."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from robots.bodies.geometry import TOUCH_M, Body
from robots.kinematics.joints import FloatArray
from robots.kinematics.kinematic_tree import Tree
from robots.kinematics.model import RobotModel, all_positions

Points = tuple[FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class SelfPairs:
    """Pairs of one arm's bodies that are checked against each other.

    Attributes:
        pairs: Numbers of both bodies among the arm's, in the order of Pinocchio's results.
        measured: The checked bodies of each pair: hulls or exact surfaces.
        geometry, workspace: Pinocchio's models of the measured bodies.
        hulls, hulls_workspace: The same with hulls instead of surfaces, for the pairs `exact`.
    """

    pairs: tuple[tuple[int, int], ...]
    measured: tuple[tuple[Body, Body], ...]
    geometry: Any
    workspace: Any
    hulls: Any
    hulls_workspace: Any
    exact: tuple[int, ...]


Pairs = Sequence[tuple[int, int, tuple[Body, Body]]]


def self_pairs(tree: Tree, bodies: Sequence[tuple[int, Body]], pairs: Pairs) -> SelfPairs:
    """Prepare the self-collision check of an arm.

    Args:
        bodies: Each with the number of its link.
        pairs: Numbers of two bodies, and the bodies to check: themselves or their exact surfaces.
    """
    geometry, hulls = pin.GeometryModel(), pin.GeometryModel()
    numbers: dict[tuple[int, int], int] = {}

    def added(number: int, body: Body) -> int:
        if (number, id(body)) not in numbers:
            link = tree.links[bodies[number][0]]
            # Pinocchio counts joints from 1; its 0 is the base.
            place = str(len(numbers)), link.joint + 1, pin.SE3(link.link_to_joint)
            numbers[number, id(body)] = geometry.addGeometryObject(pin.GeometryObject(*place, body.geometry))
            hulls.addGeometryObject(pin.GeometryObject(*place, body.hull or body.geometry))
        return numbers[number, id(body)]

    for one, other, (first, second) in pairs:
        pair = pin.CollisionPair(added(one, first), added(other, second))
        geometry.addCollisionPair(pair)
        hulls.addCollisionPair(pair)
    workspace = pin.GeometryData(geometry)
    for request in workspace.collisionRequests:
        request.security_margin = TOUCH_M
        request.enable_contact = True
    return SelfPairs(
        tuple((one, other) for one, other, _ in pairs),
        tuple(measured for _, _, measured in pairs),
        geometry,
        workspace,
        hulls,
        pin.GeometryData(hulls),
        tuple(number for number, (_, _, (body, _)) in enumerate(pairs) if body.hull is not None),
    )


def touching_pairs(own: SelfPairs, model: RobotModel, positions: FloatArray) -> dict[int, Points]:
    """Return the touching pairs by number, with a contact point (3,) on each body, in the base frame [m].

    Raises:
        JointCountError: If there is not one value per joint.
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


def nearest_pair(
    own: SelfPairs, model: RobotModel, positions: FloatArray
) -> tuple[int, float, Points] | None:
    """Return the number of the nearest pair, its distance [m] and its points; None without pairs.

    Raises:
        JointCountError: If there is not one value per joint.
    """
    if not own.pairs:
        return None
    everywhere = all_positions(model, positions)
    inner, data = model._pinocchio, model._workspace
    nearest = pin.computeDistances(inner, data, own.hulls, own.hulls_workspace, everywhere)
    if nearest not in own.exact:
        result = own.hulls_workspace.distanceResults[nearest]
        return nearest, result.min_distance, _points(result)
    results = list(own.hulls_workspace.distanceResults)
    distances = np.array([result.min_distance for result in results])
    pin.updateGeometryPlacements(inner, data, own.geometry, own.workspace)
    # A surface is never nearer than its hull, so measure as surfaces only the pairs with the nearest hulls.
    left = set(own.exact)
    while (number := int(distances.argmin())) in left:
        left.remove(number)
        results[number] = pin.computeDistance(own.geometry, own.workspace, number)
        distances[number] = results[number].min_distance
    return number, float(distances[number]), _points(results[number])


def _points(found: Any) -> Points:
    return np.array(found.getNearestPoint1()), np.array(found.getNearestPoint2())
