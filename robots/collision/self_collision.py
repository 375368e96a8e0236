"""Does an arm touch itself: pairs of its links, all in one call of Pinocchio's."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from robots.collision.geometry import TOUCH_M, Body
from robots.joints import FloatArray
from robots.kinematic_tree import Tree
from robots.model import RobotModel, all_positions

Points = tuple[FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class OwnPairs:
    """Bodies of one arm that are checked against each other.

    Attributes:
        pairs: Numbers of both bodies among the arm's, in the order of Pinocchio's results.
        measured: What is checked of each pair: the hulls, or the exact meshes.
        geometry, workspace: Pinocchio's, of what is measured.
        hulls, hulls_workspace: The same with hulls instead of meshes, for the pairs `meshes`.
    """

    pairs: tuple[tuple[int, int], ...]
    measured: tuple[tuple[Body, Body], ...]
    geometry: Any
    workspace: Any
    hulls: Any
    hulls_workspace: Any
    meshes: tuple[int, ...]


Pairs = Sequence[tuple[int, int, tuple[Body, Body]]]


def own_pairs(tree: Tree, bodies: Sequence[tuple[int, Body]], pairs: Pairs) -> OwnPairs:
    """The workspace for checks of an arm's own pairs.

    Args:
        bodies: Each with the number of its link.
        pairs: Numbers of two bodies, and what is checked of them: themselves, or their exact meshes.
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
    return OwnPairs(
        tuple((one, other) for one, other, _ in pairs),
        tuple(measured for _, _, measured in pairs),
        geometry,
        workspace,
        hulls,
        pin.GeometryData(hulls),
        tuple(number for number, (_, _, (body, _)) in enumerate(pairs) if body.hull is not None),
    )


def touching_pairs(own: OwnPairs, model: RobotModel, positions: FloatArray) -> dict[int, Points]:
    """Numbers of the pairs that touch, and where: (3,) on each, in the base frame [m].

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


def nearest_pair(own: OwnPairs, model: RobotModel, positions: FloatArray) -> tuple[int, float, Points] | None:
    """Number of the pair that is nearest, its distance [m], and where, as `touching_pairs`; None: no pairs.

    Raises:
        JointCountError: If there is not one value per joint.
    """
    if not own.pairs:
        return None
    everywhere = all_positions(model, positions)
    inner, data = model._pinocchio, model._workspace
    pin.computeDistances(inner, data, own.hulls, own.hulls_workspace, everywhere)
    results = list(own.hulls_workspace.distanceResults)
    distances = np.array([result.min_distance for result in results])
    pin.updateGeometryPlacements(inner, data, own.geometry, own.workspace)
    # No mesh is nearer than its hull: only pairs whose hulls are nearest are measured as meshes.
    left = set(own.meshes)
    while (number := int(distances.argmin())) in left:
        left.remove(number)
        results[number] = pin.computeDistance(own.geometry, own.workspace, number)
        distances[number] = results[number].min_distance
    return number, float(distances[number]), _points(results[number])


def _points(found: Any) -> Points:
    return np.array(found.getNearestPoint1()), np.array(found.getNearestPoint2())
