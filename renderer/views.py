"""The cameras of a robot's views: named ones of its description, and any that somebody asks for."""

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from renderer.appearance import Look, frame_placements, home_placements
from renderer.cameras import FIELD_OF_VIEW, Camera, fitted
from renderer.errors import CameraError, UnknownViewError
from robomesh.schemas.robomesh_pb2 import Vector3, View

FloatArray = NDArray[np.float64]

FREE = "free"
# Follows the arm and has nothing written on it: for the small pictures of a list.
CLOSE = "close"
ASPECT = 16.0 / 9.0

# From the front right and a little above: waist, shoulder and elbow all show.
_FREE_DIRECTION = np.array([1.5, -1.5, 0.7])
# A long lens: what comes nearer does not take the picture's room from the rest.
_FREE_FIELD_OF_VIEW = float(np.deg2rad(24.0))
_UP = np.array([0.0, 0.0, 1.0])

_MOST_M = 1e3
_LEAST_LOOK_M = 1e-6
_FIELDS_OF_VIEW_DEG = (1.0, 150.0)
_LEAST_HEIGHT_M = 1e-3


def view_names(look: Look) -> tuple[str, ...]:
    """Every view that the robot has."""
    return tuple(dict.fromkeys((*(view.name for view in look.description.views), FREE, CLOSE)))


def camera_of(
    look: Look, name: str, placements: Mapping[str, FloatArray] | None = None, *, aspect: float = ASPECT
) -> Camera:
    """A view's camera.

    Args:
        placements: (4, 4) link to site by link, for a camera on a link; none: at home.
        aspect: The picture's width over its height.

    Raises:
        UnknownViewError: If the robot has no such view.
        CameraError: If the description's camera is not possible.
    """
    view = next((view for view in look.description.views if view.name == name), None)
    if view is not None and view.mount:
        return camera_from(look, view, placements, aspect=aspect)
    return _standing(look, name, aspect)


def camera_from(
    look: Look, view: View, placements: Mapping[str, FloatArray] | None = None, *, aspect: float = ASPECT
) -> Camera:
    """The camera of a view that somebody asks for.

    An orthographic one that names no height shows all of the robot's room.

    Args:
        placements: (4, 4) link to site by link, for a camera on a link; none: at home.
        aspect: The picture's width over its height.

    Raises:
        CameraError: If it hangs on nothing, looks nowhere, or has numbers that are not possible.
    """
    eye, target = _vector(view.eye, "eye"), _vector(view.target, "target")
    up = _vector(view.up, "up")
    if np.linalg.norm(target - eye) < _LEAST_LOOK_M:
        where = ", ".join(f"{value:g}" for value in eye)
        raise CameraError(f"eye and target are both at ({where}) m: a camera looks from one to the other")
    mount_to_site = _mount(look, view.mount, placements)
    camera = Camera(eye, target, up if up.any() else _UP, field_of_view=_field_of_view(view))
    if view.projection == View.ORTHOGRAPHIC:
        camera = _scaled(look, replace(camera, half_height=1.0), view, aspect)
    return _placed(camera, mount_to_site)


@lru_cache(maxsize=256)
def _standing(look: Look, name: str, aspect: float) -> Camera:
    """A camera that stands in the site; it is asked for with each picture, and fitting it takes time."""
    for view in look.description.views:
        if view.name == name:
            return camera_from(look, view, aspect=aspect)
    if name not in (FREE, CLOSE):
        raise UnknownViewError(name, view_names(look))
    base_to_site = look.base_to_site
    middle = base_to_site[:3, :3].T @ (look.center - base_to_site[:3, 3])
    camera = Camera(middle + _FREE_DIRECTION, middle, _UP, field_of_view=_FREE_FIELD_OF_VIEW)
    return _placed(fitted(camera, aspect, look.room), base_to_site)


def _scaled(look: Look, camera: Camera, view: View, aspect: float) -> Camera:
    if view.HasField("height"):
        if not _LEAST_HEIGHT_M <= view.height <= _MOST_M:
            raise CameraError(f"height {view.height:g} m: {_LEAST_HEIGHT_M:g} to {_MOST_M:g} is possible")
        return replace(camera, half_height=view.height / 2.0)
    if view.mount:
        return replace(camera, half_height=look.radius)
    return fitted(camera, aspect, look.room)


def _field_of_view(view: View) -> float:
    if not view.HasField("field_of_view"):
        return FIELD_OF_VIEW
    least, most = _FIELDS_OF_VIEW_DEG
    degrees = math.degrees(view.field_of_view)
    if not least <= degrees <= most:
        raise CameraError(
            f"field_of_view {view.field_of_view:g} rad: {math.radians(least):.3f} to "
            f"{math.radians(most):.3f} ({least:g}° to {most:g}°) is possible"
        )
    return view.field_of_view


def _mount(look: Look, mount: str, placements: Mapping[str, FloatArray] | None) -> FloatArray:
    if not mount:
        return look.base_to_site
    placed = placements or home_placements(look)
    known = {**placed, **frame_placements(look, placed)}
    try:
        return known[mount]
    except KeyError:
        names = ", ".join(sorted(known))
        raise CameraError(f"mount {mount!r} is no link or frame of the robot; there are {names}") from None


def _vector(vector: Vector3, what: str) -> FloatArray:
    values = np.array([vector.x, vector.y, vector.z])
    if not np.isfinite(values).all() or np.abs(values).max() > _MOST_M:
        numbers = ", ".join(f"{value:g}" for value in values)
        raise CameraError(f"{what} ({numbers}): numbers from {-_MOST_M:g} to {_MOST_M:g} are possible")
    return values


def _placed(camera: Camera, mount_to_site: FloatArray) -> Camera:
    rotation, origin = mount_to_site[:3, :3], mount_to_site[:3, 3]
    return replace(
        camera,
        eye=rotation @ camera.eye + origin,
        target=rotation @ camera.target + origin,
        up=rotation @ camera.up,
    )
