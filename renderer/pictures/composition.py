"""Composition of one picture: the current state of a robot and its cell, seen by a view's camera."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from renderer.pictures.clearance_line import ClearanceLine
from renderer.pictures.overlay import Overlay
from renderer.pictures.requested_views import ViewSpec
from renderer.pictures.robot_state import (
    Ages,
    RobotState,
    age_s,
    current_clearance_line,
    current_contacts,
    current_placements,
    is_stale,
    overlay_of,
    warning_overlay,
)
from renderer.scene.appearance import Appearance, placements_at
from renderer.scene.assembly import Placed, scene_of
from renderer.scene.cameras import Camera
from renderer.scene.scene import Scene
from renderer.scene.views import camera_from, camera_of
from robomesh.contract.keys import CLOSE
from robomesh.schemas.robomesh_pb2 import ViewRequest

FloatArray = NDArray[np.float64]
_NOTHING = ViewRequest.Show()
# In a picture of less height the joint values would hide the arm.
_LEAST_FOR_ROWS_PX = 300


@dataclass(frozen=True, eq=False)
class RobotSnapshot:
    """A robot's state and the ages of its topics."""

    state: RobotState
    ages: Ages


@dataclass(frozen=True, eq=False, kw_only=True)
class Composition:
    """Everything that one picture consists of.

    Attributes:
        follow: The camera moves so that the robot fills the picture.
    """

    scene: Scene
    camera: Camera
    overlay: Overlay
    clearance_line: ClearanceLine | None
    follow: bool


def compose(
    spec: ViewSpec, appearance: Appearance, robot: RobotSnapshot, neighbours: Sequence[RobotSnapshot]
) -> Composition:
    """Compose a picture of a robot.

    Args:
        neighbours: The other robots of its cell.

    Raises:
        RendererError: If a newer description lacks the view, or the camera's mount.
    """
    state, age = robot.state, age_s(robot.state, robot.ages)
    placed = current_placements(state, appearance)
    show = spec.show or _NOTHING
    if spec.view is not None:
        camera = camera_from(appearance, spec.view, placed, aspect=spec.aspect)
    else:
        camera = camera_of(appearance, spec.of, placed, aspect=spec.aspect)
    close = spec.of == CLOSE
    quiet = close or show.no_text
    scene = scene_of(
        _placed(robot, appearance),
        *(_placed(each, each.state.appearance) for each in neighbours if each.state.appearance is not None),
        trail=np.array([point for _, point in state.trail]) if show.trail else None,
        frames=show.frames,
        ghost=_ghost(appearance, show),
        path=_path(appearance, show),
    )
    if quiet:
        overlay = warning_overlay(state, age=age)
    else:
        name = "" if spec.view is not None else spec.of
        overlay = overlay_of(state, appearance, name, age=age)
        if spec.size[1] < _LEAST_FOR_ROWS_PX:
            overlay = replace(overlay, rows=())
    return Composition(
        scene=scene,
        camera=camera,
        overlay=overlay,
        clearance_line=current_clearance_line(state, robot.ages),
        follow=close,
    )


def looks(robot: RobotSnapshot) -> tuple[object, ...]:
    """Return what changes in a robot's picture by time alone: it becomes stale, and so do its contacts."""
    return is_stale(robot.state, robot.ages), current_contacts(robot.state, robot.ages)


def _placed(robot: RobotSnapshot, appearance: Appearance) -> Placed:
    return Placed(
        appearance,
        current_placements(robot.state, appearance),
        stale=is_stale(robot.state, robot.ages),
        touching=current_contacts(robot.state, robot.ages),
    )


def _ghost(appearance: Appearance, show: ViewRequest.Show) -> dict[str, FloatArray] | None:
    names = [joint.name for joint in appearance.description.joints]
    if len(show.ghost) != len(names):
        return None
    return placements_at(appearance, dict(zip(names, show.ghost, strict=True)))


def _path(appearance: Appearance, show: ViewRequest.Show) -> FloatArray | None:
    points = np.array([(point.x, point.y, point.z) for point in show.path])
    if len(points) < 2:
        return None
    moved: FloatArray = points @ appearance.base_to_site[:3, :3].T + appearance.base_to_site[:3, 3]
    return moved
