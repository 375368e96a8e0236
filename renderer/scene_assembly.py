"""Robots, as they stand now, put on one stage: the scene of a picture."""

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from renderer.appearance import Look, frame_placements
from renderer.scene import Finish, Line, Part, Scene

FloatArray = NDArray[np.float64]

_TRAIL_COLOR = (0.02, 0.47, 0.62)
_PATH_COLOR = (0.10, 0.30, 0.85)
_AXES = ((0.85, 0.13, 0.13), (0.13, 0.60, 0.20), (0.15, 0.32, 0.90))
# Of an axis, over the radius of the robot's room.
_AXIS_LENGTH = 0.09
# Metres, or a rotation's entries: nearer than that a ghost is in the body's own place.
_SAME = 4e-3


@dataclass(frozen=True, eq=False)
class Placed:
    """A robot where it stands.

    Attributes:
        link_placements: (4, 4) link to site by link; a link that is not there is not drawn.
        stale: Nobody knows whether it still stands so.
        touching: Links that touch something, drawn red.
    """

    look: Look
    link_placements: Mapping[str, FloatArray]
    stale: bool = False
    touching: Collection[str] = ()


def scene_of(
    robot: Placed,
    *others: Placed,
    trail: FloatArray | None = None,
    frames: bool = False,
    ghost: Mapping[str, FloatArray] | None = None,
    path: FloatArray | None = None,
) -> Scene:
    """A scene of a robot, what stands around it, and the other robots of its cell.

    Args:
        trail: (n, 3) where its tool was, oldest first, in the site's frame [m].
        frames: Show the axes of its tool and named frames.
        ghost: (4, 4) link to site by link of the same robot where it may go.
        path: (n, 3) that its tool is to follow, in the site's frame [m].
    """
    look = robot.look
    lines: list[Line] = []
    if path is not None and len(path) > 1:
        lines.append(Line(path, _PATH_COLOR, np.full(len(path), 0.9), 2.2))
    if trail is not None and len(trail) > 1:
        lines.append(Line(trail, _TRAIL_COLOR, np.linspace(0.0, 0.95, len(trail)), 2.6))
    if frames:
        for placement in frame_placements(look, robot.link_placements).values():
            lines += _axes(placement, _AXIS_LENGTH * look.radius)
    moving = [part for other in others for part in _parts(other)]
    if ghost is not None:
        # What stays where it is has no ghost.
        moves = {link: placed for link, placed in ghost.items() if _differs(robot, link, placed)}
        moving += _bodies(look, moves, lambda _: Finish.GHOST)
    return Scene(
        parts=tuple(_parts(robot)),
        others=tuple(moving),
        fixtures=_grey(look.fixtures) if robot.stale else look.fixtures,
        center=look.center,
        radius=look.radius,
        floor=look.floor,
        lines=tuple(lines),
    )


def _differs(robot: Placed, link: str, placement: FloatArray) -> bool:
    now = robot.link_placements.get(link)
    return now is None or float(np.abs(now - placement).max()) > _SAME


def _parts(robot: Placed) -> list[Part]:
    def finish(link: str) -> Finish:
        if robot.stale:
            return Finish.STALE
        return Finish.RED if link in robot.touching else Finish.PLAIN

    return _bodies(robot.look, robot.link_placements, finish)


def _bodies(look: Look, placed: Mapping[str, FloatArray], finish: Callable[[str], Finish]) -> list[Part]:
    return [
        Part(mesh, placed[link], finish(link), link) for link, mesh in look.meshes.items() if link in placed
    ]


def _grey(fixtures: tuple[Part, ...]) -> tuple[Part, ...]:
    """A picture of which nothing is sure has no colour that looks alive."""
    return tuple(replace(fixture, finish=Finish.STALE) for fixture in fixtures)


def _axes(placement: FloatArray, length: float) -> Iterator[Line]:
    origin = placement[:3, 3]
    for axis, color in enumerate(_AXES):
        ends = np.array([origin, origin + length * placement[:3, axis]])
        yield Line(ends, color, np.ones(2), 3.0)
