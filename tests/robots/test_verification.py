"""A model against a controller's Cartesian positions: what agrees, and which single cause is found.

The controller's side is an FK of its own, written from the D-H table that Universal Robots publishes for the
UR5; the model's side is the URDF of ROS-Industrial in example-robot-data, which others wrote.
"""

from math import cos, pi, radians, sin

import numpy as np
import pytest

from robots.descriptions.description import load
from robots.kinematics.joints import Joints, joints_of
from robots.kinematics.model import build_model, link_placements, tool_placement
from robots.kinematics.verification import Sample, unlike, unmoved, verify
from robots.schema.errors import DescriptionError
from robots.schema.poses import axis_rotation, inverse

# a, alpha, d of the joints, from the manufacturer's page of D-H parameters.
UR5 = (
    (0.0, pi / 2, 0.089159),
    (-0.425, 0.0, 0.0),
    (-0.39225, 0.0, 0.0),
    (0.0, pi / 2, 0.10915),
    (0.0, -pi / 2, 0.09465),
    (0.0, 0.0, 0.0823),
)
TOOL = np.eye(4)
TOOL[:3, 3] = 0.01, -0.02, 0.15


def published(positions):
    """Return flange to base by the published table."""
    placement = np.eye(4)
    for q, (a, alpha, d) in zip(positions, UR5, strict=True):
        c, s, ca, sa = cos(q), sin(q), cos(alpha), sin(alpha)
        placement = placement @ np.array(
            [[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1]]
        )
    return placement


@pytest.fixture(scope="module")
def ur5():
    """Return joints of the URDF, and its placement of tool0 in base."""
    try:
        model = build_model(load("ur5"))
    except DescriptionError:
        pytest.skip("the extra example-robots is not installed")
    base, flange = (model.link_names.index(each) for each in ("base", "tool0"))

    def placement(positions):
        links = link_placements(model, positions)
        return inverse(links[base]) @ links[flange]

    return model.joints, placement


POSES = np.random.default_rng(7).uniform(-1.6, 1.6, (10, 6))


def samples(poses, *, controller=published, tool=TOOL):
    return [
        Sample(positions=np.array(each), tool_to_base=controller(each) @ tool, tool_to_flange=tool)
        for each in poses
    ]


def test_the_urdf_of_ros_industrial_agrees_with_the_published_table(ur5):
    joints, placement = ur5
    found = verify(placement, joints, samples(POSES))
    assert found.agrees, found
    assert max(each.distance_m for each in found.deviations) < 1e-5


def changed(index, scale=1.0, offset=0.0, other=None, share=0.0):
    def controller(positions):
        q = np.array(positions)
        q[index] = scale * q[index] + offset + (share * positions[other] if other is not None else 0.0)
        return published(q)

    return controller


def based(positions):
    turned = np.eye(4)
    turned[:3, :3] = axis_rotation(np.array([0.0, 0.0, 1.0]), pi)
    return turned @ published(positions)


def in_millimetres(positions):
    placement = published(positions).copy()
    placement[:3, 3] *= 1000
    return placement


@pytest.mark.slow
@pytest.mark.parametrize(
    ("controller", "words"),
    [
        (changed(1, scale=-1.0), "shoulder_lift_joint turns the other way"),
        (changed(2, offset=radians(1.0)), "the zero of elbow_joint is off by 1.0°"),
        (changed(3, offset=pi / 2), "the zero of wrist_1_joint is off by 90.0°"),
        (changed(4, scale=-1.0, offset=0.3), "wrist_2_joint is off by 17.2° and it turns the other way"),
        (changed(2, scale=0.8), "elbow_joint moves 0.8 times as far"),
        (changed(2, other=1, share=1.0), "elbow_joint is its value plus that of shoulder_lift_joint"),
        (changed(2, other=1, share=-1.0), "elbow_joint is its value minus that of shoulder_lift_joint"),
        (lambda q: published(q[[0, 1, 2, 4, 3, 5]]), "wrist_1_joint and wrist_2_joint are exchanged"),
        (based, "the controller's base is another one: the model's is at x 0.0 y 0.0 z 0.0 mm, roll 0.0"),
    ],
)
def test_a_single_cause_is_named(ur5, controller, words):
    joints, placement = ur5
    found = verify(placement, joints, samples(POSES, controller=controller))
    assert not found.agrees
    assert any(words in each for each in found.suspects), found.suspects
    # A wrong zero of the first joint has the effect of a turned base, that of the last of a turned flange.
    assert len(found.suspects) == (2 if controller is based else 1), found.suspects


def test_another_unit_of_length_is_named(ur5):
    joints, placement = ur5
    tool = TOOL.copy()
    tool[:3, 3] *= 1000
    found = verify(placement, joints, samples(POSES, controller=in_millimetres, tool=tool))
    assert any("lengths are 1000 times the model's" in each for each in found.suspects)


def test_two_causes_or_another_robot_have_no_suspect(ur5):
    joints, placement = ur5

    def both(positions):
        return changed(1, offset=0.1)(positions * np.array([1, 1, 1, -1, 1, 1]))

    found = verify(placement, joints, samples(POSES, controller=both))
    assert not found.agrees
    assert found.suspects == ()


def test_few_poses_or_a_joint_that_did_not_move_prove_nothing(ur5):
    joints, placement = ur5
    assert not verify(placement, joints, samples(POSES[:9])).agrees
    still = POSES.copy()
    still[:, 5] = 0.1
    found = verify(placement, joints, samples(still))
    assert not found.agrees
    assert found.unmoved == ("wrist_3_joint moved by 0.0° in all poses; 20.0° is needed",)
    assert all(each.is_small for each in found.deviations)


def test_a_pose_counts_if_it_differs_from_all_others():
    joints: Joints = joints_of(load("pt600"))
    model = build_model(load("pt600"))
    here = Sample(
        positions=joints.home, tool_to_base=tool_placement(model, joints.home), tool_to_flange=np.eye(4)
    )
    assert not unlike(joints, joints.home + radians(9.0), [here])
    assert unlike(joints, joints.home + np.radians([0, 0, 0, 0, 10.1]), [here])
    assert len(unmoved(joints, [here])) == 5
