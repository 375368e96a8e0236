"""Homogeneous transforms from translations, roll-pitch-yaw and D-H rows."""

import numpy as np
from numpy.typing import NDArray

from robots.schema.robot_toml import Pose, Units
from robots.schema.units import angle_factor, length_factor

FloatArray = NDArray[np.float64]


def pose_matrix(pose: Pose, units: Units) -> FloatArray:
    """Return the (4, 4) [m] of a pose in the file: Trans(xyz) Rot(z, yaw) Rot(y, pitch) Rot(x, roll)."""
    placement = np.eye(4)
    placement[:3, :3] = rpy_rotation(*(angle * angle_factor(units) for angle in pose.rpy))
    placement[:3, 3] = np.multiply(pose.xyz, length_factor(units))
    return placement


def rpy_rotation(roll: float, pitch: float, yaw: float) -> FloatArray:
    """Return the (3, 3) of roll, pitch and yaw [rad] about fixed x, y and z, in this order (as URDF)."""
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
    """Return the (..., 3, 3) of rotations about (..., 3) axes of any length by (...) angles [rad].

    An axis of length 0 gives the identity. Source: Rodrigues' formula.
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


def rotation_vector(rotation: FloatArray) -> FloatArray:
    """Return a (3, 3) rotation as its axis times its angle [rad], 0 to pi."""
    # By the quaternion: its largest component is never small, unlike the sine near 0 and pi.
    xx, yy, zz = np.diag(rotation)
    squares = np.array((1 + xx + yy + zz, 1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz))
    largest = int(squares.argmax())
    r = rotation
    w, x, y, z = (
        (squares[0], r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]),
        (r[2, 1] - r[1, 2], squares[1], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0]),
        (r[0, 2] - r[2, 0], r[0, 1] + r[1, 0], squares[2], r[1, 2] + r[2, 1]),
        (r[1, 0] - r[0, 1], r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], squares[3]),
    )[largest]
    vector = np.array((x, y, z)) * (1.0 if w >= 0 else -1.0)
    length = float(np.linalg.norm(vector))
    if length < 1e-12:
        return np.zeros(3)
    return vector / length * 2.0 * float(np.arctan2(length, abs(w)))


def rotation_rpy(rotation: FloatArray) -> tuple[float, float, float]:
    """Return roll, pitch and yaw [rad] of a (3, 3) rotation; roll is zero at pitch ±90°."""
    pitch = float(np.arctan2(-rotation[2, 0], np.hypot(rotation[0, 0], rotation[1, 0])))
    if np.hypot(rotation[0, 0], rotation[1, 0]) < 1e-12:
        # Only roll ∓ yaw is determined; assign all of it to yaw.
        return 0.0, pitch, float(np.arctan2(-rotation[0, 1], rotation[1, 1]))
    roll = float(np.arctan2(rotation[2, 1], rotation[2, 2]))
    return roll, pitch, float(np.arctan2(rotation[1, 0], rotation[0, 0]))


def inverse(placement: FloatArray) -> FloatArray:
    """Return the inverse of a (4, 4) placement."""
    back = np.eye(4)
    back[:3, :3] = placement[:3, :3].T
    back[:3, 3] = -placement[:3, :3].T @ placement[:3, 3]
    return back


def dh_fixed_part(d: float, a: float, alpha: float) -> FloatArray:
    """Return the (4, 4) Trans(0, 0, d) Trans(a, 0, 0) Rot(x, alpha): a D-H row after its rotation about z."""
    placement = np.eye(4)
    placement[:3, :3] = rpy_rotation(alpha, 0.0, 0.0)
    placement[:3, 3] = (a, 0.0, d)
    return placement
