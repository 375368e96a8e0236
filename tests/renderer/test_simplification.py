"""Simplification within an error, and the choice of a level of detail by it."""

from itertools import pairwise

import numpy as np
import pytest

from renderer.drawing import level_of_detail
from renderer.drawing.level_of_detail import next_level
from renderer.shapes import prepare
from renderer.shapes.creases import corner_normals
from renderer.shapes.prepare import prepared
from renderer.shapes.simplification import simplified
from tests.renderer.bodies import ball, context_or_skip, cube, glb
from tests.renderer.make_pictures import program
from tests.renderer.renderer_site import shared_shapes

ERRORS = (0.0, 0.001, 0.004)


def plate(cells):
    """Return a flat plate of 1 m in cells, facing z: positions and triangles."""
    x, y = np.meshgrid(np.linspace(0.0, 1.0, cells + 1), np.linspace(0.0, 1.0, cells + 1))
    positions = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    first = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    low, high = (first, first + 1, first + cells + 2), (first, first + cells + 2, first + cells + 1)
    return positions, np.concatenate([np.stack(low, axis=1), np.stack(high, axis=1)])


def area(positions, triangles):
    a, b, c = (positions[triangles[:, corner]] for corner in range(3))
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


def test_an_open_plate_loses_triangles_but_not_its_border():
    positions, triangles = plate(20)
    points, faces, values = simplified(
        positions, triangles, corner_normals(positions, triangles), error=0.001
    )
    assert len(faces) < len(triangles) / 4
    assert area(points, faces) == pytest.approx(1.0)
    assert np.allclose(values, [0.0, 0.0, 1.0])


def test_corners_keep_the_values_of_their_own_side_of_an_edge():
    positions, triangles = plate(20)
    positions = np.where(positions[:, :1] > 0.5, positions + (positions[:, :1] - 0.5) * [-1, 0, 1], positions)
    normals = corner_normals(positions, triangles)  # flat, then upright along the line x = 0.5
    sides = (normals[..., 0] < -0.5)[..., None].astype(float)
    points, faces, values = simplified(
        positions, triangles, np.concatenate([normals, sides], axis=2), error=0.001
    )
    assert len(faces) < len(triangles) / 4
    upright = (points[faces].max(axis=1)[:, 2] > 1e-6).astype(float)[:, None]
    assert np.allclose(values[..., 3], upright, atol=1e-6)
    assert np.allclose(values[..., 0], -upright, atol=1e-6)


def test_a_balls_levels_stay_within_their_errors():
    geometry = prepared(ball(0.3, rings=60, sectors=80))
    assert len(geometry.errors) > 2
    for (first, end), error in zip(pairwise(geometry.levels.tolist()), geometry.errors.tolist(), strict=True):
        corners = geometry.positions[geometry.triangles[first:end]].astype(float)
        distances = np.linalg.norm(
            np.concatenate([corners, corners.mean(axis=1, keepdims=True)], axis=1), axis=2
        )
        assert np.abs(distances - 0.3).max() < error + 0.0012  # as far as the finest level is from the ball


def test_a_cube_has_one_level():
    assert prepared(cube(0.5)).levels.tolist() == [0, 12]


@pytest.mark.slow
def test_a_rough_scan_keeps_its_longest_edges_only():
    positions, triangles = plate(80)
    positions[:, 2] = np.random.default_rng(0).normal(0.0, 0.02, len(positions))
    positions[positions[:, 0] > 0.99, 0] += 0.05
    geometry = prepared(glb(positions, triangles))
    assert len(geometry.edges) == 2 * 8_000
    # The longer sides at the moved border are among those that are kept.
    assert geometry.edges[:, 0].max() == pytest.approx(1.05, abs=1e-6)


def test_a_large_scan_is_reduced_before_its_errors_are_bounded(monkeypatch):
    positions, triangles = plate(40)
    positions[:, 2] = np.random.default_rng(0).normal(0.0, 0.3, len(positions))
    scan = glb(positions, triangles)
    assert len(prepared(scan).finest) == len(triangles)
    monkeypatch.setattr(prepare, "_MOST_BOUNDED", 500)
    assert 0 < len(prepared(scan).finest) < len(triangles) / 2


def test_the_coarsest_level_with_an_allowed_error_is_chosen():
    assert [next_level(ERRORS, allowed, None) for allowed in (0.0, 0.0009, 0.001, 0.1)] == [0, 0, 1, 2]


def test_a_level_is_kept_near_its_limit_and_changes_beyond():
    assert next_level(ERRORS, 0.0009, 1) == 1
    assert next_level(ERRORS, 0.0008, 1) == 0
    assert next_level(ERRORS, 0.0011, 0) == 0
    assert next_level(ERRORS, 0.0013, 0) == 1
    assert next_level(ERRORS, 0.1, 0) == 2


def test_a_shape_with_fewer_levels_than_before_gets_one_of_its_own():
    assert next_level((0.0,), 0.1, 2) == 0


@pytest.mark.slow
def test_levels_of_detail_look_like_every_triangle(tmp_path, monkeypatch):
    context_or_skip().release()
    folder = shared_shapes(tmp_path)
    fewer = program(folder, size=(1280, 720)).astype(float)
    monkeypatch.setattr(level_of_detail, "_MOST_PX", 1e-9)
    every = program(folder, size=(1280, 720)).astype(float)
    difference = np.abs(fewer - every)
    assert difference.max() > 0.0
    assert (difference.max(axis=2) > 20.0).mean() < 0.002
    assert np.square(difference).mean() < 255.0**2 / 10**4.3  # 43 dB
