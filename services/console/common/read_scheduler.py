"""Reading from pages: one piece in each turn of the event loop, and a page that asks too much waits.

A page has an allowance of work, and all pages of its account share another. While one of them is overdrawn,
the console does not read from this page, and TCP slows it down. The connection on which a page sends its
stops has separate allowances and a separate queue: a stop waits for at most one piece of the other pages and
one HTTP request, however many there are.
"""

import asyncio
import math
from collections import OrderedDict

from starlette.types import ASGIApp, Receive, Scope, Send

from robomesh.requests.request_queue import Queue, RoundRobin

# Key of the scheduler in the state of each ASGI scope.
READS = "reads"
# A message costs 1, about 0.1 ms of the event loop. At once: a page that opens watches everything it shows.
_PAGE_PER_S, _PAGE_AT_ONCE = 200.0, 400.0
_ACCOUNT_PER_S, _ACCOUNT_AT_ONCE = 600.0, 1600.0
# A press of "stop all" is a request to each robot.
_STOPS_PER_S, _STOPS_AT_ONCE = 100.0, 1024.0
_MOST_ASKERS = 1024


class Allowance:
    """Work that is allowed: `per_s` in the long run, `at_once` after a pause. Time is an argument.

    The cost of work is known only afterwards, so it may be overdrawn by one piece.
    """

    def __init__(self, per_s: float, at_once: float) -> None:
        self._per_s, self._at_once_s = per_s, at_once / per_s
        self._full_at = -math.inf

    def spend(self, cost: float, now: float) -> None:
        """Charge work that was done."""
        self._full_at = max(self._full_at, now) + cost / self._per_s

    def wait_s(self, now: float) -> float:
        """Return the time until it is no longer overdrawn [s]."""
        return max(self._full_at - self._at_once_s - now, 0.0)

    def is_full(self, now: float) -> bool:
        """Return whether nothing of it is used."""
        return self._full_at <= now


class ReadScheduler:
    """The order in which the console reads from its connections; for the running event loop.

    Attributes:
        turns: Begins one piece of work in each turn of the event loop, from the queues in turn.
        pages: Queue of pages with unread data; each has one piece in it.
        stops: The same of the connections for stops.
    """

    def __init__(self) -> None:
        self.turns = RoundRobin()
        self.pages, self.stops, self._requests = (Queue(limited=False) for _ in range(3))
        self._shared: OrderedDict[tuple[str, bool], Allowance] = OrderedDict()

    def allowances(self, asker: str, *, stops: bool) -> tuple[Allowance, Allowance]:
        """Return the allowance of a new page, and the one that it shares with its asker's other pages.

        Args:
            asker: The account; without accounts the address.
            stops: For a connection that carries stops only.
        """
        if stops:
            own, shared = (Allowance(_STOPS_PER_S, _STOPS_AT_ONCE) for _ in range(2))
        else:
            own = Allowance(_PAGE_PER_S, _PAGE_AT_ONCE)
            shared = Allowance(_ACCOUNT_PER_S, _ACCOUNT_AT_ONCE)
        shared = self._shared.setdefault((asker, stops), shared)
        self._shared.move_to_end((asker, stops))
        if len(self._shared) > _MOST_ASKERS:
            self._shared.popitem(last=False)
        return own, shared

    async def request_turn(self) -> None:
        """Wait for this request's turn among all HTTP requests and new connections."""
        turn = asyncio.get_running_loop().create_future()
        self.turns.add(self._requests, lambda: None if turn.done() else turn.set_result(None))
        await turn


class RequestTurns:
    """ASGI middleware that begins one request in each turn of the event loop."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward a request when its turn has come."""
        await scope["state"][READS].request_turn()
        await self._app(scope, receive, send)
