"""Joint positions that an arm can have, and those that no arm can have."""

from dataclasses import replace
from math import inf, nan, pi, radians

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol_gateway.link.plausibility import Plausibility
from protocol_gateway.seam import Activity, StatusReceived
from robots.descriptions.description import load
from robots.kinematics.joints import joints_of
from tests.robots.arms import TELESCOPE

# Limits of the waist: ±150°, of the shoulder: -30° to 130°; both at most 90°/s.
PT600 = joints_of(load("pt600"))
AT_HOME = (0.0,) * 5


def degrees(*first):
    return (*map(radians, first), *AT_HOME[len(first) :])


def judged(units, joints=PT600):
    """Return the code for each unit of (seconds, positions [rad] or [m], velocities); None: it can be."""
    plausibility = Plausibility(joints)
    reasons = [plausibility.problem(positions, rates, now_s) for now_s, positions, rates in units]
    return [reason and reason.code for reason in reasons]


def positions_at(*units):
    return [(now_s, positions, None) for now_s, positions in units]


@pytest.mark.parametrize(
    ("positions", "code"),
    [
        (degrees(0), None),
        (degrees(150), None),
        (degrees(150.5), None),
        (degrees(-150.5), None),
        (degrees(169.9), None),
        (degrees(170.1), "joints.far"),
        (degrees(0, -49.9), None),
        (degrees(0, -50.1), "joints.far"),
        (degrees(0, 150.1), "joints.far"),
        ((37_407.0, 0.0, 0.0, 0.0, 0.0), "joints.far"),
        ((1e308,) * 5, "joints.far"),
        ((nan, 0.0, 0.0, 0.0, 0.0), "joints.no_number"),
        ((0.0, 0.0, 0.0, 0.0, inf), "joints.no_number"),
        ((-inf,) * 5, "joints.no_number"),
    ],
)
def test_the_first_unit_is_judged_by_its_limits_only(positions, code):
    assert judged(positions_at((7.0, positions))) == [code]


def test_the_reason_names_joint_value_and_limits():
    reason = Plausibility(PT600).problem(degrees(0, 200), None, 0.0)
    assert reason.text == "joint shoulder at 200.00°, far beyond its limits -30.00° to 130.00°"
    plausibility = Plausibility(PT600)
    plausibility.problem(degrees(10), None, 1.0)
    reason = plausibility.problem(degrees(80), None, 1.01)
    assert reason.text == "joint waist at 80.00° only 0.01 s after 10.00°: no drive is that fast"


# 2 x 90°/s x (0.01 s + 0.1 s) = 19.8°
@pytest.mark.parametrize(
    ("seconds", "angle", "code"),
    [
        (0.01, 0.9, None),
        (0.01, -19.7, None),
        (0.01, 19.9, "joints.leap"),
        (0.01, -19.9, "joints.leap"),
        (0.0, 17.9, None),
        (0.0, 18.1, "joints.leap"),
        (0.5, 107.0, None),
        (0.5, 109.0, "joints.leap"),
        (3.0, 150.0, None),
    ],
)
def test_a_step_is_judged_by_the_speed_of_its_joint_and_the_time(seconds, angle, code):
    assert judged(positions_at((7.0, AT_HOME), (7.0 + seconds, degrees(angle)))) == [None, code]


def test_each_joint_has_its_own_speed():
    # The wrist turns by 240°/s: 52.8° are possible.
    wrist = (*AT_HOME[:4], radians(52.0))
    assert judged(positions_at((0.0, AT_HOME), (0.01, wrist))) == [None, None]
    assert judged(positions_at((0.0, AT_HOME), (0.01, wrist[::-1]))) == [None, "joints.leap"]


def test_units_that_a_network_delivers_together_are_those_of_a_moving_arm():
    # Full speed at 10 Hz, held back for two seconds.
    units = positions_at(*((2.0, degrees(-90 + 9 * number)) for number in range(20)))
    assert judged(units) == [None] * 20


def test_the_unit_after_a_delayed_one_may_be_far_from_it():
    # Measured at 0.01 s and received at 0.5 s, as after a lost packet.
    delayed = ((0.0, AT_HOME), (0.5, AT_HOME))
    assert judged(positions_at(*delayed, (0.501, degrees(45)))) == [None, None, None]
    assert judged(positions_at(*delayed, (0.501, degrees(45)), (0.502, AT_HOME)))[-1] == "joints.leap"
    assert judged(positions_at(*delayed, (0.501, degrees(109)))) == [None, None, "joints.leap"]


def test_a_corrupted_unit_leaves_the_units_around_it_as_they_are():
    broken, leapt = (37_407.0, *AT_HOME[1:]), degrees(100)
    units = positions_at((0.0, AT_HOME), (0.01, broken), (0.02, AT_HOME))
    assert judged(units) == [None, "joints.far", None]
    # Of a leap there and back the second is one, too.
    units = positions_at((0.0, AT_HOME), (0.01, leapt), (0.02, AT_HOME), (0.03, AT_HOME))
    assert judged(units) == [None, "joints.leap", "joints.leap", None]


def test_an_arm_that_is_elsewhere_for_good_is_there():
    units = positions_at((0.0, AT_HOME), *((0.01 * number, degrees(100)) for number in range(1, 5)))
    assert judged(units) == [None, "joints.leap", None, None, None]


def test_a_new_connection_has_no_unit_before():
    plausibility = Plausibility(PT600)
    assert plausibility.problem(AT_HOME, None, 0.0) is None
    plausibility.connected()
    assert plausibility.problem(degrees(140), None, 0.01) is None
    assert plausibility.problem(AT_HOME, None, 0.02).code == "joints.leap"


def test_velocities_are_finite_numbers():
    assert judged([(0.0, AT_HOME, AT_HOME), (0.01, AT_HOME, (0.0, nan, 0.0, 0.0, 0.0))]) == [
        None,
        "joints.no_number",
    ]


@pytest.mark.parametrize("status", [StatusReceived(homed=False), StatusReceived(activity=Activity.HOMING)])
def test_an_arm_before_and_while_it_is_homed_may_be_far_outside_its_limits(status):
    plausibility = Plausibility(PT600)
    assert plausibility.problem(AT_HOME, None, 0.0) is None
    plausibility.follow(status)
    assert plausibility.problem(degrees(300), None, 0.01) is None
    assert plausibility.problem(degrees(-500), None, 0.01) is None
    assert plausibility.problem(degrees(511), None, 0.02).code == "joints.far"
    assert plausibility.problem((nan,) * 5, None, 0.02).code == "joints.no_number"
    plausibility.follow(StatusReceived(homed=True, activity=Activity.IDLE))
    # Its zero is set: not a step.
    assert plausibility.problem(degrees(40), None, 0.03) is None
    assert plausibility.problem(degrees(-40), None, 0.04).code == "joints.leap"


def test_a_joint_without_limits_turns_on_and_may_count_from_another_turn():
    endless = replace(PT600, continuous=(True, False, False, False, False))
    steady = [(0.01 * number, degrees(40.0 * number)) for number in range(6)]
    turns = positions_at((0.0, (1e6, *AT_HOME[1:])), (0.01, (1e6 + 2 * pi, *AT_HOME[1:])))
    wraps = positions_at((0.0, degrees(179.9)), (0.01, degrees(-179.9)), (0.02, degrees(-178)))
    leaps = positions_at((0.0, degrees(0)), (0.01, degrees(-180)))
    assert judged(turns, endless) == [None, None]
    assert judged(wraps, endless) == [None, None, None]
    assert judged(leaps, endless) == [None, "joints.leap"]
    assert judged(positions_at((0.0, (inf, *AT_HOME[1:]))), endless) == ["joints.no_number"]
    assert judged(positions_at(*steady), endless)[1:] == ["joints.leap"] * 5


def test_a_description_s_own_limits_of_a_continuous_joint_count(tmp_path):
    urdf = TELESCOPE.replace('name="roll" type="revolute"', 'name="roll" type="continuous"')
    (tmp_path / "arm.urdf").write_text(urdf)
    assert joints_of(load(tmp_path / "arm.urdf")).continuous == (False,) * 4 + (True, False)
    limits = 'name = "roll"\nlimits = [-90.0, 90.0]\n'
    (tmp_path / "robot.toml").write_text(f'name = "arm"\nurdf = "arm.urdf"\n[[joint]]\n{limits}')
    limited = joints_of(load(tmp_path))
    assert limited.continuous == (False,) * 6
    roll = (*AT_HOME[:4], radians(120), 0.0)
    assert judged(positions_at((0.0, roll)), limited) == ["joints.far"]


def test_prismatic_joints_are_judged_in_metres(tmp_path):
    (tmp_path / "arm.urdf").write_text(TELESCOPE)
    telescope = joints_of(load(tmp_path / "arm.urdf"))
    assert telescope.names[2] == "lift"  # 0 to 0.3 m, 0.2 m/s: 0.044 m in 0.01 s

    def lifted(height):
        return (0.0, 0.0, height, 0.0, 0.0, 0.0)

    assert judged(positions_at((0.0, lifted(0.39))), telescope) == [None]
    assert judged(positions_at((0.0, lifted(0.41))), telescope) == ["joints.far"]
    assert judged(positions_at((0.0, lifted(0.0)), (0.01, lifted(0.04))), telescope) == [None, None]
    assert judged(positions_at((0.0, lifted(0.0)), (0.01, lifted(0.05))), telescope) == [None, "joints.leap"]


@given(
    st.lists(
        st.tuples(st.floats(0.0, 2.0), st.lists(st.floats(-8.0, 8.0), min_size=5, max_size=5)),
        min_size=1,
        max_size=8,
    )
)
def test_what_passes_is_what_a_reading_of_the_rules_allows(units):
    plausibility = Plausibility(PT600)
    margin, now_s, before, received_s = radians(20), 0.0, None, []
    for seconds, angles in units:
        now_s += seconds
        there = np.array(angles)
        near = np.all((there >= PT600.lower - margin) & (there <= PT600.upper + margin))
        slow = before is None or np.all(
            np.abs(there - before) <= 2 * PT600.max_speed * (now_s - min(received_s[-2:]) + 0.1) * (1 + 1e-12)
        )
        assert (plausibility.problem(tuple(angles), None, now_s) is None) == bool(near and slow)
        if near:
            before = there
            received_s.append(now_s)
