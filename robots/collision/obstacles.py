"""Obstacles for an arm, and a cheap lower bound of their distances."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robots.bodies.geometry import Body
from robots.kinematics.joints import FloatArray


@dataclass(frozen=True, eq=False)
class Bounds:
    """Bounding boxes of bodies, along the axes of their frames [m].

    Attributes:
        centers, halves: (b, 3).
    """

    centers: FloatArray
    halves: FloatArray


def bounds_of(bodies: Sequence[Body]) -> Bounds:
    """Return the bounding box of each body."""
    return Bounds(
        np.array([body.center for body in bodies]).reshape(-1, 3),
        np.array([body.half for body in bodies]).reshape(-1, 3),
    )


@dataclass(frozen=True, eq=False)
class Obstacles:
    """Bodies with their placements.

    Attributes:
        names: "<robot>/<link>" or "<fixture>" of each body.
        placements: (b, 4, 4) body to site [m].
        moving: (b,) whether a joint moves the body.
    """

    names: tuple[str, ...]
    bodies: tuple[Body, ...]
    placements: FloatArray
    moving: NDArray[np.bool_]
    bounds: Bounds

    def __len__(self) -> int:
        return len(self.names)


def join_obstacles(parts: Sequence[Obstacles]) -> Obstacles:
    """Concatenate obstacles."""
    bodies = tuple(body for part in parts for body in part.bodies)
    return Obstacles(
        tuple(name for part in parts for name in part.names),
        bodies,
        np.concatenate([np.empty((0, 4, 4)), *(part.placements for part in parts)]),
        np.concatenate([np.empty(0, dtype=np.bool_), *(part.moving for part in parts)]),
        bounds_of(bodies),
    )


@dataclass(frozen=True, eq=False)
class Boxes:
    """Boxes in the site's frame [m].

    Attributes:
        centers: (b, 3).
        axes: (b, 3, 3) box to site.
        halves: (b, 3) half of their sides.
    """

    centers: FloatArray
    axes: FloatArray
    halves: FloatArray


def placed_boxes(bounds: Bounds, placements: FloatArray) -> Boxes:
    """Return the bounding box of each placed body.

    Args:
        placements: (b, 4, 4) body to site [m].
    """
    axes = placements[:, :3, :3]
    centers = (axes @ bounds.centers[:, :, None])[:, :, 0] + placements[:, :3, 3]
    return Boxes(centers, axes, bounds.halves)


@dataclass(frozen=True, eq=False)
class Balls:
    """Balls that cover bodies, in the frames of their links [m].

    Attributes:
        centers: (k, 3).
        radii: (k,).
        owners: (k,) number of the body that each ball covers.
        starts: (b,) number of each body's first ball.
    """

    centers: FloatArray
    radii: FloatArray
    owners: NDArray[np.int64]
    starts: NDArray[np.int64]


def balls_of(bodies: Sequence[Body]) -> Balls:
    """Return the balls that cover each body."""
    counts = np.array([len(body.balls) for body in bodies], dtype=np.int64)
    return Balls(
        np.concatenate([np.empty((0, 3)), *(body.balls for body in bodies)]),
        np.repeat(np.array([body.radius for body in bodies], dtype=np.float64), counts),
        np.repeat(np.arange(len(bodies)), counts),
        np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(np.int64),
    )


def least_distances(balls: Balls, placements: FloatArray, boxes: Boxes) -> FloatArray:
    """Return a lower bound of the distance of each body to the content of each box [m].

    Args:
        placements: (a, 4, 4) of the bodies that the balls cover, to the site.

    Returns:
        (a, b), 0 where a body and a content may touch.
    """
    of_balls = placements[balls.owners]
    centers = (of_balls[:, :3, :3] @ balls.centers[:, :, None])[:, :, 0] + of_balls[:, :3, 3]
    # Few operations, because the arrays are small: all axes of all boxes in one multiplication.
    axes = boxes.axes.transpose(1, 2, 0)
    beyond = (centers @ axes.reshape(3, -1)).reshape(-1, 3, len(boxes.centers))
    beyond -= (boxes.centers.T[:, None] * axes).sum(axis=0)
    np.abs(beyond, out=beyond)
    beyond -= boxes.halves.T
    np.maximum(beyond, 0.0, out=beyond)
    beyond *= beyond
    gaps = np.sqrt(beyond.sum(axis=1)) - balls.radii[:, None]
    least: FloatArray = np.maximum(np.minimum.reduceat(gaps, balls.starts, axis=0), 0.0)
    return least


def join_boxes(parts: Sequence[Boxes]) -> Boxes:
    """Concatenate boxes."""
    return Boxes(
        np.concatenate([part.centers for part in parts]),
        np.concatenate([part.axes for part in parts]),
        np.concatenate([part.halves for part in parts]),
    )
