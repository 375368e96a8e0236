"""The cameras of a robot's views: those named in its description, and requested ones."""

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from renderer.errors import CameraError, UnknownViewError
from renderer.scene.appearance import Appearance, frame_placements, home_placements
from renderer.scene.cameras import FIELD_OF_VIEW, Camera, fitted
from robomesh import reason_codes as codes
from robomesh.contract.keys import CLOSE, FREE
from robomesh.schemas.robomesh_pb2 import Vector3, View

FloatArray = NDArray[np.float64]

ASPECT = 16.0 / 9.0

# From the front right and a little above: waist, shoulder and elbow are visible.
_FREE_DIRECTION = np.array([1.5, -1.5, 0.7])
# A long focal length: parts close to the camera do not appear much larger than others.
_FREE_FIELD_OF_VIEW = float(np.deg2rad(24.0))
_UP = np.array([0.0, 0.0, 1.0])

_MOST_M = 1e3
_LEAST_LOOK_M = 1e-6
_FIELDS_OF_VIEW_DEG = (1.0, 150.0)
_LEAST_HEIGHT_M = 1e-3


def view_names(appearance: Appearance) -> tuple[str, ...]:
    """Return the names of all views of a robot."""
    return tuple(dict.fromkeys((*(view.name for view in appearance.description.views), FREE, CLOSE)))


def camera_of(
    appearance: Appearance,
    name: str,
    placements: Mapping[str, FloatArray] | None = None,
    *,
    aspect: float = ASPECT,
) -> Camera:
    """Return a view's camera.

    Args:
        placements: (4, 4) link to site by link, for a camera on a link; None: at home.
        aspect: The picture's width over its height.

    Raises:
        UnknownViewError: If the robot has no such view.
        CameraError: If the description's camera is invalid.
    """
    view = next((view for view in appearance.description.views if view.name == name), None)
    if view is not None and view.mount:
        return camera_from(appearance, view, placements, aspect=aspect)
    return _fixed_camera(appearance, name, aspect)


def camera_from(
    appearance: Appearance,
    view: View,
    placements: Mapping[str, FloatArray] | None = None,
    *,
    aspect: float = ASPECT,
) -> Camera:
    """Return the camera that a view specifies.

    An orthographic camera without a height shows the robot's whole workspace.

    Args:
        placements: (4, 4) link to site by link, for a camera on a link; None: at home.
        aspect: The picture's width over its height.

    Raises:
        CameraError: If its mount is unknown, eye and target coincide, or a number is out of range.
    """
    eye, target = _vector(view.eye, "eye"), _vector(view.target, "target")
    up = _vector(view.up, "up")
    if np.linalg.norm(target - eye) < _LEAST_LOOK_M:
        raise CameraError(codes.CAMERA_NO_DIRECTION(place=", ".join(f"{value:g}" for value in eye)))
    mount_to_site = _mount(appearance, view.mount, placements)
    camera = Camera(eye, target, up if up.any() else _UP, field_of_view=_field_of_view(view))
    if view.projection == View.ORTHOGRAPHIC:
        camera = _scaled(appearance, replace(camera, half_height=1.0), view, aspect)
    return _placed(camera, mount_to_site)


@lru_cache(maxsize=256)
def _fixed_camera(appearance: Appearance, name: str, aspect: float) -> Camera:
    """Return a camera that is fixed in the site; cached, because fitting takes time for each picture."""
    for view in appearance.description.views:
        if view.name == name:
            return camera_from(appearance, view, aspect=aspect)
    if name not in (FREE, CLOSE):
        raise UnknownViewError(name, view_names(appearance))
    base_to_site = appearance.base_to_site
    middle = base_to_site[:3, :3].T @ (appearance.center - base_to_site[:3, 3])
    camera = Camera(middle + _FREE_DIRECTION, middle, _UP, field_of_view=_FREE_FIELD_OF_VIEW)
    return _placed(fitted(camera, aspect, appearance.workspace), base_to_site)


def _scaled(appearance: Appearance, camera: Camera, view: View, aspect: float) -> Camera:
    if view.HasField("height"):
        if not _LEAST_HEIGHT_M <= view.height <= _MOST_M:
            raise CameraError(codes.CAMERA_HEIGHT(value=view.height, least=_LEAST_HEIGHT_M, most=_MOST_M))
        return replace(camera, half_height=view.height / 2.0)
    if view.mount:
        return replace(camera, half_height=appearance.radius)
    return fitted(camera, aspect, appearance.workspace)


def _field_of_view(view: View) -> float:
    if not view.HasField("field_of_view"):
        return FIELD_OF_VIEW
    least, most = _FIELDS_OF_VIEW_DEG
    degrees = math.degrees(view.field_of_view)
    if not least <= degrees <= most:
        raise CameraError(
            codes.CAMERA_ANGLE(
                value=view.field_of_view,
                least=math.radians(least),
                most=math.radians(most),
                least_deg=least,
                most_deg=most,
            )
        )
    return view.field_of_view


def _mount(appearance: Appearance, mount: str, placements: Mapping[str, FloatArray] | None) -> FloatArray:
    if not mount:
        return appearance.base_to_site
    placed = placements or home_placements(appearance)
    known = {**placed, **frame_placements(appearance, placed)}
    try:
        return known[mount]
    except KeyError:
        names = ", ".join(sorted(known))
        raise CameraError(codes.CAMERA_MOUNT(mount=mount, names=names)) from None


def _vector(vector: Vector3, what: str) -> FloatArray:
    values = np.array([vector.x, vector.y, vector.z])
    if not np.isfinite(values).all() or np.abs(values).max() > _MOST_M:
        numbers = ", ".join(f"{value:g}" for value in values)
        raise CameraError(codes.CAMERA_VECTOR(field=what, numbers=numbers, most=_MOST_M))
    return values


def _placed(camera: Camera, mount_to_site: FloatArray) -> Camera:
    rotation, origin = mount_to_site[:3, :3], mount_to_site[:3, 3]
    return replace(
        camera,
        eye=rotation @ camera.eye + origin,
        target=rotation @ camera.target + origin,
        up=rotation @ camera.up,
    )
