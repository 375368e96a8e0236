"""Delays of samples that waited on their way."""

import asyncio
import time

import pytest
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates

from robomesh.contract.header import Header
from robomesh.publications.delay import Delay
from robomesh.wire.session import open_session

S = 10**9
EPOCH_NS = 1_790_000_000 * S


def header(sequence: int, source_s: float, publisher: int = 1) -> Header:
    return Header(publisher, sequence, EPOCH_NS + round(source_s * S))


@pytest.mark.parametrize("offset_s", [0.0, 86_400.0, -3_600.5])
def test_delay_is_the_time_above_the_quickest_sample_for_any_clock_offset(offset_s):
    delay = Delay()
    arrivals = [(0.00, 0.04), (0.01, 0.05), (0.02, 1.54), (0.03, 1.55), (1.60, 1.64)]
    late = [delay.of(header(n, at), got + offset_s) for n, (at, got) in enumerate(arrivals, 1)]
    assert late == pytest.approx([0.0, 0.0, 1.48, 1.48, 0.0], abs=0.01)


@pytest.mark.parametrize(
    ("arrivals", "expected"),
    [
        ([(0.0, 3.0), (3.0, 3.1), (3.1, 3.2), (0.2, 3.3)], [0.0, 0.0, 0.0, 3.0]),
        # An hour ahead: one sample, and the first one.
        (
            [(0.0, 0.1), (3600.0, 0.2), (0.3, 0.4), (0.4, 0.5), (0.5, 2.6), (3605.0, 2.7), (0.6, 2.7)],
            [0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 2.0],
        ),
        ([(3600.0, 0.1), (0.1, 0.2), (0.2, 0.3), (0.3, 2.4)], [0.0, 0.0, 0.0, 2.0]),
    ],
)
def test_two_quicker_samples_lower_the_least_lag_and_one_dated_ahead_does_not(arrivals, expected):
    delay = Delay()
    late = [delay.of(header(n, at), got) for n, (at, got) in enumerate(arrivals, 1)]
    assert late == pytest.approx(expected, abs=0.01)


@pytest.mark.parametrize("clock_s", [-5.0, 0.0, 5.0])
def test_burst_after_the_first_sample_is_late_for_any_clock_offset(clock_s):
    delay = Delay()
    arrivals = [(0.0, 0.1), *((n * 0.01, 3.0) for n in range(1, 300))]
    late = [delay.of(header(n, at + clock_s), got) for n, (at, got) in enumerate(arrivals, 1)]
    assert late[1] == pytest.approx(2.89, abs=0.01)
    assert late[-1] == pytest.approx(0.0, abs=0.02)


def test_slow_clock_drift_makes_no_sample_late():
    delay = Delay()
    # The publisher's clock loses 0.5 ms in each second, for an hour.
    late = [delay.of(header(n, n * 0.1 * 0.9995), n * 0.1) for n in range(36_000)]
    assert max(late) < 0.001


def test_sample_that_waited_after_a_long_pause_is_late():
    delay = Delay()
    delay.of(header(1, 0.0), 0.0)
    assert delay.of(header(2, 3600.0), 3602.0) == pytest.approx(2.0, abs=0.01)


def test_restarted_publisher_starts_over():
    delay = Delay()
    delay.of(header(1, 0.0), 0.0)
    assert delay.of(header(1, 5.0, publisher=2), 15.0) == 0.0


def test_publisher_without_source_times_is_never_late():
    delay = Delay()
    assert [delay.of(Header(1, n, 0), n * 10.0) for n in range(1, 4)] == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("robot", ["arm", "replay-1"])
async def test_sample_that_waited_on_its_way_is_old_on_arrival_except_of_a_replay(mesh, robot):
    async with open_session(mesh) as gateway, open_session(mesh) as monitor:
        publisher = gateway.declare_publisher("site", robot, "joints")
        subscription = monitor.subscribe(f"robomesh/site/{robot}/joints", newest=10, history=False)
        while not publisher.watched:
            await asyncio.sleep(0.01)
        publisher.put(JointStates())
        await anext(subscription)
        assert subscription.age_s(publisher.key) >= 0.0
        publisher.put(JointStates(), source_time_ns=time.time_ns() - 3 * S)
        waited = await anext(subscription)
        if robot == "arm":
            # Relative to the first sample, which also took some time.
            assert waited.late_s > 1.0
            assert subscription.age_s(publisher.key) >= waited.late_s
        else:
            assert waited.late_s == 0.0


async def test_publisher_with_a_set_clock_takes_another_identity(mesh, monkeypatch):
    async with open_session(mesh) as gateway, open_session(mesh) as monitor:
        publisher = gateway.declare_publisher("hall", "arm", "joints")
        states = monitor.subscribe("robomesh/hall/arm/joints", history=False, newest=10)
        while not publisher.watched:
            await asyncio.sleep(0.01)
        one = publisher.put(JointStates())
        await anext(states)
        real = time.time_ns
        monkeypatch.setattr(time, "time_ns", lambda: real() - 5 * S)
        other = publisher.put(JointStates())
        assert (other.publisher != one.publisher, other.sequence) == (True, one.sequence + 1)
        assert (await anext(states)).late_s < 1.0
        # With another publisher's source times the identity changes only with that publisher.
        by_one = [publisher.put(JointStates(), source_time_ns=7 * S, dated_by=1) for _ in range(2)]
        by_two = publisher.put(JointStates(), source_time_ns=3 * S, dated_by=2)
        assert by_one[0].publisher == by_one[1].publisher != by_two.publisher
        assert states.lost("robomesh/hall/arm/joints") == 0
