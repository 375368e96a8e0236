"""D-H rows of a chain of joints: the rows that it was made from, else rows computed from its axes.

A chain is given at position zero: each joint's frame in the base frame, with z as the joint's axis.
Frames follow `robots.kinematics.kinematic_tree`: z of frame i is the axis of joint i + 1.

Source: Denavit, Hartenberg 1955; Paul 1981 for the standard form.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robots.kinematics.kinematic_tree import Tree, TreeJoint, TreeLink
from robots.schema.poses import FloatArray, dh_fixed_part, inverse, rpy_rotation
from robots.schema.robot_toml import JointType

# Axes within this angle count as parallel [rad]: people write 1.5708 for a right angle, and the common
# normal of two nearly parallel lines would be kilometres away.
_PARALLEL = 1e-4
# Rounding error of a length [m] or a sine that should be zero.
_ZERO = 1e-10


@dataclass(frozen=True)
class Row:
    """A standard D-H row, in m and rad."""

    a: float
    alpha: float
    d: float
    theta: float


def row_placement(row: Row) -> FloatArray:
    """Return the (4, 4) of a row at position zero: Rot(z, theta) Trans(z, d) Trans(x, a) Rot(x, alpha)."""
    turn = np.eye(4)
    turn[:3, :3] = rpy_rotation(0.0, 0.0, row.theta)
    return turn @ dh_fixed_part(row.d, row.a, row.alpha)


def axis_to_z(joint: TreeJoint) -> FloatArray:
    """Return the (4, 4) of a frame at the joint's origin with the joint's axis as z; identity if it is z."""
    placement = np.eye(4)
    if joint.axis[2] != 1.0:
        placement[:3, :3] = _frame_with_z(np.eye(3), joint.axis)
    return placement


def _frame_with_z(frame: FloatArray, z: FloatArray) -> FloatArray:
    """Return the (3, 3) with this z, and an x as close as possible to the frame's x."""
    x = frame[:, 0] - (frame[:, 0] @ z) * z
    if np.linalg.norm(x) < 0.1:  # x is nearly parallel to z; use y
        x = np.cross(frame[:, 1], z)
    x = x / np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def base_frame(first: FloatArray) -> FloatArray:
    """Return the (4, 4) of frame 0 for a first joint (4, 4): the base frame if its z is the joint's axis."""
    point, z = first[:3, 3], first[:3, 2]
    if np.hypot(*point[:2]) < _ZERO and np.hypot(*z[:2]) < _ZERO and z[2] > 0:
        return np.eye(4)
    frame = np.eye(4)
    frame[:3, :3] = _frame_with_z(np.eye(3), z)
    frame[:3, 3] = point - (point @ z) * z
    return frame


def rows_of_axes(base: FloatArray, axes: Sequence[FloatArray]) -> tuple[Row, ...]:
    """Return one row per joint; a, alpha, d and theta of the last row are zero.

    Args:
        base: (4, 4) frame 0; its z is the first joint's axis.
        axes: (4, 4) each joint's frame at position zero, with the joint's axis as z.
    """
    rows = []
    frame = base
    for following in axes[1:]:
        row = _row(frame, following[:3, 3], following[:3, 2])
        rows.append(row)
        frame = frame @ row_placement(row)
    return (*rows, Row(0.0, 0.0, 0.0, 0.0))


def _row(frame: FloatArray, point: FloatArray, axis: FloatArray) -> Row:
    """Return the row from a frame to the frame on the next joint's axis, given by a point and a direction."""
    # In the frame's coordinates, this joint's axis is the z axis through the origin.
    px, py, pz = frame[:3, :3].T @ (point - frame[:3, 3])
    ux, uy, uz = frame[:3, :3].T @ axis
    sine = float(np.hypot(ux, uy))
    if sine < _PARALLEL:
        # The common normal may be anywhere; take the one through the origin.
        alpha = 0.0 if uz > 0 else np.pi
        a = float(np.hypot(px, py))
        if a < _ZERO:
            return Row(0.0, alpha, 0.0, 0.0)
        return Row(a, alpha, 0.0, float(np.arctan2(py, px)))
    # The common normal's direction is z x axis; its foot on z is the point nearest to the other line.
    nx, ny = -uy / sine, ux / sine
    a = float(px * nx + py * ny)
    along = (px * ux + py * uy) / sine**2
    d = float(pz - along * uz)
    if abs(a) < _ZERO:
        a = 0.0
        flipped = nx < -_ZERO or (abs(nx) <= _ZERO and ny < 0)  # choose the smaller theta
    else:
        flipped = a < 0
    if flipped:
        nx, ny, a, sine = -nx, -ny, -a, -sine
    return Row(a, float(np.arctan2(sine, uz)), d, float(np.arctan2(ny, nx)))


def original_rows(
    tree: Tree, chain: Sequence[int], base: FloatArray
) -> tuple[tuple[Row, TreeLink], ...] | None:
    """Return the rows and links of a chain that was made from D-H rows; None for any other chain.

    Args:
        base: (4, 4) the frame in which the first row begins, in the base frame.
    """
    made: list[tuple[Row, TreeLink]] = []
    before = base
    for place, number in enumerate(chain):
        joint = tree.joints[number]
        if not np.allclose(joint.axis, (0.0, 0.0, 1.0), rtol=0, atol=_ZERO):
            return None
        start = inverse(before) @ joint.joint_to_parent
        following = tree.joints[chain[place + 1]] if place + 1 < len(chain) else None
        found = _link_of_row(tree, number, start, following)
        if found is None:
            return None
        made.append(found)
        before = found[1].link_to_joint
    return tuple(made)


def _link_of_row(
    tree: Tree, number: int, start: FloatArray, following: TreeJoint | None
) -> tuple[Row, TreeLink] | None:
    joint = tree.joints[number]
    rotary = joint.type is JointType.ROTARY
    for link in tree.links:
        if link.joint != number or link.name == f"{joint.name}_axis":
            continue
        fixed = link.link_to_joint
        theta = float(np.arctan2(start[1, 0], start[0, 0]))
        alpha = float(np.arctan2(fixed[2, 1], fixed[1, 1]))
        d = float(fixed[2, 3] if rotary else start[2, 3])
        row = Row(float(fixed[0, 3]), alpha, d, theta)
        turn = np.eye(4)
        turn[:3, :3] = rpy_rotation(0.0, 0.0, theta)
        turn[2, 3] = 0.0 if rotary else d
        body = dh_fixed_part(d if rotary else 0.0, row.a, alpha)
        fits = np.allclose(turn, start, rtol=0, atol=1e-14) and np.allclose(body, fixed, rtol=0, atol=1e-14)
        if fits and (following is None or _starts_on_z(fixed, following)):
            return row, link
    return None


def _starts_on_z(link_to_joint: FloatArray, following: TreeJoint) -> bool:
    """Return whether the next joint's frame is only rotated about and moved along the link's z."""
    step = inverse(link_to_joint) @ following.joint_to_parent
    return bool(np.abs([*step[:2, 3], *step[:2, 2], *step[2, :2]]).max() < 1e-14)
