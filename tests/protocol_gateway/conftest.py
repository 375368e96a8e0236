"""What the gateway's tests share."""

import time

import pytest

from protocol_gateway.authority.lease_rules import Now
from protocol_gateway.control import control, stop_handler


class Clock:
    """A clock of control's, set by hand."""

    def __init__(self):
        self.now = Now(time.monotonic(), time.time_ns())

    def advance(self, seconds):
        self.now = Now(self.now.monotonic_s + seconds, self.now.wall_ns + round(seconds * 1e9))


@pytest.fixture
def clock(monkeypatch):
    """In place of both of control's clocks; the lease's alarm and the disk go by their own."""
    clock = Clock()
    for module in (control, stop_handler):
        monkeypatch.setattr(module, "read_clocks", lambda: clock.now)
    return clock
