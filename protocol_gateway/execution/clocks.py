"""The gateway's clocks: monotonic for durations, wall for people, and the gateway's time for deadlines.

The gateway's time is the wall clock at its first reading, plus the monotonic time since. So no step of the
system's clock makes a deadline come earlier or later. Clients learn it from `now` in each lease answer; it is
compared with no clock of another machine.
"""

import time
from functools import cache

from protocol_gateway.authority.lease_rules import Now


def read_clocks() -> Now:
    """Return the present time on each clock."""
    monotonic_ns = time.monotonic_ns()
    return Now(monotonic_ns * 1e-9, time.time_ns(), _start_ns() + monotonic_ns)


@cache
def _start_ns() -> int:
    """Return the wall clock minus the monotonic clock, at the first call [ns]."""
    return time.time_ns() - time.monotonic_ns()
