"""What is recorded, taken from the mesh: every publication once, however many files it goes into.

Zenoh keeps what comes in a ring for each topic; one thread empties all rings every few milliseconds. It
does nothing that could wait, and no Python runs in Zenoh's own threads: 2 us a message in all.
"""

import logging
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable
from typing import Any, Protocol

import zenoh
import zenoh.ext

from mcap_files.video import holds_key_frame
from robomesh.endpoints import settle
from robomesh.errors import MessageError
from robomesh.header import Header, unpack
from robomesh.ignored import PUBLICATION, REPLY, Ignored
from robomesh.keys import robot_key
from robomesh.messages import decode
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.topics import History, Topic, topic

log = logging.getLogger(__name__)

# Received times are as exact as this, while the emptying takes less.
_SWEEP_EVERY_S = 0.004
# Of its time: a hundred robots' rings are looked into less often, and more is in them.
_MOST_BUSY = 0.2
_LONGEST_S = 0.02
# A ring has room for twenty seconds of its topic at its highest rate, if this thread should not run, and
# for a burst of what has none. In time all of its room is touched, 270 bytes a message: none of it is free.
_RING_S, _SMALLEST_RING = 20.0, 512
_MOST_AT_ONCE = 2048
_MOST_MISSING = 10_000
_SAY_AGAIN_AFTER_S = 10.0
# Of a view, from its newest key frame on; what is longer is not kept, for it would begin in its middle.
_MOST_KEPT_BYTES = 16 << 20
_ANSWER_S = 2.0


class Sink(Protocol):
    """Takes publications; on the intake's thread, so it must not wait for anything."""

    def take(self, key: str, row: Topic, header: Header, payload: bytes, received_ns: int) -> None:
        """A publication of a topic, and when it came: time.monotonic_ns, which nobody sets."""

    def swept(self) -> None:
        """All that there was has been taken."""


class _Seen:
    """What is known of one key's numbers."""

    def __init__(self, header: Header) -> None:
        self.publisher, self.first, self.last = header.publisher, header.sequence, header.sequence
        self.missing: set[int] = set()
        # Told by a list as older than the recording: if one comes by itself after all, it is not.
        self.untaken: set[int] = set()


class _Kept:
    """What a file that is opened now begins with: what was told last, or the frames since a key frame."""

    def __init__(self) -> None:
        self.entries: list[tuple[Header, bytes, int]] = []
        self._bytes = 0
        self._full = False

    def begin(self) -> None:
        self.entries, self._bytes, self._full = [], 0, False

    def add(self, entry: tuple[Header, bytes, int]) -> None:
        self._bytes += len(entry[1])
        self._full = self._full or self._bytes > _MOST_KEPT_BYTES
        if self._full:
            self.entries = []
        else:
            self.entries.append(entry)


class _Tap:
    """One topic of one robot."""

    def __init__(self, session: zenoh.Session, key_expr: str, ignored: Ignored) -> None:
        self.key_expr = key_expr
        self._ignored = ignored
        self.row = topic(key_expr.split("/", 3)[3])
        # Every key's lost publications, and what a file of its own begins with.
        self.lost: Counter[str] = Counter()
        self.kept: dict[str, _Kept] = {}
        self.begun_ns = time.time_ns()
        self._session = session
        self._seen: dict[str, _Seen] = {}
        self._answers: deque[zenoh.Sample] = deque()
        # A list, and the frames since a key frame, come before what follows them: the ring waits.
        self._held_until = 0.0
        self._subscriber = _subscribe(session, key_expr, self.row)
        if self.row.history in (History.LAST_100, History.KEY_FRAME) or self._timeless:
            self._held_until = time.monotonic() + _ANSWER_S
            self.ask()

    @property
    def _timeless(self) -> bool:
        """It tells what a robot is, which was said before the recording began."""
        return self.row.history is History.LAST and self.row.stale_after_s is None

    def ask(self) -> None:
        """Ask for what was published while nobody listened."""

        def on_reply(reply: zenoh.Reply) -> None:
            if reply.ok is not None:
                self._answers.append(reply.ok)

        def on_end() -> None:
            self._held_until = 0.0

        try:
            settle(self._session, self.row.priority)
            self._session.get(
                self.key_expr,
                zenoh.handlers.Callback(on_reply, on_end),
                consolidation=zenoh.ConsolidationMode.NONE,
                congestion_control=zenoh.CongestionControl.DROP,
                priority=getattr(zenoh.Priority, self.row.priority.value),
                timeout=_ANSWER_S,
            )
        except zenoh.ZError as error:
            log.warning("%s could not be asked for: %s", self.key_expr, error)

    def refresh(self) -> None:
        """A service has come alive: what it published while the link was down is asked for."""
        if self.row.history is History.LAST_100 or self._timeless:
            self.ask()

    def sweep(self, sinks: Iterable[Sink]) -> int:
        """Hand over what has come; how much."""
        held = time.monotonic() < self._held_until  # first: what ends it comes behind the answer
        while self._answers:
            answer = self._answers.popleft()
            try:
                for key, header, payload, received_ns in self._read_answer(answer):
                    self._give(key, header, payload, received_ns, sinks)
            except (MessageError, ValueError) as error:  # a time that no timestamp can be
                log.warning("%s: left out of the recording: %s", self.key_expr, error)
        if held:
            return 0
        taken = 0
        take: Callable[[], zenoh.Sample | None] = self._subscriber.try_recv
        while taken < _MOST_AT_ONCE and (sample := take()) is not None:
            taken += 1
            attachment, key = sample.attachment, str(sample.key_expr)
            if attachment is None or sample.kind != zenoh.SampleKind.PUT or not self._fits(PUBLICATION, key):
                continue
            try:
                header = unpack(attachment.to_bytes())
            except MessageError:
                continue
            if self._is_new(key, header):
                # Read behind the ring: what is taken had been published before.
                received_ns = time.monotonic_ns()
                self._give(key, header, sample.payload.to_bytes(), received_ns, sinks)
        return taken

    def close(self) -> None:
        """Listen no more."""
        self._subscriber.undeclare()  # type: ignore[no-untyped-call]

    def _give(
        self, key: str, header: Header, payload: bytes, received_ns: int, sinks: Iterable[Sink]
    ) -> None:
        if self._timeless or self.row.history is History.KEY_FRAME:
            self._keep(key, header, payload, received_ns)
        for sink in sinks:
            sink.take(key, self.row, header, payload, received_ns)

    def _keep(self, key: str, header: Header, payload: bytes, received_ns: int) -> None:
        kept = self.kept.setdefault(key, _Kept())
        if self._timeless or holds_key_frame(payload):
            kept.begin()
        kept.add((header, payload, received_ns))

    def _fits(self, kind: str, key: str) -> bool:
        return key in self._seen or self._ignored.key(kind, key) is not None

    def _is_new(self, key: str, header: Header) -> bool:
        """Whether it has not come before; what is missing before it is counted."""
        seen = self._seen.get(key)
        if seen is None or seen.publisher != header.publisher:
            self._seen[key] = _Seen(header)
            return True
        number = header.sequence
        if number == seen.last + 1:
            seen.last = number
            return True
        if number > seen.last:
            self.lost[key] += number - seen.last - 1
            if self.row.recovered:
                seen.missing.update(range(max(seen.last + 1, number - _MOST_MISSING), number))
            seen.last = number
            return True
        if number in seen.untaken:
            seen.untaken.discard(number)
            return True
        if number in seen.missing:
            seen.missing.discard(number)
            self.lost[key] -= 1
            return True
        if self.row.recovered and number < seen.first:
            # Those between may be in the same list.
            between = range(max(number + 1, seen.first - _MOST_MISSING), seen.first)
            seen.missing.update(between)
            self.lost[key] += len(between)
            seen.first = number
            return True
        return False

    def _read_answer(self, sample: zenoh.Sample) -> list[tuple[str, Header, bytes, int]]:
        """What of an answer is new, oldest first.

        Raises:
            MessageError: If it cannot be read.
        """
        key, now_ns = str(sample.key_expr), time.monotonic_ns()
        if sample.attachment is None or not self._fits(REPLY, key):
            return []
        header = unpack(sample.attachment.to_bytes())
        payload = sample.payload.to_bytes()
        found: list[tuple[str, Header, bytes, int]] = []
        if self.row.history is History.KEY_FRAME:
            if key in self._seen:
                return []  # the next key frame is near; frames twice would only disturb
            frames = decode(schema.VideoFrames, payload)
            newest_ns = max((frame.source_time_ns for frame in frames.frames), default=0)
            for frame in frames.frames:
                each = Header(frames.publisher, frame.sequence, frame.source_time_ns)
                if self._is_new(key, each):
                    found.append((key, each, frame.data, now_ns - (newest_ns - frame.source_time_ns)))
        elif self.row.history is History.LAST_100:
            assert self.row.history_schema is not None
            answer: Any = decode(self.row.history_schema, payload)
            ((_, entries),) = answer.ListFields() or ((None, ()),)
            for number, entry in enumerate(entries, header.sequence - len(entries) + 1):
                time_ns = entry.timestamp.ToNanoseconds()
                each = Header(header.publisher, number, time_ns)
                # What is older than the recording is not its own.
                if time_ns >= self.begun_ns and self._is_new(key, each):
                    found.append((key, each, entry.SerializeToString(), now_ns))
            if not found and key not in self._seen:
                seen = self._seen[key] = _Seen(header)
                seen.untaken.update(range(header.sequence - len(entries) + 1, header.sequence + 1))
        elif self._is_new(key, header):
            found.append((key, header, payload, now_ns))
        return found


class RobotIntake:
    """A robot's topics, while anybody wants them."""

    def __init__(self, session: zenoh.Session, site: str, robot: str, ignored: Ignored) -> None:
        self._session, self._site, self._robot, self._ignored = session, site, robot, ignored
        self._taps: dict[str, _Tap] = {}
        # With the names that each takes, and what was lost of those before.
        self._sinks: dict[Sink, tuple[frozenset[str], Counter[str]]] = {}
        self._takers: dict[str, tuple[Sink, ...]] = {}

    def sweep(self) -> None:
        """Hand over what has come."""
        if not self._sinks:
            return
        taken = sum(tap.sweep(self._takers[name]) for name, tap in self._taps.items())
        if taken:
            for sink in self._sinks:
                sink.swept()

    def attach(self, sink: Sink, names: frozenset[str]) -> None:
        """Give a sink every publication of these topics' names from now on, and what explains them."""
        for name in sorted(names - self._taps.keys()):
            self._taps[name] = _Tap(self._session, robot_key(self._site, self._robot, name), self._ignored)
        for name in names:
            tap = self._taps[name]
            for key, kept in tap.kept.items():
                for header, payload, received_ns in kept.entries:
                    sink.take(key, tap.row, header, payload, received_ns)
        self._sinks[sink] = (names, self._lost_of(names))
        self._sort()

    def detach(self, sink: Sink) -> None:
        """Give a sink nothing more; topics that nobody else wants are listened to no more."""
        self._sinks.pop(sink, None)
        wanted = frozenset[str]().union(*(names for names, _ in self._sinks.values()))
        for name in self._taps.keys() - wanted:
            self._taps.pop(name).close()
        self._sort()

    def lost(self, sink: Sink) -> Counter[str] | None:
        """Publications that never came since a sink was attached, by key; None: it is not."""
        if (attached := self._sinks.get(sink)) is None:
            return None
        names, before = attached
        return self._lost_of(names) - before

    def refresh(self) -> None:
        """A service of the robot has come alive."""
        for tap in self._taps.values():
            tap.refresh()

    def _lost_of(self, names: frozenset[str]) -> Counter[str]:
        return sum((self._taps[name].lost for name in names), Counter())

    def _sort(self) -> None:
        self._takers = {
            name: tuple(sink for sink, (names, _) in self._sinks.items() if name in names)
            for name in self._taps
        }


class Intake:
    """All robots' topics, and the thread that empties their rings."""

    def __init__(self, session: zenoh.Session, site: str, ignored: Ignored) -> None:
        self._session, self._site, self._ignored = session, site, ignored
        # Held by whoever looks into the rings, or changes what is listened to.
        self.lock = threading.RLock()
        self._robots: dict[str, RobotIntake] = {}
        self._say_at = 0.0
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._run, name="intake", daemon=True)
        self._thread.start()

    def robot(self, name: str) -> RobotIntake:
        """A robot's topics; its methods are called with the lock held."""
        if name not in self._robots:
            with self.lock:
                self._robots[name] = RobotIntake(self._session, self._site, name, self._ignored)
        return self._robots[name]

    def close(self) -> None:
        """End the thread."""
        self._closed.set()
        self._thread.join()

    def _run(self) -> None:
        wait_s = _SWEEP_EVERY_S
        while not self._closed.wait(wait_s):
            begun = time.monotonic()
            with self.lock:
                for robot in tuple(self._robots.values()):
                    self._sweep(robot, begun)
            took_s = time.monotonic() - begun
            wait_s = min(max(_SWEEP_EVERY_S, took_s / _MOST_BUSY - took_s), _LONGEST_S)

    def _sweep(self, robot: RobotIntake, now_s: float) -> None:
        """Robots know nothing of each other: what fails at one message ends no recording."""
        try:
            robot.sweep()
        except Exception:
            if now_s >= self._say_at:
                self._say_at = now_s + _SAY_AGAIN_AFTER_S
                log.exception("something that came is left out of the recording")


_Ring = zenoh.Handler[zenoh.Sample]


def _ring(row: Topic) -> int:
    """Messages that a topic's ring has room for."""
    return max(round((row.rate_hz or 0.0) * _RING_S), _SMALLEST_RING)


def _subscribe(
    session: zenoh.Session, key_expr: str, row: Topic
) -> zenoh.Subscriber[_Ring] | zenoh.ext.AdvancedSubscriber[_Ring]:
    ring: zenoh.handlers.RingChannel[zenoh.Sample] = zenoh.handlers.RingChannel(_ring(row))
    if row.recovered:
        recovery = zenoh.ext.RecoveryConfig(periodic_queries=None, heartbeat=True)
        return zenoh.ext.declare_advanced_subscriber(session, key_expr, ring, recovery=recovery)
    return session.declare_subscriber(key_expr, ring)
