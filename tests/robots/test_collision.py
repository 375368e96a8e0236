"""Collision and clearance in cells whose distances are known by hand."""

import pickle
from dataclasses import replace
from math import pi, radians
from pathlib import Path

import numpy as np
import pytest

from robots.collision import (
    Nearest,
    build_cell,
    distances,
    outside_clearance,
    outside_nearest,
    own_contacts,
    own_nearest,
    unshaped,
)
from robots.descriptions.cells import CellDescription, Fixture
from robots.kinematics.kinematic_tree import Shape
from robots.schema.errors import JointCountError, ShapeError
from robots.schema.poses import rpy_rotation
from tests.robots.boxes import bar_arm, block, bracket, cell_of, globe, placed, two_cheeks

STRETCHED = np.zeros(2)
ORIGIN = np.eye(4)


def arm_cell(folder: Path, *fixtures: Fixture, more: str = "") -> CellDescription:
    return cell_of({"arm": (bar_arm(folder, more), ORIGIN)}, fixtures)


def by_pair(found: tuple[Nearest, ...]) -> dict[tuple[str, str], float]:
    return {each.pair: each.distance_m for each in found}


def test_distance_to_a_wall_is_what_the_arm_does_not_reach(tmp_path: Path) -> None:
    cell = build_cell(arm_cell(tmp_path, block("wall", (0.1, 2.0, 2.0), placed(1.05))))
    found = outside_nearest(cell, "arm", STRETCHED, {})
    assert [each.pair for each in found] == [("arm/elbow", "wall"), ("arm/shoulder", "wall")]
    assert [each.distance_m for each in found] == pytest.approx([0.22, 0.62], abs=1e-6)
    on_bar, on_wall = found[0].points
    assert on_bar[0] == pytest.approx(0.78, abs=1e-6)
    assert abs(on_bar[1]) <= 0.02 + 1e-6
    assert -1e-6 <= on_bar[2] <= 0.02 + 1e-6
    assert on_wall[0] == pytest.approx(1.0, abs=1e-6)
    assert np.linalg.norm(on_wall - on_bar) == pytest.approx(0.22, abs=1e-6)


def test_distance_to_a_ball_is_measured_to_its_surface(tmp_path: Path) -> None:
    cell = build_cell(arm_cell(tmp_path, globe("ball", 0.1, placed(0.6, 0.3, 0.01))))
    nearest = outside_clearance(cell, "arm", STRETCHED, {})
    assert nearest is not None
    assert nearest.pair == ("arm/elbow", "ball")
    assert nearest.distance_m == pytest.approx(0.18, abs=1e-6)
    assert nearest.points[1] == pytest.approx([0.6, 0.2, 0.01], abs=1e-6)


def test_pairs_beyond_the_requested_distance_are_left_out(tmp_path: Path) -> None:
    cell = build_cell(arm_cell(tmp_path, block("wall", (0.1, 2.0, 2.0), placed(1.05))))
    assert by_pair(outside_nearest(cell, "arm", STRETCHED, {}, within_m=0.3)) == {
        ("arm/elbow", "wall"): pytest.approx(0.22, abs=1e-6)
    }
    assert outside_nearest(cell, "arm", STRETCHED, {}, within_m=0.2) == ()


def test_folded_arm_touches_its_post_from_the_geometric_angle_on(tmp_path: Path) -> None:
    cell = build_cell(arm_cell(tmp_path))
    # The post's corner at (0.1, 0.1) meets the bar's flank, 0.02 m from its middle; elbow at (0.4, 0).
    reach = np.hypot(0.3, 0.1)
    touch = pi - np.arctan2(0.1, 0.3) - np.arcsin(0.02 / reach)
    assert own_contacts(cell, "arm", np.array([0.0, touch - radians(0.05)])) == ()
    (found,) = own_contacts(cell, "arm", np.array([0.0, touch + radians(0.05)]))
    assert found.pair == ("arm/base", "arm/elbow")
    assert found.distance_m == 0.0
    before = own_nearest(cell, "arm", np.array([0.0, touch - radians(2.0)]))
    assert before is not None
    assert before.pair == ("arm/base", "arm/elbow")
    assert before.distance_m == pytest.approx(
        reach * np.sin(np.arcsin(0.02 / reach) + radians(2.0)) - 0.02, abs=1e-6
    )
    assert before.points[0][:2] == pytest.approx([0.1, 0.1], abs=1e-6)


def test_neighbours_and_ignored_pairs_are_not_contacts(tmp_path: Path) -> None:
    ignored = '[collision]\nignore = [["elbow", "base"]]\n'
    cell = build_cell(arm_cell(tmp_path, more=ignored))
    assert own_contacts(cell, "arm", np.array([0.0, pi])) == ()
    assert own_nearest(cell, "arm", np.array([0.0, pi])) is None


def test_fixture_inside_the_base_is_ignored(tmp_path: Path) -> None:
    floor = block("floor", (0.5, 0.5, 0.2), placed(0.0, 0.0, -0.2))
    cell = build_cell(arm_cell(tmp_path, floor))
    assert ("arm/base", "floor") not in by_pair(outside_nearest(cell, "arm", STRETCHED, {}))


def test_fixture_that_a_link_may_touch_is_ignored(tmp_path: Path) -> None:
    wall = replace(block("wall", (0.1, 2.0, 2.0), placed(0.8)), ignore=("arm/elbow",))
    cell = build_cell(arm_cell(tmp_path, wall))
    assert by_pair(outside_nearest(cell, "arm", STRETCHED, {})) == {
        ("arm/shoulder", "wall"): pytest.approx(0.37, abs=1e-6)
    }


def test_distance_of_two_arms_is_symmetric(tmp_path: Path) -> None:
    path = bar_arm(tmp_path)
    facing = {"one": (path, ORIGIN), "two": (path, placed(1.8, yaw=pi))}
    cell = build_cell(cell_of(facing))
    one = outside_nearest(cell, "one", STRETCHED, {"two": STRETCHED})
    two = outside_nearest(cell, "two", STRETCHED, {"one": STRETCHED})
    assert one[0].pair == ("one/elbow", "two/elbow")
    assert one[0].distance_m == pytest.approx(0.24, abs=1e-6)
    assert {(b, a): pytest.approx(d, abs=1e-6) for (a, b), d in by_pair(one).items()} == by_pair(two)
    # Bases do not move and are not measured against each other.
    assert len(one) == 8
    assert outside_nearest(cell, "one", STRETCHED, {}) == ()
    nearer = build_cell(cell_of({**facing, "two": (path, placed(1.7, yaw=pi))}))
    (nearest, *_) = outside_nearest(nearer, "one", STRETCHED, {"two": STRETCHED})
    assert nearest.distance_m == pytest.approx(0.14, abs=1e-6)


def test_the_larger_distance_of_two_robots_counts(tmp_path: Path) -> None:
    path = bar_arm(tmp_path)
    description = cell_of({"one": (path, ORIGIN), "two": (path, placed(1.8))}, (globe("ball", 0.1, ORIGIN),))
    one, two = description.robots
    shy = replace(two, warning_m=0.2, stop_m=0.03)
    cell = build_cell(replace(description, robots=(one, shy)))
    assert distances(cell, ("one/elbow", "two/base")) == (0.2, 0.03)
    assert distances(cell, ("one/elbow", "ball")) == (0.05, 0.01)


def test_moving_the_whole_cell_changes_no_distance(tmp_path: Path) -> None:
    path = bar_arm(tmp_path)
    cell = cell_of(
        {"one": (path, ORIGIN), "two": (path, placed(1.5, 0.2, yaw=pi))},
        (block("wall", (0.1, 2.0, 2.0), placed(0.3, 1.0, yaw=0.3)),),
    )
    moved = np.eye(4)
    moved[:3, :3] = rpy_rotation(0.4, -1.1, 2.0)
    moved[:3, 3] = 3.0, -2.0, 0.7
    moved_cell = CellDescription(
        tuple(replace(robot, base_to_site=moved @ robot.base_to_site) for robot in cell.robots),
        tuple(replace(each, fixture_to_site=moved @ each.fixture_to_site) for each in cell.fixtures),
    )
    at, other = np.array([0.3, 0.9]), np.array([-0.2, 0.4])
    found = outside_nearest(build_cell(cell), "one", at, {"two": other})
    again = outside_nearest(build_cell(moved_cell), "one", at, {"two": other})
    assert len(found) == 10
    assert by_pair(again) == {pair: pytest.approx(d, abs=1e-6) for pair, d in by_pair(found).items()}
    # The nearest point is a corner, so it is unique.
    first = found[0].points[0]
    assert again[0].points[0] == pytest.approx(moved[:3, :3] @ first + moved[:3, 3], abs=1e-5)


def test_hull_fills_a_bracket_that_the_exact_shape_leaves_open(tmp_path: Path) -> None:
    def nearest(*, exact: bool) -> Nearest:
        # The elbow's bar ends 0.02 m before the back, 0.08 m from each cheek.
        cell = build_cell(arm_cell(tmp_path, bracket("bracket", placed(0.8), exact=exact)))
        found = outside_clearance(cell, "arm", STRETCHED, {})
        assert found is not None
        return found

    assert nearest(exact=False).distance_m == 0.0
    assert nearest(exact=True).distance_m == pytest.approx(0.02, abs=1e-6)
    assert nearest(exact=True).points[1][0] == pytest.approx(0.8, abs=1e-6)


def test_disconnected_pieces_of_a_shape_become_separate_hulls(tmp_path: Path) -> None:
    cell = build_cell(arm_cell(tmp_path, two_cheeks("cheeks", placed(0.8))))
    found = outside_clearance(cell, "arm", STRETCHED, {})
    assert found is not None
    assert found.distance_m == pytest.approx(0.08, abs=1e-6)


def test_exact_shapes_and_hulls_of_boxes_measure_the_same(tmp_path: Path) -> None:
    description = arm_cell(
        tmp_path, globe("ball", 0.1, placed(0.6, 0.4)), block("b", (0.1,) * 3, placed(0.2, 0.3))
    )
    hulls, meshes = build_cell(description), build_cell(description, exact=True)
    for positions in np.random.default_rng(0).uniform(-pi, pi, (50, 2)):
        rough = by_pair(outside_nearest(hulls, "arm", positions, {}))
        fine = by_pair(outside_nearest(meshes, "arm", positions, {}))
        assert fine == {pair: pytest.approx(distance, abs=1e-5) for pair, distance in rough.items()}


def test_links_without_shapes_are_reported_as_not_covered(tmp_path: Path) -> None:
    description = cell_of(
        {
            "seen": (bar_arm(tmp_path / "a"), ORIGIN),
            "half": (bar_arm(tmp_path / "b", bare=("elbow",)), ORIGIN),
            "bare": (bar_arm(tmp_path / "c", bare=("base", "shoulder", "elbow")), ORIGIN),
        }
    )
    cell = build_cell(description)
    assert unshaped(cell, "seen") == ()
    assert unshaped(cell, "half") == ("elbow",)
    assert unshaped(cell, "bare") == ("base", "shoulder", "elbow")
    assert own_contacts(cell, "bare", np.array([0.0, pi])) == ()
    assert own_nearest(cell, "bare", STRETCHED) is None
    assert outside_nearest(cell, "bare", STRETCHED, {"seen": STRETCHED}) == ()
    assert outside_clearance(cell, "seen", STRETCHED, {"bare": STRETCHED}) is None


def test_bare_frames_are_not_reported_unless_a_shape_is_missing(tmp_path: Path) -> None:
    look = "<visual><geometry>{}</geometry></visual>"
    text = """<robot name="stick">
<link name="foot">{foot}</link><link name="flange"/><link name="stick">{stick}</link>
<joint name="turn" type="continuous"><axis xyz="0 0 1"/><parent link="foot"/><child link="stick"/></joint>
<joint name="end" type="fixed"><parent link="stick"/><child link="flange"/></joint></robot>"""
    cube = look.format('<box size="0.1 0.1 0.1"/>')
    for name, foot, bare in (
        ("whole", cube, ()),
        ("lost", look.format('<mesh filename="foot.stl"/>'), ("foot", "flange")),
    ):
        path = tmp_path / f"{name}.urdf"
        path.write_text(text.format(foot=foot, stick=cube))
        assert unshaped(build_cell(cell_of({"arm": (path, ORIGIN)})), "arm") == bare


def test_pickled_cell_gives_the_same_distances(tmp_path: Path) -> None:
    description = arm_cell(tmp_path, block("wall", (0.1, 2.0, 2.0), placed(1.05)))
    sent = pickle.loads(pickle.dumps(description))
    expected, found = (
        outside_clearance(build_cell(each), "arm", STRETCHED, {}) for each in (description, sent)
    )
    assert expected is not None
    assert found is not None
    assert (expected.pair, expected.distance_m) == (found.pair, found.distance_m)
    assert np.array_equal(expected.points, found.points)


def test_fixture_that_cannot_be_checked_is_refused_with_a_reason(tmp_path: Path) -> None:
    (tmp_path / "broken.wrl").write_text("#VRML V2.0 utf8\nShape {")
    broken = Fixture("jig", (Shape(tmp_path / "broken.wrl", ORIGIN),), ORIGIN)
    with pytest.raises(ShapeError, match=r"broken\.wrl"):
        build_cell(arm_cell(tmp_path / "a", broken))
    with pytest.raises(ShapeError, match=r"fixture jig: has no surface"):
        build_cell(arm_cell(tmp_path / "a", Fixture("jig", (), ORIGIN)))
    wrong = replace(block("wall", (1.0, 1.0, 1.0), ORIGIN), ignore=("arm/elbw",))
    with pytest.raises(ShapeError, match=r"fixture wall: ignore 'arm/elbw': no such link.*'arm/elbow'"):
        build_cell(arm_cell(tmp_path / "a", wrong))


def test_positions_of_another_robot_are_refused(tmp_path: Path) -> None:
    cell = build_cell(arm_cell(tmp_path, globe("ball", 0.1, ORIGIN)))
    for ask in (own_contacts, own_nearest):
        with pytest.raises(JointCountError):
            ask(cell, "arm", np.zeros(3))
    with pytest.raises(JointCountError):
        outside_nearest(cell, "arm", np.zeros(3), {})
