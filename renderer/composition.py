"""What one picture shows: a robot and its cell as they are known now, by one view's camera."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from renderer.appearance import Look, placements_at
from renderer.cameras import Camera
from renderer.clearance_line import Span
from renderer.overlay import Overlay
from renderer.requested_views import Shot
from renderer.robot_state import (
    Ages,
    RobotState,
    age_s,
    is_stale,
    overlay_of,
    placements_now,
    span_now,
    touching_now,
    warning_of,
)
from renderer.scene import Scene
from renderer.scene_assembly import Placed, scene_of
from renderer.views import CLOSE, camera_from, camera_of
from robomesh.schemas.robomesh_pb2 import ViewRequest

FloatArray = NDArray[np.float64]
_NOTHING = ViewRequest.Show()
# In a lower picture the joints' values would hide the arm.
_LEAST_FOR_ROWS_PX = 300


@dataclass(frozen=True, eq=False)
class Known:
    """A robot, and how old what is known of it is."""

    state: RobotState
    ages: Ages


@dataclass(frozen=True, eq=False, kw_only=True)
class Composition:
    """All that one picture is made of.

    Attributes:
        follow: The camera moves so that the robot fills the picture.
    """

    scene: Scene
    camera: Camera
    overlay: Overlay
    span: Span | None
    follow: bool


def composed(shot: Shot, look: Look, robot: Known, neighbours: Sequence[Known]) -> Composition:
    """A picture of a robot.

    Args:
        neighbours: The other robots of its cell.

    Raises:
        RendererError: If a newer description has no such view, or nothing that the camera hangs on.
    """
    state, age = robot.state, age_s(robot.state, robot.ages)
    placed = placements_now(state, look)
    show = shot.show or _NOTHING
    if shot.view is not None:
        camera = camera_from(look, shot.view, placed, aspect=shot.aspect)
    else:
        camera = camera_of(look, shot.of, placed, aspect=shot.aspect)
    close = shot.of == CLOSE
    quiet = close or show.no_text
    scene = scene_of(
        _placed(robot, look),
        *(_placed(each, each.state.look) for each in neighbours if each.state.look is not None),
        trail=np.array([point for _, point in state.trail]) if show.trail else None,
        frames=show.frames,
        ghost=_ghost(look, show),
        path=_path(look, show),
    )
    if quiet:
        overlay = warning_of(state, age=age)
    else:
        name = "" if shot.view is not None else shot.of
        overlay = overlay_of(state, look, name, age=age)
        if shot.size[1] < _LEAST_FOR_ROWS_PX:
            overlay = replace(overlay, rows=())
    return Composition(
        scene=scene,
        camera=camera,
        overlay=overlay,
        span=span_now(state, robot.ages),
        follow=close,
    )


def _placed(robot: Known, look: Look) -> Placed:
    return Placed(
        look,
        placements_now(robot.state, look),
        stale=is_stale(robot.state, robot.ages),
        touching=touching_now(robot.state, robot.ages),
    )


def _ghost(look: Look, show: ViewRequest.Show) -> dict[str, FloatArray] | None:
    names = [joint.name for joint in look.description.joints]
    if len(show.ghost) != len(names):
        return None
    return placements_at(look, dict(zip(names, show.ghost, strict=True)))


def _path(look: Look, show: ViewRequest.Show) -> FloatArray | None:
    points = np.array([(point.x, point.y, point.z) for point in show.path])
    if len(points) < 2:
        return None
    moved: FloatArray = points @ look.base_to_site[:3, :3].T + look.base_to_site[:3, 3]
    return moved
