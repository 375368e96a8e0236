"""The placement of a VRML node's children."""

import numpy as np

from robots.schema.poses import axis_rotation
from robots.shapes.files.vrml.parser import Node
from robots.shapes.files.vrml.values import numbers
from robots.shapes.geometry import FloatArray


def transform_matrix(node: Node) -> FloatArray:
    """Return the (4, 4) matrix of a Transform: `T C R SR S -SR -C` (6.52)."""
    given = node.fields
    matrix = np.eye(4)
    linear = matrix[:3, :3]
    if "scale" in given:
        linear *= numbers(node, "scale", [1, 1, 1], 3)
        if "scaleOrientation" in given:
            stretch = rotations(numbers(node, "scaleOrientation", [0, 0, 1, 0], 4))
            linear[:] = stretch @ linear @ stretch.T
    if "rotation" in given:
        linear[:] = rotations(numbers(node, "rotation", [0, 0, 1, 0], 4)) @ linear
    if "center" in given:
        center = numbers(node, "center", [0, 0, 0], 3)
        matrix[:3, 3] = center - linear @ center
    if "translation" in given:
        matrix[:3, 3] += numbers(node, "translation", [0, 0, 0], 3)
    return matrix


def rotations(axis_angles: FloatArray) -> FloatArray:
    """Return (..., 3, 3) rotations from (..., 4) axes of any length and angles [rad]; axis 0: no rotation."""
    return axis_rotation(axis_angles[..., :3], axis_angles[..., 3])
