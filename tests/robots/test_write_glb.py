"""Written GLB, read back as a file and as the renderer reads it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from renderer.shapes.prepare import prepared
from robots.shapes.files.gltf import read_glb
from robots.shapes.files.read import read_geometry
from robots.shapes.files.write_glb import glb_of
from robots.shapes.geometry import Geometry, Material, Part, Wire, bounds
from robots.shapes.normals import creased
from robots.shapes.simplify import lightened
from robots.shapes.solids import ball, box

GLASS = Material("glass", (0.2, 0.4, 0.6), emissive=(0.0, 0.5, 0.0), transparency=0.25, texture="wood.png")


def a_box(material: Material = GLASS) -> Part:
    return Part("box", material, *creased(*box(np.zeros(3), np.array([1.0, 2.0, 3.0])), 0.0), two_sided=True)


def a_ball(segments: int) -> Part:
    return Part("ball", Material("paint"), *creased(*ball(1.0, segments), np.pi))


def back(folder: Path, geometry: Geometry) -> Geometry:
    path = folder / "made.glb"
    path.write_bytes(glb_of(geometry))
    return read_geometry(path)


def test_material_and_shape_survive_a_round_trip(tmp_path: Path) -> None:
    geometry = back(tmp_path, Geometry((a_box(),)))
    (part,) = geometry.parts
    assert len(part.triangles) == 12
    np.testing.assert_array_equal(bounds(geometry), [[0, 0, 0], [1, 2, 3]])
    assert part.material.diffuse == pytest.approx(GLASS.diffuse, abs=1e-6)
    assert part.material.emissive == pytest.approx(GLASS.emissive, abs=1e-6)
    assert part.material.transparency == pytest.approx(0.25)
    assert (part.material.name, part.material.texture, part.two_sided) == ("glass", "wood.png", True)
    assert len(part.vertices) == 24  # the edges stay sharp


def test_vrml_to_glb_keeps_triangles_bounds_colours_and_transparency(tmp_path: Path) -> None:
    path = tmp_path / "some.wrl"
    path.write_text(
        "#VRML V2.0 utf8\nShape { appearance Appearance { material DEF M Material {"
        " diffuseColor 0.9 0.1 0.3 transparency 0.5 } } geometry Cylinder { radius 0.123456 height 7 } }"
        "Transform { translation 1 2 3 children Shape { geometry Box { } } }"
    )
    before = read_geometry(path)
    after = back(tmp_path, before)
    assert after.triangle_count == before.triangle_count
    np.testing.assert_allclose(bounds(after), bounds(before), rtol=1e-7)
    colors = {part.material.diffuse: part.material.transparency for part in before.parts}
    for part in after.parts:
        same = min(colors, key=lambda color: float(np.abs(np.subtract(color, part.material.diffuse)).max()))
        assert part.material.diffuse == pytest.approx(same, abs=1e-6)
        assert part.material.transparency == pytest.approx(colors[same])


def test_vertex_colours_are_read_by_robots_and_by_the_renderer(tmp_path: Path) -> None:
    plain = a_box()
    colors = np.tile([0.2, 0.4, 0.6, 1.0], (len(plain.vertices), 1))
    colors[0] = [1.0, 0.0, 0.5, 0.5]
    geometry = Geometry((replace(plain, colors=colors),))
    (part,) = back(tmp_path, geometry).parts
    assert part.colors is not None
    np.testing.assert_allclose(part.colors, colors, atol=1e-6)
    (surface,) = read_glb(glb_of(geometry))
    assert surface.colors is not None
    assert surface.color == pytest.approx((1.0, 1.0, 1.0, 1.0))
    np.testing.assert_allclose(surface.colors, colors, atol=1e-6)


def test_lines_and_points_survive_a_round_trip_and_the_renderer_ignores_them(tmp_path: Path) -> None:
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0]])
    red = Material("red", (1.0, 0.0, 0.0))
    lines = Wire("lines", red, corners, np.array([[0, 1], [1, 2]]))
    points = Wire("points", red, corners + 5, np.zeros((0, 2), dtype=np.int64))
    geometry = Geometry((a_box(),), wires=(lines, points))
    found = back(tmp_path, geometry)
    assert sorted(len(wire.vertices) for wire in found.wires if not len(wire.segments)) == [3]
    drawn = next(wire for wire in found.wires if len(wire.segments))
    ends = {tuple(sorted(map(tuple, drawn.vertices[pair].tolist()))) for pair in drawn.segments}
    assert ends == {((0, 0, 0), (1, 0, 0)), ((1, 0, 0), (1, 1, 0))}
    assert len(prepared(glb_of(geometry)).finest) == 12


def test_empty_shape_is_a_valid_glb(tmp_path: Path) -> None:
    geometry = back(tmp_path, Geometry())
    assert geometry.triangle_count == 0
    assert read_glb(glb_of(Geometry())) == ()


def test_same_shape_gives_the_same_bytes() -> None:
    assert glb_of(Geometry((a_box(),))) == glb_of(Geometry((a_box(),)))


def test_large_shape_is_simplified_and_keeps_its_shape() -> None:
    heavy = Geometry((a_ball(128), a_box()))
    light = lightened(heavy, 2000)
    assert light.triangle_count == pytest.approx(2000, rel=0.1)
    assert len(light.parts[1].triangles) == 12  # small shapes are not reduced
    np.testing.assert_allclose(bounds(light), bounds(heavy), atol=0.02)
    radii = np.linalg.norm(light.parts[0].vertices, axis=1)
    assert radii.min() > 0.98
    assert lightened(heavy, 10**6) is heavy


def test_simplified_vertices_keep_the_colours_of_their_positions() -> None:
    part = a_ball(128)
    halves = np.where(part.vertices[:, 2:] > 0, [1.0, 0, 0, 1], [0.0, 0, 1, 1])
    (light,) = lightened(Geometry((replace(part, colors=halves),)), 2000).parts
    assert light.colors is not None
    away = np.abs(light.vertices[:, 2]) > 0.15
    np.testing.assert_array_equal(light.colors[away, 0] == 1.0, light.vertices[away, 2] > 0)
