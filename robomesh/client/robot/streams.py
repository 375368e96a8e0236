"""Streams of messages: the newest first, without stale ones unless the program asks for them."""

import asyncio
import contextlib
import math
import os
import time
import weakref
from collections import deque
from collections.abc import Awaitable, Callable, Iterable
from dataclasses import replace
from typing import Generic, Literal, Self, TypeVar

from robomesh.client.robot.samples import Sample
from robomesh.contract.header import Header
from robomesh.errors import MessageError, RobomeshError, UnknownTopicError
from robomesh.files.forked import check_owner
from robomesh.publications.subscription import Sample as RawSample
from robomesh.publications.subscription import Subscription

T = TypeVar("T")

OnStale = Literal["raise", "yield"]
# The first message may take this long [s], for example over a slow line.
_FIRST_S = 2.0
# Messages that a stream can keep for a slow program.
_MOST_KEPT = 1_000_000
# How often a blocked thread looks whether its stream was closed [s].
_POLL_S = 0.5


class StaleError(RobomeshError):
    """A topic without a new message for longer than its limit; the last one is not current.

    Attributes:
        last: The last message; None: none arrived.
        silent_s: Time since the last current message, or since the stream began [s].
    """

    def __init__(self, name: str, limit_s: float, silent_s: float, last: object) -> None:
        super().__init__(name, limit_s, silent_s, last)
        self.last, self.silent_s = last, silent_s

    def __str__(self) -> str:
        name, limit_s, silent_s, last = self.args
        there = "its last message is not current" if last is not None else "it has no publisher"
        return (
            f"{name}: no current message for {silent_s:.1f} s (limit {limit_s:g} s): {there}. See "
            "`robomesh list`: is the service running, and the controller connected?"
        )


def check_options(buffer: int, on_stale: OnStale) -> None:
    """Check the options of a stream.

    Raises:
        ValueError: If one is invalid.
    """
    if not isinstance(buffer, int) or not 1 <= buffer <= _MOST_KEPT:
        raise ValueError(f"buffer={buffer!r}: must be a whole number from 1 to {_MOST_KEPT}")
    if on_stale not in ("raise", "yield"):
        raise ValueError(f"on_stale={on_stale!r}: must be 'raise' or 'yield'")


class SampleReader(Generic[T]):
    """Reader of a subscription for a stream: it selects the values to return, and never waits.

    Args:
        convert: Returns the values of a sample, given `stale` and `skipped`.
        limit_s: Age from which a message is stale [s]; None: never.
        on_stale: "raise": leave stale messages out, and raise StaleError when the topic falls silent.
            "yield": return them, and the last one again when the topic falls silent, with `stale` true.
    """

    def __init__(
        self,
        subscription: Subscription,
        convert: Callable[[RawSample, bool, int], Iterable[T]],
        *,
        limit_s: float | None,
        on_stale: OnStale,
    ) -> None:
        self.subscription = subscription
        self.skipped = 0
        self._convert, self._limit_s, self._on_stale = convert, limit_s, on_stale
        self._last: T | None = None
        self._values: deque[T] = deque()
        # Of the last message of each key that the stream returned.
        self._returned: dict[str, Header] = {}
        self._pid = os.getpid()
        self._current_s = time.monotonic()
        self._deadline_s = None if limit_s is None else self._current_s + max(limit_s, _FIRST_S)

    def set_limit(self, limit_s: float | None) -> None:
        """Set the age from which a message is stale [s], before the first one was taken; None: never."""
        self._limit_s = limit_s
        self._deadline_s = None if limit_s is None else time.monotonic() + max(limit_s, _FIRST_S)

    def next(self, *, awaited: bool) -> T | None:
        """Return the next value without waiting; None: there is none.

        Args:
            awaited: The event loop is woken by the next message, not only a blocked thread.

        Raises:
            StaleError: If the topic has fallen silent.
            ForkedError: In a process that was forked from the stream's.
        """
        check_owner(self._pid)
        while not self._values and (sample := self.subscription.take(awaited=awaited)) is not None:
            self._accept(sample)
        if self._values:
            return self._values.popleft()
        if self.subscription.closed:
            return None
        return self._silence() if self._deadline_s is not None else None

    def left_s(self) -> float | None:
        """Return the time until the topic counts as silent [s]; None: never."""
        return None if self._deadline_s is None else max(0.0, self._deadline_s - time.monotonic())

    def _accept(self, sample: RawSample) -> None:
        returned, header = self._returned.get(sample.key), sample.header
        if returned is None or returned.publisher != header.publisher:
            returned = None
        skipped = 0 if returned is None else max(0, header.sequence - returned.sequence - 1)
        limit_s, topic = self._limit_s, self.subscription.topic
        # A last value of a topic with a heartbeat is at most that old; another's age is unknown.
        late_s = sample.late_s if sample.live else topic.heartbeat_s
        current_s = None if late_s is None else sample.received - late_s
        stale = limit_s is not None and (current_s is None or time.monotonic() - current_s >= limit_s)
        try:
            values = list(self._convert(sample, stale, skipped))
        except (MessageError, UnknownTopicError):
            return  # another program's invalid message
        if values:
            self._last = values[-1]
        if limit_s is not None and current_s is not None and not stale:
            self._current_s, self._deadline_s = current_s, current_s + limit_s
        if not stale or self._on_stale == "yield":
            self._returned[sample.key] = header
            self.skipped += skipped
            self._values.extend(values)
        elif returned is None and sample.live:
            self._returned[sample.key] = header._replace(sequence=header.sequence - 1)  # counts as skipped

    def _silence(self) -> T | None:
        now = time.monotonic()
        if self._limit_s is None or self._deadline_s is None or now < self._deadline_s:
            return None
        if self._on_stale == "raise":
            self._deadline_s = now + self._limit_s  # for a program that goes on after the error
            name = self.subscription.key_expr.partition("/")[2]
            raise StaleError(name, self._limit_s, now - self._current_s, self._last)
        self._deadline_s = None  # once, until the next message
        last = self._last
        return replace(last, stale=True, skipped=0) if isinstance(last, Sample) else last


class _Counted(Generic[T]):
    """The counters of a stream, which unsubscribes when it is no longer used."""

    def __init__(self, reader: SampleReader[T]) -> None:
        self._reader = reader
        self._unsubscribe = weakref.finalize(self, reader.subscription.close_soon)
        # A mesh that is not closed is closed when the main thread ends.
        self._unsubscribe.atexit = False

    def __repr__(self) -> str:
        subscription = self._reader.subscription
        return f"<{'closed ' if subscription.closed else ''}stream of {subscription.key_expr}>"

    @property
    def skipped(self) -> int:
        """Number of messages that the stream did not return: they were skipped, lost, or stale."""
        return self._reader.skipped

    @property
    def lost(self) -> int:
        """Number of messages that the network lost."""
        return self._reader.subscription.total_lost


class AsyncStream(_Counted[T]):
    """The messages of a topic, as an asynchronous iterator; also an asynchronous context manager.

    A program that is slower than the topic gets the newest message, and skips the ones before it.
    """

    def __init__(self, reader: SampleReader[T], prepare: Callable[[], Awaitable[None]] | None = None) -> None:
        super().__init__(reader)
        self._prepare = prepare

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> T:
        await self.prepare()
        subscription = self._reader.subscription
        while True:
            if (value := self._reader.next(awaited=True)) is not None:
                return value
            if subscription.closed:
                raise StopAsyncIteration
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(self._reader.left_s()):
                    await subscription.arrived()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        self.close()

    async def prepare(self) -> None:
        """Query what the messages are converted with, once."""
        if self._prepare is not None:
            prepare, self._prepare = self._prepare, None
            await prepare()

    def close(self) -> None:
        """Unsubscribe; the iterator ends."""
        self._reader.subscription.close()

    def blocking(self, connection: object) -> "Stream[T]":
        """Return this stream for a thread, instead of this one.

        Args:
            connection: Ends when no object refers to it.
        """
        self._unsubscribe.detach()
        return Stream(self._reader, connection)


class Stream(_Counted[T]):
    """The messages of a topic, as an iterator; also a context manager.

    A program that is slower than the topic gets the newest message, and skips the ones before it.
    """

    def __init__(self, reader: SampleReader[T], connection: object) -> None:
        super().__init__(reader)
        self._connection = connection

    def __iter__(self) -> Self:
        return self

    def __next__(self) -> T:
        return self.next(timeout_s=None)

    def next(self, *, timeout_s: float | None) -> T:
        """Wait for the next message, and return it.

        Args:
            timeout_s: How long to wait [s]; None: without a limit, as `next(stream)` does.

        Raises:
            TimeoutError: If none arrived in time.
            StaleError: If the topic has fallen silent.
            StopIteration: If the stream was closed.
        """
        subscription = self._reader.subscription
        deadline_s = math.inf if timeout_s is None else time.monotonic() + timeout_s
        while True:
            if (value := self._reader.next(awaited=False)) is not None:
                return value
            if subscription.closed:
                raise StopIteration
            left_s = deadline_s - time.monotonic()
            if left_s <= 0:
                raise TimeoutError(f"{subscription.key_expr}: no message within {timeout_s:g} s")
            silent_s = self._reader.left_s()
            subscription.wait(min(left_s, _POLL_S, math.inf if silent_s is None else silent_s))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Unsubscribe; the iterator ends."""
        self._reader.subscription.close_soon()
