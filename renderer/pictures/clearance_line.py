"""The line between an arm and the nearest body, with its length; drawn over the picture."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from renderer.pictures.overlay import AMBER, FAINT, INK, Color, Picture, write_label
from renderer.scene.cameras import Camera, pixels
from robomesh.schemas.robomesh_pb2 import Clearance, Description
from robots.descriptions.cells import FLOOR

FloatArray = NDArray[np.float64]

RED: Color = (205, 38, 38)
_PAPER: Color = (255, 255, 255)
# Smaller changes are below a pixel, and below the resolution of the label.
_NOTICEABLE_M = 5e-4
# Fractional bits of the coordinates that OpenCV takes.
_SHIFT = 4
# Points closer to the eye than this, or behind it, cannot be projected [m].
_BEFORE_EYE_M = 0.01


@dataclass(frozen=True, eq=False)
class ClearanceLine:
    """A line to draw.

    Attributes:
        ends: (2, 3) in the site's frame [m].
        color: Shows how close the bodies are.
    """

    ends: FloatArray
    text: str
    color: Color


def line_of(clearance: Clearance, descriptions: Sequence[Description]) -> ClearanceLine:
    """Return the line of a clearance: red within the stop distance, amber within the warning distance.

    Args:
        descriptions: Descriptions of the robots at its ends; the largest of their distances counts.
    """
    color = FAINT
    of_floor = clearance.second.endswith(f"/{FLOOR}")
    limits = [each.floor if of_floor else each for each in descriptions]
    if clearance.distance < max((each.warning_distance for each in limits), default=0.0):
        color = AMBER
    stop = max((each.stop_distance for each in limits), default=0.0)
    if clearance.distance < stop or clearance.distance == 0.0:
        color = RED
    ends = [(point.x, point.y, point.z) for point in (clearance.first_point, clearance.second_point)]
    return ClearanceLine(np.array(ends), f"{clearance.distance * 1000:.0f} mm", color)


def same_line(one: ClearanceLine | None, other: ClearanceLine | None) -> bool:
    """Return whether two lines look the same."""
    if one is None or other is None:
        return one is other
    return one.color == other.color and float(np.abs(one.ends - other.ends).max()) < _NOTICEABLE_M


def draw_clearance_line(
    picture: Picture, camera: Camera, clearance_line: ClearanceLine, *, labelled: bool
) -> None:
    """Draw a line into a picture (height, width, 3), in place."""
    if (
        not camera.orthographic
        and ((clearance_line.ends - camera.eye) @ camera.forward).min() < _BEFORE_EYE_M
    ):
        return
    height, width = picture.shape[:2]
    start, end = pixels(camera, (width, height), clearance_line.ends)
    first, second = (tuple(np.round(each * 2**_SHIFT).astype(int).tolist()) for each in (start, end))
    thick = max(1, round(height / 360))
    for color, more in ((_PAPER, 2), (clearance_line.color, 0)):
        cv2.line(picture, first, second, color, thick + more, cv2.LINE_AA, _SHIFT)
        for place in (first, second):
            cv2.circle(
                picture, place, (thick + 1 + more // 2) << _SHIFT, color, cv2.FILLED, cv2.LINE_AA, _SHIFT
            )
    if labelled:
        x, y = np.round((start + end) / 2).astype(int).tolist()
        # An amber text would be illegible on the light background.
        write_label(
            picture,
            clearance_line.text,
            (x + 4 * thick, y + 2 * thick),
            color=RED if clearance_line.color == RED else INK,
        )
