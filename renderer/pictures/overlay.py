"""The texts over a picture: robot, view, time, joint values, and STALE.

Digits have one width, so that columns do not move while values change.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.uint8]
Mask = NDArray[np.float32]
Color = tuple[int, int, int]

INK: Color = (34, 40, 48)
FAINT: Color = (58, 66, 77)
PAPER: Color = (228, 232, 237)
AMBER: Color = (250, 176, 24)
MAGENTA: Color = (140, 14, 104)

_FIGURES = "0123456789"
_REGULAR, _BOLD = 420, 650


@dataclass(frozen=True)
class Row:
    """A joint's line: name, value, unit, and position between the limits (0 to 1)."""

    name: str
    value: str
    unit: str
    share: float


@dataclass(frozen=True)
class Overlay:
    """The texts of a picture.

    Attributes:
        marks: Highlighted words ("simulated", "replay", "inside forearm").
        scale: Width of a square of the floor ("100 mm"), or empty.
        stale: "STALE 3 s", or empty while the picture is current.
    """

    title: str
    view: str
    time: str
    state: str
    rows: tuple[Row, ...]
    marks: tuple[str, ...] = ()
    scale: str = ""
    stale: str = ""


def inside(overlay: Overlay, body: str) -> Overlay:
    """Return an overlay with a mark for the body that contains the camera; unchanged if `body` is empty."""
    return replace(overlay, marks=(*overlay.marks, f"inside {body}")) if body else overlay


def write_over(picture: Picture, overlay: Overlay) -> None:
    """Write an overlay on an RGB picture (height, width, 3), in place."""
    height, width = picture.shape[:2]
    # Legible at 480p, and not too large at 1080p.
    size = max(13, round(height / 34))
    margin = round(size * 0.9)
    baseline = margin + size
    x = margin + _text(picture, overlay.title, (margin, baseline), size=round(size * 1.2), weight=_BOLD)
    x += round(size * 0.7)
    x += _text(picture, overlay.view, (x, baseline), size=size, color=FAINT)
    for mark in overlay.marks:
        x += round(size * 0.7)
        x += _text(picture, mark, (x, baseline), size=size, color=MAGENTA)
    at = width - margin - text_width(overlay.time, size)
    _text(picture, overlay.time, (at, baseline), size=size)
    at = width - margin - text_width(overlay.state, size)
    _text(picture, overlay.state, (at, baseline + round(1.45 * size)), size=size, color=FAINT)
    _write_rows(picture, overlay, size=size, margin=margin)
    if overlay.scale:
        _write_scale(picture, overlay.scale, size=size, margin=margin)
    if overlay.stale:
        _write_badge(picture, overlay.stale, size=round(size * 1.5), y=margin)


def write_label(picture: Picture, text: str, at: tuple[int, int], *, color: Color) -> None:
    """Write a text on a light background, left-aligned at a position, or moved to fit in the picture."""
    height, width = picture.shape[:2]
    size = max(13, round(height / 34))
    pad = size // 3
    extent = text_width(text, size) + 2 * pad, round(1.3 * size)
    x = min(max(at[0], 0), max(width - extent[0], 0))
    y = min(max(at[1], 0), max(height - extent[1], 0))
    _wash(picture, (x, y), extent)
    _text(picture, text, (x + pad, y + size), size=size, color=color)


def _write_rows(picture: Picture, overlay: Overlay, *, size: int, margin: int) -> None:
    if not overlay.rows:
        return
    height = picture.shape[0]
    line = round(1.5 * size)
    names = max(text_width(row.name, size) for row in overlay.rows)
    values = max(text_width(row.value, size) for row in overlay.rows)
    units = max(text_width(row.unit, size) for row in overlay.rows)
    bar = 4 * size
    gap = round(0.7 * size)
    box_width = names + values + units + bar + 5 * gap
    box_height = line * len(overlay.rows) + gap
    top = height - margin - box_height
    _wash(picture, (margin, top), (box_width, box_height))
    color = FAINT if overlay.stale else INK
    for number, row in enumerate(overlay.rows):
        baseline = top + gap // 2 + line * number + round(1.12 * size)
        x = margin + gap
        _text(picture, row.name, (x, baseline), size=size, color=FAINT)
        x += names + gap + values
        _text(picture, row.value, (x - text_width(row.value, size), baseline), size=size, color=color)
        if overlay.stale:
            middle = baseline - round(0.34 * size)
            picture[middle : middle + 1, x - text_width(row.value, size) : x] = color
        x += 0 if row.unit == "°" else gap // 2
        _text(picture, row.unit, (x, baseline), size=size, color=FAINT)
        x += units + gap
        middle = baseline - round(0.36 * size)
        picture[middle : middle + max(1, size // 10), x : x + bar] = (156, 164, 173)
        at = x + round(min(max(row.share, 0.0), 1.0) * bar)
        half = max(2, size // 3)
        picture[middle - half : middle + half, at - 1 : at + 2] = color


def _write_scale(picture: Picture, text: str, *, size: int, margin: int) -> None:
    """Draw the scale: a square, and the width of a square of the floor."""
    height, width = picture.shape[:2]
    small, gap = round(0.85 * size), round(0.4 * size)
    side = round(0.62 * size)
    extent = side + text_width(text, small) + 3 * gap, round(1.45 * small)
    x, y = width - margin - extent[0], height - margin - extent[1]
    _wash(picture, (x, y), extent)
    middle = y + extent[1] // 2
    corner = x + gap, middle - side // 2
    cv2.rectangle(picture, corner, (corner[0] + side, corner[1] + side), FAINT, max(1, size // 16))
    _text(picture, text, (corner[0] + side + gap, middle + round(0.36 * small)), size=small, color=FAINT)


def _write_badge(picture: Picture, text: str, *, size: int, y: int) -> None:
    width = picture.shape[1]
    pad = round(0.55 * size)
    inner = text_width(text, size, _BOLD)
    x = max((width - inner) // 2 - pad, 0)
    picture[y : y + size + 2 * pad - size // 4, x : x + inner + 2 * pad] = AMBER
    _text(picture, text, (x + pad, y + pad + round(0.78 * size)), size=size, weight=_BOLD, color=(28, 22, 8))


def _wash(picture: Picture, at: tuple[int, int], size: tuple[int, int]) -> None:
    """Lighten an area, so that a text on it is legible over anything."""
    x, y = at
    area = picture[max(y, 0) : max(y + size[1], 0), max(x, 0) : max(x + size[0], 0)]
    if not area.size:
        return
    cv2.addWeighted(area, 0.34, np.full_like(area, PAPER), 0.66, 0.0, dst=area)


def text_width(text: str, size: int, weight: int = _REGULAR) -> int:
    """Return the width of a text [px]."""
    return sum(advance for _, advance in _pieces(text, size, weight))


def _text(
    picture: Picture, text: str, at: tuple[int, int], *, size: int, weight: int = _REGULAR, color: Color = INK
) -> int:
    """Write a text with its baseline's left end at a position; return its width [px]."""
    x, baseline = at
    start = x
    for mask, advance in _pieces(text, size, weight):
        _lay(picture, mask, x - 1, baseline - size - size // 4, color)
        x += advance
    return x - start


def _lay(picture: Picture, mask: Mask, x: int, y: int, color: Color) -> None:
    """Blend a colour into a picture through a mask, clipped at the picture's edges."""
    top, left = max(y, 0), max(x, 0)
    area = picture[top : max(y + mask.shape[0], 0), left : max(x + mask.shape[1], 0)]
    if area.size:
        part = mask[top - y : top - y + area.shape[0], left - x : left - x + area.shape[1], None]
        area[:] = area + (np.array(color, dtype=np.float32) - area) * part


def _pieces(text: str, size: int, weight: int) -> list[tuple[Mask, int]]:
    """Return (mask, advance) of runs of text; each digit is a separate run with a fixed width."""
    pieces: list[tuple[Mask, int]] = []
    run = ""
    for character in text:
        if character in _FIGURES:
            if run:
                pieces.append(_drawn(run, size, weight))
            pieces.append((_drawn(character, size, weight)[0], _figure_width(size, weight)))
            run = ""
        else:
            run += character
    if run:
        pieces.append(_drawn(run, size, weight))
    return pieces


@lru_cache(maxsize=16)
def _figure_width(size: int, weight: int) -> int:
    return max(_drawn(figure, size, weight)[1] for figure in _FIGURES)


@lru_cache(maxsize=1024)
def _drawn(text: str, size: int, weight: int) -> tuple[Mask, int]:
    """Return a run of text as a mask, 0 to 1, and the distance to the next run [px]."""
    face = _font()
    canvas = np.zeros((round(size * 1.7), (len(text) + 2) * size * 2, 3), dtype=np.uint8)
    (end, _), _ = cv2.putText(canvas, text, (1, size + size // 4), (255, 255, 255), face, size, weight)
    advance = end - 1
    mask = canvas[:, : advance + max(2, size // 3), 0].astype(np.float32) / 255.0
    return mask, advance


@lru_cache(maxsize=1)
def _font() -> "cv2.FontFace":
    return cv2.FontFace("sans")
