import random
from itertools import pairwise

import pytest

from protocol_gateway.link.timestamping import EventTime, Timestamper
from protocol_gateway.seam import (
    Activity,
    JointsReceived,
    MalformedReceived,
    StatusReceived,
    UnknownReceived,
)

MS = 1_000_000


def at(seconds):
    return EventTime(seconds, round(seconds * 1e9))


def joints(time_s=None):
    return JointsReceived((0.0,), None, time_s)


def date(timestamper, time_s, now):
    (received,) = timestamper.timestamps([joints(time_s)], now)
    return received


def near(seconds):
    return pytest.approx(seconds, abs=1e-6)


def fresh(timestamper, begin_s=100.0, clock_s=0.0):
    """Receive units at 100 Hz for a second; return its end."""
    for number in range(101):
        now = at(begin_s + number * 0.01)
        assert date(timestamper, clock_s + number * 0.01, now).monotonic_s == near(now.monotonic_s)
    return begin_s + 1.0


def test_units_without_delay_are_stamped_at_receipt():
    fresh(Timestamper())


def test_a_burst_after_a_gap_is_stamped_by_time():
    timestamper = Timestamper()
    end_s = fresh(timestamper)
    # Delayed by three seconds, then received within a few milliseconds.
    for number in range(1, 280):
        received = date(timestamper, 1.0 + number * 0.01, at(end_s + 3.0 + number * 1e-5))
        assert received.monotonic_s == near(end_s + number * 0.01)
        assert received.wall_ns == pytest.approx((end_s + number * 0.01) * 1e9, abs=1000)
        assert received.clock == 0
    now = at(end_s + 3.01)
    assert date(timestamper, 1.0 + 3.01, now).monotonic_s == near(now.monotonic_s)


def test_a_controller_after_a_pause_is_fresh():
    timestamper = Timestamper()
    end_s = fresh(timestamper)
    assert date(timestamper, 1.0 + 3.0, at(end_s + 3.0)).monotonic_s == near(end_s + 3.0)


@pytest.mark.parametrize("clock_s", [0.2, 1.0, 5000.0])
def test_a_set_or_stuck_clock_makes_nothing_look_old(clock_s):
    timestamper = Timestamper()
    end_s = fresh(timestamper)
    clocks = set()
    for number in range(1, 300):
        now = at(end_s + number * 0.01)
        received = date(timestamper, clock_s, now)
        # Of units with one TIME, the second may be stamped like the first.
        assert number <= 2 or received.monotonic_s == near(now.monotonic_s)
        clocks.add(received.clock)
    assert clocks == ({0} if clock_s == 1.0 else {1}), "a stuck clock is no new one for each unit"


def test_after_a_gap_a_slow_clock_is_trusted_for_a_second_only():
    timestamper = Timestamper()
    end_s = fresh(timestamper)
    assert date(timestamper, 1.01, at(end_s + 2.0)).monotonic_s == near(end_s + 0.01)
    for number in range(1, 200):
        received = date(timestamper, 1.01 + number * 0.01, at(end_s + 2.0 + number * 0.01))
    assert received.clock == 1
    assert date(timestamper, 3.01, at(end_s + 4.0)).monotonic_s == near(end_s + 4.0)


def test_without_a_clock_units_are_stamped_at_receipt():
    timestamper = Timestamper()
    for now in (at(1.0), at(1.01), at(5.0), at(5.02)):
        assert date(timestamper, None, now) == now


def test_units_of_one_read_without_time_are_spaced_at_the_measured_rate():
    timestamper = Timestamper()
    for number in range(150):
        date(timestamper, None, at(10.0 + number * 0.01))
    read = timestamper.timestamps([joints() for _ in range(5)], at(11.54))
    stamps = [received.monotonic_s for received in read]
    assert stamps == [near(11.50), near(11.51), near(11.52), near(11.53), near(11.54)]
    # Faster than the rate allows: between the newest stamp and the receipt.
    read = timestamper.timestamps([joints() for _ in range(4)], at(11.56))
    assert [received.monotonic_s for received in read] == [near(11.545 + 0.005 * n) for n in range(4)]


def test_a_repeated_event_of_a_unit_gets_another_stamp():
    unit = [
        joints(1.0),
        StatusReceived(activity=Activity.IDLE, controller_time_s=1.0),
        UnknownReceived("OVEN", ("1",), b"", 1.0),
        UnknownReceived("OVEN", ("2",), b"", 1.0),
        MalformedReceived(0, "", "nonsense"),
        joints(1.01),
    ]
    position, status, oven, oven_again, _, following = Timestamper().timestamps(unit, at(5.0))
    assert position == status == oven
    assert 0 < oven_again.wall_ns - oven.wall_ns < MS
    assert 9 * MS < following.wall_ns - oven_again.wall_ns <= 10 * MS
    assert following == at(5.0)


def test_setting_the_gateways_clock_begins_a_new_number():
    timestamper = Timestamper()
    end_s = fresh(timestamper)
    timestamper.wall_clock_was_set()
    received = date(timestamper, 1.01, EventTime(end_s + 0.03, round((end_s + 500.0) * 1e9)))
    assert (received.monotonic_s, received.clock) == (near(end_s + 0.01), 1)


def test_a_new_connection_discards_the_previous_clock():
    timestamper = Timestamper()
    end_s = fresh(timestamper)
    timestamper.connected()
    assert date(timestamper, 1.0 + 0.5, at(end_s + 2.0)) == EventTime(
        end_s + 2.0, round((end_s + 2.0) * 1e9), 1
    )


@pytest.mark.parametrize("nonsense_s", [1e305, -1e305, 1e11, 5e-324])
def test_an_absurd_time_is_ignored(nonsense_s):
    timestamper = Timestamper()
    end_s = fresh(timestamper)
    for number in range(1, 50):
        time_s = nonsense_s if number % 7 == 3 else 1.0 + number * 0.01
        now = at(end_s + number * 0.01)
        assert 0 <= now.wall_ns - date(timestamper, time_s, now).wall_ns < 20 * MS


def test_a_clock_that_begins_anew_gives_no_stamp_before_the_last_one():
    timestamper = Timestamper()
    # Read 9 ms late, because the gateway was preempted: a unit of 8 ms later shows it.
    first = date(timestamper, 0.0, at(100.009))
    later = timestamper.timestamps([joints(0.008), joints(0.016)], at(100.0164))
    assert first.clock < later[0].clock
    assert first.wall_ns < later[0].wall_ns < later[1].wall_ns == at(100.0164).wall_ns


def test_a_new_connection_gives_no_stamp_before_the_last_one():
    timestamper = Timestamper()
    first = date(timestamper, 7.0, at(100.0))
    timestamper.connected()
    later = timestamper.timestamps([joints(0.0), joints(0.01)], at(100.005))
    assert first.wall_ns < later[0].wall_ns < later[1].wall_ns


@pytest.mark.parametrize("ppm", [-5000, -200, 0, 200, 5000])
def test_a_drifting_clock_is_followed_in_one_identity(ppm):
    timestamper = Timestamper()
    dates = []
    for number in range(6000):
        now = at(100.0 + number * 0.01)
        received = date(timestamper, 5.0 + number * 0.01 * (1.0 - ppm * 1e-6), now)
        dates.append(received)
        assert 0.0 <= now.monotonic_s - received.monotonic_s < 0.1
    assert {received.clock for received in dates} == {0}
    spans = [later.wall_ns - earlier.wall_ns for earlier, later in pairwise(dates)]
    assert all(abs(span - 10 * MS) <= MS for span in spans)


@pytest.mark.parametrize("seed", range(25))
def test_stamps_increase_follow_time_and_precede_their_receipt(seed):
    chance = random.Random(seed)
    timestamper = Timestamper()
    period_s = chance.choice([0.001, 0.004, 0.01, 0.1])
    digits = chance.choice([3, 6, 9])
    now_s, made_s, waiting, last, quiet_until_s = 1000.0, 0.0, [], {}, 0.0
    jitter_s, newest_ns = chance.choice([1e-4, 0.005, 0.06]), 0
    for _ in range(1500):
        made_s += period_s
        if chance.random() < 0.002:
            made_s += chance.choice([-7.0, 0.3, 11.0])
        waiting += [round(made_s, digits)] * (2 if chance.random() < 0.01 else 1)
        now_s += period_s
        if chance.random() < 0.4 and period_s < 0.1:
            continue  # held back
        read_s = now_s + chance.expovariate(1.0 / jitter_s)
        now_s = max(now_s, read_s - chance.choice([0.0, 0.5]) * jitter_s)
        times, waiting, numbers = waiting, [], set(last)
        if read_s > quiet_until_s and chance.random() < 0.02:
            quiet_until_s = read_s + 1.0
            times.insert(chance.randrange(len(times) + 1), None)  # a unit without TIME
        for time_s, received in zip(
            times, timestamper.timestamps([joints(t) for t in times], at(read_s)), strict=True
        ):
            before = last.get(received.clock)
            # A nanosecond for each unit, where TIME goes back within a read.
            assert newest_ns - len(times) < received.wall_ns <= at(read_s).wall_ns
            newest_ns = received.wall_ns
            if before is not None:
                span_ns = received.wall_ns - before[0]
                assert span_ns > 0
                if time_s is not None and before[1] is not None and time_s > before[1]:
                    time_ns = (time_s - before[1]) * 1e9
                    tolerance_ns = max(0.1 * time_ns, MS)
                    assert span_ns - time_ns <= tolerance_ns
                    # The units with which a number begins may be closer.
                    assert received.clock not in numbers or time_ns - span_ns <= tolerance_ns
            last[received.clock] = received.wall_ns, time_s
        now_s = max(now_s, read_s)


@pytest.mark.parametrize("seed", range(10))
def test_the_shortcut_without_time_gives_the_general_stamps(seed, monkeypatch):
    chance = random.Random(seed)
    reads, now_s, time_s = [], 100.0, 0.0
    for _ in range(300):
        now_s += chance.choice([0.0, 1e-9, 1e-3, 0.01, 0.01, 0.3])
        time_s += 0.01
        units = chance.choice([1, 1, 1, 2, 5])
        reads.append(
            (chance.random(), [joints(time_s if chance.random() < 0.02 else None)] * units, at(now_s))
        )

    def stamped(timestamper):
        for event, events, now in reads:
            if event < 0.02:
                timestamper.connected()
            elif event < 0.03:
                timestamper.wall_clock_was_set()
            yield timestamper.timestamps(events, now)

    shortened = [*stamped(Timestamper())]
    monkeypatch.setattr(Timestamper, "_is_of_now", lambda self, event, now, now_ns: False)
    assert shortened == [*stamped(Timestamper())]
