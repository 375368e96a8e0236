"""Checks of programs: known collisions at known times, limits, tool speeds, and obstacles."""

from math import asin, atan2, degrees, hypot, radians
from pathlib import Path

import numpy as np
import pytest

from robomesh import reason_codes as codes
from robots.checks.check import check_plan, check_program
from robots.checks.tool_chain import samples_between, tool_chain, tools_and_jacobians
from robots.checks.violations import MOST_VIOLATIONS, ViolationCollector
from robots.collision import Cell, build_cell
from robots.collision.path import SAMPLE_M, placements_along, travelled
from robots.descriptions.cells import CellDescription, CellRobot
from robots.kinematics.model import tool_jacobian, tool_placement
from robots.kinematics.motion import Motion
from robots.kinematics.singularity import arm_length, singularity_margin, singularity_margins
from robots.kinematics.straight_motion import HOMING_REST_S
from robots.programs.steps import CheckReport, Step, StepKind, ViolationKind
from tests.robots.boxes import bar_arm, block, cell_of, placed

STRETCHED = np.zeros(2)
# Two aligned bars: the outer corner moves on a circle and touches a shelf at y = 0.5 m.
CORNER = (0.78, 0.02)
MEETS = asin(0.5 / hypot(*CORNER)) - atan2(CORNER[1], CORNER[0])
# 90°/s, 360°/s², 3600°/s³: half of the 0.35 s of acceleration is lost.
LOST_S = 0.175


@pytest.fixture(scope="module")
def shelf(tmp_path_factory: pytest.TempPathFactory) -> Cell:
    """Return a cell of bars and a shelf that begins at y = 0.5 m."""
    arm = bar_arm(tmp_path_factory.mktemp("arm"))
    return build_cell(cell_of({"arm": (arm, placed(0))}, (block("shelf", (2.0, 1.0, 0.5), placed(0, 1.0)),)))


@pytest.fixture(scope="module")
def arm_cell(tmp_path_factory: pytest.TempPathFactory) -> Cell:
    return build_cell(cell_of({"arm": (bar_arm(tmp_path_factory.mktemp("arm")), placed(0))}))


@pytest.fixture(scope="module")
def pt600() -> Cell:
    return build_cell(cell_of({"arm": ("pt600", placed(0))}))


def checked(cell: Cell, text: str, start: np.ndarray = STRETCHED) -> CheckReport:
    return check_program(text, cell, "arm", start)


def kinds(result: CheckReport) -> list[str]:
    return [str(each.kind) for each in result.violations]


def test_collision_is_found_at_the_geometric_time_and_place(shelf: Cell) -> None:
    result = checked(shelf, "wait 1\nmove_joints 90 0\n")
    assert not result.ok
    assert result.refused
    (touch,) = [
        each for each in result.violations if each.kind is ViolationKind.COLLISION and "elbow" in each.pair[0]
    ]
    assert (touch.line, touch.pair, touch.distance_m) == (2, ("arm/elbow", "shelf"), 0.0)
    # The outer bar moves at most 5 mm between samples, at 1.2 m/s.
    assert touch.time_s == pytest.approx(1 + degrees(MEETS) / 90 + LOST_S, abs=0.006)
    assert touch.until_s == pytest.approx(result.duration_s)
    assert touch.points[0] == pytest.approx([0.6, 0.5, 0.01], abs=0.05)


def test_the_steps_durations_add_up_to_the_programs(arm_cell: Cell) -> None:
    result = checked(arm_cell, "wait 1\nmove_joints 90 0\nmove_joints 0 0\n")
    assert len(result.durations_s) == len(result.steps)
    assert sum(result.durations_s) == pytest.approx(result.duration_s)
    waits = [
        s for step, s in zip(result.steps, result.durations_s, strict=True) if step.kind is StepKind.WAIT
    ]
    assert waits == [1.0]


def test_nearer_than_the_warning_warns_and_nearer_than_the_stop_refuses(shelf: Cell) -> None:
    def at(gap_m: float) -> float:
        return degrees(asin((0.5 - gap_m) / hypot(*CORNER)) - atan2(CORNER[1], CORNER[0]))

    warned = checked(shelf, f"move_joints {at(0.03):.6f} 0\n")
    (violation,) = warned.violations
    assert (violation.kind, violation.refuses) == (ViolationKind.CLEARANCE, False)
    assert violation.distance_m == pytest.approx(0.03, abs=1e-5)
    assert violation.text == (
        "arm/elbow comes within 30.0 mm of shelf, nearer than its warning distance of 50 mm"
    )
    assert (warned.ok, warned.refused) == (False, False)
    (violation,) = checked(shelf, f"move_joints {at(0.004):.6f} 0\n").violations
    assert violation.refuses
    assert violation.text.endswith("nearer than its stop distance of 10 mm")
    assert checked(shelf, f"move_joints {at(0.06):.6f} 0\n").ok


def test_retreat_is_allowed_but_coming_nearer_again_is_a_violation(shelf: Cell) -> None:
    near = np.array([asin(0.495 / hypot(*CORNER)) - atan2(CORNER[1], CORNER[0]), 0.0])
    assert checked(shelf, "move_joints 0 0\n", near).ok
    back = checked(shelf, f"move_joints 0 0\nmove_joints {degrees(near[0]) - 1:.6f} 0\n", near)
    assert [(each.line, each.kind) for each in back.violations] == [(2, ViolationKind.CLEARANCE)]
    nearer = checked(shelf, f"move_joints {degrees(near[0]) + 0.2:.6f} 0\n", near)
    assert [each.refuses for each in nearer.violations] == [True]
    standing = checked(shelf, "wait 1\n", near)
    assert standing.ok


def test_a_way_of_the_size_of_rounding_is_checked(arm_cell: Cell) -> None:
    step = Step(line=1, kind=StepKind.MOVE, target=np.array([1e-14, 0.0]))
    result = check_plan(arm_cell, "arm", STRETCHED, (step,), others={})
    assert (result.ok, result.duration_s) == (True, 0.0)


def test_contact_at_the_start_is_reported(shelf: Cell) -> None:
    result = checked(shelf, "move_joints 0 0\n", np.array([MEETS + 0.05, 0.0]))
    (touch,) = result.violations
    assert (touch.kind, touch.time_s) == (ViolationKind.COLLISION, 0.0)
    assert 0.0 < touch.until_s < 0.4
    assert kinds(checked(shelf, "wait 0\n", np.array([MEETS + 0.05, 0.0]))) == ["collision"]


def test_self_collision_is_a_violation(arm_cell: Cell) -> None:
    result = checked(arm_cell, "move_joints 0 179\n")
    (touch,) = result.violations
    assert touch.kind is ViolationKind.COLLISION
    assert set(touch.pair) == {"arm/base", "arm/elbow"}
    assert np.isinf(result.path.clearances).all()
    assert result.notes == (codes.CHECK_NOTE_ONLY_FLOOR(),)


def test_each_pass_is_a_separate_violation(shelf: Cell) -> None:
    result = checked(shelf, "repeat 2\n  move_joints 36 0\n  move_joints 0 0\nend\n")
    spans = [(each.line, each.time_s, each.until_s) for each in result.violations]
    # There and back: adjacent, but two statements.
    assert [line for line, *_ in spans] == [2, 3, 2, 3]
    assert all(begin < until for _, begin, until in spans)
    assert spans[0][2] == pytest.approx(spans[1][1])


def test_limits_are_reported_in_degrees_for_the_whole_move(arm_cell: Cell) -> None:
    result = checked(arm_cell, "move_joints 0 0\nmove_joints 200 0\n")
    (beyond,) = result.violations
    assert (beyond.kind, beyond.line, beyond.refuses) == (ViolationKind.LIMIT, 2, True)
    assert beyond.text == "joint shoulder at 200.00° is beyond its limit 180.00°"
    assert (beyond.time_s, beyond.until_s) == (0.0, result.duration_s)


def test_coupled_limits_count(pt600: Cell) -> None:
    result = checked(pt600, "move_joints 0 120 60 0 0\n", pt600.arms["arm"].joints.home)
    assert "shoulder + elbow at 180.00° is beyond its limit 160.00°" in [
        each.text for each in result.violations
    ]


def test_arm_beyond_a_limit_may_move_back(arm_cell: Cell) -> None:
    result = checked(arm_cell, "move_joints 0 0\n", np.array([radians(185.0), 0.0]))
    (start,) = result.violations
    assert (start.line, start.refuses) == (0, False)
    assert start.text.startswith("at the start: joint shoulder at 185.00°")


def test_asserted_tool_speed_is_checked(arm_cell: Cell) -> None:
    # The tool is at a radius of 0.8 m and turns at 90°/s.
    most = 0.8 * radians(90)
    result = checked(arm_cell, f"move_joints 45 0\ntool_speed {most * 1000 - 20:.3f}\nmove_joints 0 0\n")
    (fast,) = result.violations
    assert (fast.kind, fast.line, fast.pair, fast.distance_m) == (ViolationKind.SPEED, 3, (), None)
    assert fast.text.startswith(f"the tool moves at {most * 1000:.0f} mm/s, ")
    assert result.path.tool_speeds.max() == pytest.approx(most)
    assert checked(arm_cell, f"tool_speed {most * 1000 + 1:.3f}\nmove_joints 45 0\nmove_joints 0 0\n").ok
    assert checked(arm_cell, f"speed 50\ntool_speed {most * 500 + 1:.3f}\nmove_joints 45 0\n").ok


def test_line_near_a_singular_position_is_reported(pt600: Cell) -> None:
    # The wrist is at most 600 mm from the shoulder, with a straight elbow.
    begin = "move_joints 0 60 -80 -70 0\nmove_line 550 0 230 180 0 0\n"
    near = checked(pt600, f"{begin}move_line 599.9 0 230 180 0 0\n", pt600.arms["arm"].joints.home)
    (singular,) = near.violations
    assert (singular.kind, singular.line, singular.pair) == (ViolationKind.SINGULARITY, 3, ())
    assert singular.text.endswith(", but motion along a line needs 0.02")
    assert singular.until_s == pytest.approx(near.duration_s)
    # Between joint positions it does not matter.
    last = " ".join(f"{each:.6f}" for each in np.degrees(near.path.joint_positions[-1]))
    assert checked(pt600, f"{begin}move_joints {last}\n", pt600.arms["arm"].joints.home).ok


def test_duration_equals_the_simulated_arms(pt600: Cell) -> None:
    joints = pt600.arms["arm"].joints
    result = checked(pt600, "home\nspeed 40\nmove_joints 30 60 -60 20 -40\nwait 0.25\n", joints.home + 0.3)
    motion, now_s = Motion(joints, joints.home + 0.3), 0.0
    motion.move(joints.home, now_s, speed=0.5)
    now_s = motion.end_s + HOMING_REST_S
    motion.move(np.radians([30.0, 60.0, -60.0, 20.0, -40.0]), now_s, speed=0.4)
    assert result.duration_s == pytest.approx(motion.end_s + 0.25, abs=1e-9)
    for time_s, positions in zip(result.path.times_s, result.path.joint_positions, strict=True):
        if time_s > now_s:
            assert positions == pytest.approx(motion.state(time_s).positions, abs=2e-3)


def test_no_link_moves_more_than_5_mm_between_samples(pt600: Cell) -> None:
    arm = pt600.arms["arm"]
    result = checked(pt600, "move_joints 90 20 60 80 170\nmove_joints -140 120 -100 -90 0\n", arm.joints.home)
    placements = placements_along(arm, result.path.joint_positions)
    assert np.diff(travelled(arm.bodies, placements), axis=0).max() <= SAMPLE_M
    assert len(result.path.times_s) > 100


@pytest.mark.parametrize("robot", ["pt600", "puma560"])
@pytest.mark.slow
def test_vectorized_tools_and_jacobians_equal_pinocchios(robot: str) -> None:
    arm = build_cell(cell_of({"arm": (robot, placed(0.3, 0.2, 0.1))})).arms["arm"]
    chain, random = tool_chain(arm), np.random.default_rng(1)
    positions = random.uniform(arm.joints.lower, arm.joints.upper, (20, len(arm.joints)))
    tools, jacobians = tools_and_jacobians(chain, positions)
    margins = singularity_margins(jacobians, arm.joints.types, reach=chain.reach_m)
    for at, tool, jacobian, margin in zip(positions, tools, jacobians, margins, strict=True):
        assert tool == pytest.approx(tool_placement(arm.model, at), abs=1e-12)
        assert jacobian == pytest.approx(tool_jacobian(arm.model, at), abs=1e-12)
        expected = singularity_margin(arm.model, at, reach=arm_length(arm.description))
        assert margin == pytest.approx(expected, abs=1e-12)


def two_arms(folder: Path, apart_m: float) -> Cell:
    models = {name: bar_arm(folder / name) for name in ("arm", "other")}
    bases = {"arm": placed(0), "other": placed(apart_m)}
    return build_cell(cell_of({name: (models[name], bases[name]) for name in models}))


def test_another_robot_counts_at_every_position_of_its_path(tmp_path: Path) -> None:
    plan = [Step(line=7, kind=StepKind.MOVE, target=np.array([0.5, 0.0]))]
    # Each reaches 0.78 m: at 2 m distance they never touch ...
    turn = np.array([[0.0, 0.0], [np.pi, 0.0]])
    assert check_plan(two_arms(tmp_path, 2.0), "arm", STRETCHED, plan, others={"other": turn}).ok
    near = two_arms(tmp_path, 1.5)
    # ... at 1.5 m they do, on a path that begins and ends elsewhere.
    quarter = np.array([[np.pi * 0.7, 0.0], [np.pi * 1.3, 0.0]])
    passed = check_plan(near, "arm", STRETCHED, plan, others={"other": quarter})
    assert ("arm/elbow", "other/elbow") in [each.pair for each in passed.violations]
    assert check_plan(near, "arm", STRETCHED, plan, others={"other": quarter[:1]}).ok
    unknown = check_plan(near, "arm", STRETCHED, plan, others={})
    assert unknown.ok
    assert unknown.notes == (codes.CHECK_NOTE_LEFT_OUT(name="other"),)


def test_links_without_a_shape_are_named(tmp_path: Path) -> None:
    cell = build_cell(cell_of({"arm": (bar_arm(tmp_path, bare=("base", "elbow")), placed(0))}))
    assert codes.CHECK_NOTE_NO_SHAPE(links="base, elbow") in checked(cell, "home\n").notes


def test_unreadable_text_gives_violations_with_lines(arm_cell: Cell) -> None:
    result = checked(arm_cell, "home\nspeed 0\nmov 1\n")
    assert [(str(each.kind), each.line) for each in result.violations] == [("program", 2), ("program", 3)]
    assert (result.ok, result.steps, len(result.path.times_s)) == (False, (), 0)


def test_result_of_a_long_program_is_bounded(shelf: Cell) -> None:
    result = checked(shelf, "repeat 700\n move_joints 36 0\n move_joints 0 0\nend\n")
    assert len(result.violations) == MOST_VIOLATIONS
    assert result.notes == (codes.CHECK_NOTE_MORE_VIOLATIONS(count=400),)
    assert 10_000 <= len(result.path.times_s) <= 20_001
    assert result.path.times_s[-1] == pytest.approx(result.duration_s)
    assert (np.diff(result.path.times_s) >= 0).all()


def test_adjacent_samples_are_one_violation_with_the_worst_value() -> None:
    runs = ViolationCollector()
    for sample, value in ((5, 0.04), (6, 0.008), (7, 0.02), (9, 0.03)):
        runs.add(
            line=3,
            sample=sample,
            time_s=sample / 10,
            kind=ViolationKind.CLEARANCE,
            value=value,
            limit=0.05,
            pair=("a/x", "b"),
            points=np.full((2, 3), value),
            stops=value < 0.01,
        )
    first, second = runs.violations()
    assert (first.time_s, first.until_s, first.distance_m, first.refuses) == (0.5, 0.7, 0.008, True)
    assert first.points[0, 0] == 0.008
    assert (second.time_s, second.until_s, second.refuses) == (0.9, 0.9, False)


def test_more_joints_need_more_samples(arm_cell: Cell) -> None:
    chain = tool_chain(arm_cell.arms["arm"])
    one = samples_between(chain, STRETCHED, np.array([1.0, 0.0]))
    # The outer bar's far corner is at a radius of 0.78 m.
    assert 0.78 / SAMPLE_M <= one <= 0.9 / SAMPLE_M
    assert samples_between(chain, STRETCHED, np.array([1.0, 1.0])) > one


def test_a_cell_can_have_other_distances_per_robot(tmp_path: Path) -> None:
    robot = CellRobot("arm", bar_arm(tmp_path), placed(0), warning_m=0.2, stop_m=0.15)
    cell = build_cell(CellDescription((robot,), (block("wall", (0.1, 2.0, 2.0), placed(1.0)),)))
    (violation,) = checked(
        cell, "move_joints 0 0\nmove_joints 2 0\nmove_joints 0 0\n", np.array([1.0, 0.0])
    ).violations[:1]
    assert violation.text.endswith("nearer than its warning distance of 200 mm")
