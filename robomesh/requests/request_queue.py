"""Queues of requests from Zenoh to the event loop, so that a flood of requests delays no stop.

    stop             Zenoh's thread -> event loop, immediately
    command, lease   queue -> thread of a paced callback -> event loop, one at a time
    other requests   queue -> thread of a callback -> event loop, in the same way; those of a flood by a ring

With a plain callback Python would run for each request as fast as requests arrive: the event loop would wait
for the interpreter lock again and again, and Zenoh's queue in front of the callback blocks the whole session
when it is full. So a thread takes a few requests each millisecond. The requests to a gateway have separate
connections, one for control and one for the audit log and the cell, where blocking is intended: a flood waits
at its sender and takes no processor time from a stop. Other requests share a connection, which must not
block: they wait in a ring, and Zenoh ends a request that the ring drops without an answer. It is not Zenoh's
own ring: a thread that reads one wakes up ten times a second to notice signals, the thread of a callback only
for requests.
"""

import asyncio
import threading
import time
from collections import deque
from collections.abc import Callable, Coroutine, Generator
from typing import Any

import zenoh

# Requests of a flood that wait for their turn.
_RING = 1024
# A thread takes a few requests, then leaves the interpreter to the event loop. Without the pause the system
# often suspends this thread while it holds the interpreter lock, and a stop waits for it.
_BATCH = 32
_PAUSE_S, _BACKGROUND_PAUSE_S = 0.001, 0.01
# Limits of one robot's commands and lease requests: burst, and rate [1/s]. The system wakes a mostly idle
# loop immediately even on a busy machine; a loop that is always busy waits for its time slice.
_BURST = 256
_PER_S = 250.0


class RateLimit:
    """A token bucket with a rate [1/s] and a burst size. For one thread; time is an argument."""

    def __init__(self, *, per_s: float, burst: int) -> None:
        self._each_s, self._burst_s = 1.0 / per_s, burst / per_s
        self._even_s = 0.0  # time at which the bucket is full again

    def take(self, now_s: float) -> bool:
        """Take one token; False: the bucket is empty."""
        even_s = max(self._even_s, now_s) + self._each_s
        if even_s - now_s > self._burst_s:
            return False
        self._even_s = even_s
        return True


class Queue:
    """A first-in-first-out queue of work of one kind for the event loop.

    Args:
        limited: Work begins at a limited rate.
    """

    def __init__(self, *, limited: bool) -> None:
        self.waiting = deque[Callable[[], None]]()
        self.limit = RateLimit(per_s=_PER_S, burst=_BURST) if limited else None


class RoundRobin:
    """A scheduler that begins one piece of work in each iteration of the event loop, from the queues in turn.

    So a stop waits for one request, not for all earlier ones, and a flood for one robot does not delay
    another robot's requests.
    """

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._queues = deque[Queue]()  # the queues that are not empty
        self._lock = threading.Lock()
        self._scheduled = False

    def add(self, queue: Queue, begin: Callable[[], None]) -> None:
        """Add work to a queue. On any thread."""
        with self._lock:
            if not queue.waiting:
                self._queues.append(queue)
            queue.waiting.append(begin)
            if self._scheduled or self._loop.is_closed():
                return
            self._scheduled = True
        self._loop.call_soon_threadsafe(self._next)

    def _next(self) -> None:
        with self._lock:
            begin = self._take(time.monotonic())
            self._scheduled = begin is not None or bool(self._queues)
        if begin is not None:
            self._loop.call_soon(self._next)
            begin()
        elif self._scheduled:
            self._loop.call_later(_PAUSE_S, self._next)

    def _take(self, now_s: float) -> Callable[[], None] | None:
        for _ in range(len(self._queues)):
            queue = self._queues.popleft()
            begin = queue.waiting.popleft() if queue.limit is None or queue.limit.take(now_s) else None
            if queue.waiting:
                self._queues.append(queue)
            if begin is not None:
                return begin
        return None


def paced(
    take: Callable[[zenoh.Query], None], *, in_background: bool = False
) -> Callable[[zenoh.Query], None]:
    """Return a callback that passes each query to `take`, with a pause after a few of a flood.

    In the background the pause is longer: a flood waits at its sender, and takes less time from a stop.

    Zenoh calls it in a thread of its own, behind a queue of 256 queries. When the queue is full, Zenoh stops
    reading the connection.
    """
    pause_s = _BACKGROUND_PAUSE_S if in_background else _PAUSE_S
    begun_s = 0.0
    taken = 0

    def take_paced(query: zenoh.Query) -> None:
        nonlocal begun_s, taken
        if (now_s := time.monotonic()) - begun_s > pause_s:
            begun_s, taken = now_s, 0
        take(query)
        taken += 1
        if taken > _BATCH:
            time.sleep(pause_s)

    return take_paced


def spilling(take: Callable[[zenoh.Query], None]) -> Callable[[zenoh.Query], None]:
    """Return a callback that passes a few queries a millisecond to `take`; those of a flood wait in a ring.

    Zenoh calls it in a thread of its own, and never waits for it long. A full ring drops its oldest query.
    """
    loop = asyncio.get_running_loop()
    waiting = deque[zenoh.Query](maxlen=_RING)
    lock = threading.Lock()
    flooded = False
    begun_s = 0.0
    taken = 0

    def take_or_keep(query: zenoh.Query) -> None:
        nonlocal begun_s, taken, flooded
        with lock:
            if (now_s := time.monotonic()) - begun_s > _PAUSE_S:
                begun_s, taken = now_s, 0
            taken += 1
            if flooded:
                waiting.append(query)
                return
            if taken > _BATCH and not loop.is_closed():
                waiting.append(query)
                flooded = True
                loop.call_soon_threadsafe(loop.call_later, _PAUSE_S, take_waiting)
                return
        take(query)

    def take_waiting() -> None:
        nonlocal flooded
        for _ in range(_BATCH):
            with lock:
                flooded = bool(waiting)
                if not flooded:
                    return
                query = waiting.popleft()
            take(query)
        loop.call_later(_PAUSE_S, take_waiting)

    return take_or_keep


def begin_now(loop: asyncio.AbstractEventLoop, work: Coroutine[Any, Any, None]) -> asyncio.Task[None] | None:
    """Run a coroutine now until it first waits, without another iteration of the event loop.

    Like `eager_start` of Python 3.12.

    Returns:
        The task that continues it; None: it has finished.
    """
    try:
        waits_for = work.send(None)
    except StopIteration:
        return None
    return loop.create_task(_continue(_Begun(work, waits_for)))


async def _continue(begun: "_Begun") -> None:
    await begun


class _Begun:
    """An awaitable for the rest of a started coroutine."""

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
