"""Answering: a request's owner hears it on the event loop, answers it or refuses it in words."""

import asyncio
import logging
import math
import threading
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from functools import partial
from threading import Lock
from typing import Any

import zenoh
from google.protobuf.message import Message

from robomesh import keys, pieces, topics
from robomesh import reason_codes as codes
from robomesh.errors import BusyError, KeyNameError, MessageError, QuotaError, RefusedError
from robomesh.ignored import REQUEST, Ignored
from robomesh.latencies import Latencies
from robomesh.messages import JSON, PROTOBUF, TEXT, decode_request, encode, is_json
from robomesh.reasons import RETRY, to_parameters
from robomesh.request_queue import HELD, RING, Queue, RateLimit, Turns, begin_now, read

log = logging.getLogger(__name__)

# How a refusal that may be asked again is encoded for clients that do not ask for codes; behind the second:
# when to ask again [s].
OLD_AGAIN_S = "quota"
BUSY_TEXT = f"{TEXT};busy"
QUOTA_TEXT = f"{TEXT};{OLD_AGAIN_S}="
# A parameter of the question: for how many seconds its asker waits. Zenoh does not tell the owner.
WITHIN = "within"
# A parameter of the question: its asker reads a refusal's code from the encoding, those two among them.
CODES = "codes"
BUSY, AGAIN_S = RETRY
_LONGEST_AGAIN_S = 86_400.0
# Of a request that is asked over both links: what marks its two copies, and how many marks are known.
MARK_BYTES = 8
_MOST_MARKS = 256
# Of one owner's row so many have no answer yet, and so many of them are one asker's.
_MOST = 256
_MOST_OF_ONE = 16
# Limits of the "too many requests wait" answers: at once, and a second.
_BUSY_BURST = 1024
_BUSY_PER_S = 250.0
_ANYBODY = "*"
_OCTETS = "application/octet-stream"


@dataclass(frozen=True, slots=True)
class Request:
    """A request as its handler sees it.

    Attributes:
        message: Of the request's schema; None where it has none.
        chunk: What stood in the place of the row's first `*`: the operator, the view, the mesh.
        received_ns: When it came, before it waited for anything; ns since the Unix epoch.
        within_s: For how long from then on its asker waits [s]; None: the question does not say.
    """

    key: keys.Key
    message: Message | None
    chunk: str
    received_ns: int = 0
    within_s: float | None = None

    @property
    def asker(self) -> str:
        """In whose name it is asked, where its row is `in_name`."""
        return self.key.topic.rpartition("/")[2]


Handler = Callable[[Request], Awaitable[Message | bytes]]
# What stood in the place of the row's `*`, and why no handler has seen the request.
OnRefused = Callable[[str, str], None]


class Answerer:
    """Answers a request's key by a coroutine, none on Zenoh's thread.

    Some at a time, and so many of one asker: who floods an owner is told so, takes no other's place and
    delays no stop.

    Args:
        on_refused: Told of what cannot be read, or meant: no handler sees it.
        ignored: Counts requests on keys that fit no key of the contract.

    Attributes:
        turned_away: How many were told that too many wait.
        over_quota: How many were told that their asker has had its quota.
        latencies: How long the others took, from coming to their answer.
    """

    def __init__(
        self,
        session: zenoh.Session,
        site: str,
        robot: str,
        name: str,
        handler: Handler,
        *,
        turns: Turns,
        on_refused: OnRefused = lambda chunk, text: None,
        ignored: Ignored,
    ) -> None:
        self._ignored = ignored
        self._row = topics.request(name)
        self._own = keys.Key(site, robot, name)
        self._handler = handler
        self._on_refused = on_refused
        self._loop = asyncio.get_running_loop()
        self._tasks: set[asyncio.Task[None]] = set()
        self._begun: dict[bytes, asyncio.Future[Message | bytes]] = {}
        self._long = pieces.LongAnswers(in_name=self._row.in_name)
        # By the last chunk that was asked, so by asker where the row has a place for one.
        self._unanswered: dict[str, int] = {}
        self._waiting = 0
        self._most_of_one = _MOST_OF_ONE if "*" in name else _MOST
        self._counting = Lock()  # the reading thread counts up, the loop's down
        self._turns = turns
        self._queue = Queue(limited=bool(self._row.own_link))
        self._busy_answers = RateLimit(per_s=_BUSY_PER_S, burst=_BUSY_BURST)
        self.turned_away = self.over_quota = 0
        self.latencies = Latencies()
        self._closed = False
        # `*` in the row is the asker's: one chunk.
        key = keys.robot_key(site, robot, name)
        self._queryable: zenoh.Queryable[Any]
        if self._row.unread:
            # Straight from Zenoh's thread: a stop changes threads once.
            at_once = zenoh.handlers.Callback(self._hand_over_at_once, indirect=False)
            self._queryable = session.declare_queryable(key, at_once)
        else:
            self._queryable = session.declare_queryable(
                key,
                # Alone on its connection it may hold up who asks too much; else the newest count.
                zenoh.handlers.FifoChannel(HELD) if self._row.own_link else zenoh.handlers.RingChannel(RING),
            )
            reading = (self._queryable.handler, self._hand_over)
            # No daemon, as in `Subscription`.
            threading.Thread(target=read, args=reading, name=f"read {key}").start()

    @property
    def closed(self) -> bool:
        """Whether it was closed."""
        return self._closed

    def close(self) -> None:
        """Answer no more."""
        if self._closed:
            return
        self._closed = True
        self._queryable.undeclare()
        for task in self._tasks:
            task.cancel()

    @property
    def waiting(self) -> int:
        """How many requests have no answer yet."""
        return self._waiting

    @property
    def name(self) -> str:
        """Of its row."""
        return self._row.name

    def _hand_over_at_once(self, query: zenoh.Query) -> None:
        """Start on the event loop, whatever waits: a stop is a stop."""
        if not self._loop.is_closed():
            self._count(_ANYBODY, 1)
            self._loop.call_soon_threadsafe(self._start, query, _ANYBODY, time.time_ns())

    def _hand_over(self, query: zenoh.Query) -> None:
        """Start on the event loop in its turn, or say that too many wait."""
        if self._long.reply_piece(query):
            return
        received_ns = time.time_ns()
        asker = _last_chunk(str(query.key_expr))
        if self._waiting >= _MOST or self._unanswered.get(asker, 0) >= self._most_of_one:
            self._turn_away(query)
        else:
            self._count(asker, 1)
            self._turns.add(self._queue, partial(self._start, query, asker, received_ns))

    def _turn_away(self, query: zenoh.Query) -> None:
        self.turned_away += 1
        with query:
            # To answer costs more than to read; Zenoh says to those who are left out that nothing came.
            if self._busy_answers.take(time.monotonic()):
                _refuse(query, BusyError(codes.BUSY()))

    def _count(self, asker: str, more: int) -> None:
        with self._counting:
            self._waiting += more
            count = self._unanswered.get(asker, 0) + more
            if count:
                self._unanswered[asker] = count
            else:
                del self._unanswered[asker]

    def _start(self, query: zenoh.Query, asker: str, received_ns: int) -> None:
        if self._closed:  # it came in the last moment: nothing is done for it any more
            query.drop()
            return
        work = self._answer(query, received_ns)
        task = begin_now(self._loop, work) if self._row.unread else self._loop.create_task(work)
        if task is None:
            self._end(asker, received_ns)
            return
        self._tasks.add(task)
        task.add_done_callback(lambda task: self._done(task, asker, received_ns))

    def _done(self, task: asyncio.Task[None], asker: str, received_ns: int) -> None:
        self._tasks.discard(task)
        self._end(asker, received_ns)

    def _end(self, asker: str, received_ns: int) -> None:
        self.latencies.add((time.time_ns() - received_ns) * 1e-9)
        self._count(asker, -1)

    async def _answer(self, query: zenoh.Query, received_ns: int) -> None:
        asked = str(query.key_expr)
        with query:
            key = self._own_key(asked)
            if key is None:
                return
            encoding = str(query.encoding) if query.encoding is not None else ""
            try:
                request = self._read(key, query, encoding, received_ns)
                answer = await self._handled(request, query)
            except RefusedError as error:
                self.over_quota += isinstance(error, QuotaError)
                _refuse(query, error)
                return
            except (MessageError, KeyNameError) as error:
                _refuse(query, RefusedError(codes.INVALID(detail=error)))
                return
            except Exception:
                log.exception("%s: a request failed", key)
                _refuse(query, RefusedError(codes.FAILED(request=self._row.name)))
                return
            as_json = is_json(encoding)
            if isinstance(answer, bytes):
                self._long.reply(query, str(key), answer, _OCTETS)
            else:
                payload = encode(answer, as_json=as_json)
                self._long.reply(query, str(key), payload, JSON if as_json else PROTOBUF)

    async def _handled(self, request: Request, query: zenoh.Query) -> Message | bytes:
        """The handler's answer; of two copies of one request, which came over two links, the same."""
        mark = query.attachment.to_bytes() if query.attachment is not None else b""
        if not self._row.both_links or len(mark) != MARK_BYTES:
            return await self._handler(request)
        if (begun := self._begun.get(mark)) is not None:
            return await asyncio.shield(begun)
        begun = self._begun[mark] = self._loop.create_future()
        if len(self._begun) > _MOST_MARKS:
            del self._begun[next(iter(self._begun))]
        try:
            answer = await self._handler(request)
        except asyncio.CancelledError:
            begun.cancel()
            raise
        except Exception as error:
            begun.set_exception(error)
            begun.exception()  # the other copy may have been lost
            raise
        begun.set_result(answer)
        return answer

    def _read(self, key: keys.Key, query: zenoh.Query, encoding: str, received_ns: int) -> Request:
        asked, chunk = str(query.key_expr), _chunk(self._row.name, key.topic)
        try:
            if keys.has_wildcard(asked):
                if not self._row.wildcard:
                    raise RefusedError(codes.WILDCARD(key=asked, request=self._row.name))
            elif self._ignored.key(REQUEST, asked) is None:
                keys.parse_key(asked)  # says why
            payload = query.payload.to_bytes() if query.payload is not None else b""
            message = self._message(payload, encoding)
            return Request(key, message, chunk, received_ns, _within_s(query))
        except (RefusedError, MessageError, KeyNameError) as error:
            self._on_refused(chunk, str(error))
            raise

    def _message(self, payload: bytes, encoding: str) -> Message | None:
        schema = self._row.request
        if schema is None:
            return None
        try:
            return decode_request(schema, payload, encoding)
        except MessageError:
            if self._row.unread:
                return schema()
            raise

    def _own_key(self, asked: str) -> keys.Key | None:
        """The own key that was asked; None: a wildcard that does not name the request `stop`.

        `robomesh/**` asks for everybody's last values: it must not stop a robot.
        """
        if not keys.has_wildcard(asked):
            return keys.parse_expression(asked)
        last = self._own.topic.rsplit("/", 1)[-1]
        return self._own if not self._row.wildcard or asked.rsplit("/", 1)[-1] == last else None


def _refuse(query: zenoh.Query, error: RefusedError) -> None:
    """Answer with the reason of a refusal."""
    if isinstance(error, BusyError):
        when, old = BUSY, BUSY_TEXT
    elif isinstance(error, QuotaError):
        again_s = min(error.again_s, _LONGEST_AGAIN_S)
        when, old = f"{AGAIN_S}={again_s:.3f}", f"{QUOTA_TEXT}{again_s:.3f}"
    else:
        when, old = "", ""
    if old and query.parameters.get(CODES) is None:
        encoding = old  # an older client knows nothing else
    else:
        encoding = f"{TEXT};{to_parameters(error.reason, when)}"
    query.reply_err(str(error).encode(), encoding=encoding)


def _within_s(query: zenoh.Query) -> float | None:
    try:
        within_s = float(query.parameters.get(WITHIN) or "")
    except ValueError:
        return None
    return within_s if math.isfinite(within_s) and within_s > 0 else None


def _last_chunk(asked: str) -> str:
    """Whose place a request takes; all wildcards share one, however they are spelt."""
    return "*" if keys.has_wildcard(asked) else asked.rpartition("/")[2]


def _chunk(row: str, name: str) -> str:
    for pattern, chunk in zip(row.split("/"), name.split("/"), strict=True):
        if pattern == "*":
            return chunk
    return ""
