"""A picture of a robot's four views, drawn off screen."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robots.schema.errors import RobotError
from robots.schema.robot_toml import RobotDescription

_VIEWS = ("front", "left", "top", "free")
_SIZE = (720, 540)
_MARGIN = 1.3


class PictureError(RobotError):
    """The picture cannot be written."""


def draw_four_views(description: RobotDescription, out: Path) -> None:
    """Draw front, left, top and free, two by two, all joints at home.

    Raises:
        RobotError: If a mesh cannot be read, or the picture cannot be written.
        RendererError: If OpenGL is missing.
    """
    from renderer.drawing.drawing import Drawing
    from renderer.drawing.opengl import open_context
    from renderer.pictures.overlay import Overlay, write_over
    from renderer.scene.appearance import appearance_of, home_placements, shape_name
    from renderer.scene.assembly import Placed, scene_of
    from renderer.scene.cameras import fitted
    from renderer.scene.views import camera_of
    from renderer.shapes.cache import cache_folder, prepared_once
    from robots.descriptions.glb import link_glbs
    from robots.descriptions.urdf.write import to_urdf
    from services.kinematics.descriptions import describe

    drawing = Drawing(open_context(), _SIZE)
    try:
        shapes = link_glbs(description)
        message = describe(
            description,
            urdf=to_urdf(description),
            shapes=shapes,
            base_to_site=np.eye(4),
            cell="",
            simulated=False,
        )
        aspect = _SIZE[0] / _SIZE[1]
        appearance = appearance_of(message)
        for link in message.links:
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
            write_over(picture, Overlay(message.title, view, time="", state="", rows=()))
            pictures.append(picture)
    finally:
        drawing.close()
    _write(np.vstack([np.hstack(pictures[:2]), np.hstack(pictures[2:])]), out)


def _write(picture: NDArray[np.uint8], out: Path) -> None:
    import cv2

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
