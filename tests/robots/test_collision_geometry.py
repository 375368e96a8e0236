"""The checked geometry of a robot: its complete collision geometry, also after import and export."""

from pathlib import Path

import numpy as np
import pytest

from robots.bodies.geometry import hull_body
from robots.collision import build_cell, outside_nearest
from robots.descriptions.cells import CellDescription, CellRobot
from robots.descriptions.description import load
from robots.descriptions.glb import link_geometry
from robots.kinematics.joints import FloatArray
from robots.kinematics.kinematic_tree import tree_of
from services.command_line.main import run
from tests.robots.boxes import block, placed

REAL = Path(__file__).parents[3] / "shared" / "testdata" / "urdf"
needs_real_robots = pytest.mark.skipif(not REAL.is_dir(), reason="no ../shared/testdata/urdf: no real robots")
IRB2400 = REAL / "abb_irb2400_support" / "urdf" / "irb2400_12_155.urdf"
GP8 = REAL / "motoman_gp8_support" / "urdf" / "gp8.urdf"

# The visual geometry reaches to x = 0.5 m, the collision geometry to 0.6 m.
PADDED = """<robot name="padded">
<link name="root"><visual><geometry><box size="0.1 0.1 0.1"/></geometry></visual></link>
<link name="arm">
  <visual><origin xyz="0.25 0 0.3"/><geometry><box size="0.5 0.1 0.1"/></geometry></visual>
  <collision><origin xyz="0.3 0 0.3"/><geometry><box size="0.6 0.2 0.2"/></geometry></collision>
</link>
<joint name="turn" type="revolute"><axis xyz="0 0 1"/><parent link="root"/><child link="arm"/>
  <limit lower="-3" upper="3" velocity="1" effort="1"/></joint>
</robot>"""


def cell_of(model: Path) -> CellDescription:
    return CellDescription((CellRobot("arm", model, np.eye(4)),), (block("wall", (0.1, 2, 2), placed(0.7)),))


def corners(model: Path, link: str) -> tuple[FloatArray, FloatArray]:
    """Return the corners of the bounding box of a link's checked geometry."""
    (found,) = (each for each in tree_of(load(model)).links if each.name == link)
    vertices = np.concatenate([part.vertices for part in link_geometry(found.checked).parts])
    return vertices.min(axis=0), vertices.max(axis=0)


def test_distance_is_measured_from_the_collision_geometry(tmp_path: Path) -> None:
    arm = tmp_path / "padded.urdf"
    arm.write_text(PADDED)
    (found,) = outside_nearest(build_cell(cell_of(arm)), "arm", np.zeros(1), {})
    assert found.pair == ("arm/arm", "wall")
    assert found.distance_m == pytest.approx(0.05, abs=1e-6)


@pytest.mark.parametrize("options", [[], ["--dh"]])
def test_an_imported_robot_keeps_its_collision_geometry(tmp_path: Path, options: list[str]) -> None:
    arm = tmp_path / "padded.urdf"
    arm.write_text(PADDED)
    assert run(["robot", "import", str(arm), str(tmp_path / "out"), *options]) == 0
    imported = tmp_path / "out" / "robot.toml"
    (found,) = outside_nearest(build_cell(cell_of(imported)), "arm", np.zeros(1), {})
    assert found.distance_m == pytest.approx(0.05, abs=1e-6)
    # An import of the import has it too.
    assert run(["robot", "import", str(imported), str(tmp_path / "again"), *options]) == 0
    again = tmp_path / "again" / "robot.toml"
    np.testing.assert_allclose(corners(again, "arm"), corners(imported, "arm"), atol=1e-6)


def test_an_exported_robot_keeps_its_collision_geometry(tmp_path: Path) -> None:
    arm = tmp_path / "padded.urdf"
    arm.write_text(PADDED)
    assert run(["robot", "export", str(arm), str(tmp_path / "out")]) == 0
    exported = tmp_path / "out" / "padded.urdf"
    np.testing.assert_allclose(corners(exported, "arm"), corners(arm, "arm"), atol=1e-6)


@needs_real_robots
def test_real_robots_collision_files_are_checked_and_visual_files_drawn() -> None:
    links = {link.name: link for link in tree_of(load(IRB2400)).links if link.shapes}
    assert len(links) == 9
    for link in links.values():
        for shapes, folder in ((link.checked, "collision"), (link.shapes, "visual")):
            (shape,) = shapes
            assert isinstance(shape.source, Path)
            assert shape.source.parent.name == folder


@needs_real_robots
@pytest.mark.slow
def test_a_real_hull_with_a_vertex_of_many_neighbours_is_checked() -> None:
    description = CellDescription((CellRobot("gp8", GP8, np.eye(4)),))
    assert len(build_cell(description).arms["gp8"].bodies) == 7


def round_points(count: int, z: float) -> FloatArray:
    angles = np.linspace(0, 2 * np.pi, count, endpoint=False)
    return np.column_stack([0.1 * np.cos(angles), 0.1 * np.sin(angles), np.full(count, z)])


@pytest.mark.parametrize("count", [100, 300, 5_000])
def test_hulls_contain_round_faces_and_tips_of_any_resolution(count: int) -> None:
    disc = np.concatenate([round_points(count, 0.0), round_points(count, 0.05)])
    cone = np.concatenate([round_points(count, 0.0), [[0.0, 0.0, 0.2]]])
    for points in (disc, cone):
        body = hull_body(points)
        vertices = np.array(body.geometry.points())
        for direction in np.random.default_rng(0).standard_normal((200, 3)):
            direction /= np.linalg.norm(direction)
            beyond = (vertices @ direction).max() - (points @ direction).max()
            # The hull contains the points, and is at most a few cells larger.
            assert -1e-9 <= beyond < 2e-3
