"""Publishers: number and timestamp messages, and answer late joiners."""

import asyncio
import secrets
import threading
import time
from collections import deque
from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any

import zenoh
import zenoh.ext
from google.protobuf.message import Message

from robomesh.contract import keys
from robomesh.contract.endpoints import wait_until_declared
from robomesh.contract.header import Header, pack
from robomesh.contract.messages import PROTOBUF
from robomesh.contract.topics import History, Topic, topic
from robomesh.publications.late_joiners import AnsweringThread
from robomesh.publications.outbox import Outbox
from robomesh.publications.wall_clock import WallClock
from robomesh.schemas.robomesh_pb2 import VideoFrames

LIST_LENGTH = 100
# Two key frame intervals at 30 Hz: a publisher that never marks a key frame must not grow.
_MOST_FRAMES = 150

OnGet = Callable[[], Awaitable[Message | None]]


class Publisher:
    """The publisher of one topic of one robot.

    Safe to use from any one thread at a time.

    Args:
        answering: Answers late joiners.
        outbox: Takes the messages, which the event loop's thread alone may then publish; None: they are put
            immediately.
    """

    def __init__(
        self,
        session: zenoh.Session,
        site: str,
        robot: str,
        name: str,
        *,
        answering: AnsweringThread,
        on_get: OnGet | None = None,
        outbox: Outbox | None = None,
    ) -> None:
        self.key = keys.robot_key(site, robot, name)
        self.topic: Topic = topic(name)
        # New at each start, so that restarted sequence numbers do not look old; and new when another clock
        # provides the source times, because receivers compare the lags of one identity (`delay.py`).
        self._identity = secrets.randbits(64)
        self._wall_clock = WallClock()
        self._dated_by: int | None = None
        self._sequence = 0
        self._closed = False
        self._outbox = outbox
        self._lock = threading.Lock()
        self._history: deque[tuple[Header, bytes]] = deque(maxlen=_history_length(self.topic))
        self._publisher: Any = _declare(session, self.key, self.topic)
        self._listener: Any = None
        self._queryable: zenoh.Queryable[None] | None = None
        if on_get is not None:
            loop = asyncio.get_running_loop()
            self._queryable = _on_query(session, self.key, lambda q: self._hand_over(q, on_get, loop))
        elif self.topic.history is not History.NONE:
            self._queryable = _on_query(
                session, self.key, lambda query: answering.add(partial(self._answer, query))
            )
        wait_until_declared(session, self.topic.priority)

    def put(
        self,
        message: Message,
        *,
        source_time_ns: int | None = None,
        dated_by: int | None = None,
        key_frame: bool = False,
    ) -> Header:
        """Publish a message of the topic's schema.

        Args:
            source_time_ns: Time of the message's contents, ns since the Unix epoch; by default now.
            dated_by: Number of the clock of that time: a publisher whose message contained it, or a
                controller's clock; None: this machine's clock. Another number starts another identity.
            key_frame: For a video topic: late joiners get the frames from this one on.

        Returns:
            The published header.
        """
        if source_time_ns is None:
            source_time_ns = time.time_ns()
        return self.put_bytes(
            message.SerializeToString(),
            source_time_ns=source_time_ns,
            dated_by=dated_by,
            key_frame=key_frame,
        )

    def put_bytes(
        self, payload: bytes, *, source_time_ns: int, dated_by: int | None = None, key_frame: bool = False
    ) -> Header:
        """Publish a serialized message; see `put`."""
        with self._lock:
            if self._clock_is_another(dated_by):
                self._identity = secrets.randbits(64)
                if self.topic.history is History.KEY_FRAME:
                    self._history.clear()
            self._sequence += 1
            header = Header(self._identity, self._sequence, source_time_ns)
            if key_frame:
                self._history.clear()
            if not (self.topic.history is History.KEY_FRAME and not (key_frame or self._history)):
                self._history.append((header, payload))
        if self._outbox is None:
            self._publisher.put(payload, attachment=pack(header))
        else:
            self._outbox.add(self._publisher, payload, pack(header))
        return header

    def _clock_is_another(self, dated_by: int | None) -> bool:
        """Return whether the clock of the source times differs from the last message's, or was set."""
        before, self._dated_by = self._dated_by, dated_by
        was_set = dated_by is None and self._wall_clock.was_set()
        return self._sequence > 0 and (dated_by != before or was_set)

    def remember(self, message: Message, *, source_time_ns: int) -> None:
        """Answer late joiners with a message without publishing it: an old value gets no new number."""
        self.remember_bytes(message.SerializeToString(), source_time_ns=source_time_ns)

    def remember_bytes(self, payload: bytes, *, source_time_ns: int) -> None:
        """Answer late joiners with a serialized message; see `remember`."""
        with self._lock:
            self._history.append((Header(self._identity, self._sequence, source_time_ns), payload))

    def forget(self) -> None:
        """Answer late joiners with nothing until the next `put` or `remember`."""
        with self._lock:
            self._history.clear()

    @property
    def published(self) -> int:
        """Number of published messages."""
        return self._sequence

    @property
    def watched(self) -> bool:
        """True while the topic has subscribers; always for recovered topics, which are rare and small."""
        if self._closed:
            return False
        if not isinstance(self._publisher, zenoh.Publisher):
            return True
        # Annotated as bool, but an object that is always true.
        status: Any = self._publisher.matching_status
        return bool(status.matching)

    def on_watched(self, changed: Callable[[], None]) -> None:
        """Call `changed` on the event loop when the first subscriber appears or the last one disappears."""
        loop = asyncio.get_running_loop()

        def hand_over(status: object) -> None:
            if not loop.is_closed():
                loop.call_soon_threadsafe(changed)

        self._listener = self._publisher.declare_matching_listener(
            zenoh.handlers.Callback(hand_over, indirect=False)
        )

    @property
    def closed(self) -> bool:
        """True after `close`."""
        return self._closed

    def close(self) -> None:
        """Stop publishing and answering."""
        if self._closed:
            return
        self._closed = True
        if self._outbox is not None:
            self._outbox.flush()
        if self._listener is not None:
            self._listener.undeclare()
        if self._queryable is not None:
            self._queryable.undeclare()
        self._publisher.undeclare()

    def _answer(self, query: zenoh.Query) -> None:
        with self._lock:
            history = list(self._history)
        with query:
            if history:
                self._reply(query, history[-1][0], _history_payload(self.topic, history))

    def _reply(self, query: zenoh.Query, header: Header, payload: bytes) -> None:
        query.reply(self.key, payload, encoding=PROTOBUF, attachment=pack(header))

    def _hand_over(self, query: zenoh.Query, on_get: OnGet, loop: asyncio.AbstractEventLoop) -> None:
        async def answer() -> None:
            with query:
                message = await on_get()
                if message is not None:
                    header = Header(self._identity, self._sequence, time.time_ns())
                    self._reply(query, header, message.SerializeToString())

        if not loop.is_closed():
            asyncio.run_coroutine_threadsafe(answer(), loop)


def _on_query(session: zenoh.Session, key: str, take: Callable[[zenoh.Query], None]) -> zenoh.Queryable[None]:
    """Declare a queryable whose callback runs on Zenoh's own thread, so it must only pass the query on."""
    return session.declare_queryable(key, zenoh.handlers.Callback(take, indirect=False))


def _history_length(row: Topic) -> int:
    match row.history:
        case History.LAST_100:
            return LIST_LENGTH
        case History.KEY_FRAME:
            return _MOST_FRAMES
        case _:
            return 1


def _history_payload(row: Topic, history: list[tuple[Header, bytes]]) -> bytes:
    """Return the answer for a late joiner as the bytes of one message."""
    if row.history_schema is None:
        return history[-1][1]
    if row.history is History.KEY_FRAME:
        frames = VideoFrames(publisher=history[0][0].publisher)
        for header, payload in history:
            frames.frames.add(sequence=header.sequence, source_time_ns=header.source_time_ns, data=payload)
        return frames.SerializeToString()
    answer = row.history_schema()
    (items,) = answer.DESCRIPTOR.fields
    getattr(answer, items.name).extend(row.schema.FromString(payload) for _, payload in history)
    return answer.SerializeToString()


def _declare(session: zenoh.Session, key: str, row: Topic) -> zenoh.Publisher | zenoh.ext.AdvancedPublisher:
    priority = getattr(zenoh.Priority, row.priority.value)
    if row.recovered:
        return zenoh.ext.declare_advanced_publisher(
            session,
            key,
            encoding=PROTOBUF,
            priority=priority,
            congestion_control=zenoh.CongestionControl.DROP,
            cache=zenoh.ext.CacheConfig(LIST_LENGTH),
            sample_miss_detection=zenoh.ext.MissDetectionConfig(heartbeat=None, sporadic_heartbeat=0.5),
            publisher_detection=True,
        )
    return session.declare_publisher(
        key, encoding=PROTOBUF, priority=priority, congestion_control=zenoh.CongestionControl.DROP
    )
