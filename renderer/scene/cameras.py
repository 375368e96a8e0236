"""Cameras: pose, projection, and fitting to a set of points.

Camera frame: x right, y up, view direction -z. Pixels count from the picture's upper left corner.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

FIELD_OF_VIEW = float(np.deg2rad(30.0))
_NEAREST_M = 0.01
# A close-up camera stays as it is while its object fills at least this share of the picture and keeps this
# distance from the edges; a new one gets this margin.
_CLOSE_LEAST, _CLOSE_EDGE, _CLOSE_MARGIN = 0.68, 0.03, 1.16


@dataclass(frozen=True, eq=False)
class Camera:
    """A camera in the site's frame.

    Attributes:
        eye: (3,) [m].
        target: (3,) point in the picture's centre [m].
        up: (3,) direction that is upwards in the picture.
        half_height: Half the height that an orthographic picture shows [m]; None: perspective.
        field_of_view: Vertical field of view of a perspective picture [rad].
    """

    eye: FloatArray
    target: FloatArray
    up: FloatArray
    half_height: float | None = None
    field_of_view: float = FIELD_OF_VIEW

    @property
    def orthographic(self) -> bool:
        """True if the projection is orthographic."""
        return self.half_height is not None

    @property
    def forward(self) -> FloatArray:
        """(3,) unit vector from the eye to the target."""
        return _unit(self.target - self.eye)


def site_to_camera(camera: Camera) -> FloatArray:
    """Return the (4, 4) transform from the site's frame to the camera's."""
    backward = -camera.forward
    right = np.cross(camera.up, backward)
    if np.linalg.norm(right) < 1e-9 * np.linalg.norm(camera.up):
        # The view direction is along "up": choose any right, or the picture would be empty.
        right = np.cross([0.0, 1.0, 0.0] if abs(backward[1]) < 0.9 else [1.0, 0.0, 0.0], backward)
    right = _unit(right)
    transform = np.eye(4)
    transform[:3, :3] = [right, np.cross(backward, right), backward]
    transform[:3, 3] = -transform[:3, :3] @ camera.eye
    return transform


def projection(camera: Camera, aspect: float, *, near: float, far: float) -> FloatArray:
    """Return (4, 4) camera frame to clip coordinates, y **down**: the first row drawn is the picture's first.

    Flipping the picture here costs nothing; flipping it after reading costs a copy of each frame.
    """
    matrix = np.zeros((4, 4))
    if camera.half_height is not None:
        matrix[0, 0] = 1.0 / (camera.half_height * aspect)
        matrix[1, 1] = -1.0 / camera.half_height
        matrix[2, 2] = -2.0 / (far - near)
        matrix[2, 3] = -(far + near) / (far - near)
        matrix[3, 3] = 1.0
    else:
        scale = 1.0 / np.tan(camera.field_of_view / 2.0)
        matrix[0, 0] = scale / aspect
        matrix[1, 1] = -scale
        matrix[2, 2] = -(far + near) / (far - near)
        matrix[2, 3] = -2.0 * far * near / (far - near)
        matrix[3, 2] = -1.0
    return matrix


def site_to_clip(camera: Camera, aspect: float, *, center: FloatArray, radius: float) -> FloatArray:
    """Return (4, 4) site frame to clip coordinates, with a depth range that contains a sphere."""
    distance = float((center - camera.eye) @ camera.forward)
    far = max(distance + radius, 2.0 * _NEAREST_M)
    near = distance - radius
    if not camera.orthographic:
        near = max(near, _NEAREST_M, far * 1e-4)
    return projection(camera, aspect, near=near, far=far) @ site_to_camera(camera)


def scales(camera: Camera, height: int, distances: FloatArray) -> FloatArray:
    """Return the (n,) scale of bodies [px/m] in a picture of a height [px].

    Args:
        distances: (n,) from the eye along the view direction [m].
    """
    if camera.half_height is not None:
        return np.full(len(distances), height / (2.0 * camera.half_height))
    across = 2.0 * np.tan(camera.field_of_view / 2.0) * np.maximum(distances, _NEAREST_M)
    found: FloatArray = height / across
    return found


def pixels(
    camera: Camera, size: tuple[int, int], points: FloatArray, *, aspect: float | None = None
) -> FloatArray:
    """Project points to (n, 2) pixels, x to the right and y downwards from the upper left corner.

    Args:
        size: Width and height [px].
        points: (n, 3) in the site's frame [m], in front of a perspective camera.
        aspect: Width over height of the picture, if pixels are not square.
    """
    width, height = size
    matrix = projection(camera, aspect or width / height, near=0.1, far=100.0) @ site_to_camera(camera)
    clip = np.c_[points, np.ones(len(points))] @ matrix.T
    projected: FloatArray = (clip[:, :2] / clip[:, 3:] + 1.0) / 2.0 * np.array(size)
    return projected


def fitted(camera: Camera, aspect: float, points: FloatArray, *, margin: float = 1.06) -> Camera:
    """Return a camera with the same direction that shows the points centred and as large as possible.

    An orthographic camera changes its scale, a perspective one its distance.

    Args:
        points: (n, 3) in the site's frame [m].
    """
    to_camera = site_to_camera(camera)[:3, :3]
    right, up, backward = ((points - camera.target) @ to_camera.T).T
    if camera.orthographic:
        half_width, half_height = np.ptp(right) / 2.0, np.ptp(up) / 2.0
        across = np.array([right.min() + half_width, up.min() + half_height, 0.0])
        moved = camera.eye + across @ to_camera, camera.target + across @ to_camera
        scale = float(max(half_height, half_width / aspect, 1e-3) * margin)
        return Camera(*moved, camera.up, half_height=scale)
    # A point is below the picture's upper edge if up + slope * backward is at most what the eye's
    # distance and height allow: the outermost point at each edge decides.
    slope = np.tan(camera.field_of_view / 2.0) / margin
    distances, middle = [1e-3], []
    for along, edge in ((right, slope * aspect), (up, slope)):
        high, low = (along + edge * backward).max(), (-along + edge * backward).max()
        distances.append((high + low) / (2.0 * edge))
        middle.append((high - low) / 2.0)
    target = camera.target + np.array([*middle, 0.0]) @ to_camera
    return replace(camera, eye=target - camera.forward * max(distances), target=target)


def close_up(camera: Camera, aspect: float, points: FloatArray) -> Camera:
    """Return the camera if the points fill its picture well, otherwise a fitted one with the same direction.

    A camera that moved with every picture would make static bodies seem to move.

    Args:
        points: (n, 3) in the site's frame [m].
    """
    shares = pixels(camera, (1, 1), points, aspect=aspect)
    inside = shares.min() >= _CLOSE_EDGE and shares.max() <= 1.0 - _CLOSE_EDGE
    if inside and np.ptp(shares, axis=0).max() >= _CLOSE_LEAST:
        return camera
    return fitted(camera, aspect, points, margin=_CLOSE_MARGIN)


def _unit(vector: FloatArray) -> FloatArray:
    length = float(np.linalg.norm(vector))
    return vector / length if length > 0 else np.array([0.0, 0.0, -1.0])
