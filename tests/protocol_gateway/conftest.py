"""Fixtures of the gateway's tests."""

import time

import pytest

from protocol_gateway.authority.lease_rules import Now
from protocol_gateway.execution import control
from tests.patience import wait_patiently


def later(now, seconds):
    """Return the time on each clock, some time later."""
    return Now(now.monotonic_s + seconds, *(each + round(seconds * 1e9) for each in now[1:]))


class Clock:
    """Clock of Control, advanced by the test."""

    def __init__(self):
        self.now = Now(time.monotonic(), time.time_ns(), time.time_ns())

    def advance(self, seconds):
        self.now = later(self.now, seconds)


@pytest.fixture
def clock(monkeypatch):
    """Replace both clocks of Control; the lease's timer and the disk use the real time."""
    clock = Clock()
    monkeypatch.setattr(control, "read_clocks", lambda: clock.now)
    return clock


@pytest.fixture
def mesh(request, mesh, monkeypatch):
    """Return session settings; a gateway in the test's process waits longer than a busy machine does.

    Not with the marker `exact_times`: there a command waits at most 1 s, and a lease lasts at most 5 s.
    """
    if request.node.get_closest_marker("exact_times") is None:
        wait_patiently(monkeypatch.setattr)
    return mesh
