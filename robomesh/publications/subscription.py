"""Subscriptions: the newest samples for asyncio, with their order, loss and age.

Zenoh puts samples into a ring, so that a slow consumer does not delay other subscriptions. A thread of the
subscription reads the ring, drops duplicates, and wakes the event loop.

For a consumer that pauses between its batches, the event loop itself reads the ring while samples keep
coming, which saves the thread's wake for each of them:

    thread reads --several in a pause--> event loop reads after each pause --none for 3--> thread reads
"""

import asyncio
import threading
import time
from collections import deque
from collections.abc import AsyncIterator
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import zenoh
import zenoh.ext
from google.protobuf.message import Message

from robomesh.contract import keys
from robomesh.contract.endpoints import timed_out, wait_until_declared
from robomesh.contract.header import Header, unpack
from robomesh.contract.ignored import PUBLICATION, REPLY, Ignored
from robomesh.contract.messages import decode
from robomesh.contract.topics import History, Topic, topic
from robomesh.errors import MessageError
from robomesh.publications.delay import Delay

# Samples that may arrive between two runs of the reading thread.
_ZENOH_RING = 1024
# Wait before a query for the last value [s], because the services of one robot start together.
_QUERY_AFTER_S = 0.1
# Time for the answers of a query [s]. A publisher that missed it, because its machine is busy, is queried
# again with twice the time: some values are published only once.
_ANSWER_S, _LONGEST_ANSWER_S = 2.0, 32.0
# How long a reply waits for live samples that it overtook [s].
_EARLY_S = 0.5
# Pauses without a sample after which the thread reads again.
_IN_VAIN = 3
# For rows with a key for each process or view: a key without samples for this time is forgotten [s].
_FORGOTTEN_AFTER_S = 3600.0
_FORGET_EACH_S = 60.0


@dataclass(frozen=True, slots=True)
class Sample:
    """A received message.

    Attributes:
        parsed: Site, robot and topic of the key.
        live: Received as a publication; False: the reply to a query for the last value, of unknown age, in
            the topic's history schema if there is one. A value that is published during the query may
            arrive twice: first as the reply, then live.
        received: Time of arrival on this process's monotonic clock [s].
        late_s: Age at arrival: how much longer it took than its publisher's quickest sample [s].
    """

    key: str
    parsed: keys.Key
    payload: bytes
    header: Header
    live: bool
    received: float
    late_s: float = 0.0

    def message(self) -> Message:
        """Decode the message by the topic table.

        Raises:
            MessageError: If the bytes are not that message.
        """
        row = topic(self.parsed.topic)
        schema = row.schema if self.live else row.history_schema or row.schema
        return decode(schema, self.payload)


@dataclass(slots=True)
class _KeyState:
    """State of one key.

    Attributes:
        header: Of the newest sample.
    """

    key: keys.Key
    header: Header
    is_replay: bool = False
    is_reply: bool = False  # of the newest sample
    heard: bool = False  # a publication of this publisher has arrived
    delay: Delay = field(default_factory=Delay)
    live_at: float | None = None
    received_at: float = 0.0
    lost: int = 0
    skipped: int = 0


class Subscription:
    """The newest samples of a key expression, as an asynchronous iterator.

    One consumer at a time. Its counters may be read at any time.
    """

    def __init__(
        self,
        session: zenoh.Session,
        key_expr: str,
        *,
        newest: int,
        history: bool,
        ignored: Ignored,
    ) -> None:
        self.key_expr = key_expr
        self._ignored = ignored
        self.topic: Topic = topic(keys.parse_expression(key_expr).topic)
        self._session = session
        self._loop = asyncio.get_running_loop()
        # Set by the first sample after the ring was found empty: for a thread, and for the event loop.
        self._arrived = threading.Event()
        self._ready = asyncio.Event()
        self._awaited = False
        self._ring: deque[Sample] = deque(maxlen=newest)
        self._seen: dict[str, _KeyState] = {}
        self._forgotten = _KeyState(keys.Key("", "", ""), Header(0, 0, 0))  # counters of forgotten keys
        self._forgot_at = time.monotonic()
        self._lock = threading.Lock()
        self._malformed = 0
        self._received = 0
        # Whether the event loop reads the ring and not the thread, and when it did so last.
        self._pause_s = self._loop_read_at = 0.0
        self._read_by_loop = False
        self._thread_reads = threading.Event()
        self._history = history
        self._closed = False
        self._query_timer: asyncio.TimerHandle | None = None
        self._queries = 0
        # Live samples that wait for the reply with the list, which must come first.
        self._waiting: deque[zenoh.Sample] | None = None
        if history and self.topic.history in (History.LAST_100, History.KEY_FRAME):
            self._waiting = deque(maxlen=_ZENOH_RING)
        self._subscriber: Any = _declare(session, key_expr, self.topic)
        # Taken now: while another thread ends the subscriber, nothing of it can be read.
        self._handler = self._subscriber.handler
        self._finished = threading.Event()
        # Not a daemon: Python would end a daemon thread inside Zenoh's code, which aborts the process.
        self._thread = threading.Thread(target=self._read, name=f"read {key_expr}")
        self._thread.start()
        if history:
            self._query(_ANSWER_S)

    def __aiter__(self) -> AsyncIterator[Sample]:
        return self

    async def __anext__(self) -> Sample:
        while (sample := self.take(awaited=True)) is None:
            if self._closed:
                raise StopAsyncIteration
            await self.arrived()
        return sample

    def take(self, *, awaited: bool = False) -> Sample | None:
        """Return the next sample without waiting; None: there is none. On any thread.

        Args:
            awaited: Without one, the event loop is woken by the next one, and not only `wait`.
        """
        with self._lock:
            if self._ring:
                return self._ring.popleft()
            self._arrived.clear()
            self._ready.clear()
            self._awaited = awaited
            return None

    async def arrived(self) -> None:
        """Wait for a sample after `take` found none, or for `close`."""
        if not self._closed:
            await self._ready.wait()

    def wait(self, timeout_s: float) -> bool:
        """Block the calling thread until a sample arrives or the subscription is closed; False: timeout."""
        return self._arrived.wait(timeout_s)

    async def next_batch(self, *, pause_s: float = 0.0) -> list[Sample]:
        """Wait for a sample and return all samples received; empty after `close`.

        Args:
            pause_s: Pause after the samples that have arrived [s]: those of the pause are returned together
                after it, so many keys wake the process less often. A sample after a longer gap is not
                delayed. A consumer that pauses reads only batches.
        """
        self._pause_s = pause_s
        in_vain = 0
        while not (samples := self._take_all()) and not self._closed:
            if not self._read_by_loop:
                await self._ready.wait()
                continue
            await asyncio.sleep(self._loop_read_at + pause_s - time.monotonic())
            in_vain = 0 if self._read_in_loop() else in_vain + 1
            if in_vain == _IN_VAIN:
                self._read_by_loop = False
                self._thread_reads.set()
        return samples

    def _read_in_loop(self) -> int:
        """Take the samples that wait, for a consumer that is about to look; return their number."""
        self._loop_read_at = time.monotonic()
        self._awaited = False
        return 0 if self._closed else self._read_waiting()

    def _take_all(self) -> list[Sample]:
        with self._lock:
            samples = [*self._ring]
            self._ring.clear()
            if not samples:
                self._arrived.clear()
                self._ready.clear()
                self._awaited = True
            return samples

    def age_s(self, key: str) -> float | None:
        """Return the age of a key's newest live sample [s]; None: no live sample arrived.

        A reply with the last value counts only for topics with a heartbeat.
        """
        seen = self._seen.get(key)
        return None if seen is None or seen.live_at is None else time.monotonic() - seen.live_at

    def ages_s(self) -> dict[keys.Key, float]:
        """Return the age of the newest live sample of each key that has one [s]; see `age_s`."""
        now = time.monotonic()
        seen = [(each.key, each.live_at) for each in tuple(self._seen.values())]
        return {key: now - live_at for key, live_at in seen if live_at is not None}

    def lost(self, key: str) -> int:
        """Return the number of the key's samples that never arrived: gaps in the publisher's numbers."""
        seen = self._seen.get(key)
        return 0 if seen is None else seen.lost

    def missed(self, key: str) -> int:
        """Return the number of the key's samples that were lost, or dropped for a slow consumer."""
        seen = self._seen.get(key)
        return 0 if seen is None else seen.lost + seen.skipped

    @property
    def skipped(self) -> int:
        """Number of samples dropped because the consumer was too slow."""
        with self._lock:
            return sum(seen.skipped for seen in (self._forgotten, *self._seen.values()))

    @property
    def received(self) -> int:
        """Number of samples, without duplicates."""
        return self._received

    @property
    def total_lost(self) -> int:
        """Number of samples of all keys that never arrived."""
        with self._lock:
            return sum(seen.lost for seen in (self._forgotten, *self._seen.values()))

    @property
    def malformed(self) -> int:
        """Number of samples without a valid attachment, which are dropped."""
        return self._malformed

    @property
    def closed(self) -> bool:
        """True after `close`."""
        return self._closed

    def refresh(self, site: str, robot: str) -> None:
        """Query a robot's last value again, because one of its services came alive.

        A message that was published while the link was down was silently lost.
        """
        if self._history and self._query_timer is None and not self._closed:
            wanted = keys.parse_expression(self.key_expr)
            if wanted.site in ("*", site) and wanted.robot in ("*", robot, keys.WHOLE_SITE):
                self._query_timer = self._loop.call_later(_QUERY_AFTER_S, self._query_again)

    def close(self) -> None:
        """Unsubscribe; the iterator ends."""
        if not self._closed:
            self._closed = True
            if self._query_timer is not None:
                self._query_timer.cancel()
            self._subscriber.undeclare()
            self._thread_reads.set()
            self._wake()

    def join(self) -> None:
        """Wait until a closed subscription's thread has ended."""
        self._finished.wait()

    def close_soon(self) -> None:
        """Unsubscribe; on any thread."""
        if not self._closed and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self.close)

    def _query_again(self, timeout_s: float = _ANSWER_S) -> None:
        self._query_timer = None
        if not self._closed:
            self._query(timeout_s)

    def _query(self, timeout_s: float) -> None:
        self._queries = number = self._queries + 1
        replies: list[zenoh.Sample] = []
        late = False

        def on_reply(reply: zenoh.Reply) -> None:
            nonlocal late
            if reply.ok is not None:
                replies.append(reply.ok)
            late = late or timed_out(reply)

        def on_end() -> None:
            with self._lock:
                early = [reply for reply in replies if self._is_early(reply)]
                for reply in replies:
                    if reply not in early:
                        self._take(reply, queried_at=queried_at)
                waiting, self._waiting = self._waiting, None
                for sample in waiting or ():
                    self._take(sample)
            self._wake()
            if early and not self._loop.is_closed():
                self._loop.call_soon_threadsafe(self._loop.call_later, _EARLY_S, take_early, early)
            if late and number == self._queries and not self._loop.is_closed():
                longer_s = min(2 * timeout_s, _LONGEST_ANSWER_S)
                self._loop.call_soon_threadsafe(self._query_again, longer_s)

        def take_early(early: list[zenoh.Sample]) -> None:
            if self._closed:
                return
            with self._lock:
                for reply in early:
                    self._take(reply, queried_at=queried_at)
            self._wake()

        wait_until_declared(self._session, self.topic.priority)
        queried_at = time.monotonic()
        self._session.get(
            self.key_expr,
            zenoh.handlers.Callback(on_reply, on_end),
            target=zenoh.QueryTarget.ALL,
            consolidation=zenoh.ConsolidationMode.NONE,
            congestion_control=zenoh.CongestionControl.DROP,
            priority=getattr(zenoh.Priority, self.topic.priority.value),
            timeout=timeout_s,
        )

    def _is_early(self, reply: zenoh.Sample) -> bool:
        """Return whether live samples that a reply overtook may still arrive (with the lock held)."""
        seen = self._seen.get(str(reply.key_expr))
        if seen is None or seen.live_at is None or self.topic.history is not History.LAST:
            return False
        with suppress(MessageError):
            header = unpack(b"" if reply.attachment is None else reply.attachment.to_bytes())
            return header.publisher == seen.header.publisher and header.sequence > seen.header.sequence
        return False

    def _read(self) -> None:
        try:
            while not self._closed:
                self._receive(self._handler.recv())
                more = self._read_waiting()
                if self._pause_s and more:
                    self._hand_over()
                elif self._pause_s:
                    time.sleep(self._pause_s)
        except zenoh.ZError:
            if not self._closed:  # `close` before the first read raises too
                raise
        finally:
            self._finished.set()

    def _hand_over(self) -> None:
        """Let the event loop read the ring, until it finds no sample after several pauses."""
        self._thread_reads.clear()
        if not self._closed:
            self._loop_read_at = time.monotonic()
            self._read_by_loop = True
            self._wake()
            self._thread_reads.wait()

    def _read_waiting(self) -> int:
        """Take the samples that wait in the ring, and return their number."""
        number = 0
        with suppress(zenoh.ZError):  # closed: the thread's next read raises, too
            while (sample := self._handler.try_recv()) is not None:
                self._receive(sample)
                number += 1
        return number

    def _receive(self, sample: zenoh.Sample) -> None:
        with self._lock:
            if self._waiting is not None:
                self._waiting.append(sample)
                return
            self._take(sample)
        if not self._arrived.is_set():
            self._wake()

    def _take(self, sample: zenoh.Sample, *, queried_at: float | None = None) -> None:
        """Keep a sample if it is new (with the lock held).

        Args:
            queried_at: Time of the query, for a reply; None: a publication.
        """
        key = str(sample.key_expr)
        attachment = sample.attachment
        kind = PUBLICATION if queried_at is None else REPLY
        seen = self._seen.get(key)
        parsed = self._ignored.key(kind, key) if seen is None else seen.key
        if parsed is None:
            return
        if attachment is None or sample.kind != zenoh.SampleKind.PUT:
            self._malformed += 1
            return
        try:
            header = unpack(attachment.to_bytes())
        except MessageError:
            self._malformed += 1
            return
        now = time.monotonic()
        payload = sample.payload.to_bytes()
        if seen is None:
            self._forget(now)
            self._seen[key] = seen = _KeyState(parsed, header, keys.is_replay(parsed.robot))
        elif header.publisher != seen.header.publisher:
            if queried_at is not None and seen.live_at is not None and seen.live_at > queried_at:
                return  # a live sample overtook the reply
        elif header.sequence == seen.header.sequence:
            # A reply may overtake the publication of the same value.
            if not (queried_at is None and seen.is_reply and self.topic.history is History.LAST):
                return
        elif header.sequence < seen.header.sequence:
            return
        else:
            gap = header.sequence - seen.header.sequence
            if queried_at is not None and self.topic.history is History.KEY_FRAME:
                return  # wait for the next key frame instead of repeating frames
            if queried_at is not None and self.topic.history is History.LAST_100:
                payload, new = self._newest_of_list(payload, gap)
                seen.lost += gap - new
            # Between the first reply and the first publication, the publisher did not know the subscription.
            elif seen.heard or self.topic.history is not History.LAST:
                seen.lost += gap - 1
        seen.heard = queried_at is None or (seen.heard and header.publisher == seen.header.publisher)
        seen.header, seen.received_at, seen.is_reply = header, now, queried_at is not None
        self._received += 1
        late_s = 0.0
        if queried_at is None:
            # The source times of a replay are those of its recording.
            late_s = 0.0 if seen.is_replay else seen.delay.of(header, now)
            seen.live_at = now - late_s
        elif self.topic.heartbeat_s is not None:
            seen.live_at = now - self.topic.heartbeat_s
        if len(self._ring) == self._ring.maxlen:
            self._seen.get(self._ring[0].key, self._forgotten).skipped += 1
        self._ring.append(Sample(key, parsed, payload, header, queried_at is None, now, late_s))

    def _forget(self, now: float) -> None:
        """Forget the keys of processes and views that have ended, except for their counters."""
        if "*" not in self.topic.name or now - self._forgot_at < _FORGET_EACH_S:
            return
        self._forgot_at = now
        for key, seen in tuple(self._seen.items()):
            if now - seen.received_at > _FORGOTTEN_AFTER_S:
                del self._seen[key]
                self._forgotten.lost += seen.lost
                self._forgotten.skipped += seen.skipped

    def _newest_of_list(self, payload: bytes, most: int) -> tuple[bytes, int]:
        """Return a list message cut to its newest entries, and their number."""
        assert self.topic.history_schema is not None
        try:
            message = decode(self.topic.history_schema, payload)
        except MessageError:
            return payload, 0  # the consumer rejects it
        (field,) = message.DESCRIPTOR.fields
        entries = getattr(message, field.name)
        del entries[: max(len(entries) - most, 0)]
        return message.SerializeToString(), len(entries)

    def _wake(self) -> None:
        self._arrived.set()
        if self._awaited and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._ready.set)


_Ring = zenoh.Handler[zenoh.Sample]


def _declare(
    session: zenoh.Session, key_expr: str, row: Topic
) -> zenoh.Subscriber[_Ring] | zenoh.ext.AdvancedSubscriber[_Ring]:
    ring: zenoh.handlers.RingChannel[zenoh.Sample] = zenoh.handlers.RingChannel(_ZENOH_RING)
    if row.recovered:
        return zenoh.ext.declare_advanced_subscriber(
            session,
            key_expr,
            ring,
            recovery=zenoh.ext.RecoveryConfig(periodic_queries=None, heartbeat=True),
        )
    return session.declare_subscriber(key_expr, ring)
