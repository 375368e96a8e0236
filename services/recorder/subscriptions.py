"""Subscriptions of the recorder: one a topic, however many files record it.

Zenoh keeps the messages of each topic in a ring buffer; one thread drains all rings every few milliseconds,
and those of topics that are seldom published every 20 ms. The thread never blocks, and no Python runs in
Zenoh's own threads: 2 us a message in all.
"""

import logging
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any, Protocol

import zenoh
import zenoh.ext

from robomesh.contract.endpoints import timed_out, wait_until_declared
from robomesh.contract.header import Header, unpack
from robomesh.contract.ignored import PUBLICATION, REPLY, Ignored
from robomesh.contract.keys import robot_key
from robomesh.contract.messages import decode
from robomesh.contract.topics import History, Topic, topic
from robomesh.errors import MessageError
from robomesh.recordings.h264 import holds_key_frame
from robomesh.schemas import robomesh_pb2 as schema

log = logging.getLogger(__name__)

# Interval of draining, and so the accuracy of receive times.
_DRAIN_EVERY_S = 0.004
# Limit of the thread's load: with many robots the interval grows up to a maximum, unless a ring fills.
_MAX_BUSY = 0.2
_MAX_INTERVAL_S = 0.02
# A ring that was empty this many times in a row is drained at the longest interval until it has a message.
# The joint states of a moving arm are never so far apart; those of an arm at rest are.
_EMPTY_IN_TURN = 5
# Other threads run for this time while rings fill faster than that.
_MIN_INTERVAL_S = 0.0005
# A ring holds twenty seconds of its topic at its full rate, in case this thread does not run, or a burst of
# a topic without a rate. Rings fill over time, 270 bytes a message, so their size is real memory.
_RING_S, _SMALLEST_RING = 20.0, 512
_MAX_BATCH = 2048
_MAX_MISSING = 10_000
_LOG_INTERVAL_S = 10.0
QUIET = -1.0
"""Returned in place of how full a ring is, for a ring that has been empty for some time."""
# Limit of a view's frames since its newest key frame, and what each needs besides its payload, about.
_MAX_PREAMBLE_BYTES, _FRAME_BYTES = 16 << 20, 200
# Time for the answer to a query [s]; a publisher that missed it is queried again with twice the time.
_ANSWER_S, _LONGEST_ANSWER_S = 2.0, 32.0


class Sink(Protocol):
    """Receiver of publications; it runs on the subscriptions' thread and must not block."""

    def take(self, key: str, row: Topic, header: Header, payload: bytes, received_ns: int) -> None:
        """Take a publication of a topic; `received_ns` is its receive time on `time.monotonic_ns`."""

    def drained(self) -> None:
        """Handle the end of a batch."""


class _Sequence:
    """Sequence numbers received on one key."""

    def __init__(self, header: Header) -> None:
        self.publisher, self.first, self.last = header.publisher, header.sequence, header.sequence
        self.missing: set[int] = set()
        # Numbers that a history list dated before the recording; one that arrives live is recorded anyway.
        self.skipped: set[int] = set()


@dataclass
class _Preamble:
    """What a file that is opened now lacks: the last value, or the frames since a key frame."""

    entries: list[tuple[Header, bytes]] = field(default_factory=list)
    size: int = 0


class _TopicSubscription:
    """Subscription of one topic of one robot."""

    def __init__(self, session: zenoh.Session, key_expr: str, ignored: Ignored) -> None:
        self.key_expr = key_expr
        self._ignored = ignored
        self.row = topic(key_expr.split("/", 3)[3])
        self._is_video = self.row.history is History.KEY_FRAME
        # It describes the robot and is published only once, before the recording.
        self.is_static = self.row.history is History.LAST and self.row.stale_after_s is None
        # Lost publications, and what a new file lacks, by key.
        self.lost: Counter[str] = Counter()
        self.preamble: dict[str, _Preamble] = {}
        # Sinks that received the newest picture.
        self._begun: frozenset[Sink] = frozenset()
        self.begun_ns = time.time_ns()
        self._ring = _ring(self.row)
        self._session = session
        self._sequences: dict[str, _Sequence] = {}
        self._replies: deque[zenoh.Sample] = deque()
        self._empty_in_turn, self._drain_at = 0, 0.0
        # The ring is not drained before the reply with earlier messages has come, or its timeout.
        self._blocked_until = 0.0
        self._queries, self._repeat_for_s = 0, 0.0
        self._subscriber = _subscribe(session, key_expr, self.row)
        if self.row.history in (History.LAST_100, History.KEY_FRAME) or self.is_static:
            self._blocked_until = time.monotonic() + _ANSWER_S
            self._query(_ANSWER_S)

    def _query(self, answer_s: float) -> None:
        """Query the publisher for earlier messages, and wait for the answer for a time [s]."""
        self._queries = number = self._queries + 1
        late = False

        def on_reply(reply: zenoh.Reply) -> None:
            nonlocal late
            if reply.ok is not None:
                self._replies.append(reply.ok)
            late = late or timed_out(reply)

        def on_end() -> None:
            self._blocked_until = 0.0
            if late and number == self._queries and not self._is_video:
                self._repeat_for_s = min(2 * answer_s, _LONGEST_ANSWER_S)

        try:
            wait_until_declared(self._session, self.row.priority)
            self._session.get(
                self.key_expr,
                zenoh.handlers.Callback(on_reply, on_end),
                consolidation=zenoh.ConsolidationMode.NONE,
                congestion_control=zenoh.CongestionControl.DROP,
                priority=getattr(zenoh.Priority, self.row.priority.value),
                timeout=answer_s,
            )
        except zenoh.ZError as error:
            log.warning("%s could not be queried: %s", self.key_expr, error)

    def refresh(self) -> None:
        """Query a service that came online for what it published while the link was down."""
        if self.row.history is History.LAST_100 or self.is_static:
            self._query(_ANSWER_S)

    def drain(self, sinks: Iterable[Sink]) -> float:
        """Deliver received messages to the sinks.

        Returns:
            How full the ring was, as a share of its places; `QUIET`: it has been empty for some time.
        """
        if (answer_s := self._repeat_for_s) > 0.0:
            self._repeat_for_s = 0.0
            self._query(answer_s)
        now = time.monotonic()
        blocked = now < self._blocked_until  # read first: the reply arrives before it ends
        while self._replies:
            reply = self._replies.popleft()
            try:
                for key, header, payload in self._read_reply(reply):
                    self._deliver(key, header, payload, time.monotonic_ns(), sinks)
            except (MessageError, ValueError) as error:  # ValueError: an invalid timestamp
                log.warning("%s: a message is not recorded: %s", self.key_expr, error)
        if blocked:
            return 0.0
        taken = 0
        take: Callable[[], zenoh.Sample | None] = self._subscriber.try_recv
        while taken < _MAX_BATCH and (sample := take()) is not None:
            taken += 1
            attachment, key = sample.attachment, str(sample.key_expr)
            if (
                attachment is None
                or sample.kind != zenoh.SampleKind.PUT
                or not self._accepts(PUBLICATION, key)
            ):
                continue
            try:
                header = unpack(attachment.to_bytes())
            except MessageError:
                continue
            if self._is_new(key, header):
                # Read after taking the message, so that it is never before the publication.
                received_ns = time.monotonic_ns()
                self._deliver(key, header, sample.payload.to_bytes(), received_ns, sinks)
        self._empty_in_turn = 0 if taken else self._empty_in_turn + 1
        if self._empty_in_turn >= _EMPTY_IN_TURN:
            self._drain_at = now + _MAX_INTERVAL_S
            return QUIET
        return 1.0 if taken == _MAX_BATCH else taken / self._ring

    def drain_if_due(self, sinks: Iterable[Sink]) -> float:
        """Drain the ring, but only every `_MAX_INTERVAL_S` while it stays empty."""
        return self.drain(sinks) if time.monotonic() >= self._drain_at else QUIET

    def close(self) -> None:
        """End the subscription."""
        self._subscriber.undeclare()  # type: ignore[no-untyped-call]

    def _deliver(
        self, key: str, header: Header, payload: bytes, received_ns: int, sinks: Iterable[Sink]
    ) -> None:
        if self._is_video:
            # Without a new picture, a viewer would show the last one as live, however old it is.
            if not holds_key_frame(payload) and key in self.preamble:
                for sink in frozenset(sinks) - self._begun:
                    self.deliver_preamble(key, sink, received_ns)
            self._begun = frozenset(sinks)
        for sink in sinks:
            sink.take(key, self.row, header, payload, received_ns)
        if self._is_video or self.is_static:
            self._keep(key, header, payload)

    def deliver_preamble(self, key: str, sink: Sink, received_ns: int) -> None:
        """Give a sink the messages that a new file lacks."""
        for header, payload in self.preamble[key].entries:
            sink.take(key, self.row, header, payload, received_ns)

    def _keep(self, key: str, header: Header, payload: bytes) -> None:
        if self.is_static or holds_key_frame(payload):
            self.preamble[key] = _Preamble()
        if (kept := self.preamble.get(key)) is None:
            return
        kept.entries.append((header, payload))
        kept.size += len(payload) + _FRAME_BYTES
        without_loss = header.sequence == kept.entries[0][0].sequence + len(kept.entries) - 1
        if not without_loss or kept.size > _MAX_PREAMBLE_BYTES:
            # Frames without their key frame, or after a lost one, cannot be decoded.
            del self.preamble[key]

    def _accepts(self, kind: str, key: str) -> bool:
        return key in self._sequences or self._ignored.key(kind, key) is not None

    def _is_new(self, key: str, header: Header) -> bool:
        """Return whether a publication is new; count the numbers missing before it as lost."""
        seen = self._sequences.get(key)
        if seen is None or seen.publisher != header.publisher:
            self._sequences[key] = _Sequence(header)
            return True
        number = header.sequence
        if number == seen.last + 1:
            seen.last = number
            return True
        if number > seen.last:
            self.lost[key] += number - seen.last - 1
            if self.row.recovered:
                seen.missing.update(range(max(seen.last + 1, number - _MAX_MISSING), number))
            seen.last = number
            return True
        if number in seen.skipped:
            seen.skipped.discard(number)
            return True
        if number in seen.missing:
            seen.missing.discard(number)
            self.lost[key] -= 1
            return True
        if self.row.recovered and number < seen.first:
            # The numbers between may be in the same list.
            between = range(max(number + 1, seen.first - _MAX_MISSING), seen.first)
            seen.missing.update(between)
            self.lost[key] += len(between)
            seen.first = number
            return True
        return False

    def _read_reply(self, sample: zenoh.Sample) -> list[tuple[str, Header, bytes]]:
        """Return the new messages of a reply, oldest first; keep pictures, which may be old, for `_deliver`.

        Raises:
            MessageError: If it cannot be decoded.
        """
        key = str(sample.key_expr)
        if sample.attachment is None or not self._accepts(REPLY, key):
            return []
        header = unpack(sample.attachment.to_bytes())
        payload = sample.payload.to_bytes()
        found: list[tuple[str, Header, bytes]] = []
        if self._is_video:
            if key in self._sequences:
                return []  # live frames have arrived; the next key frame is near
            frames = decode(schema.VideoFrames, payload)
            for frame in frames.frames:
                each = Header(frames.publisher, frame.sequence, frame.source_time_ns)
                if self._is_new(key, each):
                    self._keep(key, each, frame.data)
        elif self.row.history is History.LAST_100:
            assert self.row.history_schema is not None
            history: Any = decode(self.row.history_schema, payload)
            ((_, entries),) = history.ListFields() or ((None, ()),)
            for number, entry in enumerate(entries, header.sequence - len(entries) + 1):
                time_ns = entry.timestamp.ToNanoseconds()
                each = Header(header.publisher, number, time_ns)
                # Older entries belong to earlier recordings.
                if time_ns >= self.begun_ns and self._is_new(key, each):
                    found.append((key, each, entry.SerializeToString()))
            if not found and key not in self._sequences:
                seen = self._sequences[key] = _Sequence(header)
                seen.skipped.update(range(header.sequence - len(entries) + 1, header.sequence + 1))
        elif self._is_new(key, header):
            found.append((key, header, payload))
        return found


class RobotSubscriptions:
    """Subscriptions of a robot's topics; each lasts while a sink is attached."""

    def __init__(self, session: zenoh.Session, site: str, robot: str, ignored: Ignored) -> None:
        self._session, self._site, self._robot, self._ignored = session, site, robot, ignored
        self._topics: dict[str, _TopicSubscription] = {}
        # The topic names of each sink, and the publications lost before it was attached.
        self._sinks: dict[Sink, tuple[frozenset[str], Counter[str]]] = {}
        self._sinks_of: dict[str, tuple[Sink, ...]] = {}

    def drain(self) -> None:
        """Deliver all received messages to the sinks."""
        for name, each in self._topics.items():
            each.drain(self._sinks_of[name])
        for sink in self._sinks:
            sink.drained()

    def drain_due(self) -> float:
        """Deliver received messages to the sinks; return how full the fullest ring was, or `QUIET`."""
        looked = (each.drain_if_due(self._sinks_of[name]) for name, each in self._topics.items())
        full = max(looked, default=QUIET)
        if full > 0.0:
            for sink in self._sinks:
                sink.drained()
        return full

    def attach(self, sink: Sink, names: frozenset[str]) -> None:
        """Give a sink the last values of static topics, and every publication of these from now on."""
        for name in sorted(names - self._topics.keys()):
            key_expr = robot_key(self._site, self._robot, name)
            self._topics[name] = _TopicSubscription(self._session, key_expr, self._ignored)
        for name in names:
            each = self._topics[name]
            for key in each.preamble if each.is_static else ():
                each.deliver_preamble(key, sink, received_ns=0)  # before the file's start
        self._sinks[sink] = (names, self._lost_of(names))
        self._update_sinks()

    def detach(self, sink: Sink) -> None:
        """Remove a sink, and end the subscriptions that no other sink needs."""
        self._sinks.pop(sink, None)
        wanted = frozenset[str]().union(*(names for names, _ in self._sinks.values()))
        for name in self._topics.keys() - wanted:
            self._topics.pop(name).close()
        self._update_sinks()

    def lost(self, sink: Sink) -> Counter[str] | None:
        """Return the publications lost since a sink was attached, by key; None if it is not attached."""
        if (attached := self._sinks.get(sink)) is None:
            return None
        names, before = attached
        return self._lost_of(names) - before

    def refresh(self) -> None:
        """Query a service of the robot that came online."""
        for each in self._topics.values():
            each.refresh()

    def _lost_of(self, names: frozenset[str]) -> Counter[str]:
        return sum((self._topics[name].lost for name in names), Counter())

    def _update_sinks(self) -> None:
        self._sinks_of = {
            name: tuple(sink for sink, (names, _) in self._sinks.items() if name in names)
            for name in self._topics
        }


class Subscriptions:
    """Subscriptions of all robots, and the thread that drains their rings."""

    def __init__(self, session: zenoh.Session, site: str, ignored: Ignored) -> None:
        self._session, self._site, self._ignored = session, site, ignored
        # Held to drain the rings and to change subscriptions.
        self.lock = threading.RLock()
        self._robots: dict[str, RobotSubscriptions] = {}
        self._log_at = 0.0
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._run, name="subscriptions", daemon=True)
        self._thread.start()

    def robot(self, name: str) -> RobotSubscriptions:
        """Return a robot's subscriptions; call their methods with the lock held."""
        if name not in self._robots:
            with self.lock:
                self._robots[name] = RobotSubscriptions(self._session, self._site, name, self._ignored)
        return self._robots[name]

    def close(self) -> None:
        """Stop the thread."""
        self._closed.set()
        self._thread.join()

    def _run(self) -> None:
        wait_s = _DRAIN_EVERY_S
        while not self._closed.wait(wait_s):
            begun = time.monotonic()
            with self.lock:
                full = max((self._drain(each, begun) for each in tuple(self._robots.values())), default=QUIET)
            wait_s = interval_s(time.monotonic() - begun, full)

    def _drain(self, robot: RobotSubscriptions, now_s: float) -> float:
        """Drain a robot's rings; an error must not end other robots' recordings."""
        try:
            return robot.drain_due()
        except Exception:
            if now_s >= self._log_at:
                self._log_at = now_s + _LOG_INTERVAL_S
                log.exception("a received message could not be recorded")
        return 0.0


def interval_s(took_s: float, full: float) -> float:
    """Return the wait until the rings are drained again [s].

    Args:
        took_s: Duration of the last draining.
        full: How full the fullest ring was then, as a share of its places; `QUIET`: all were.
    """
    if full >= 0.25:
        return _MIN_INTERVAL_S
    if full == QUIET:
        return _MAX_INTERVAL_S
    return min(max(_DRAIN_EVERY_S, took_s / _MAX_BUSY - took_s), _MAX_INTERVAL_S)


_Ring = zenoh.Handler[zenoh.Sample]


def _ring(row: Topic) -> int:
    """Return the capacity of a topic's ring in messages."""
    return max(round((row.rate_hz or 0.0) * _RING_S), _SMALLEST_RING)


def _subscribe(
    session: zenoh.Session, key_expr: str, row: Topic
) -> zenoh.Subscriber[_Ring] | zenoh.ext.AdvancedSubscriber[_Ring]:
    ring: zenoh.handlers.RingChannel[zenoh.Sample] = zenoh.handlers.RingChannel(_ring(row))
    if row.recovered:
        recovery = zenoh.ext.RecoveryConfig(periodic_queries=None, heartbeat=True)
        return zenoh.ext.declare_advanced_subscriber(session, key_expr, ring, recovery=recovery)
    return session.declare_subscriber(key_expr, ring)
