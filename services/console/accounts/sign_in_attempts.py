"""Rate limits for sign-in attempts: the wait grows with each failure; memory is bounded.

The caller passes the time.
"""

import ipaddress
from collections import OrderedDict
from dataclasses import dataclass

_MOST_REMEMBERED = 4096
_FORGOTTEN_AFTER_S = 3600.0
_FIRST_WAIT_S = 1.0


@dataclass
class _Tries:
    failed: int
    last: float
    again_at: float


class Attempts:
    """Failed attempts by name, or by address.

    Args:
        free: Number of failures without a wait.
        longest_s: Longest wait [s].
    """

    def __init__(self, *, free: int, longest_s: float) -> None:
        self._free, self._longest_s = free, longest_s
        self._tries: OrderedDict[str, _Tries] = OrderedDict()

    def wait_s(self, who: str, now: float) -> float:
        """Return the time until the next allowed attempt [s]; 0: now."""
        tries = self._tries.get(who)
        return 0.0 if tries is None else max(0.0, tries.again_at - now)

    def begin(self, who: str, now: float) -> None:
        """Count an attempt as failed before it is verified, so that concurrent attempts count."""
        tries = self._tries.pop(who, None)
        if tries is None or now - tries.last > _FORGOTTEN_AFTER_S:
            tries = _Tries(0, now, now)
        tries.failed += 1
        tries.last = now
        tries.again_at = now + self._wait_s(tries.failed)
        self._tries[who] = tries
        while len(self._tries) > _MOST_REMEMBERED:
            self._tries.popitem(last=False)

    def succeed(self, who: str, *, all_of_them: bool) -> None:
        """Forget the last failure, or all, after a successful attempt."""
        tries = self._tries.get(who)
        if tries is not None:
            tries.failed = 0 if all_of_them else tries.failed - 1
            tries.again_at = tries.last + self._wait_s(tries.failed)

    def withdraw(self, who: str) -> None:
        """Forget an attempt that was not verified."""
        tries = self._tries.get(who)
        if tries is not None:
            tries.failed -= 1
            tries.again_at = tries.last

    def _wait_s(self, failed: int) -> float:
        if failed < self._free:
            return 0.0
        # Bounded, because a float's exponent is.
        return min(_FIRST_WAIT_S * 2.0 ** min(failed - self._free, 30), self._longest_s)


class SignInLimits:
    """Limits by account name and by address.

    A name waits a minute at most, so that failed attempts by others cannot lock its owner out for long.
    Unknown names are counted separately, so that a flood of them evicts no real one. A password that is
    entered again in a session is counted by session, so that failed sign-ins elsewhere do not keep an
    operator from commanding.
    """

    def __init__(self) -> None:
        self._names = Attempts(free=3, longest_s=60.0)
        self._unknown = Attempts(free=3, longest_s=60.0)
        self._addresses = Attempts(free=10, longest_s=900.0)
        self._sessions = Attempts(free=3, longest_s=60.0)

    def wait_s(self, name: str, address: str, now: float, *, known: bool, session: str = "") -> float:
        """Return the wait before this name may be tried from this address, or in this session [s]."""
        if session:
            return self._sessions.wait_s(session, now)
        names = self._names if known else self._unknown
        return max(names.wait_s(name, now), self._addresses.wait_s(network(address), now))

    def begin(self, name: str, address: str, now: float, *, known: bool, session: str = "") -> None:
        """Count an attempt."""
        if session:
            self._sessions.begin(session, now)
        else:
            (self._names if known else self._unknown).begin(name, now)
            self._addresses.begin(network(address), now)

    def withdraw(self, name: str, address: str, *, known: bool, session: str = "") -> None:
        """Forget an attempt that was not verified, because the queue was full."""
        if session:
            self._sessions.withdraw(session)
        else:
            (self._names if known else self._unknown).withdraw(name)
            self._addresses.withdraw(network(address))

    def succeed(self, name: str, address: str, *, session: str = "") -> None:
        """Record a success: it clears all failures of the name, but one of the address."""
        if session:
            self._sessions.succeed(session, all_of_them=True)
        else:
            self._names.succeed(name, all_of_them=True)
            self._addresses.succeed(network(address), all_of_them=False)


def network(address: str) -> str:
    """Return the address; for IPv6 the /64 network, since one client has all of it."""
    try:
        parsed = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return address
    if parsed.version == 6 and parsed.ipv4_mapped is None:
        return str(ipaddress.ip_network((parsed, 64), strict=False))
    return str(parsed)
