import time
from types import SimpleNamespace

import pytest

from robomesh.publications.wall_clock import ForwardClock, WallClock

S = 1_000_000_000


def test_two_readers_on_one_machine_agree_on_the_order_of_times():
    earlier, later = WallClock(), WallClock()
    for _ in range(1000):
        now_ns = time.monotonic_ns()
        assert not earlier.was_set()
        assert earlier.earliest_ns(now_ns) <= later.latest_ns(now_ns)
        assert earlier.earliest_ns(now_ns) <= time.time_ns() <= later.latest_ns(time.monotonic_ns())
    assert later.latest_ns(0) - earlier.earliest_ns(0) < S


@pytest.mark.parametrize(
    ("by_ns", "was_set"), [(5 * S, True), (-2 * S, True), (-900_000, True), (200_000, False), (100, False)]
)
def test_set_clock_is_reported_once(monkeypatch, by_ns, was_set):
    clock, real = WallClock(), time.time_ns
    monkeypatch.setattr(time, "time_ns", lambda: real() + by_ns)
    assert clock.was_set() is was_set
    assert not clock.was_set()
    assert abs(clock.earliest_ns(time.monotonic_ns()) - time.time_ns()) < 0.2 * S


def test_suspended_reading_is_not_taken_for_a_set_clock(monkeypatch):
    clock, real, waited_ns = WallClock(), time.monotonic_ns, 0

    def slowly():
        nonlocal waited_ns
        waited_ns += 1_000_000
        time.sleep(0.001)
        return real()

    monkeypatch.setattr(time, "monotonic_ns", slowly)
    for _ in range(5):
        assert not clock.was_set()
    assert waited_ns


def test_a_small_step_back_in_a_suspended_reading_puts_no_time_back_by_the_suspension(monkeypatch):
    now, suspended_ns = SimpleNamespace(monotonic_ns=0, offset_ns=S), [0]

    def monotonic_ns():
        now.monotonic_ns += 20
        return now.monotonic_ns

    def time_ns():
        now.monotonic_ns += 20
        read_ns = now.monotonic_ns + now.offset_ns
        now.monotonic_ns += suspended_ns.pop() if suspended_ns else 0
        return read_ns

    monkeypatch.setattr(time, "monotonic_ns", monotonic_ns)
    monkeypatch.setattr(time, "time_ns", time_ns)
    clock = WallClock()
    before_ns = clock.earliest_ns(0)
    now.offset_ns -= 200
    suspended_ns.append(500_000)
    assert not clock.was_set()
    assert before_ns - clock.earliest_ns(0) <= 1000


def test_a_clock_that_only_goes_forward_passes_no_date_twice(monkeypatch):
    real, hour_s = time.time, 3600.0
    clock = ForwardClock()
    begun_s, monotonic_s = clock.now_s(), time.monotonic()
    for set_by_s in (-hour_s, 0.0):
        monkeypatch.setattr(time, "time", lambda set_by_s=set_by_s: real() + set_by_s)
        passed_s = time.monotonic() - monotonic_s
        assert clock.now_s() - begun_s - passed_s < 10.0
        assert clock.now_s() - begun_s >= passed_s
    monkeypatch.setattr(time, "time", lambda: real() + hour_s)
    assert clock.now_s() >= begun_s + hour_s
    monkeypatch.setattr(time, "time", real)
    assert clock.now_s() >= begun_s + hour_s
