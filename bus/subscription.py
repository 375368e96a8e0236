"""Subscriptions: the newest n, their order, loss and age, handed over to asyncio.

A Zenoh ring takes what comes, so that a slow consumer starves no other subscription; a thread
of the subscription reads it, drops what it has seen, and wakes the event loop.
"""

import asyncio
import threading
import time
from collections import deque
from collections.abc import AsyncIterator
from dataclasses import dataclass
from typing import Any

import zenoh
import zenoh.ext
from google.protobuf.message import Message

from bus import keys
from bus.endpoints import settle
from bus.errors import MessageError
from bus.header import Header, unpack
from bus.messages import decode
from bus.topics import History, Topic, topic

# What may come between two runs of the reading thread, which does next to nothing.
_ZENOH_RING = 1024
# Services of one robot come alive together: one question for all of them.
_ASK_AGAIN_AFTER_S = 0.1


@dataclass(frozen=True, slots=True)
class Sample:
    """Something received.

    Attributes:
        live: Published since we listen; False: an answer to "what is the last value?", whose age
            nobody knows. It then has the topic's history schema, where there is one.
        received: When, on this process's monotonic clock [s].
    """

    key: str
    payload: bytes
    header: Header
    live: bool
    received: float

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
    live_at: float | None = None
    lost: int = 0
    skipped: int = 0


class Subscription:
    """The newest samples of a key expression, as an asynchronous iterator.

    One consumer at a time. Its counters may be read at any time.
    """

    def __init__(self, session: zenoh.Session, key_expr: str, *, newest: int, history: bool) -> None:
        self.key_expr = key_expr
        self.topic: Topic = topic(keys.parse_key(key_expr).topic)
        self._session = session
        self._loop = asyncio.get_running_loop()
        self._ready = asyncio.Event()
        self._ring: deque[Sample] = deque(maxlen=newest)
        self._seen: dict[str, _Seen] = {}
        self._lock = threading.Lock()
        self._malformed = 0
        self._closed = False
        self._asking: asyncio.TimerHandle | None = None
        # A list must come before what follows it: live samples wait for the answer.
        self._held: deque[zenoh.Sample] | None = None
        if history and self.topic.history in (History.LAST_100, History.KEY_FRAME):
            self._held = deque(maxlen=_ZENOH_RING)
        self._subscriber: Any = _declare(session, key_expr, self.topic)
        self._thread = threading.Thread(target=self._read, name=f"read {key_expr}", daemon=True)
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

    def age_s(self, key: str) -> float | None:
        """Time since a new sample of the key came [s]; None: none came while we listened.

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
        return sum(seen.skipped for seen in self._seen.values())

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
        if self._asking is None and not self._closed:
            wanted = keys.parse_key(self.key_expr)
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
                for reply in replies:
                    self._take(reply, asked_at=asked_at)
                held, self._held = self._held, None
                for sample in held or ():
                    self._take(sample)
            self._wake()

        settle(self._session, self.topic.priority)
        asked_at = time.monotonic()
        self._session.get(
            key_expr,
            zenoh.handlers.Callback(on_reply, on_end),
            consolidation=zenoh.ConsolidationMode.NONE,
            congestion_control=zenoh.CongestionControl.DROP,
            priority=getattr(zenoh.Priority, self.topic.priority.value),
            timeout=2.0,
        )

    def _read(self) -> None:
        for sample in self._subscriber:
            with self._lock:
                if self._held is not None:
                    self._held.append(sample)
                    continue
                self._take(sample)
            if not self._ready.is_set():
                self._wake()

    def _take(self, sample: zenoh.Sample, *, asked_at: float | None = None) -> None:
        """Keep a sample that is new (the lock is held); `asked_at`: it answers a question of then."""
        key = str(sample.key_expr)
        attachment = sample.attachment
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
            self._seen[key] = seen = _Seen(header)
        elif header.publisher != seen.header.publisher:
            if asked_at is not None and seen.live_at is not None and seen.live_at > asked_at:
                return  # an answer overtaken by what came live meanwhile
        elif header.sequence <= seen.header.sequence:
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
        seen.header = header
        if asked_at is None or self.topic.heartbeat_s is not None:
            seen.live_at = now - (self.topic.heartbeat_s or 0.0) if asked_at is not None else now
        if len(self._ring) == self._ring.maxlen:
            self._seen[self._ring[0].key].skipped += 1
        self._ring.append(Sample(key, payload, header, asked_at is None, now))

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
