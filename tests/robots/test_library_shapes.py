"""The library's shapes: made by the script in the repository, and shaped as an arm's links are."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from robots.descriptions.description import LIBRARY, library_names, load
from robots.kinematics.model import build_model, link_placements, tool_placement
from robots.library.build_shapes import ROBOTS, shape_file
from robots.shapes.files.read import read_geometry
from robots.shapes.files.vrml.read import read_vrml
from robots.shapes.files.vrml.write import write_vrml
from robots.shapes.geometry import Geometry, bounds

FILES = [(robot, name) for robot, files in ROBOTS.items() for name in files]


def same(one: Geometry, other: Geometry, tolerance: float) -> None:
    assert [part.material for part in one.parts] == [part.material for part in other.parts]
    for a, b in zip(one.parts, other.parts, strict=True):
        np.testing.assert_array_equal(a.triangles.shape, b.triangles.shape)
        np.testing.assert_allclose(a.vertices[a.triangles], b.vertices[b.triangles], atol=tolerance)
        np.testing.assert_allclose(a.normals[a.triangles], b.normals[b.triangles], atol=tolerance)


@pytest.mark.parametrize(("robot", "name"), FILES)
def test_script_makes_the_committed_file(tmp_path: Path, robot: str, name: str) -> None:
    # Not byte for byte: another machine's sine may differ in the last digit.
    (tmp_path / name).write_bytes(shape_file(robot, name))
    same(read_geometry(tmp_path / name), read_geometry(LIBRARY / robot / "meshes" / name), 0.002)


@pytest.mark.parametrize("robot", library_names())
def test_every_link_has_a_shape_and_both_formats_are_used(robot: str) -> None:
    description = load(robot)
    paths = [description.mesh_path(body) for body in description.bodies.values()]
    assert None not in paths
    assert {path.suffix for path in paths if path} == {".wrl", ".3ds"}


@pytest.mark.parametrize(("robot", "name"), FILES)
def test_file_reads_without_a_warning_and_with_its_paint(robot: str, name: str) -> None:
    geometry = read_geometry(LIBRARY / robot / "meshes" / name)
    assert geometry.warnings == ()
    assert {part.material.name for part in geometry.parts} <= {"paint", "casting", "steel", "rubber"}
    assert geometry.triangle_count < 12_000


@pytest.mark.parametrize(("robot", "name"), FILES)
def test_normals_point_as_their_triangles_do(robot: str, name: str) -> None:
    for part in read_geometry(LIBRARY / robot / "meshes" / name).parts:
        a, b, c = (part.vertices[part.triangles[:, corner]] for corner in range(3))
        facing = np.cross(b - a, c - a)
        sense = np.einsum("ij,ij->i", facing, part.normals[part.triangles].mean(axis=1))
        assert (sense < -1e-3).sum() == 0


@pytest.mark.parametrize("robot", library_names())
def test_arm_stands_on_the_floor_and_ends_at_its_tool(robot: str) -> None:
    description = load(robot)
    model = build_model(description)
    placements = link_placements(model, model.joints.home)
    corners = {}
    for (name, body), placement in zip(description.bodies.items(), placements, strict=True):
        path = description.mesh_path(body)
        assert path is not None
        points = np.concatenate([part.vertices for part in read_geometry(path).parts]) * body.mesh_scale
        corners[name] = points @ placement[:3, :3].T + placement[:3, 3]
    assert np.concatenate(list(corners.values()))[:, 2].min() == pytest.approx(0.0, abs=1e-6)
    tool = tool_placement(model, model.joints.home)
    along = (corners["flange"] - tool[:3, 3]) @ tool[:3, 2]
    assert along.max() == pytest.approx(0.0, abs=0.005)  # the dowel projects by 3 mm
    # Each link touches the next: no gap that one could see through.
    names = list(corners)
    for one, other in pairwise(names):
        low = np.maximum(corners[one].min(axis=0), corners[other].min(axis=0))
        high = np.minimum(corners[one].max(axis=0), corners[other].max(axis=0))
        assert (high - low > -0.004).all(), (one, other)


def test_what_is_written_as_vrml_reads_the_same(tmp_path: Path) -> None:
    geometry = read_geometry(LIBRARY / "pt600" / "meshes" / "flange.3ds")
    path = tmp_path / "flange.wrl"
    path.write_text(write_vrml(geometry))
    again = read_vrml(path)
    assert again.warnings == ()
    np.testing.assert_allclose(bounds(again), bounds(geometry), atol=0.001)
    for one, other in zip(geometry.parts, again.parts, strict=True):
        assert other.material.name == one.material.name
        np.testing.assert_allclose(other.material.diffuse, one.material.diffuse, atol=1e-4)
        np.testing.assert_allclose(other.vertices[other.triangles], one.vertices[one.triangles], atol=0.001)
