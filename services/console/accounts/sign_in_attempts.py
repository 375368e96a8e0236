"""Tries to sign in: who tries too often waits, longer each time; what is remembered is bounded.

The time is an argument.
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
    """Failed tries by name, or by address.

    Args:
        free: So many may fail before anybody waits.
        longest_s: Nobody waits longer [s].
    """

    def __init__(self, *, free: int, longest_s: float) -> None:
        self._free, self._longest_s = free, longest_s
        self._tries: OrderedDict[str, _Tries] = OrderedDict()

    def wait_s(self, who: str, now: float) -> float:
        """How long until this one may try again [s]; 0: now."""
        tries = self._tries.get(who)
        return 0.0 if tries is None else max(0.0, tries.again_at - now)

    def begin(self, who: str, now: float) -> None:
        """Counts a try as failed before it is looked at: many at once are many."""
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
        """The last try was right: it is forgotten, or all are."""
        tries = self._tries.get(who)
        if tries is not None:
            tries.failed = 0 if all_of_them else tries.failed - 1
            tries.again_at = tries.last + self._wait_s(tries.failed)

    def withdraw(self, who: str) -> None:
        """Forget a try that was begun and never looked at."""
        tries = self._tries.get(who)
        if tries is not None:
            tries.failed -= 1
            tries.again_at = tries.last

    def _wait_s(self, failed: int) -> float:
        if failed < self._free:
            return 0.0
        # The exponent is bounded: a float's is.
        return min(_FIRST_WAIT_S * 2.0 ** min(failed - self._free, 30), self._longest_s)


class SignInLimits:
    """Of an account's name, and of an address.

    A name waits a minute at most, so that nobody can keep its owner out for long by trying it; names
    that nobody has are counted like others, but apart: a flood of them makes no real one forgotten. A
    password that is given again in a session is counted by the session: whoever tries names at the door
    keeps nobody who is in from commanding.
    """

    def __init__(self) -> None:
        self._names = Attempts(free=3, longest_s=60.0)
        self._unknown = Attempts(free=3, longest_s=60.0)
        self._addresses = Attempts(free=10, longest_s=900.0)
        self._sessions = Attempts(free=3, longest_s=60.0)

    def wait_s(self, name: str, address: str, now: float, *, known: bool, session: str = "") -> float:
        """How long until somebody there, or in that session, may try this name [s]."""
        if session:
            return self._sessions.wait_s(session, now)
        names = self._names if known else self._unknown
        return max(names.wait_s(name, now), self._addresses.wait_s(network(address), now))

    def begin(self, name: str, address: str, now: float, *, known: bool, session: str = "") -> None:
        """Counts a try."""
        if session:
            self._sessions.begin(session, now)
        else:
            (self._names if known else self._unknown).begin(name, now)
            self._addresses.begin(network(address), now)

    def withdraw(self, name: str, address: str, *, known: bool, session: str = "") -> None:
        """Forget a try that was begun and never looked at, because too many waited."""
        if session:
            self._sessions.withdraw(session)
        else:
            (self._names if known else self._unknown).withdraw(name)
            self._addresses.withdraw(network(address))

    def succeed(self, name: str, address: str, *, session: str = "") -> None:
        """The try was right; of the address no other is forgiven, for one account is no key to the rest."""
        if session:
            self._sessions.succeed(session, all_of_them=True)
        else:
            self._names.succeed(name, all_of_them=True)
            self._addresses.succeed(network(address), all_of_them=False)


def network(address: str) -> str:
    """An address, or for IPv6 the network that one household has."""
    try:
        parsed = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return address
    if parsed.version == 6 and parsed.ipv4_mapped is None:
        return str(ipaddress.ip_network((parsed, 64), strict=False))
    return str(parsed)
