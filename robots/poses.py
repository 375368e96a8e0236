"""Placements as 4x4 matrices: translations, roll-pitch-yaw, D-H rows."""

import numpy as np
from numpy.typing import NDArray

from robots.schema import Pose, Units
from robots.units import angle_factor, length_factor

FloatArray = NDArray[np.float64]


def pose_matrix(pose: Pose, units: Units) -> FloatArray:
    """(4, 4) of a pose of the file, in metres: Trans(xyz) Rot(z, yaw) Rot(y, pitch) Rot(x, roll)."""
    placement = np.eye(4)
    placement[:3, :3] = rpy_rotation(*(angle * angle_factor(units) for angle in pose.rpy))
    placement[:3, 3] = np.multiply(pose.xyz, length_factor(units))
    return placement


def rpy_rotation(roll: float, pitch: float, yaw: float) -> FloatArray:
    """(3, 3) of roll, pitch and yaw [rad] about the fixed x, y and z axes, in this order (as URDF)."""
    cr, sr, cp, sp, cy, sy = (
        np.cos(roll),
        np.sin(roll),
        np.cos(pitch),
        np.sin(pitch),
        np.cos(yaw),
        np.sin(yaw),
    )
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def axis_rotation(axes: FloatArray, angles: FloatArray | float) -> FloatArray:
    """(..., 3, 3) of turns about (..., 3) axes of any length by (...) angles [rad]: Rodrigues' formula.

    An axis of 0 turns nothing.
    """
    lengths = np.linalg.norm(axes, axis=-1, keepdims=True)
    axes = np.divide(axes, lengths, out=np.zeros_like(axes), where=lengths > 0)
    cross = np.zeros((*axes.shape[:-1], 3, 3))
    for axis in range(3):
        one, other = (axis + 1) % 3, (axis + 2) % 3
        cross[..., other, one] = axes[..., axis]
        cross[..., one, other] = -axes[..., axis]
    by = np.asarray(angles)[..., None, None]
    result: FloatArray = np.eye(3) + np.sin(by) * cross + (1 - np.cos(by)) * (cross @ cross)
    return result


def rotation_rpy(rotation: FloatArray) -> tuple[float, float, float]:
    """Roll, pitch and yaw [rad] of a (3, 3) rotation; at pitch ±90°, roll is zero."""
    pitch = float(np.arctan2(-rotation[2, 0], np.hypot(rotation[0, 0], rotation[1, 0])))
    if np.hypot(rotation[0, 0], rotation[1, 0]) < 1e-12:
        # Only roll ∓ yaw is determined: all of it goes to yaw.
        return 0.0, pitch, float(np.arctan2(-rotation[0, 1], rotation[1, 1]))
    roll = float(np.arctan2(rotation[2, 1], rotation[2, 2]))
    return roll, pitch, float(np.arctan2(rotation[1, 0], rotation[0, 0]))


def inverse(placement: FloatArray) -> FloatArray:
    """(4, 4) of a placement's inverse."""
    back = np.eye(4)
    back[:3, :3] = placement[:3, :3].T
    back[:3, 3] = -placement[:3, :3].T @ placement[:3, 3]
    return back


def dh_fixed_part(d: float, a: float, alpha: float) -> FloatArray:
    """(4, 4) of `Trans(0, 0, d) Trans(a, 0, 0) Rot(x, alpha)`: a D-H row behind its rotation about z."""
    placement = np.eye(4)
    placement[:3, :3] = rpy_rotation(alpha, 0.0, 0.0)
    placement[:3, 3] = (a, 0.0, d)
    return placement
