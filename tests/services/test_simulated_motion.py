"""Motion of the simulated arm as a function of time."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controllers.simulated.demo import demo_tour
from controllers.unit.simulated.controller import Controller
from protocol_gateway.unit_protocol.records import AbsolutePositions, Command
from robots.collision.cell import build_cell
from robots.collision.distance import outside_clearance
from robots.descriptions.description import load
from robots.descriptions.example_robots import example_folder
from robots.kinematics.joints import joints_of, violations
from robots.kinematics.model import build_model, tool_placement
from robots.kinematics.motion import Motion
from services.cells.descriptions import cells_of
from services.site_file.site import DEMO

PT600 = load("pt600")
JOINTS = joints_of(PT600)


positions = st.lists(st.floats(0.0, 1.0), min_size=5, max_size=5).map(
    lambda parts: JOINTS.lower + np.array(parts) * (JOINTS.upper - JOINTS.lower)
)


@settings(max_examples=60)
@given(st.lists(st.tuples(positions, st.floats(0.02, 2.0), st.floats(0.01, 1.0)), min_size=1, max_size=5))
def test_motion_keeps_limits_speeds_and_accelerations_however_it_is_interrupted(legs):
    motion, now_s = Motion(JOINTS, JOINTS.home.copy()), 0.0
    top = 0.0
    for target, after_s, speed in legs:
        motion.move(target, now_s, speed=speed)
        # A motion that is slowed first brakes down to its new speed.
        top = max(top, speed)
        for at_s in np.linspace(now_s, now_s + after_s, 25):
            state = motion.state(at_s)
            assert np.all(state.positions >= JOINTS.lower - 1e-6)
            assert np.all(state.positions <= JOINTS.upper + 1e-6)
            assert np.all(np.abs(state.velocities) <= JOINTS.max_speed * top + 1e-6)
            assert np.all(np.abs(state.accelerations) <= JOINTS.max_acceleration + 1e-6)
        now_s += after_s
    motion.brake(now_s)
    assert motion.end_s - now_s < 1.0
    assert np.all(motion.state(motion.end_s).velocities == 0.0)


@pytest.mark.parametrize("robot", ["pt500", "pt600", "puma560"])
def test_the_demo_tours_several_poses_within_limits_and_above_the_floor(robot):
    description = load(robot)
    joints, model = joints_of(description), build_model(description)
    tour = list(itertools.islice(demo_tour(description), 30))
    assert len({tuple(pose) for pose in tour}) >= 6
    motion, now_s = Motion(joints, joints.home.copy()), 0.0
    for pose in tour[:10]:
        motion.move(pose, now_s, speed=1.0)
        for at_s in np.linspace(now_s, motion.end_s, 20):
            positions = motion.state(at_s).positions
            assert not violations(joints, positions)
            assert tool_placement(model, positions)[2, 3] > 0.1
        now_s = motion.end_s


@pytest.mark.skipif(example_folder() is None, reason="no example robots here")
def test_the_demo_moves_an_arm_that_lies_flat_at_home():
    description = load("ur5")
    tour = list(itertools.islice(demo_tour(description), 10))
    assert len({tuple(pose) for pose in tour}) > 2
    assert not any(violations(joints_of(description), pose) for pose in tour)


def test_the_built_in_site_moves_clear_of_its_workbench():
    cell = build_cell(cells_of(DEMO)["pt600"])
    tour = [JOINTS.home, *itertools.islice(demo_tour(PT600), 10)]
    warning_m = cell.arms["pt600"].warning_m
    for begin, end in itertools.pairwise(tour):
        for positions in np.linspace(begin, end, 25):
            found = outside_clearance(cell, "pt600", positions, {})
            assert found
            assert found.distance_m > warning_m, found


def test_speed_hold_resume_and_stop_stay_on_the_checked_line():
    target = np.array([140.0, 20.0, 60.0, -80.0, -170.0])
    controller = Controller(JOINTS, codes={}, demo=None, now_s=0.0)
    reported = []
    # Words by time [s]; some are received while the arm brakes.
    words = {0.4: "speed=30", 0.8: "hold", 0.85: "resume", 0.9: "hold", 2.0: "speed=90", 2.5: "resume"}
    words |= {3.2: "stop"}
    controller.execute((AbsolutePositions(tuple(target)),), 0.0)
    for tick in range(400):
        now_s = tick / 100
        if word := words.get(now_s):
            assert controller.execute((Command((word,)),), now_s) is None
        controller.tick(now_s)
        reported.append(controller.state_records(now_s)[0].values)
    start, way = np.degrees(JOINTS.home), target - np.degrees(JOINTS.home)
    shares = (np.array(reported) - start) @ way / (way @ way)
    # Positions are reported with six decimals.
    assert np.abs(np.array(reported) - start - shares[:, None] * way).max() < 2e-6
    assert np.all(np.diff(shares) > -1e-7)
    assert 0.2 < shares[-1] < 0.9
    assert controller.state_records(4.0)[2].words[0] == "stopped"
