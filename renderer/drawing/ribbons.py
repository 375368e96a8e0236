"""Lines with a width in pixels, as triangles in clip coordinates: OpenGL's lines are one pixel wide."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from renderer.scene.scene import Line

FloatArray = NDArray[np.float64]

_NEAREST = 1e-3
# Offset of a line in front of the surface that it is on, as a share of the depth.
_LIFT = 2e-4


def ribbons(lines: Sequence[Line], site_to_clip: FloatArray, size: tuple[int, int]) -> NDArray[np.float32]:
    """Return the (6k, 8) corners of triangles: position in clip coordinates, colour and opacity.

    Args:
        site_to_clip: (4, 4).
        size: Size of the picture [px]; line widths are for a picture 720 px high.
    """
    pieces = [_ribbon(line, site_to_clip, size) for line in lines if len(line.points) > 1]
    return np.concatenate([np.empty((0, 8)), *pieces]).astype(np.float32)


def _ribbon(line: Line, site_to_clip: FloatArray, size: tuple[int, int]) -> FloatArray:
    clip = np.c_[line.points, np.ones(len(line.points))] @ site_to_clip.T
    start, end = clip[:-1], clip[1:]
    fade = np.stack([line.opacity[:-1], line.opacity[1:]], axis=1)
    # Segments that reach behind the eye cannot be projected and are left out.
    kept = (start[:, 3] > _NEAREST) & (end[:, 3] > _NEAREST)
    start, end, fade = start[kept], end[kept], fade[kept]
    half_px = line.width * size[1] / 720.0 / 2.0
    places = np.stack([start[:, :2] / start[:, 3:], end[:, :2] / end[:, 3:]], axis=1) * np.array(size) / 2.0
    along = places[:, 1] - places[:, 0]
    length = np.linalg.norm(along, axis=1, keepdims=True)
    along = np.where(length > 1e-9, along / np.maximum(length, 1e-9), np.array([1.0, 0.0]))
    aside = np.stack([-along[:, 1], along[:, 0]], axis=1)
    corners = np.empty((len(start), 4, 8))
    # A half width beyond each end, so that a bend has no gap.
    for number, (which, side) in enumerate(((0, -1), (0, 1), (1, -1), (1, 1))):
        point = (start, end)[which].copy()
        off_px = half_px * (side * aside + (2 * which - 1) * 0.5 * along)
        point[:, :2] += off_px / (np.array(size) / 2.0) * point[:, 3:]
        point[:, 2] -= _LIFT * point[:, 3]
        corners[:, number, :4] = point
        corners[:, number, 4:7] = line.color
        corners[:, number, 7] = fade[:, which]
    return corners[:, [0, 1, 2, 2, 1, 3]].reshape(-1, 8)
