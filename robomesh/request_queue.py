"""The way of requests from Zenoh to the event loop: a flood of them delays no stop.

    stop             Zenoh's thread -> event loop, at once
    command, lease   queue -> reading thread, some each millisecond -> event loop, one at a time
    other requests   ring  -> as those

A plain callback would run Python for each request as fast as they come: the event loop would wait for the
interpreter's lock each time that it needs it, and Zenoh's queue before the callback blocks the whole
session when it is full. Commands and leases have a connection of their own, so there that is wanted: a flood
waits at its sender, and takes no processor time from a stop. Other requests share a connection, which nothing
may block: they wait in a ring, and Zenoh ends a request that falls out of it without an answer.
"""

import asyncio
import threading
import time
from collections import deque
from collections.abc import Callable, Coroutine, Generator
from typing import Any

import zenoh

# The reading thread comes back long before a flood has pushed this many through.
RING = 1024
# Commands and leases wait here; when it is full, Zenoh reads no more of their connection. A request waits for
# those before it, so it is short.
HELD = 64
# It reads some, then leaves the interpreter to the event loop. Without a rest the system often puts this
# thread aside while it holds the interpreter's lock, and a stop waits for it.
_AT_ONCE = 32
_REST_S = 0.001
# Of one robot's commands, or requests for control, so many begin at once and so many a second. A loop that is
# idle for most of the time is woken up at once on a busy machine; one that never rests waits for its share.
_BURST = 256
_PER_S = 250.0


class RateLimit:
    """A token bucket: so many at once, and so many a second. For one thread; time is an argument."""

    def __init__(self, *, per_s: float, burst: int) -> None:
        self._each_s, self._burst_s = 1.0 / per_s, burst / per_s
        self._even_s = 0.0  # when time has given back all that was taken

    def take(self, now_s: float) -> bool:
        """Take one; False: there is none now."""
        even_s = max(self._even_s, now_s) + self._each_s
        if even_s - now_s > self._burst_s:
            return False
        self._even_s = even_s
        return True


class Queue:
    """Work of one kind that waits for its turn on the event loop, first come, first served.

    Args:
        limited: It begins at a limited rate.
    """

    def __init__(self, *, limited: bool) -> None:
        self.waiting = deque[Callable[[], None]]()
        self.limit = RateLimit(per_s=_PER_S, burst=_BURST) if limited else None


class Turns:
    """Begins work on the event loop, one piece each time that the loop has been round; queues take turns.

    So what must not wait waits for one request, not for all that came before it, and a flood for one robot
    takes no other robot's turn.
    """

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._queues = deque[Queue]()  # with something in them
        self._lock = threading.Lock()
        self._going = False

    def add(self, queue: Queue, begin: Callable[[], None]) -> None:
        """Begin it when its turn has come. On any thread."""
        with self._lock:
            if not queue.waiting:
                self._queues.append(queue)
            queue.waiting.append(begin)
            if self._going or self._loop.is_closed():
                return
            self._going = True
        self._loop.call_soon_threadsafe(self._next)

    def _next(self) -> None:
        with self._lock:
            begin = self._take(time.monotonic())
            self._going = begin is not None or bool(self._queues)
        if begin is not None:
            self._loop.call_soon(self._next)
            begin()
        elif self._going:
            self._loop.call_later(_REST_S, self._next)

    def _take(self, now_s: float) -> Callable[[], None] | None:
        for _ in range(len(self._queues)):
            queue = self._queues.popleft()
            begin = queue.waiting.popleft() if queue.limit is None or queue.limit.take(now_s) else None
            if queue.waiting:
                self._queues.append(queue)
            if begin is not None:
                return begin
        return None


def read(ring: zenoh.Handler[zenoh.Query], take: Callable[[zenoh.Query], None]) -> None:
    """Hand over what comes until the queryable is undeclared. Runs in a thread of its own."""
    while True:
        try:
            query: zenoh.Query | None = ring.recv()
            for _ in range(_AT_ONCE):
                if query is None:
                    break
                take(query)
                query = ring.try_recv()
            else:
                if query is not None:
                    take(query)
                    time.sleep(_REST_S)
        except zenoh.ZError:  # it is undeclared
            return


def begin_now(loop: asyncio.AbstractEventLoop, work: Coroutine[Any, Any, None]) -> asyncio.Task[None] | None:
    """Run a coroutine now, up to where it waits, without another round of the event loop.

    As `eager_start` of Python 3.12.

    Returns:
        The task that goes on with it; None: it is done.
    """
    try:
        waits_for = work.send(None)
    except StopIteration:
        return None
    return loop.create_task(_go_on(_Begun(work, waits_for)))


async def _go_on(begun: "_Begun") -> None:
    await begun


class _Begun:
    """The rest of a coroutine that has begun."""

    def __init__(self, work: Coroutine[Any, Any, None], waits_for: Any) -> None:
        self._work, self._waits_for = work, waits_for

    def __await__(self) -> Generator[Any, Any, None]:
        waits_for = self._waits_for
        while True:
            try:
                sent = yield waits_for
            except BaseException as error:
                step: Callable[[Any], Any] = self._work.throw
                value: Any = error
            else:
                step, value = self._work.send, sent
            try:
                waits_for = step(value)
            except StopIteration:
                return
