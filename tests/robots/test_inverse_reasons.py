"""Reasons for no solution, which is never replaced by an approximation."""

from pathlib import Path

import numpy as np
import pytest

from robomesh import reason_codes as codes
from robomesh.reasons import Code, Reason
from robots.kinematics.inverse import InverseResult, Task, build_solver, solve
from robots.kinematics.model import build_model, tool_placement
from robots.schema.poses import rpy_rotation
from tests.robots.arms import allowed_positions, arm, telescope


def placed(x: float, y: float, z: float, roll: float, pitch: float, yaw: float) -> np.ndarray:
    """Return the (4, 4) of a pose in mm and degrees."""
    pose = np.eye(4)
    pose[:3, :3] = rpy_rotation(*np.radians([roll, pitch, yaw]))
    pose[:3, 3] = np.array([x, y, z]) / 1000
    return pose


def none(result: InverseResult) -> Reason:
    """Return the reason for no solution."""
    assert result.solutions.shape[0] == 0
    assert not result.analytic
    assert result.reason is not None
    limits = result.reason.code == "inverse.limits"
    assert result.residual_m > 1e-5 or result.residual_rad > 2e-4 or limits
    return result.reason


@pytest.mark.parametrize("name", ["pt600", "puma560", "crooked"])
def test_too_far_pose_reports_the_distance_and_the_reach(name: str) -> None:
    solver = arm(name)[2]
    result = solve(solver, placed(3000, 0, 0, 0, 90, 0), task=Task.POSITION_AND_AXIS_5D)
    reason = none(result)
    assert reason.code == "inverse.too_far"
    distance, reach = (float(reason.values[name].removesuffix(" mm")) for name in ("distance", "reach"))
    first = solver.chain.origins[0]
    assert distance == pytest.approx(1000 * np.linalg.norm([3.0 - first[0], *first[1:]]), abs=0.01)
    assert reach == pytest.approx(1000 * solver.chain.reach, abs=0.01)
    # The nearest position found is farther away than if the arm were fully stretched.
    assert result.residual_m >= (distance - reach) / 1000 - 1e-6


def test_too_near_pose_reports_the_least_distance_of_the_tool() -> None:
    _, model, solver = arm("puma560")
    target = placed(0, 0, 660, 0, 0, 0)
    reason = none(solve(solver, target, task=Task.POSE_6D))
    assert reason.code == "inverse.gap"
    distance = float(reason.values["distance"].removesuffix(" mm"))
    tools = [tool_placement(model, positions)[:3, 3] for positions in allowed_positions(model, 5000)]
    nearest = 1000 * np.linalg.norm(np.array(tools) - target[:3, 3], axis=1).min()
    # 5,000 random positions come this near to the least distance.
    assert nearest - 30 < distance < nearest


def test_a_solution_beyond_limits_names_joint_value_and_range() -> None:
    _, model, solver = arm("pt600")
    beyond = np.radians([10.0, 20.0, -118.0, 10.0, 5.0])  # the elbow's limit is 110
    reason = none(solve(solver, tool_placement(model, beyond), task=Task.POSE_6D))
    assert reason.code == "inverse.limits"
    assert {each.code for each in reason.causes} == {"joints.beyond"}
    for values in (each.values for each in reason.causes):
        value, lower, upper = (float(values[name].removesuffix("°")) for name in ("value", "lower", "upper"))
        assert values["name"] in model.joints.names
        assert not lower <= value <= upper


def test_solution_beyond_limits_is_reported_without_a_closed_form(tmp_path: Path) -> None:
    description = telescope(tmp_path)
    model, solver = build_model(description), build_solver(description)
    # The lift's limit is 300 mm; the grip does not move the tool.
    target = tool_placement(model, [0.3, 0.5, 0.33, -0.8, 0.2, 0.1])
    reason = none(solve(solver, target, task=Task.POSE_6D))
    assert reason == codes.INVERSE_LIMITS(
        codes.JOINT_BEYOND(name="lift", value="330.00 mm", lower="0.00 mm", upper="300.00 mm")
    )


@pytest.mark.parametrize(
    ("task", "code"),
    [(Task.POSE_6D, codes.INVERSE_ORIENTATION), (Task.POSITION_AND_AXIS_5D, codes.INVERSE_AXIS)],
)
def test_unreachable_orientation_of_five_joints_reports_the_least_deviation(task: Task, code: Code) -> None:
    _, model, solver = arm("pt600")
    # Only the 3 degrees out of the arm's plane make this pose unreachable.
    target = placed(350, 0, 300, 177, 45, 0)
    result = solve(solver, target, task=task)
    off = np.degrees(result.residual_rad)
    assert none(result) == code(angle=f"{off:.2f}°")
    assert result.residual_m < 1e-4
    solutions = solve(solver, target, task=Task.POSITION_3D, all_solutions=True).solutions
    axes = [tool_placement(model, each)[:3, 2] for each in solutions]
    assert len(axes) > 20
    least = np.degrees(np.arccos(max(axis @ target[:3, 2] for axis in axes)))
    assert 0.5 < off < least + 0.1


def test_reachable_6d_pose_of_five_joints_is_solved() -> None:
    _, model, solver = arm("pt600")
    positions = np.radians([10.0, 50.0, 60.0, -20.0, 70.0])
    result = solve(solver, tool_placement(model, positions), task=Task.POSE_6D, near=positions)
    np.testing.assert_allclose(result.solutions, [positions], atol=1e-9)
