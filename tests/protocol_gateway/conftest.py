"""Fixtures of the gateway's tests."""

import time

import pytest

from protocol_gateway.authority.lease_rules import Now
from protocol_gateway.control import control


class Clock:
    """Clock of Control, advanced by the test."""

    def __init__(self):
        self.now = Now(time.monotonic(), time.time_ns())

    def advance(self, seconds):
        self.now = Now(self.now.monotonic_s + seconds, self.now.wall_ns + round(seconds * 1e9))


@pytest.fixture
def clock(monkeypatch):
    """Replace both clocks of Control; the lease's timer and the disk use the real time."""
    clock = Clock()
    monkeypatch.setattr(control, "read_clocks", lambda: clock.now)
    return clock
