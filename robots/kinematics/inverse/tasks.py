"""Tasks of the tool, validation of poses, and the tolerances of a solution."""

from enum import StrEnum
from math import atan2, hypot, sqrt

import numpy as np
from numpy.typing import ArrayLike

from robomesh import reason_codes as codes
from robots.kinematics.joints import Joints
from robots.schema.errors import PoseError
from robots.schema.poses import FloatArray, inverse

# Tolerances of a solution: the rounding error of two decimals in degrees and millimetres, which is the
# resolution of the paper's controllers. Reachable poses are reached with much smaller errors.
TOLERANCE_M = 1e-5
TOLERANCE_RAD = 2e-4

# A rotation written by hand with four decimals is not exactly orthonormal.
_ROUNDING = 2e-3
_EXACT = 1e-12
_FARTHEST_M = 1e6


class Task(StrEnum):
    """The constrained part of the tool's pose; 5d leaves the roll about the tool's z axis free."""

    POSE_6D = "6d"
    POSITION_AND_AXIS_5D = "5d"
    POSITION_3D = "3d"

    @property
    def rows(self) -> int:
        """The number of constrained degrees of freedom."""
        return int(self[0])


def natural_task(joints: Joints) -> Task:
    """Return the task that suits the number of joints: the full pose from six joints on."""
    return Task.POSE_6D if len(joints) >= 6 else Task.POSITION_AND_AXIS_5D


def tool_pose(values: ArrayLike) -> FloatArray:
    """Return a tool pose as (4, 4) with an exact rotation.

    Args:
        values: (4, 4), or its 16 numbers by rows: tool to base [m].

    Raises:
        PoseError: If the values are not a pose; the text says why.
    """
    try:
        pose = np.array(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise PoseError(codes.POSE_NOT_NUMBERS()) from None
    if pose.shape not in ((4, 4), (16,)):
        shape = codes.POSE_SHAPE(shape=pose.shape)
        raise PoseError(codes.POSE_SIZE(count=pose.size) if pose.ndim == 1 else shape)
    pose = pose.reshape(4, 4)
    # Most poses come from programs and are exact. The full validation would double the time of an answer.
    return pose if _exact(pose.ravel().tolist()) else _orthonormalized(pose)


def _exact(numbers: list[float]) -> bool:
    a, b, c, x, d, e, f, y, g, h, i, z, *last = numbers
    return (
        abs(a * a + b * b + c * c - 1.0) < _EXACT
        and abs(d * d + e * e + f * f - 1.0) < _EXACT
        # The third row is the cross product of the others.
        and abs(b * f - c * e - g) < _EXACT
        and abs(c * d - a * f - h) < _EXACT
        and abs(a * e - b * d - i) < _EXACT
        and abs(a * d + b * e + c * f) < _EXACT
        and abs(x) + abs(y) + abs(z) < _FARTHEST_M
        and last == [0.0, 0.0, 0.0, 1.0]
    )


def _orthonormalized(pose: FloatArray) -> FloatArray:
    if not np.isfinite(pose).all():
        raise PoseError(codes.POSE_NOT_FINITE(value=pose[~np.isfinite(pose)][0]))
    if pose[3].tolist() != [0.0, 0.0, 0.0, 1.0]:
        raise PoseError(codes.POSE_LAST_ROW(row=" ".join(f"{x:g}" for x in pose[3])))
    if np.abs(pose[:3, 3]).sum() >= _FARTHEST_M:
        raise PoseError(codes.POSE_TOO_FAR(distance_m=np.abs(pose[:3, 3]).max(), limit_m=_FARTHEST_M))
    rotation = pose[:3, :3]
    if np.abs(rotation).max() > 2 or np.abs(rotation @ rotation.T - np.eye(3)).max() > _ROUNDING:
        lengths = " ".join(f"{length:.4g}" for length in np.hypot.reduce(rotation, axis=1))
        raise PoseError(codes.POSE_NO_ROTATION(lengths=lengths))
    if np.linalg.det(rotation) < 0:
        raise PoseError(codes.POSE_MIRRORED())
    left, _, right = np.linalg.svd(rotation)
    pose[:3, :3] = left @ right
    return pose


def tool_misses(tool: FloatArray, wanted: FloatArray, task: Task) -> tuple[float, float]:
    """Return the deviation of a tool (4, 4) from the wanted pose: [m] and [rad]."""
    return misses((inverse(tool) @ wanted).ravel().tolist(), task.rows)


def misses(placement: list[float], rows: int) -> tuple[float, float]:
    """Return the deviation of the tool from a target: [m] and [rad].

    Args:
        placement: The 16 numbers of target to tool, or of tool to target, by rows.
        rows: Compared rows: 6 for the pose, 5 for position and axis, 3 for the position.
    """
    xx, xy, xz, x, yx, yy, yz, y, zx, zy, zz, z, *_ = placement
    away = sqrt(x * x + y * y + z * z)
    if rows < 6:
        return away, atan2(hypot(xz, yz), zz) if rows == 5 else 0.0
    a, b, c = zy - yz, xz - zx, yx - xy
    return away, atan2(sqrt(a * a + b * b + c * c), xx + yy + zz - 1.0)
