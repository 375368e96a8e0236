"""The cameras of a description, in SI: those that it names, and top, front and left where it does not."""

from dataclasses import dataclass

import numpy as np

from robots.joints import FloatArray, joints_of, length_factor
from robots.schema import RobotDescription


@dataclass(frozen=True, eq=False)
class View:
    """A camera in the base frame [m]; each vector is (3,)."""

    name: str
    eye: FloatArray
    target: FloatArray
    up: FloatArray
    orthographic: bool


def views_of(description: RobotDescription) -> tuple[View, ...]:
    """Top, front and left first, then the description's others.

    The front looks back along x at the base; the left looks from positive y; up in the top view is y.
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
    """Orthographic top, front and left at a distance from which the whole arm's reach is in front."""
    size = reach(description)
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
    """How far from the base's origin any part of the tool frame's way can come [m]: an upper bound."""
    metres = length_factor(description.units)
    joints = joints_of(description)
    links = sum(np.hypot(joint.a, joint.d) for joint in description.joints) * metres
    strokes = sum(
        max(abs(lower), abs(upper))
        for lower, upper, kind in zip(joints.lower, joints.upper, joints.types, strict=True)
        if kind == "prismatic"
    )
    return float(links + strokes + np.linalg.norm(description.tool.xyz) * metres)
