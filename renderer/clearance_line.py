"""The line between an arm and what is nearest to it, with its length: over the picture, whatever hides it."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from renderer.cameras import Camera, pixels
from renderer.overlay import AMBER, FAINT, INK, Color, Picture, write_label
from robomesh.schemas.robomesh_pb2 import Clearance, Description
from robots.cells import FLOOR

FloatArray = NDArray[np.float64]

RED: Color = (205, 38, 38)
_PAPER: Color = (255, 255, 255)
# Less is below a pixel, and below what a distance is told with.
_NOTICEABLE_M = 5e-4
# OpenCV takes points of so many bits behind the point.
_SHIFT = 4
# Beside the eye a line has no place in the picture [m].
_BEFORE_EYE_M = 0.01


@dataclass(frozen=True, eq=False)
class Span:
    """A line to be drawn.

    Attributes:
        ends: (2, 3) in the site's frame [m].
        color: Of how near it is.
    """

    ends: FloatArray
    text: str
    color: Color


def span_of(clearance: Clearance, descriptions: Sequence[Description]) -> Span:
    """The line of a clearance: red within the stop distance, amber within the warning distance, else grey.

    Args:
        descriptions: Of the robots at its ends; the largest of their distances counts.
    """
    color = FAINT
    of_floor = clearance.second.endswith(f"/{FLOOR}")
    told = [each.floor if of_floor else each for each in descriptions]
    if clearance.distance < max((each.warning_distance for each in told), default=0.0):
        color = AMBER
    stop = max((each.stop_distance for each in told), default=0.0)
    if clearance.distance < stop or clearance.distance == 0.0:
        color = RED
    ends = [(point.x, point.y, point.z) for point in (clearance.first_point, clearance.second_point)]
    return Span(np.array(ends), f"{clearance.distance * 1000:.0f} mm", color)


def same_span(one: Span | None, other: Span | None) -> bool:
    """Whether two look the same."""
    if one is None or other is None:
        return one is other
    return one.color == other.color and float(np.abs(one.ends - other.ends).max()) < _NOTICEABLE_M


def draw_span(picture: Picture, camera: Camera, span: Span, *, labelled: bool) -> None:
    """Draw a line into a picture (height, width, 3), in place."""
    if not camera.orthographic and ((span.ends - camera.eye) @ camera.forward).min() < _BEFORE_EYE_M:
        return
    height, width = picture.shape[:2]
    start, end = pixels(camera, (width, height), span.ends)
    first, second = (tuple(np.round(each * 2**_SHIFT).astype(int).tolist()) for each in (start, end))
    thick = max(1, round(height / 360))
    for color, more in ((_PAPER, 2), (span.color, 0)):
        cv2.line(picture, first, second, color, thick + more, cv2.LINE_AA, _SHIFT)
        for place in (first, second):
            cv2.circle(
                picture, place, (thick + 1 + more // 2) << _SHIFT, color, cv2.FILLED, cv2.LINE_AA, _SHIFT
            )
    if labelled:
        x, y = np.round((start + end) / 2).astype(int).tolist()
        # Amber on paper cannot be read.
        write_label(
            picture, span.text, (x + 4 * thick, y + 2 * thick), color=RED if span.color == RED else INK
        )
