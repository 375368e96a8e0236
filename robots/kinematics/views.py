"""Cameras of a description, in SI, with default top, front and left views."""

from dataclasses import dataclass

import numpy as np

from robots.kinematics.joints import FloatArray, joints_of
from robots.kinematics.kinematic_tree import chain_to, tool_frame, tree_of
from robots.schema.robot_toml import JointType, RobotDescription
from robots.schema.units import length_factor

# A robot that is being defined has a reach of zero while all its rows are zero.
_LEAST_M = 0.25


@dataclass(frozen=True, eq=False)
class View:
    """A camera in the base frame [m]; each vector is (3,)."""

    name: str
    eye: FloatArray
    target: FloatArray
    up: FloatArray
    orthographic: bool


def views_of(description: RobotDescription) -> tuple[View, ...]:
    """Return the top, front and left views, then the description's other views.

    The front view looks along -x at the base; the left view looks from positive y; up in the top view is y.
    """
    metres = length_factor(description.units)
    given = {
        name: View(
            name=name,
            eye=np.multiply(view.eye, metres),
            target=np.multiply(view.target, metres),
            up=np.array(view.up),
            orthographic=view.projection == "orthographic",
        )
        for name, view in description.views.items()
    }
    return tuple((default_views(description) | given).values())


def default_views(description: RobotDescription) -> dict[str, View]:
    """Return orthographic top, front and left views, far enough away to have the whole reach in front."""
    size = max(reach(description), _LEAST_M)
    target = np.array([0.0, 0.0, 0.45 * size])
    directions = {
        "top": ((0, 0, 1), (0, 1, 0)),
        "front": ((1, 0, 0), (0, 0, 1)),
        "left": ((0, 1, 0), (0, 0, 1)),
    }
    return {
        name: View(
            name, target + 3.0 * size * np.array(direction), target, np.array(up, dtype=np.float64), True
        )
        for name, (direction, up) in directions.items()
    }


def reach(description: RobotDescription) -> float:
    """Return an upper bound of the distance of any link frame or the tool from the base's origin [m]."""
    tree = tree_of(description)
    joints = joints_of(description)
    strokes = [0.0] * len(tree.joints)
    for number, lower, upper in zip(tree.free, joints.lower, joints.upper, strict=True):
        if tree.joints[number].type is JointType.PRISMATIC:
            strokes[number] = max(abs(lower), abs(upper))
    link, tool_to_link = tool_frame(description)
    farthest = 0.0
    for one in tree.links:
        chain = chain_to(tree, one.joint)
        length = sum(float(np.linalg.norm(tree.joints[n].joint_to_parent[:3, 3])) + strokes[n] for n in chain)
        length += float(np.linalg.norm(one.link_to_joint[:3, 3]))
        length += float(np.linalg.norm(tool_to_link[:3, 3])) if one.name == link else 0.0
        farthest = max(farthest, length)
    return farthest
