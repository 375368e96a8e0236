"""Assembly of a picture's scene from robots at their current placements."""

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from renderer.scene.appearance import Appearance, frame_placements
from renderer.scene.scene import Finish, Line, Part, Scene

FloatArray = NDArray[np.float64]

_TRAIL_COLOR = (0.02, 0.47, 0.62)
_PATH_COLOR = (0.10, 0.30, 0.85)
_AXES = ((0.85, 0.13, 0.13), (0.13, 0.60, 0.20), (0.15, 0.32, 0.90))
# Length of an axis over the radius of the robot's workspace.
_AXIS_LENGTH = 0.09
# A ghost is drawn only if its placement differs by more than this (metres, or rotation matrix entries).
_SAME = 4e-3


@dataclass(frozen=True, eq=False)
class Placed:
    """A robot with its placements.

    Attributes:
        link_placements: (4, 4) link to site by link; other links are not drawn.
        stale: The placements are out of date.
        touching: Links in contact, drawn red.
    """

    appearance: Appearance
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
    """Return the scene of a robot, its fixtures, and the other robots of its cell.

    Args:
        trail: (n, 3) past positions of the tool, oldest first, in the site's frame [m].
        frames: Show the axes of the tool and of named frames.
        ghost: (4, 4) link to site by link of the same robot at a target.
        path: (n, 3) planned path of the tool, in the site's frame [m].
    """
    appearance = robot.appearance
    lines: list[Line] = []
    if path is not None and len(path) > 1:
        lines.append(Line(path, _PATH_COLOR, np.full(len(path), 0.9), 2.2))
    if trail is not None and len(trail) > 1:
        lines.append(Line(trail, _TRAIL_COLOR, np.linspace(0.0, 0.95, len(trail)), 2.6))
    if frames:
        for placement in frame_placements(appearance, robot.link_placements).values():
            lines += _axes(placement, _AXIS_LENGTH * appearance.radius)
    moving = [part for other in others for part in _parts(other)]
    if ghost is not None:
        # Links that do not move have no ghost.
        moves = {link: placed for link, placed in ghost.items() if _differs(robot, link, placed)}
        moving += _bodies(appearance, moves, lambda _: Finish.GHOST)
    return Scene(
        parts=tuple(_parts(robot)),
        others=tuple(moving),
        fixtures=_grey(appearance.fixtures) if robot.stale else appearance.fixtures,
        center=appearance.center,
        radius=appearance.radius,
        floor=appearance.floor,
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

    return _bodies(robot.appearance, robot.link_placements, finish)


def _bodies(
    appearance: Appearance, placed: Mapping[str, FloatArray], finish: Callable[[str], Finish]
) -> list[Part]:
    return [
        Part(shape, placed[link], finish(link), link)
        for link, shape in appearance.shapes.items()
        if link in placed
    ]


def _grey(fixtures: tuple[Part, ...]) -> tuple[Part, ...]:
    """Return fixtures in grey, so that a stale picture has no colour that looks live."""
    return tuple(replace(fixture, finish=Finish.STALE) for fixture in fixtures)


def _axes(placement: FloatArray, length: float) -> Iterator[Line]:
    origin = placement[:3, 3]
    for axis, color in enumerate(_AXES):
        ends = np.array([origin, origin + length * placement[:3, axis]])
        yield Line(ends, color, np.ones(2), 3.0)
