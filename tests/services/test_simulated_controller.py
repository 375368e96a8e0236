"""Simulated controller with time as an argument: execution of units, and state records."""

import numpy as np
import pytest

from controllers.simulated.demo import demo_tour
from controllers.unit.simulated.controller import Controller
from protocol_gateway.unit_protocol.records import (
    AbsolutePositions,
    Command,
    Error,
    RelativePositions,
    Status,
    Time,
    Velocities,
    write_unit,
)
from robots.descriptions.description import load
from robots.kinematics.joints import joints_of

PT600 = load("pt600")
JOINTS = joints_of(PT600)
DEGREES = 180.0 / np.pi
TARGET = (20.0, 60.0, -40.0, 10.0, 90.0)
HOME = tuple(np.round(JOINTS.home * DEGREES, 6).tolist())


class Bench:
    """A controller with a clock that the test advances."""

    def __init__(self, **options):
        self.now_s = 100.0
        self.controller = Controller(JOINTS, **{"codes": {}, "demo": None, "now_s": self.now_s, **options})

    def execute(self, *records):
        return self.controller.execute(records, self.now_s)

    def word(self, *words):
        return self.execute(Command(words))

    def pass_s(self, seconds):
        states = []
        for _ in range(round(seconds * 100)):
            self.now_s += 0.01
            self.controller.tick(self.now_s)
            states.append(self.state())
        return states

    def state(self):
        return self.controller.state_records(self.now_s)

    @property
    def positions(self):
        return self.state()[0].values

    @property
    def words(self):
        return self.state()[2].words


def test_a_controller_boots_at_rest_and_not_homed():
    bench = Bench()
    positions, velocities, status, clock = bench.state()
    assert positions == AbsolutePositions(HOME)
    assert velocities == Velocities((0.0,) * 5)
    assert status == Status(("idle", "remote"))
    assert clock == Time(0.0)


def test_homing_is_reported_and_ends_homed():
    bench = Bench()
    bench.execute(AbsolutePositions(TARGET))
    bench.pass_s(4.0)
    bench.word("home")
    bench.pass_s(0.1)
    assert bench.words == ("homing", "remote")
    bench.pass_s(5.0)
    assert bench.words == ("idle", "remote", "homed")
    assert bench.positions == HOME


def test_the_papers_unit_traces_homes_and_then_moves_in_this_order():
    bench = Bench()
    assert bench.execute(Command(("trace", "home")), AbsolutePositions(TARGET)) is None
    bench.pass_s(0.3)
    assert bench.words == ("homing", "remote", "trace")
    bench.pass_s(5.0)
    assert bench.words == ("idle", "remote", "homed", "trace")
    assert bench.positions == TARGET


def test_a_relative_target_is_added_to_the_current_position():
    bench = Bench()
    bench.execute(
        RelativePositions((10.0, 0.0, 0.0, 0.0, -10.0)), RelativePositions((1.0, 0.0, 0.0, 0.0, 0.0))
    )
    bench.pass_s(3.0)
    assert bench.positions == (HOME[0] + 11.0, *HOME[1:4], HOME[4] - 10.0)


def test_stop_brakes_hard_latches_and_clears_the_queue():
    bench = Bench()
    bench.execute(AbsolutePositions(TARGET), AbsolutePositions(HOME))
    bench.pass_s(0.5)
    bench.word("stop")
    assert bench.words[0] == "moving"
    bench.pass_s(0.4)
    assert bench.words == ("stopped", "remote")
    rest = bench.positions
    assert bench.execute(AbsolutePositions(TARGET)) == Error(8, "stopped, reset first")
    assert bench.word("home") == Error(8, "stopped, reset first")
    bench.word("resume")
    bench.pass_s(1.0)
    assert bench.positions == rest
    bench.word("reset")
    bench.pass_s(1.0)
    assert bench.words == ("idle", "remote")
    assert bench.positions == rest


def test_hold_comes_to_rest_and_resume_continues_to_the_target():
    bench = Bench()
    bench.execute(AbsolutePositions(TARGET))
    bench.pass_s(0.3)
    bench.word("hold")
    bench.pass_s(0.5)
    assert bench.words[0] == "holding"
    held = bench.positions
    assert bench.execute(AbsolutePositions(HOME)) == Error(8, "holding, resume or reset first")
    bench.pass_s(1.0)
    assert bench.positions == held
    bench.word("resume")
    bench.pass_s(3.0)
    assert bench.positions == TARGET
    assert bench.words[0] == "idle"


def test_reset_after_hold_forgets_the_motion():
    bench = Bench()
    bench.execute(AbsolutePositions(TARGET))
    bench.pass_s(0.3)
    bench.word("hold")
    bench.pass_s(0.5)
    held = bench.positions
    bench.word("reset")
    bench.pass_s(1.0)
    assert bench.positions == held
    assert bench.words[0] == "idle"


def test_speed_slows_a_running_motion():
    fast, slow = Bench(), Bench()
    for bench in (fast, slow):
        bench.execute(AbsolutePositions(TARGET))
        bench.pass_s(0.2)
    slow.word("speed=10")
    slow.pass_s(0.5)
    top = max(abs(v) for state in slow.pass_s(0.5) for v in state[1].values)
    assert top <= 0.1 * JOINTS.max_speed.max() * DEGREES + 1e-6
    fast.pass_s(1.0)
    assert fast.positions == TARGET
    slow.pass_s(20.0)
    assert slow.positions == TARGET


def test_a_new_target_replaces_the_old_one_without_a_jump():
    bench = Bench()
    bench.execute(AbsolutePositions(TARGET))
    before = bench.pass_s(0.4)[-1]
    bench.execute(AbsolutePositions(HOME))
    after = bench.state()
    assert after[0].values == pytest.approx(before[0].values, abs=1e-5)
    assert after[1].values == pytest.approx(before[1].values, abs=1e-4)
    bench.pass_s(4.0)
    assert bench.positions == HOME


REFUSED = [
    ((AbsolutePositions((1.0, 2.0)),), 4, "2 values for 5 joints"),
    (
        (AbsolutePositions((500.0, *TARGET[1:])),),
        5,
        "joint waist at 500.00 deg is beyond its limit 150.00 deg",
    ),
    ((AbsolutePositions((0.0, -29.0, -109.0, 0.0, 0.0)),), 5, "shoulder + elbow"),
    ((RelativePositions((200.0, 0.0, 0.0, 0.0, 0.0)),), 5, "waist"),
    ((Command(("dance",)),), 3, "unknown word dance"),
    ((Command(("speed=0",)),), 5, "outside 1-100"),
    ((Command(("speed=101",)),), 5, "outside 1-100"),
    ((Command(("speed=fast",)),), 2, "not a finite number"),
]


@pytest.mark.parametrize(("records", "number", "text"), REFUSED)
def test_an_invalid_unit_is_refused_whole(records, number, text):
    bench = Bench()
    refusal = bench.execute(Command(("trace",)), AbsolutePositions(TARGET), *records)
    assert refusal.number == number
    assert text in refusal.text
    assert write_unit((refusal,))
    bench.pass_s(1.0)
    assert bench.positions == HOME
    assert bench.words == ("idle", "remote")


def test_a_reset_allows_the_motion_behind_it_in_the_same_unit():
    bench = Bench()
    bench.word("stop")
    assert bench.execute(Command(("reset",)), AbsolutePositions(TARGET)) is None
    bench.pass_s(3.0)
    assert bench.positions == TARGET


def test_a_stop_is_executed_even_when_the_rest_of_its_unit_is_refused():
    bench = Bench()
    bench.execute(AbsolutePositions(TARGET))
    bench.pass_s(0.2)
    assert bench.word("stop", "dance").number == 3
    bench.pass_s(0.5)
    assert bench.words[0] == "stopped"


def test_state_records_and_errors_are_not_commands():
    bench = Bench()
    state = bench.state()
    assert bench.execute(state[1], state[2], state[3], Error(9, "x")) is None
    bench.pass_s(0.5)
    assert bench.positions == HOME


def test_the_demo_moves_until_the_first_motion_command_and_begins_homed():
    bench = Bench(demo=demo_tour(PT600))
    bench.pass_s(2.0)
    assert bench.words == ("moving", "remote", "homed")
    bench.word("trace")
    assert bench.word("dance").number == 3
    before = bench.positions
    bench.pass_s(6.0)
    assert bench.positions != before
    bench.execute(AbsolutePositions(TARGET))
    bench.pass_s(20.0)
    assert bench.positions == TARGET
    assert bench.words == ("idle", "remote", "homed", "trace")


def test_a_stop_ends_the_demo_for_good():
    bench = Bench(demo=demo_tour(PT600))
    bench.pass_s(1.0)
    bench.word("stop")
    bench.pass_s(1.0)
    assert bench.words[0] == "stopped"
    bench.word("reset")
    rest = bench.positions
    bench.pass_s(5.0)
    assert bench.positions == rest
