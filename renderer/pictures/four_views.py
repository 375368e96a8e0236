"""A picture of a robot's four views, drawn off screen."""

from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from renderer.drawing.drawing import Drawing
from renderer.drawing.opengl import open_context
from renderer.errors import PictureError
from renderer.pictures.overlay import Overlay, write_over
from renderer.scene.appearance import appearance_of, home_placements, shape_name
from renderer.scene.assembly import Placed, scene_of
from renderer.scene.cameras import fitted
from renderer.scene.views import camera_of
from renderer.shapes.cache import cache_folder, prepared_once
from robomesh.schemas import robomesh_pb2 as schema

_VIEWS = ("front", "left", "top", "free")
_SIZE = (720, 540)
_MARGIN = 1.3


def draw_four_views(description: schema.Description, shapes: Mapping[str, bytes], out: Path) -> None:
    """Draw front, left, top and free, two by two, all joints at home.

    Args:
        shapes: GLB bytes by link name.

    Raises:
        RendererError: If OpenGL is missing, or the picture cannot be written.
    """
    drawing = Drawing(open_context(), _SIZE)
    try:
        aspect = _SIZE[0] / _SIZE[1]
        appearance = appearance_of(description)
        for link in description.links:
            if link.mesh and not drawing.has(shape_name(link)):
                glb = prepared_once(shapes[link.name], color=link.color, folder=cache_folder())
                drawing.add(shape_name(link), glb)
        scene = scene_of(Placed(appearance, home_placements(appearance)))
        pictures = []
        corners = drawing.corners(scene)
        for view in _VIEWS:
            camera = camera_of(appearance, view, aspect=aspect)
            if corners is not None:
                # A site's views leave room for every pose; this picture shows one pose.
                camera = fitted(camera, aspect, corners, margin=_MARGIN)
            picture = drawing.draw(scene, camera).copy()
            write_over(picture, Overlay(description.title, view, time="", state="", rows=()))
            pictures.append(picture)
    finally:
        drawing.close()
    _write(np.vstack([np.hstack(pictures[:2]), np.hstack(pictures[2:])]), out)


def _write(picture: NDArray[np.uint8], out: Path) -> None:
    try:
        done, encoded = cv2.imencode(out.suffix or ".png", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
    except cv2.error:
        done = False
    if not done:
        raise PictureError(f"{out}: no picture format {out.suffix!r}; must be .png or .jpg")
    try:
        out.write_bytes(encoded.tobytes())
    except OSError as error:
        raise PictureError(f"{out}: cannot be written: {error.strerror}") from None
