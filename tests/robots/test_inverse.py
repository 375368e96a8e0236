"""Inverse kinematics: every solution is verified by forward kinematics."""

import pickle
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robomesh import reason_codes as codes
from robomesh.reasons import Reason
from robots.descriptions.description import load, parse
from robots.descriptions.example_robots import example_folder
from robots.kinematics.inverse import (
    InverseSolver,
    Task,
    build_solver,
    closed_form,
    follow,
    natural_task,
    solve,
    tool_pose,
)
from robots.kinematics.joints import violations
from robots.kinematics.model import build_model, tool_placement
from robots.schema.errors import JointCountError, PoseError
from tests.conftest import needs_eaik
from tests.robots.arms import allowed_positions, arm, dh_arm, reached, telescope

installed = pytest.mark.skipif(example_folder() is None, reason="./dev example-robots is not installed")
ARMS = ["pt500", "pt600", "puma560", "offsets", "crooked"] + [
    pytest.param(name, marks=installed) for name in ("ur5", "panda", "xarm7")
]


@pytest.mark.parametrize("task", [Task.POSE_6D, Task.POSITION_AND_AXIS_5D])
@pytest.mark.parametrize("name", ARMS)
def test_reachable_poses_are_solved_within_limits(name: str, task: Task) -> None:
    _, model, solver = arm(name)
    for positions in allowed_positions(model, 60):
        target = tool_placement(model, positions)
        result = solve(solver, target, task=task)
        assert len(result.solutions) == 1, result.reason
        assert result.reason is None
        assert max(result.residual_m, result.residual_rad) < 1e-8
        assert reached(model, result.solutions[0], target, roll=task is Task.POSE_6D) < 1e-8
        assert (result.solutions >= model.joints.lower).all()
        assert (result.solutions <= model.joints.upper).all()
        assert violations(model.joints, result.solutions[0]) == ()


@needs_eaik
@pytest.mark.parametrize(
    ("name", "analytic"),
    [("pt500", True), ("puma560", True), ("offsets", True), ("crooked", False)]
    + [pytest.param(name, known, marks=installed) for name, known in (("ur5", True), ("panda", False))],
)
def test_closed_form_is_used_if_the_arms_family_has_one(name: str, analytic: bool) -> None:
    _, model, solver = arm(name)
    for positions in allowed_positions(model, 10):
        assert solve(solver, tool_placement(model, positions), task=Task.POSE_6D).analytic is analytic


def test_without_eaik_poses_are_solved_by_search_and_one_line_says_so(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    description, model, _ = arm("puma560")
    monkeypatch.setitem(sys.modules, "eaik.pybindings", None)
    closed_form._eaik.cache_clear()
    try:
        solvers = [build_solver(description) for _ in range(2)]
    finally:
        closed_form._eaik.cache_clear()
    (line,) = [each.message for each in caplog.records]
    assert line.startswith("eaik is not installed, so inverse kinematics searches")
    for positions in allowed_positions(model, 10):
        target = tool_placement(model, positions)
        result = solve(solvers[0], target, task=Task.POSE_6D)
        assert not result.analytic
        assert reached(model, result.solutions[0], target, roll=True) < 1e-8


@needs_eaik
def test_all_postures_of_a_puma_are_found_once_each() -> None:
    _, model, solver = arm("offsets")  # no joint is beyond its limits
    for positions in allowed_positions(model, 20):
        target = tool_placement(model, positions)
        found = solve(solver, target, task=Task.POSE_6D, near=positions, all_solutions=True).solutions
        assert len(found) == 8
        np.testing.assert_allclose(found[0], positions, atol=1e-7)
        assert all(reached(model, each, target, roll=True) < 1e-8 for each in found)
        turns = np.round(found / (2 * np.pi), 6) % 1.0
        assert len(np.unique(np.round(turns, 5), axis=0)) == 8


@needs_eaik
def test_solutions_are_sorted_by_distance_and_a_single_one_is_the_nearest() -> None:
    _, model, solver = arm("puma560")
    width = model.joints.upper - model.joints.lower
    for positions, near in zip(
        allowed_positions(model, 30), allowed_positions(model, 30, seed=5), strict=True
    ):
        target = tool_placement(model, positions)
        found = solve(solver, target, task=Task.POSE_6D, near=near, all_solutions=True).solutions
        distances = (np.square((found - near) / width)).sum(axis=1)
        assert (np.diff(distances) >= 0).all()
        np.testing.assert_array_equal(
            solve(solver, target, task=Task.POSE_6D, near=near).solutions, found[:1]
        )


@pytest.mark.parametrize("turn", [-2 * np.pi, 0.0])
def test_joint_of_two_turns_is_solved_at_the_nearest_turn(turn: float) -> None:
    _, model, solver = arm("offsets")
    positions = np.array([2.0, 0.5, -1.0, 0.4, 1.2, 3.0]) + turn * np.array([1, 0, 0, 0, 0, 1])
    found = solve(solver, tool_placement(model, positions), task=Task.POSE_6D, near=positions + 0.1)
    np.testing.assert_allclose(found.solutions[0], positions, atol=1e-8)


@needs_eaik
def test_free_roll_leaves_the_last_joint_where_it_was() -> None:
    _, model, solver = arm("pt600")
    near = model.joints.home.copy()
    near[4] = 1.234
    for positions in allowed_positions(model, 10):
        target = tool_placement(model, positions)
        found = solve(solver, target, task=Task.POSITION_AND_AXIS_5D, near=near, all_solutions=True)
        assert found.analytic
        assert (found.solutions[:, 4] == 1.234).all()


def test_coupled_limits_exclude_some_postures() -> None:
    _, model, _ = arm("puma560")
    text = (
        load("puma560").text
        + "\n[[constraint]]\njoints = { shoulder = 1.0, elbow = 1.0 }\nlimits = [60, 120]\n"
    )
    solver = build_solver(parse(text, load("puma560").source))
    seen = 0
    for positions in allowed_positions(model, 60):
        target = tool_placement(model, positions)
        result = solve(solver, target, task=Task.POSE_6D, near=positions, all_solutions=True)
        free = solve(arm("puma560")[2], target, task=Task.POSE_6D, near=positions, all_solutions=True)
        sums = np.degrees(free.solutions[:, 1:3].sum(axis=1))
        assert len(result.solutions) == ((sums >= 60) & (sums <= 120)).sum()
        if not len(result.solutions):
            assert result.reason.code == "inverse.limits"
        seen += 0 < len(result.solutions) < len(free.solutions)
    assert seen > 5


@pytest.mark.parametrize("name", ["puma560", "pt600", pytest.param("ur5", marks=installed)])
def test_singular_positions_are_solved(name: str) -> None:
    _, model, solver = arm(name)
    random = np.random.default_rng(8)
    for _ in range(40):
        # With joints at zero or at home, axes are aligned.
        chosen = random.random((2, len(model.joints))) < 0.5
        positions = np.where(
            chosen[0], np.where(chosen[1], 0.0, model.joints.home), random.uniform(-0.5, 0.5)
        )
        positions = np.clip(positions, model.joints.lower, model.joints.upper)
        target = tool_placement(model, positions)
        result = solve(solver, target, task=natural_task(model.joints))
        assert len(result.solutions), result.reason
        assert reached(model, result.solutions[0], target, roll=len(model.joints) > 5) < 2e-4


@pytest.mark.parametrize("name", ["puma560", "pt500"])
def test_pose_with_two_decimals_is_reached_within_its_rounding(name: str) -> None:
    """Use poses that users type or controllers report, with rounded values."""
    _, model, solver = arm(name)
    for positions in allowed_positions(model, 20):
        target = tool_placement(model, positions)
        target[:3, 3] = np.round(target[:3, 3], 5)
        result = solve(solver, target, task=Task.POSE_6D)
        assert len(result.solutions), result.reason
        assert max(result.residual_m, result.residual_rad) < 2e-4


def test_prismatic_and_mimic_joints_are_solved_and_the_finger_stays(tmp_path: Path) -> None:
    description = telescope(tmp_path)
    model, solver = build_model(description), build_solver(description)
    near = model.joints.home.copy()
    near[model.joints.names.index("grip")] = 0.07
    for positions in allowed_positions(model, 30):
        target = tool_placement(model, positions)
        result = solve(solver, target, task=Task.POSE_6D, near=near)
        assert len(result.solutions), result.reason
        assert not result.analytic
        assert reached(model, result.solutions[0], target, roll=True) < 1e-8
        assert result.solutions[0, model.joints.names.index("grip")] == 0.07


def test_an_arm_of_one_joint_is_solved() -> None:
    description = parse(dh_arm("one", [(10.0, 100.0, 200.0, 30.0)], (-90.0, 90.0)), Path("robot.toml"))
    model, solver = build_model(description), build_solver(description)
    result = solve(solver, tool_placement(model, [0.7]), task=Task.POSE_6D)
    np.testing.assert_allclose(result.solutions, [[0.7]], atol=1e-9)


@pytest.mark.parametrize("name", ["puma560", "crooked"])
@pytest.mark.slow
def test_same_arguments_give_bit_identical_results(name: str) -> None:
    _, model, solver = arm(name)
    again = build_solver(arm(name)[0])
    for positions in allowed_positions(model, 10):
        target = tool_placement(model, positions)
        answers = [
            solve(each, target, task=Task.POSE_6D, all_solutions=True, seed=3)
            for each in (solver, solver, again)
        ]
        for other in answers[1:]:
            np.testing.assert_array_equal(other.solutions, answers[0].solutions)


def test_other_seeds_search_elsewhere() -> None:
    _, model, solver = arm("crooked")
    target = tool_placement(model, allowed_positions(model, 1)[0])
    found = [solve(solver, target, task=Task.POSITION_3D, all_solutions=True, seed=seed) for seed in (0, 1)]
    assert found[0].solutions.shape[0] > 10
    assert not np.array_equal(found[0].solutions[:5], found[1].solutions[:5])


@pytest.mark.parametrize("name", ["pt600", "puma560", "crooked"])
def test_a_line_is_followed_on_one_branch(name: str) -> None:
    _, model, solver = arm(name)
    positions = model.joints.home + 0.2
    step = np.full(len(model.joints), 0.004)
    for _ in range(100):
        expected = positions + step
        target = tool_placement(model, expected)
        found = follow(solver, target, task=natural_task(model.joints), near=positions)
        assert found is not None
        assert np.abs(found - positions).max() < 0.05
        assert reached(model, found, target, roll=len(model.joints) > 5) < 1e-8
        positions = found


def test_following_to_another_branch_or_out_of_reach_gives_nothing() -> None:
    _, model, solver = arm("puma560")
    near = model.joints.home + 0.2
    far = tool_placement(model, near + np.array([1.5, 0.0, 0.0, 0.0, 0.0, 0.0]))
    assert follow(solver, far, task=Task.POSE_6D, near=near) is None
    away = tool_placement(model, near)
    away[:3, 3] *= 10
    assert follow(solver, away, task=Task.POSE_6D, near=near) is None


@settings(max_examples=60)
@given(shares=st.lists(st.floats(0.0, 1.0), min_size=6, max_size=6))
def test_any_allowed_position_is_among_all_solutions_of_its_pose(shares: list[float]) -> None:
    _, model, solver = arm("puma560")
    positions = model.joints.lower + np.array(shares) * (model.joints.upper - model.joints.lower)
    target = tool_placement(model, positions)
    result = solve(solver, target, task=Task.POSE_6D, near=positions, all_solutions=True)
    assert len(result.solutions), result.reason
    assert min(reached(model, each, target, roll=True) for each in result.solutions) < 1e-6


def exact(solver: InverseSolver, pose: object) -> None:
    solve(solver, pose, task=Task.POSE_6D)  # type: ignore[arg-type]


HERE = np.eye(4)


@pytest.mark.parametrize(
    ("pose", "reason"),
    [
        ([1.0] * 15, codes.POSE_SIZE(count=15)),
        (np.eye(3), codes.POSE_SHAPE(shape=(3, 3))),
        ("nonsense", codes.POSE_NOT_NUMBERS()),
        ([[1, 0], [0]], codes.POSE_NOT_NUMBERS()),
        (HERE * np.nan, codes.POSE_NOT_FINITE(value="nan")),
        (np.where(HERE == 0, np.inf, HERE), codes.POSE_NOT_FINITE(value="inf")),
        (np.diag([1.0, 1.0, -1.0, 1.0]), codes.POSE_MIRRORED()),
        (np.diag([2.0, 1.0, 1.0, 1.0]), codes.POSE_NO_ROTATION(lengths="2 1 1")),
        (np.zeros((4, 4)), codes.POSE_LAST_ROW(row="0 0 0 0")),
        (np.diag([1.0, 1.0, 1.0, 2.0]), codes.POSE_LAST_ROW(row="0 0 0 2")),
        (np.diag([0.0, 0.0, 0.0, 1.0]), codes.POSE_NO_ROTATION(lengths="0 0 0")),
        (np.diag([1e300, 1e300, 1e300, 1.0]), codes.POSE_NO_ROTATION(lengths="1e+300 1e+300 1e+300")),
        (HERE + np.outer([1, 0, 0, 0], [0, 0, 0, 1e9]), codes.POSE_TOO_FAR(distance_m=1e9, limit_m=1e6)),
        ([10**400] * 16, codes.POSE_NOT_NUMBERS()),
    ],
)
def test_invalid_pose_is_refused_with_a_reason(pose: object, reason: Reason) -> None:
    with pytest.raises(PoseError) as caught:
        exact(arm("pt600")[2], pose)
    assert caught.value.reason == reason
    # The error comes from a worker process.
    assert pickle.loads(pickle.dumps(caught.value)).reason == reason


def test_a_rotation_with_few_decimals_is_made_exact() -> None:
    pose = np.round(tool_placement(arm("puma560")[1], [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]), 4)
    mended = tool_pose(pose)
    np.testing.assert_allclose(mended[:3, :3] @ mended[:3, :3].T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(mended, pose, atol=1e-4)


def test_near_takes_one_finite_number_per_joint() -> None:
    _, model, solver = arm("pt600")
    target = tool_placement(model, model.joints.home)
    with pytest.raises(JointCountError) as wrong:
        solve(solver, target, task=Task.POSE_6D, near=[0.0])
    assert wrong.value.reason == codes.JOINT_SHAPE(shape=(1,), joints=5)
    with pytest.raises(PoseError) as infinite:
        follow(solver, target, task=Task.POSE_6D, near=[0.0, 0.0, np.nan, 0.0, 0.0])
    assert infinite.value.reason.code == "pose.near_not_finite"
