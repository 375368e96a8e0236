"""Units and upward axes on import."""

from pathlib import Path

import numpy as np
import pytest

from robots.shapes.files.read import read_geometry
from robots.shapes.files.unit_guess import file_to_link, guess
from robots.shapes.files.write_glb import glb_of
from robots.shapes.geometry import Geometry, Material, Part
from robots.shapes.normals import creased
from robots.shapes.solids import box

ODD = "odd for a robot's link"


def a_cube(size: float, unit_m: float | None = None, up: str = "") -> Geometry:
    part = Part("cube", Material(), *creased(*box(np.zeros(3), np.full(3, size)), 0.0))
    return Geometry((part,), unit_m=unit_m, up=up)


@pytest.mark.parametrize(
    ("geometry", "scale_m", "up", "sentence"),
    [
        (a_cube(300), 0.001, "z", "millimetres assumed, the file states no unit: 300 mm large; z up assumed"),
        (a_cube(0.3), 1.0, "z", "metres assumed, the file states no unit: 300 mm large; z up assumed"),
        (a_cube(4.9), 1.0, "z", "metres assumed, the file states no unit: 4.9 m large; z up assumed"),
        (a_cube(5.1), 0.001, "z", "millimetres assumed, the file states no unit: 5.1 mm large; z up assumed"),
        (
            a_cube(60000),
            0.001,
            "z",
            f"millimetres assumed, the file states no unit: 60 m large, {ODD}: check it; z up assumed",
        ),
        (a_cube(0.3, 1.0, "y"), 1.0, "y", "in metres, as the file states: 300 mm large; y up"),
        (a_cube(12, 0.0254, "z"), 0.0254, "z", "in inches, as the file states: 305 mm large; z up"),
        (
            a_cube(300, 1.0, "y"),
            1.0,
            "y",
            "in metres, as the file states: 300 m large; odd for a robot's link; y up",
        ),
        (a_cube(1, 0.07), 0.07, "z", "in units of 0.07 m, as the file states: 70 mm large; z up assumed"),
        (Geometry(), 0.001, "z", "no triangles to judge the size by: millimetres assumed; z up assumed"),
    ],
)
def test_guess_has_a_sentence_with_its_reason(
    geometry: Geometry, scale_m: float, up: str, sentence: str
) -> None:
    found = guess(geometry)
    assert (found.scale_m, found.up, found.sentence) == (scale_m, up, sentence)


def test_upward_y_is_turned_to_z_without_mirroring() -> None:
    matrix = file_to_link(guess(a_cube(0.3, 0.5, "y")))
    np.testing.assert_allclose(matrix[:3, :3] @ [1, 2, 3], [0.5, -1.5, 1.0])
    assert np.linalg.det(matrix[:3, :3]) > 0


def test_exported_glb_is_read_with_z_up(tmp_path: Path) -> None:
    path = tmp_path / "own.glb"
    path.write_bytes(glb_of(a_cube(0.3)))
    assert guess(read_geometry(path)).up == "z"
