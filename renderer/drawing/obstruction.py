"""Detection of fixtures that hide the arm, and of a body that contains the camera."""

import numpy as np
from numpy.typing import NDArray

from renderer.scene.cameras import Camera, pixels, site_to_camera

FloatArray = NDArray[np.float64]

# A fixture hides the arm if it covers more than this share of the workspace and is in front of its centre.
_MUCH = 0.22
_BEFORE_EYE_M = 0.02


def hides(camera: Camera, aspect: float, corners: FloatArray, *, center: FloatArray, radius: float) -> bool:
    """Return whether a fixture is between a camera and the arm's workspace.

    The workspace is used instead of the arm's current place: a fence that appears and disappears would
    distract the operator.

    Args:
        corners: (8, 3) corners of the box around the fixture, in the site's frame [m].
        center: (3,) centre of the workspace [m].
        radius: Radius of the workspace [m].
    """
    to_camera = site_to_camera(camera)
    depths = -((corners @ to_camera[:3, :3].T)[:, 2] + to_camera[2, 3])
    middle = float((center - camera.eye) @ camera.forward)
    if depths.mean() > middle - 0.2 * radius or depths.max() < _BEFORE_EYE_M:
        return False
    if depths.min() < _BEFORE_EYE_M and not camera.orthographic:
        return True  # the camera is next to it or inside it
    right, up = to_camera[0, :3], to_camera[1, :3]
    sides = np.array([center + 0.6 * radius * (x * right + y * up) for x in (-1, 1) for y in (-1, 1)])
    workspace, fixture = (pixels(camera, (1, 1), points, aspect=aspect) for points in (sides, corners))
    low = np.maximum(workspace.min(axis=0), fixture.min(axis=0))
    high = np.minimum(workspace.max(axis=0), fixture.max(axis=0))
    covered = np.prod(np.maximum(high - low, 0.0)) / np.prod(np.ptp(workspace, axis=0))
    return bool(covered > _MUCH)


def contains(positions: FloatArray, triangles: NDArray[np.uint32], point: FloatArray) -> bool:
    """Return whether a point is inside a body, which may have holes and gaps.

    Source: generalised winding number (Jacobson et al. 2013); solid angle of a triangle (van Oosterom,
    Strackee 1983).
    """
    a, b, c = (positions[triangles[:, corner]] - point for corner in range(3))
    la, lb, lc = (np.linalg.norm(each, axis=1) for each in (a, b, c))
    above = (a * np.cross(b, c)).sum(axis=1)
    below = la * lb * lc + (a * b).sum(axis=1) * lc + (b * c).sum(axis=1) * la + (c * a).sum(axis=1) * lb
    turns = float(np.arctan2(above, below).sum()) / (2.0 * np.pi)
    return abs(turns) > 0.5
