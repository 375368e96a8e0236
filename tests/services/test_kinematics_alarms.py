"""Alarm events of an arm's state: each begins once and ends once, also for a noisy value."""

import numpy as np
import pytest

from controllers.simulated.demo import demo_tour
from robomesh.schemas.robomesh_pb2 import Event
from robots.collision import Nearest
from robots.descriptions.description import load
from robots.kinematics.joints import joints_of
from robots.kinematics.model import build_model
from robots.kinematics.singularity import arm_length, singularity_margin
from robots.kinematics.straight_motion import straight_motion
from services.kinematics.alarms import Alarms
from services.kinematics.conditions import (
    limit_conditions,
    missing_conditions,
    outside_conditions,
    own_conditions,
    singularity_conditions,
)

JOINTS = joints_of(load("pt600"))
TICK_S = 0.05


def judged(conditions_of, values, alarms=None):
    """Judge one value each 50 ms; return (tick, severity, code) of every event."""
    alarms = alarms or Alarms()
    return [
        (tick, event.severity, event.code)
        for tick, value in enumerate(values)
        for event in alarms.judge(conditions_of(value), tick * TICK_S)
    ]


def elbow_at(share):
    """Return the conditions of an elbow at this fraction of its range below its upper limit."""
    positions = np.zeros(len(JOINTS))
    positions[2] = JOINTS.upper[2] - share * (JOINTS.upper[2] - JOINTS.lower[2])
    return limit_conditions(JOINTS, positions)


def away(distance_m, pair=("arm/flange", "table")):
    points = np.zeros(3), np.array([distance_m, 0.0, 0.0])
    return Nearest(pair, distance_m, points)


def near_table(distance_m):
    return outside_conditions([away(distance_m)], lambda pair: (0.05, 0.01))


NOISE = np.random.default_rng(5).normal(0.0, 1.0, 2000)


@pytest.mark.parametrize(
    ("conditions_of", "threshold", "noise", "far", "code"),
    [
        (elbow_at, 0.02, 0.002, 0.10, "kinematics.limit"),
        (singularity_conditions, 0.02, 0.002, 0.10, "kinematics.singularity"),
        (near_table, 0.05, 0.0015, 0.20, "kinematics.clearance.warning"),
        (lambda d: own_conditions(away(max(d, 0.0))), 0.0, 0.0003, 0.05, "kinematics.collision"),
    ],
)
def test_a_noisy_value_at_its_threshold_is_one_event(conditions_of, threshold, noise, far, code):
    at_threshold = threshold + noise * NOISE
    # Singular positions wait for five minutes, because an arm passes them in each cycle.
    wait_s = 300.0 if code.endswith("singularity") else 1.0
    values = [far] * 20 + at_threshold.tolist() + [far] * round((wait_s + 2) / TICK_S)
    first, last = judged(conditions_of, values)
    assert first[1:] in [(Event.INFO, code), (Event.WARNING, code), (Event.ERROR, code)]
    assert 20 <= first[0] < 40
    assert last[1:] == (Event.INFO, f"{code}.over")
    assert last[0] == pytest.approx(2020 + wait_s / TICK_S, abs=1)


def demonstrated(robot, *, speed, for_s, step_s):
    """Yield (time [s], positions) of the built-in demonstration, without its pauses."""
    description = load(robot)
    joints, tour = joints_of(description), demo_tour(description)
    at, begin_s = joints.home, 0.0
    while begin_s < for_s:
        target = next(tour)
        motion = straight_motion(joints, at, target, speed=speed)
        times = np.arange(0.0, motion.duration, step_s)
        shares = motion.progress(times)[0]
        yield from zip(begin_s + times, at + shares[:, None] * (target - at), strict=True)
        at, begin_s = target, begin_s + motion.duration + 0.4


# The simulated controller demonstrates at 60 % by default.
@pytest.mark.parametrize("speed", [0.6, 0.1])
def test_a_cycle_through_singular_positions_is_one_event(speed):
    description = load("pt600")
    model, reach, alarms = build_model(description), arm_length(description), Alarms()
    codes, margins = [], []
    for now_s, positions in demonstrated("pt600", speed=speed, for_s=600.0, step_s=0.2):
        margins.append(singularity_margin(model, positions, reach=reach))
        codes += [event.code for event in alarms.judge(singularity_conditions(margins[-1]), now_s)]
    # The condition itself begins and ends several times.
    assert np.count_nonzero(np.diff(np.array(margins) < 0.02)) > 8
    assert codes == ["kinematics.singularity"]


def test_a_condition_that_returns_within_a_second_is_not_over():
    values = ([0.01] + [0.10] * 15) * 5 + [0.10] * 30
    assert [code for _, _, code in judged(elbow_at, values)] == ["kinematics.limit", "kinematics.limit.over"]


def test_a_condition_neither_begins_nor_ends_in_its_deadband():
    assert judged(elbow_at, [0.025] * 100) == []
    assert [code for _, _, code in judged(elbow_at, [0.015] + [0.025] * 100)] == ["kinematics.limit"]


def test_an_approach_causes_a_warning_then_an_error_then_a_collision():
    distances = np.linspace(0.2, 0.0, 200)
    assert [(severity, code) for _, severity, code in judged(near_table, distances)] == [
        (Event.WARNING, "kinematics.clearance.warning"),
        (Event.ERROR, "kinematics.clearance.stop"),
        (Event.ERROR, "kinematics.collision"),
    ]


def test_an_obstacle_is_one_event_whichever_link_is_nearest():
    def conditions(tick):
        link = f"arm/{('flange', 'wrist')[tick % 2]}"
        near = [away(0.03, (link, "table")), away(0.04, (link, "post")), away(0.045, ("arm/column", "post"))]
        return outside_conditions(near, lambda pair: (0.05, 0.01))

    alarms = Alarms()
    events = [event for tick in range(50) for event in alarms.judge(conditions(tick), tick * TICK_S)]
    assert [dict(event.values)["second"] for event in events] == ["table", "post"]


def test_an_event_names_joint_pair_and_distance():
    (event,) = Alarms().judge(elbow_at(0.01), 0.0)
    assert dict(event.values)["joint"] == "elbow"
    assert event.text == "elbow is near the end of its range: 107.8° of 110.0°"
    assert event.source == "kinematics"
    (event,) = Alarms().judge(near_table(0.0314), 0.0)
    assert event.text == "arm/flange is 31 mm from table, within the warning distance of 50 mm"
    assert dict(event.values) == {"first": "arm/flange", "second": "table", "distance_m": "0.0314"}


def test_coupled_limits_count_as_joints_do(tmp_path):
    text = load("pt600").source.read_text(encoding="utf-8")
    coupled = text + "\n[[constraint]]\njoints = { shoulder = 1.0, elbow = 1.0 }\nlimits = [-120.0, 10.0]\n"
    robot = tmp_path / "robot.toml"
    robot.write_text(coupled, encoding="utf-8")
    (tmp_path / "meshes").symlink_to(load("pt600").source.parent / "meshes")
    joints = joints_of(load(robot))
    at = np.array(joints.home)
    at[1:3] = np.radians([60.0, -51.0])
    (event,) = Alarms().judge(limit_conditions(joints, at), 0.0)
    assert event.text == "shoulder + elbow is near the end of its range: 9.0° of 10.0°"


def test_a_robot_that_starts_late_is_no_event_and_one_that_stays_absent_is():
    def cell(present):
        return missing_conditions([] if present else ["second"])

    assert judged(cell, [False] * 20 + [True] * 100) == []
    events = judged(cell, [False] * 100 + [True] * 100)
    assert [(severity, code) for _, severity, code in events] == [
        (Event.WARNING, "kinematics.not_counted"),
        (Event.INFO, "kinematics.not_counted.over"),
    ]
    assert events[0][0] == pytest.approx(40, abs=1)
