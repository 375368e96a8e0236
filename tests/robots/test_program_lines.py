"""Lines of the tool as joint moves: within the tolerance everywhere, or refused with a reason."""

from functools import cache

import numpy as np
import pytest
from trimesh.transformations import euler_matrix, rotation_from_matrix

from robomesh import reason_codes as codes
from robots.collision import build_cell
from robots.kinematics.inverse import build_solver, natural_task
from robots.kinematics.inverse.tasks import tool_misses
from robots.kinematics.model import tool_placement
from robots.programs.lines import line_to
from robots.programs.plan import plan_program
from robots.programs.steps import LINE_DEG, LINE_M, StepKind, ViolationKind
from robots.programs.text import parse_program
from tests.robots.boxes import cell_of, placed


@cache
def arm_of(robot: str):
    return build_cell(cell_of({robot: (robot, placed(0))})).arms[robot]


def planned(robot: str, text: str):
    arm = arm_of(robot)
    solver = build_solver(arm.description)
    return plan_program(parse_program(text, arm.joints), arm, solver, arm.joints.home.copy())


@pytest.mark.parametrize(
    ("robot", "taught", "line"),
    [
        ("pt600", "move_joints 30 80 -80 -90 0", "move_line 400 -200 300 180 0 0"),
        ("pt600", "move_joints -20 60 -70 -80 30", "move_line 450 100 200 180 0 90"),
        ("puma560", "move_joints 0 -30 150 0 50 0", "move_line 500 -300 200 170 20 40"),
        ("puma560", "move_line 500 -150 200 180 0 0", "move_line 500 -150 200 150 10 0"),
    ],
)
@pytest.mark.slow
def test_tool_stays_within_tolerance_of_the_line_and_arrives(robot: str, taught: str, line: str) -> None:
    model, task = arm_of(robot).model, natural_task(arm_of(robot).joints)
    plan = planned(robot, f"{taught}\n{line}\n")
    assert not plan.violations
    assert not plan.notes
    before = [step for step in plan.steps if step.line == 1][-1].target
    parts = [step for step in plan.steps if step.line == 2]
    assert all(step.kind is StepKind.MOVE and step.along_line for step in parts)
    wanted = parse_program(line, arm_of(robot).joints).statements[0].target.tool_to_base
    way = line_to(tool_placement(model, before), wanted, task)
    at = before
    for step in parts:
        for look in np.linspace(0, 1, 15):
            tool = tool_placement(model, at + look * (step.target - at))
            # If the tool only rotates, its rotation gives its share of the line.
            turned = tool_misses(tool, way.begin, task)[1] / max(float(np.linalg.norm(way.turn)), 1e-9)
            away, angle = tool_misses(tool, way.pose(way.share_of(tool, turned)), task)
            assert away <= LINE_M
            assert angle <= np.radians(LINE_DEG)
        at = step.target
    away, angle = tool_misses(tool_placement(model, at), wanted, task)
    assert away < 1e-6
    assert angle < 1e-5


def test_unreachable_line_ends_the_plan_with_a_reason() -> None:
    plan = planned("pt600", "move_line 400 0 300 180 0 0\nmove_line 1400 0 300 180 0 0\nhome\n")
    (violation,) = plan.violations
    assert (violation.kind, violation.line) == (ViolationKind.UNREACHABLE, 2)
    assert violation.text.startswith("the line cannot be followed beyond ")
    assert " of its 1000.0 mm: its end cannot be reached: out of reach: " in violation.text
    assert plan.notes == (codes.CHECK_NOTE_ENDS(line=2),)
    assert {step.line for step in plan.steps} == {1}
    ((x, y, z),) = violation.points
    assert 0.4 < x < 0.65
    assert (y, z) == pytest.approx((0.0, 0.3), abs=1e-6)


def test_a_pose_out_of_reach_names_the_point() -> None:
    plan = planned("pt600", "point far = pose 3000 0 0 0 0 0\nmove_joints far\n")
    (violation,) = plan.violations
    assert violation.text.startswith("point far cannot be reached: ")
    assert violation.points[0] == pytest.approx([3.0, 0.0, 0.0])


def test_arm_of_five_joints_reports_its_axis_deviation_on_a_line() -> None:
    plan = planned("pt600", "move_joints 30 80 -80 20 0\nmove_line 400 200 300 180 0 0\n")
    assert not plan.violations
    (note,) = plan.notes
    assert (note.code, note.values["lines"]) == ("check.note.bent", "2")
    assert float(note.values["angle_deg"]) > 0.5


def test_repeated_line_gives_bit_identical_moves() -> None:
    out, back = "move_line 400 200 300 180 0 0", "move_line 400 0 300 180 0 0"
    plan = planned("pt600", f"{back}\nrepeat 3\n{out}\n{back}\nend")
    rounds = [step.target.tobytes() for step in plan.steps if step.line in (3, 4)]
    third = len(rounds) // 3
    assert third > 2
    assert rounds[third : 2 * third] == rounds[2 * third :]


def test_program_without_a_speed_begins_with_100_percent() -> None:
    kinds = [(step.kind, step.percent) for step in planned("pt600", "trace on\nhome\nspeed 20\nhome").steps]
    assert kinds == [
        (StepKind.TRACE, None),
        (StepKind.SPEED, 100.0),
        (StepKind.HOME, None),
        (StepKind.SPEED, 20.0),
        (StepKind.HOME, None),
    ]


@pytest.mark.parametrize("frame", ["tool", "base", "site"])
def test_a_step_moves_and_turns_the_tool_along_the_axes_of_its_frame(frame: str) -> None:
    """Expected poses by trimesh's transformations."""
    base_to_site = euler_matrix(*np.radians([20, -10, 135]))
    arm = build_cell(cell_of({"puma560": ("puma560", base_to_site)})).arms["puma560"]
    text = f"move_joints 0 -30 150 0 50 0\nmove_line_by {frame} 10 -20 30 5 -4 3\n"
    plan = plan_program(
        parse_program(text, arm.joints), arm, build_solver(arm.description), arm.joints.home.copy()
    )
    assert not plan.violations
    before, after = (
        tool_placement(arm.model, [step for step in plan.steps if step.line == line][-1].target)
        for line in (1, 2)
    )
    axes = {"tool": before[:3, :3], "base": np.eye(3), "site": base_to_site[:3, :3].T}[frame]
    assert after[:3, 3] == pytest.approx(before[:3, 3] + axes @ [0.010, -0.020, 0.030], abs=1e-6)
    offset = euler_matrix(*np.radians([5, -4, 3]))[:3, :3]
    off = np.eye(4)
    off[:3, :3] = (axes @ offset @ axes.T @ before[:3, :3]).T @ after[:3, :3]
    assert abs(rotation_from_matrix(off)[0]) < 1e-5


def test_five_joints_move_by_a_step_and_turn_only_as_they_can() -> None:
    there = "move_joints 30 80 -80 20 0\nmove_line_by base "
    plan = planned("pt600", f"{there} 0 60 0 0 0 0\n")
    assert not plan.violations
    before, after = (
        tool_placement(arm_of("pt600").model, [step for step in plan.steps if step.line == line][-1].target)
        for line in (1, 2)
    )
    assert after[:3, 3] - before[:3, 3] == pytest.approx([0, 0.06, 0], abs=1e-5)
    assert plan.notes[0].code == codes.CHECK_NOTE_BENT(angle_deg=1, lines="2").code
    above = "move_line 400 0 300 180 0 0\nmove_line_by tool "
    assert not planned("pt600", f"{above} 0 0 10 0 5 0\n").violations
    for turn, why in (("5 0 0", "not this orientation"), ("0 0 10", "cannot set the roll")):
        (violation,) = planned("pt600", f"{above} 0 0 0 {turn}\n").violations
        assert (violation.kind, violation.line) == (ViolationKind.UNREACHABLE, 2)
        assert why in violation.text
