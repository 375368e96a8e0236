"""Motion from rest to rest: straight, at the joints' limits, and known at every time."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robots.descriptions.description import load
from robots.kinematics.joints import joints_of
from robots.kinematics.motion import Motion, _plan_on_line
from robots.kinematics.straight_motion import straight_motion

JOINTS = joints_of(load("pt600"))
# The ratios differ between joints, so ruckig's phase synchronization would leave the straight line.
UNEVEN = replace(
    JOINTS,
    max_acceleration=JOINTS.max_acceleration * np.array([1.0, 0.05, 1.0, 0.2, 3.0]),
    max_jerk=JOINTS.max_jerk * np.array([1.0, 0.1, 0.03, 1.0, 2.0]),
)
shares = st.lists(st.floats(0.0, 1.0), min_size=5, max_size=5).map(np.array)


@settings(max_examples=60)
@given(shares, shares, st.floats(0.01, 1.0), st.sampled_from([JOINTS, UNEVEN]))
def test_motion_from_rest_is_a_straight_line_within_all_limits(one, other, speed, joints):
    start, target = (joints.lower + share * (joints.upper - joints.lower) for share in (one, other))
    motion = Motion(joints, start)
    motion.move(target, 3.0, speed=speed)
    way = target - start
    for now_s in np.linspace(3.0, motion.end_s, 30):
        state = motion.state(now_s)
        done = (state.positions - start) @ way / max(way @ way, 1e-300)
        assert np.abs(state.positions - start - done * way).max() < 1e-9
        assert np.all(np.abs(state.velocities) <= joints.max_speed * speed * (1 + 1e-6))
        assert np.all(np.abs(state.accelerations) <= joints.max_acceleration * (1 + 1e-6))
    assert np.array_equal(motion.state(motion.end_s).positions, target)


interruptions = st.lists(
    st.tuples(st.floats(0.0, 1.0), st.one_of(st.none(), st.floats(0.01, 1.0))), min_size=1, max_size=4
)


@settings(max_examples=60)
@given(shares, shares, interruptions, st.sampled_from([JOINTS, UNEVEN]))
def test_speed_changes_brakes_and_resumes_stay_on_the_line_within_limits(one, other, interrupted, joints):
    start, target = (joints.lower + share * (joints.upper - joints.lower) for share in (one, other))
    motion, now_s, done = Motion(joints, start), 0.0, 0.0
    motion.move(target, now_s, speed=1.0)
    way = target - start
    for after, speed in [*interrupted, (1.0, None), (1.0, 1.0), (1.0, None)]:
        for at_s in np.linspace(now_s, until_s := now_s + after * (motion.end_s - now_s), 20):
            state = motion.state(at_s)
            before, done = done, (state.positions - start) @ way / max(np.linalg.norm(way), 1e-300)
            assert np.abs((state.positions - start) * np.linalg.norm(way) - done * way).max() < 1e-8
            assert before - 1e-6 <= done <= np.linalg.norm(way) + 1e-6
            assert np.all(np.abs(state.velocities) <= joints.max_speed * (1 + 1e-6))
            assert np.all(np.abs(state.accelerations) <= joints.max_acceleration * (1 + 1e-6))
        now_s, moves = until_s, motion.state(until_s)
        if speed is None:
            motion.brake(now_s)
        else:
            motion.move(target, now_s, speed=speed)
        assert motion.state(now_s).positions == pytest.approx(moves.positions, abs=1e-9)
        assert motion.state(now_s).velocities == pytest.approx(moves.velocities, abs=1e-9)
        assert motion.state(now_s).accelerations == pytest.approx(moves.accelerations, abs=1e-6)
    assert np.array_equal(motion.state(motion.end_s).positions, target)


@pytest.mark.parametrize(
    ("after", "speed", "becomes_slow"),
    # Near its target it brakes already, and continues to brake.
    [
        (0.5, 0.04, True),
        (0.12, 0.1, True),
        (0.7, 0.1, True),
        (0.75, 0.1, False),
        (0.9, 0.02, False),
        (0.97, 0.5, False),
    ],
)
def test_slowed_motion_never_reverses(after, speed, becomes_slow):
    target = JOINTS.home + np.radians([90.0, -45.0, 30.0, 0.0, 5.0])
    motion = Motion(JOINTS, JOINTS.home)
    motion.move(target, 0.0, speed=1.0)
    now_s = after * motion.end_s
    motion.move(target, now_s, speed=speed)
    waist = [motion.state(at_s).velocities[0] for at_s in np.linspace(now_s, motion.end_s, 500)]
    assert min(waist) > -1e-6
    assert (motion.end_s > now_s + 0.36) == becomes_slow
    # Braking from full speed takes 0.35 s.
    assert motion.state(now_s + 0.35).velocities[0] <= np.pi / 2 * speed + 1e-6


def test_braking_distance_is_the_least_within_the_limits():
    target = JOINTS.home + np.radians([90.0, 45.0, 0.0, 0.0, 0.0])
    motion = Motion(JOINTS, JOINTS.home)
    motion.move(target, 0.0, speed=1.0)
    motion.brake(motion.end_s / 2)
    # From 90°/s with 360°/s² and 3600°/s³: 0.25 s and 0.1 s, at half the speed on average.
    end = motion.state(motion.end_s).positions
    assert motion.end_s == pytest.approx(1.35 / 2 + 0.35, abs=1e-9)
    assert np.degrees(end - JOINTS.home)[:2] == pytest.approx([45 + 15.75, (45 + 15.75) / 2], abs=1e-9)


def test_duration_follows_from_way_speed_acceleration_and_jerk():
    target = JOINTS.home + np.radians([90.0, 0.0, 0.0, 0.0, 0.0])
    motion = straight_motion(JOINTS, JOINTS.home, target, speed=1.0)
    # 90°/s, 360°/s², 3600°/s³: 0.25 s and 0.1 s to accelerate, and as long to stop.
    assert motion is not None
    assert motion.duration == pytest.approx(90 / 90 + 0.25 + 0.1, abs=1e-9)
    share, rate = motion.progress(np.array([0.0, motion.duration / 2, motion.duration]))
    assert share == pytest.approx([0.0, 0.5, 1.0], abs=1e-9)
    assert rate == pytest.approx([0.0, 1.0, 0.0], abs=1e-9)


@pytest.mark.slow
@settings(max_examples=300)
@given(
    st.floats(-9.0, 1.5).map(lambda exponent: 10.0**exponent),
    st.floats(0.01, 1.0),
    st.sampled_from([JOINTS, UNEVEN]),
)
def test_motion_from_rest_is_the_one_that_ruckig_plans(way, speed, joints):
    target = joints.home + way * np.array([1.0, -0.3, 0.0, 0.7, 0.2])
    motion = straight_motion(joints, joints.home, target, speed=speed)
    ruckigs = _plan_on_line(joints, joints.home, target, (0.0, 0.0, 0.0), speed=speed)
    assert motion.duration == pytest.approx(ruckigs.duration, rel=1e-6, abs=1e-9)
    for time_s in np.linspace(0.0, motion.duration, 20):
        for own, other in zip(motion.at_time(time_s), ruckigs.at_time(time_s), strict=True):
            assert own == pytest.approx(other, rel=1e-5, abs=1e-6)


def test_motion_of_length_zero_takes_no_time():
    for way in (0.0, 1e-320, 1e-200, 1e-16):
        assert straight_motion(JOINTS, 0 * JOINTS.home, way + 0 * JOINTS.home, speed=1.0) is None
