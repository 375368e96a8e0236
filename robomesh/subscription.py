"""Subscriptions: the newest n, their order, loss and age, handed over to asyncio.

A Zenoh ring takes what comes, so that a slow consumer starves no other subscription; a thread
of the subscription reads it, drops what it has seen, and wakes the event loop.
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

from robomesh import keys
from robomesh.delay import Lateness
from robomesh.endpoints import settle
from robomesh.errors import MessageError
from robomesh.header import Header, unpack
from robomesh.ignored import PUBLICATION, REPLY, Ignored
from robomesh.messages import decode
from robomesh.topics import History, Topic, topic

# What may come between two runs of the reading thread, which does next to nothing.
_ZENOH_RING = 1024
# Services of one robot come alive together: one question for all of them.
_ASK_AGAIN_AFTER_S = 0.1
# So long an answer waits for the live samples that it has overtaken.
_EARLY_S = 0.5
# Of rows with a key for each process, or view: whose nothing came for so long has gone.
_FORGOTTEN_AFTER_S = 3600.0
_LOOK_EACH_S = 60.0


@dataclass(frozen=True, slots=True)
class Sample:
    """Something received.

    Attributes:
        live: Published since we listen; False: an answer to "what is the last value?", whose age
            nobody knows. It then has the topic's history schema, where there is one. A value that is
            published while it is answered may come twice: first as the answer, then live.
        received: When, on this process's monotonic clock [s].
        late_s: How much longer it was on its way than its publisher's quickest: its age when it came [s].
    """

    key: str
    payload: bytes
    header: Header
    live: bool
    received: float
    late_s: float = 0.0

    @property
    def parsed(self) -> keys.Key:
        """Site, robot and topic."""
        return keys.parse_key(self.key)

    def message(self) -> Message:
        """The message, decoded by the topic table.

        Raises:
            MessageError: If the bytes are not that message.
        """
        row = topic(self.parsed.topic)
        schema = row.schema if self.live else row.history_schema or row.schema
        return decode(schema, self.payload)


@dataclass(slots=True)
class _Seen:
    """What is known of one key."""

    header: Header
    answered: bool = False  # the newest sample was an answer
    lateness: Lateness = field(default_factory=Lateness)
    live_at: float | None = None
    came_at: float = 0.0
    lost: int = 0
    skipped: int = 0


class Subscription:
    """The newest samples of a key expression, as an asynchronous iterator.

    One consumer at a time. Its counters may be read at any time.
    """

    def __init__(
        self, session: zenoh.Session, key_expr: str, *, newest: int, history: bool, ignored: Ignored
    ) -> None:
        self.key_expr = key_expr
        self._ignored = ignored
        self.topic: Topic = topic(keys.parse_expression(key_expr).topic)
        self._session = session
        self._loop = asyncio.get_running_loop()
        self._ready = asyncio.Event()
        self._ring: deque[Sample] = deque(maxlen=newest)
        self._seen: dict[str, _Seen] = {}
        self._gone = _Seen(Header(0, 0, 0))  # what keys that are forgotten have lost
        self._looked_at = time.monotonic()
        self._lock = threading.Lock()
        self._malformed = 0
        self._received = 0
        self._history = history
        self._closed = False
        self._asking: asyncio.TimerHandle | None = None
        # A list must come before what follows it: live samples wait for the answer.
        self._held: deque[zenoh.Sample] | None = None
        if history and self.topic.history in (History.LAST_100, History.KEY_FRAME):
            self._held = deque(maxlen=_ZENOH_RING)
        self._subscriber: Any = _declare(session, key_expr, self.topic)
        # No daemon: Python ends a daemon's thread within Zenoh's code, and that aborts the process.
        self._thread = threading.Thread(target=self._read, name=f"read {key_expr}")
        self._thread.start()
        if history:
            self._ask(key_expr)

    def __aiter__(self) -> AsyncIterator[Sample]:
        return self

    async def __anext__(self) -> Sample:
        while True:
            with self._lock:
                if self._ring:
                    return self._ring.popleft()
                self._ready.clear()
            if self._closed:
                raise StopAsyncIteration
            await self._ready.wait()

    async def all_that_came(self) -> list[Sample]:
        """Waits for the next sample; it, and all that came after it. None: it was closed."""
        async for sample in self:
            with self._lock:
                samples = [sample, *self._ring]
                self._ring.clear()
            return samples
        return []

    def age_s(self, key: str) -> float | None:
        """Time since a new sample of the key came, and how late it was [s]; None: none came as we listened.

        An answer to "the last value?" counts only for topics that beat at a known interval.
        """
        seen = self._seen.get(key)
        return None if seen is None or seen.live_at is None else time.monotonic() - seen.live_at

    def lost(self, key: str) -> int:
        """Samples of the key that never arrived: gaps in the publisher's numbers."""
        seen = self._seen.get(key)
        return 0 if seen is None else seen.lost

    def missed(self, key: str) -> int:
        """Samples of the key that the consumer never saw: lost, or dropped because it was too slow."""
        seen = self._seen.get(key)
        return 0 if seen is None else seen.lost + seen.skipped

    @property
    def keys(self) -> tuple[str, ...]:
        """The keys of which something came."""
        return tuple(self._seen)

    @property
    def skipped(self) -> int:
        """Samples that arrived and that the consumer was too slow to take."""
        with self._lock:
            return sum(seen.skipped for seen in (self._gone, *self._seen.values()))

    @property
    def received(self) -> int:
        """Samples that were new."""
        return self._received

    @property
    def lost_in_all(self) -> int:
        """Samples of every key that never arrived."""
        with self._lock:
            return sum(seen.lost for seen in (self._gone, *self._seen.values()))

    @property
    def malformed(self) -> int:
        """Samples without a right attachment, left out."""
        return self._malformed

    @property
    def closed(self) -> bool:
        """Whether it was closed."""
        return self._closed

    def refresh(self, site: str, robot: str) -> None:
        """Ask for a robot's last value again: a service of it has come alive.

        What a publisher put while the link was down was lost in silence.
        """
        if self._history and self._asking is None and not self._closed:
            wanted = keys.parse_expression(self.key_expr)
            if wanted.site in ("*", site) and wanted.robot in ("*", robot, keys.WHOLE_SITE):
                self._asking = self._loop.call_later(_ASK_AGAIN_AFTER_S, self._ask_again)

    def close(self) -> None:
        """Listen no more; the iterator ends."""
        if not self._closed:
            self._closed = True
            if self._asking is not None:
                self._asking.cancel()
            self._subscriber.undeclare()
            self._wake()

    def _ask_again(self) -> None:
        self._asking = None
        if not self._closed:
            self._ask(self.key_expr)

    def _ask(self, key_expr: str) -> None:
        replies: list[zenoh.Sample] = []

        def on_reply(reply: zenoh.Reply) -> None:
            if reply.ok is not None:
                replies.append(reply.ok)

        def on_end() -> None:
            with self._lock:
                early = [reply for reply in replies if self._is_early(reply)]
                for reply in replies:
                    if reply not in early:
                        self._take(reply, asked_at=asked_at)
                held, self._held = self._held, None
                for sample in held or ():
                    self._take(sample)
            self._wake()
            if early and not self._loop.is_closed():
                self._loop.call_soon_threadsafe(self._loop.call_later, _EARLY_S, take_late, early)

        def take_late(early: list[zenoh.Sample]) -> None:
            if self._closed:
                return
            with self._lock:
                for reply in early:
                    self._take(reply, asked_at=asked_at)
            self._wake()

        settle(self._session, self.topic.priority)
        asked_at = time.monotonic()
        self._session.get(
            key_expr,
            zenoh.handlers.Callback(on_reply, on_end),
            target=zenoh.QueryTarget.ALL,
            consolidation=zenoh.ConsolidationMode.NONE,
            congestion_control=zenoh.CongestionControl.DROP,
            priority=getattr(zenoh.Priority, self.topic.priority.value),
            timeout=2.0,
        )

    def _is_early(self, reply: zenoh.Sample) -> bool:
        """Return whether live samples that an answer has overtaken may still arrive (the lock is held)."""
        seen = self._seen.get(str(reply.key_expr))
        if seen is None or seen.live_at is None or self.topic.history is not History.LAST:
            return False
        with suppress(MessageError):
            header = unpack(b"" if reply.attachment is None else reply.attachment.to_bytes())
            return header.publisher == seen.header.publisher and header.sequence > seen.header.sequence
        return False

    def _read(self) -> None:
        try:
            for sample in self._subscriber:
                self._receive(sample)
        except zenoh.ZError:
            if not self._closed:  # closed before this thread had come to read
                raise

    def _receive(self, sample: zenoh.Sample) -> None:
        with self._lock:
            if self._held is not None:
                self._held.append(sample)
                return
            self._take(sample)
        if not self._ready.is_set():
            self._wake()

    def _take(self, sample: zenoh.Sample, *, asked_at: float | None = None) -> None:
        """Keep a sample that is new (the lock is held); `asked_at`: it answers a question of then."""
        key = str(sample.key_expr)
        attachment = sample.attachment
        kind = PUBLICATION if asked_at is None else REPLY
        if key not in self._seen and self._ignored.key(kind, key) is None:
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
        seen = self._seen.get(key)
        if seen is None:
            self._forget(now)
            self._seen[key] = seen = _Seen(header)
        elif header.publisher != seen.header.publisher:
            if asked_at is not None and seen.live_at is not None and seen.live_at > asked_at:
                return  # an answer overtaken by what came live meanwhile
        elif header.sequence == seen.header.sequence:
            # An answer may overtake the publication of the same value.
            if not (asked_at is None and seen.answered and self.topic.history is History.LAST):
                return
        elif header.sequence < seen.header.sequence:
            return
        else:
            gap = header.sequence - seen.header.sequence
            if asked_at is not None and self.topic.history is History.KEY_FRAME:
                return  # a picture's next key frame is near; frames twice would only disturb
            if asked_at is not None and self.topic.history is History.LAST_100:
                payload, new = self._newest_of_list(payload, gap)
                seen.lost += gap - new
            else:
                seen.lost += gap - 1
        seen.header, seen.came_at, seen.answered = header, now, asked_at is not None
        self._received += 1
        late_s = 0.0
        if asked_at is None:
            late_s = 0.0 if keys.is_replay(key) else seen.lateness.of(header, now)
            seen.live_at = now - late_s
        elif self.topic.heartbeat_s is not None:
            seen.live_at = now - self.topic.heartbeat_s
        if len(self._ring) == self._ring.maxlen:
            self._seen.get(self._ring[0].key, self._gone).skipped += 1
        self._ring.append(Sample(key, payload, header, asked_at is None, now, late_s))

    def _forget(self, now: float) -> None:
        """Processes come and go for years: of those that went only what they lost is kept."""
        if "*" not in self.topic.name or now - self._looked_at < _LOOK_EACH_S:
            return
        self._looked_at = now
        for key, seen in tuple(self._seen.items()):
            if now - seen.came_at > _FORGOTTEN_AFTER_S:
                del self._seen[key]
                self._gone.lost += seen.lost
                self._gone.skipped += seen.skipped

    def _newest_of_list(self, payload: bytes, most: int) -> tuple[bytes, int]:
        """A list message cut to its newest entries, and how many there are."""
        assert self.topic.history_schema is not None
        try:
            message = decode(self.topic.history_schema, payload)
        except MessageError:
            return payload, 0  # for the consumer to refuse
        (field,) = message.DESCRIPTOR.fields
        entries = getattr(message, field.name)
        del entries[: max(len(entries) - most, 0)]
        return message.SerializeToString(), len(entries)

    def _wake(self) -> None:
        if not self._loop.is_closed():
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
