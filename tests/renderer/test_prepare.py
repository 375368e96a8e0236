"""Meshes: reading from GLB, preparation, cache."""

import contextlib
import json
import math
import struct

import numpy as np
import pytest

from renderer.errors import GlbError
from renderer.shapes import cache
from renderer.shapes.prepare import prepared
from robots.schema.errors import ShapeError
from robots.shapes.files.gltf import glb_to_z_up, read_glb
from tests.renderer.bodies import ball, cube

RED = (1.0, 0.0, 0.0, 1.0)


def area(geometry):
    a, b, c = (geometry.positions[geometry.triangles[:, corner]] for corner in range(3))
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


def test_a_cube_keeps_its_flat_faces_and_its_twelve_edges():
    geometry = prepared(cube(0.5))
    assert len(geometry.triangles) == 12
    # Each of the 8 corners once for each adjacent face.
    assert len(geometry.positions) == 24
    assert np.isclose(np.abs(geometry.normals).max(axis=1), 1.0).all()
    assert len(geometry.edges) == 2 * 12
    assert area(geometry) == pytest.approx(6.0)


def test_a_ball_is_smooth_and_has_no_edges():
    geometry = prepared(ball(0.3))
    outwards = geometry.positions / np.linalg.norm(geometry.positions, axis=1, keepdims=True)
    assert (outwards * geometry.normals).sum(axis=1).min() > 0.98
    assert len(geometry.edges) == 0


def test_a_heavy_shape_is_simplified_and_keeps_its_size():
    heavy = ball(0.3, rings=80, sectors=100)
    geometry = prepared(heavy, most_triangles=1000)
    assert 300 < len(geometry.finest) <= 1000
    assert len(geometry.shadow) // 3 < 400
    assert np.abs(geometry.positions).max() == pytest.approx(0.3, rel=0.02)
    assert area(geometry) == pytest.approx(4 * np.pi * 0.09, rel=0.03)


def test_a_node_places_its_shape():
    quarter_turn_about_z = [0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)]
    node = {"translation": [1.0, 2.0, 3.0], "rotation": quarter_turn_about_z, "scale": [2.0, 1.0, 1.0]}
    positions = prepared(cube(0.5, node=node)).positions
    # x 0.5 to 1.5, y 1 to 3, z 2.5 to 3.5 in the file, where y is up.
    assert positions.min(axis=0) == pytest.approx([0.5, -3.5, 1.0], abs=1e-6)
    assert positions.max(axis=0) == pytest.approx([1.5, -2.5, 3.0], abs=1e-6)


def test_a_mirrored_node_still_shows_its_outside():
    geometry = prepared(cube(0.5, node={"scale": [-1.0, 1.0, 1.0]}))
    assert ((geometry.positions * geometry.normals).sum(axis=1) > 0).all()


@pytest.mark.parametrize(
    ("color", "said", "painted"),
    [
        (RED, "#00ff00", (255, 0, 0, 255)),
        (None, "#00ff00", (0, 255, 0, 255)),
        ((1.0, 0.0, 0.0, 0.5), "", (255, 0, 0, 128)),
    ],
)
def test_the_files_colour_takes_precedence_over_the_descriptions(color, said, painted):
    geometry = prepared(cube(0.5, color=color), color=said)
    assert tuple(geometry.colors[0]) == painted
    assert geometry.transparent == (painted[3] < 255)


def test_an_empty_shape_is_empty():
    geometry = prepared(b"glTF" + struct.pack("<II", 2, 22) + struct.pack("<II", 2, 0x4E4F534A) + b"{}")
    assert len(geometry.triangles) == 0


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"", "not a GLB"),
        (b"#VRML V2.0 utf8 Shape {}", "not a GLB"),
        (b"glTF" + struct.pack("<II", 1, 24) + bytes(12), "version 1"),
        (cube(0.5)[:-8], "truncated"),
        (cube(0.5).replace(b'"POSITION": 0', b'"POSITION": 7'), "is inconsistent"),
        (cube(0.5).replace(b'"count": 8', b'"count": 3'), "uses vertex 7; there are 3"),
    ],
)
def test_invalid_glb_is_rejected(data, says):
    with pytest.raises(GlbError, match=says):
        prepared(data)


@pytest.mark.parametrize(
    "document",
    [
        [],
        {"asset": 5},
        {"asset": {"extras": []}, "nodes": [7]},
        {"nodes": {"a": 1}, "scenes": [3]},
        {"asset": {}, "nodes": [{"mesh": 0}], "meshes": [{"primitives": 4}], "scenes": [{"nodes": [0]}]},
    ],
)
def test_json_of_another_shape_is_rejected_or_has_no_surface(document):
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    data = struct.pack("<4sIIII", b"glTF", 2, 20 + len(text), len(text), 0x4E4F534A) + text
    for read in (read_glb, glb_to_z_up):
        with contextlib.suppress(ShapeError):
            read(data)


def test_positions_that_are_not_finite_are_rejected():
    with pytest.raises(GlbError, match="non-finite"):
        prepared(cube(math.nan))


def test_nodes_that_form_a_cycle_are_rejected():
    with pytest.raises(GlbError, match="its own ancestor"):
        prepared(cube(0.5, node={"children": [0]}))


def test_a_file_truncated_anywhere_is_an_error():
    whole = cube(0.5)
    for length in range(len(whole)):
        with pytest.raises(ShapeError):
            read_glb(whole[:length])


def test_a_shape_is_prepared_once(tmp_path, monkeypatch):
    glb = ball(0.3)
    first = cache.prepared_once(glb, color="#102030", folder=tmp_path)
    monkeypatch.setattr(cache, "prepared", None)
    again = cache.prepared_once(glb, color="#102030", folder=tmp_path)
    assert np.array_equal(first.positions, again.positions)
    assert np.array_equal(first.triangles, again.triangles)


def test_a_damaged_or_unwritable_cache_is_harmless(tmp_path):
    glb = cube(0.5)
    whole = cache.prepared_once(glb, color="", folder=tmp_path)
    (path,) = tmp_path.iterdir()
    for length in (0, 10, path.stat().st_size // 2, path.stat().st_size - 1):
        path.write_bytes(path.read_bytes()[:length])
        again = cache.prepared_once(glb, color="", folder=tmp_path)
        assert np.array_equal(again.positions, whole.positions)
        assert [each.name for each in tmp_path.iterdir()] == [path.name]
    no_folder = path / "below a file"
    assert len(cache.prepared_once(glb, color="", folder=no_folder).triangles) == 12
    cache.store_glb(glb, no_folder)


def test_a_damaged_stored_shape_is_not_used(tmp_path):
    cache.store_glb(b"some mesh", tmp_path)
    (path,) = tmp_path.iterdir()
    assert cache.stored_glb(path.stem, tmp_path) == b"some mesh"
    path.write_bytes(b"some mes")
    assert cache.stored_glb(path.stem, tmp_path) is None
    assert cache.stored_glb("0" * 64, tmp_path) is None
