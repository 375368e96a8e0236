"""Joints in SI, and violations of their limits."""

import math
import subprocess
import sys

import numpy as np
import pytest

from robomesh import reason_codes as codes
from robots.descriptions.description import load
from robots.kinematics.joints import JointType, joints_of, violations
from robots.schema.errors import JointCountError

PAPER_SAMPLE_DEG = [100.00, 30.45, 92.66, -67.10, -25.85]


def test_joints_are_in_radians() -> None:
    joints = joints_of(load("pt600"))
    assert joints.names == ("waist", "shoulder", "elbow", "wrist", "roll")
    assert set(joints.types) == {JointType.ROTARY}
    np.testing.assert_allclose(joints.lower, np.radians([-150, -30, -110, -100, -180]))
    np.testing.assert_allclose(joints.upper, np.radians([150, 130, 110, 100, 180]))


@pytest.mark.parametrize("robot", ["pt500", "pt600"])
def test_papers_sample_frame_is_within_the_limits(robot: str) -> None:
    assert violations(joints_of(load(robot)), np.radians(PAPER_SAMPLE_DEG)) == ()


@pytest.mark.parametrize("robot", ["pt500", "pt600", "puma560"])
def test_home_and_each_limit_are_allowed(robot: str) -> None:
    joints = joints_of(load(robot))
    assert violations(joints, joints.home) == ()
    for index in range(len(joints)):
        for limit in (joints.lower[index], joints.upper[index]):
            positions = joints.home.copy()
            positions[index] = limit
            assert codes.JOINT_LIMIT.name not in [each.code for each in violations(joints, positions)]


def test_position_beyond_a_limit_is_reported_in_degrees() -> None:
    joints = joints_of(load("pt600"))
    positions = np.radians([0, 131, 0, 0, 0])
    (found,) = violations(joints, positions)
    assert found.text == "joint shoulder at 131.00° is beyond its limit 130.00°"
    assert found == codes.JOINT_LIMIT(name="shoulder", value="131.00°", limit="130.00°")


def test_limit_rounded_to_the_protocols_digits_is_allowed() -> None:
    joints = joints_of(load("pt600"))
    assert violations(joints, np.radians([150.004, 0, 0, 0, 0])) == ()
    assert violations(joints, np.radians([150.01, 0, 0, 0, 0])) != ()


def test_coupled_limit_is_checked() -> None:
    joints = joints_of(load("pt600"))
    found = violations(joints, np.radians([0, 100, 100, 0, 0]))
    assert [each.text for each in found] == ["shoulder + elbow at 200.00° is beyond its limit 160.00°"]


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_nonfinite_number_is_a_violation(value: float) -> None:
    (found,) = violations(joints_of(load("pt600")), [0, 0, value, 0, 0])
    assert found == codes.JOINT_NOT_FINITE(name="elbow", value=value)


@pytest.mark.parametrize("positions", [[], [0.0] * 4, [0.0] * 6, [[0.0] * 5]])
def test_wrong_count_is_an_error(positions: list[float]) -> None:
    with pytest.raises(JointCountError) as caught:
        violations(joints_of(load("pt600")), positions)
    assert caught.value.reason == codes.JOINT_SHAPE(shape=np.shape(positions), joints=5)


@pytest.mark.slow
def test_joints_need_neither_pinocchio_nor_trimesh() -> None:
    code = (
        "import sys; from robots.descriptions.description import load; "
        "from robots.kinematics.joints import joints_of; "
        "joints_of(load('pt600')); print({'pinocchio', 'trimesh'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"
