"""Choice of the triangles that are lit at their vertices."""

import numpy as np
import pytest

from renderer.drawing import drawing
from renderer.shapes.prepare import prepared
from renderer.shapes.vertex_light import SCALES, counts_at, ordered
from tests.renderer.bodies import ball, context_or_skip, cube
from tests.renderer.make_pictures import free, front
from tests.renderer.renderer_site import shared_shapes


def lit_at(geometry, scale):
    return int(counts_at(np.array([scale]), geometry.vertex_lit[:1])[0])


def test_flat_faces_are_lit_at_vertices_until_they_are_wide_in_the_picture():
    geometry = prepared(cube(0.05))  # its faces' diagonals are 0.14 m long
    assert lit_at(geometry, 1000.0) == 12
    assert lit_at(geometry, 2000.0) == 0


def triangle_turned(*turns, roughness):
    """Return triangles with sides of 0.1 m, whose normals turn by `turns` [rad]."""
    positions = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.05, 0.0866, 0.0]] * len(turns))
    up = [0.0, 0.0, 1.0]
    normals = np.array([row for turn in turns for row in (up, [np.sin(turn), 0.0, np.cos(turn)], up)])
    return (
        positions,
        normals,
        np.repeat(roughness, 3),
        np.arange(len(positions), dtype=np.uint32).reshape(-1, 3),
    )


def test_strongly_curved_triangles_are_lit_at_vertices_only_where_they_are_tiny():
    _, counts = ordered(*triangle_turned(1.2, roughness=[0.5]))
    assert counts_at(np.array([30.0, 60.0]), np.array([counts, counts])).tolist() == [1, 0]


def test_the_number_of_triangles_grows_with_smaller_scales_down_to_all():
    geometry = prepared(ball(0.3))
    counts = geometry.vertex_lit[0].astype(int)
    assert (np.diff(counts) >= 0).all()
    assert counts[-1] == len(geometry.finest)


def test_a_scale_above_all_lights_no_triangle_at_vertices():
    counts = np.full((2, len(SCALES)), 7, dtype=np.uint32)
    assert counts_at(np.array([2.0 * SCALES[0], SCALES[-1] / 2.0]), counts).tolist() == [0, 7]


def test_a_polished_surface_needs_light_at_each_pixel_where_a_matt_one_does_not():
    triangles, counts = ordered(*triangle_turned(0.4, 0.4, roughness=[0.2, 0.8]))
    assert triangles.tolist() == [[3, 4, 5], [0, 1, 2]]
    assert counts_at(np.array([500.0]), counts[None]).tolist() == [1]


def test_transparent_triangles_keep_their_order_and_light_at_each_pixel():
    solid, glass = (prepared(ball(0.3, color=(1.0, 0.0, 0.0, opacity))) for opacity in (1.0, 0.5))
    assert lit_at(solid, 100.0) > 0
    assert glass.vertex_lit.max() == 0


@pytest.mark.parametrize("picture", [free, front])
@pytest.mark.slow
def test_light_at_vertices_looks_like_light_at_each_pixel(picture, tmp_path, monkeypatch):
    context_or_skip().release()
    folder = shared_shapes(tmp_path)
    fast = picture(folder, size=(640, 360)).astype(float)
    monkeypatch.setattr(drawing, "counts_at", lambda scales, _: np.zeros(len(scales), dtype=np.uint32))
    exact = picture(folder, size=(640, 360)).astype(float)
    difference = np.abs(fast - exact)
    assert difference.max() > 0.0
    assert (difference.max(axis=2) > 8.0).mean() < 0.001
    assert np.square(difference).mean() < 255.0**2 / 10**5  # 50 dB
