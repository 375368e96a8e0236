"""Server side of requests: the owner handles a request on the event loop, and answers or refuses it."""

import asyncio
import logging
import math
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from functools import partial
from threading import Lock
from typing import Any

import zenoh
from google.protobuf.message import Message

from robomesh import reason_codes as codes
from robomesh.contract import keys, topics
from robomesh.contract.ignored import REQUEST, Ignored
from robomesh.contract.messages import JSON, PROTOBUF, TEXT, decode_request, encode, is_json
from robomesh.errors import BusyError, KeyNameError, MessageError, QuotaError, RefusedError
from robomesh.reasons import RETRY, Reason, to_parameters
from robomesh.requests import chunked_replies
from robomesh.requests.latencies import Latencies
from robomesh.requests.request_queue import Queue, RateLimit, RoundRobin, begin_now, paced, spilling

log = logging.getLogger(__name__)

# Encodings of refusals that may be repeated, for clients that do not ask for codes. The wait [s] follows
# the second.
OLD_AGAIN_S = "quota"
BUSY_TEXT = f"{TEXT};busy"
QUOTA_TEXT = f"{TEXT};{OLD_AGAIN_S}="
# Parameter of a request: how long the caller waits [s]. Zenoh does not send a query's timeout to the owner.
WITHIN = "within"
# Parameter of a request: the caller reads a refusal's code from the encoding, also for the two above.
CODES = "codes"
BUSY, AGAIN_S = RETRY
_LONGEST_AGAIN_S = 86_400.0
# Length of the mark on the two copies of a request sent over both links, and marks that are remembered.
MARK_BYTES = 8
_MOST_MARKS = 256
# Most unanswered requests of one row at one owner: in all, and of one caller.
_MOST = 256
_MOST_OF_ONE = 16
# Limits of the "too many requests" answers: burst, and rate [1/s].
_BUSY_BURST = 1024
_BUSY_PER_S = 250.0
_OCTETS = "application/octet-stream"


@dataclass(frozen=True, slots=True)
class Request:
    """A received request for a handler.

    Attributes:
        message: Message of the request's schema; None if the request has no schema.
        chunk: The chunk in place of the row's first `*`: the operator, the view, the shape.
        received_s: Time of arrival, before any wait (monotonic).
        within_s: How long the caller waits from then on [s]; None: unknown.
    """

    key: keys.Key
    message: Message | None
    chunk: str
    received_s: float = 0.0
    within_s: float | None = None

    @property
    def asker(self) -> str:
        """Name of the caller, for a request whose row is `in_name`."""
        return self.key.last_chunk


@dataclass(frozen=True, slots=True)
class _Arrived:
    """A request as it arrives, with its key parsed.

    Attributes:
        key: The key at this owner, also of a request with a wildcard.
        chunk: As in `Request`; `*` for a refused wildcard.
        caller: The last chunk, by which requests are limited; `*` for any key with a wildcard.
        refused: Why the key is not that of a request; None: it is.
    """

    query: zenoh.Query
    key: keys.Key
    chunk: str
    caller: str
    refused: Reason | None = None
    received_s: float = field(default_factory=time.monotonic)


Handler = Callable[[Request], Awaitable[Message | bytes]]
# Called with the chunk in place of the row's `*`, and the reason why the handler was not called.
OnRefused = Callable[[str, Reason], None]
# Returns the answer to a repeated request, which no handler sees; None: it is not a repeat. On any thread.
Recall = Callable[[], Message | None]


class RequestServer:
    """The owner of one request: answers it with a coroutine on the event loop.

    Limits the waiting requests in all and for each caller: a flooding caller gets an error, takes no other
    caller's place and delays no stop.

    Args:
        on_refused: Called for an invalid request, which no handler sees.
        recall: For stops: returns what answers a repeated one.
        ignored: Counts requests on invalid keys.

    Attributes:
        turned_away: Number of requests refused because too many were waiting.
        over_quota: Number of requests refused because of the caller's quota.
        latencies: Time from arrival to answer of the other requests.
    """

    def __init__(
        self,
        session: zenoh.Session,
        site: str,
        robot: str,
        name: str,
        handler: Handler,
        *,
        scheduler: RoundRobin,
        on_refused: OnRefused = lambda chunk, reason: None,
        recall: Recall = lambda: None,
        ignored: Ignored,
    ) -> None:
        self._recall = recall
        self._repeated = 0
        self._newest_repeated: tuple[zenoh.ZBytes | None, str, Message] | None = None
        self._ignored = ignored
        self._row = topics.request(name)
        self._own = keys.Key(site, robot, name)
        # Place of the chunk that the row leaves open, in a whole key.
        chunks = str(self._own).split("/")
        self._chunk_at = chunks.index("*") if "*" in chunks else None
        self._handler = handler
        self._on_refused = on_refused
        self._loop = asyncio.get_running_loop()
        self._tasks: set[asyncio.Task[None]] = set()
        # Answers by the mark on both copies of a request; None: the first copy waits for the loop.
        self._begun: dict[bytes, asyncio.Future[Message | bytes] | Message | None] = {}
        self._chunked = chunked_replies.ChunkedReplies(in_name=self._row.in_name)
        # By the last chunk of the key, which is the caller if the row names one.
        self._unanswered: dict[str, int] = {}
        self._waiting = 0
        self._most_of_one = _MOST_OF_ONE if "*" in name else _MOST
        self._counting = Lock()  # Zenoh's thread counts up, the loop's down
        self._scheduler = scheduler
        self._queue = Queue(limited=bool(self._row.own_link) and not self._row.unread)
        self._busy_answers = RateLimit(per_s=_BUSY_PER_S, burst=_BUSY_BURST)
        self.turned_away = self.over_quota = 0
        self.latencies = Latencies()
        self._closed = False
        # `*` in the row stays a wildcard for the caller's chunk.
        key = keys.robot_key(site, robot, name)
        self._queryable: zenoh.Queryable[Any]
        if self._row.unread:
            # Directly from Zenoh's thread, so that a stop changes threads only once.
            at_once = zenoh.handlers.Callback(paced(self._hand_over_at_once), indirect=False)
            self._queryable = session.declare_queryable(key, at_once)
        elif self._row.own_link:
            # Its queue may block a flooding sender, because the connection carries nothing else.
            in_background = self._row.priority is topics.Priority.BACKGROUND
            take = paced(self._hand_over, in_background=in_background)
            self._queryable = session.declare_queryable(key, take)
        else:
            self._queryable = session.declare_queryable(key, spilling(self._hand_over))

    @property
    def closed(self) -> bool:
        """True after `close`."""
        return self._closed

    def close(self) -> None:
        """Stop answering and cancel the running handlers."""
        if self._closed:
            return
        self._closed = True
        self._queryable.undeclare()
        for task in self._tasks:
            task.cancel()

    @property
    def waiting(self) -> int:
        """Number of requests without an answer yet."""
        return self._waiting

    @property
    def name(self) -> str:
        """Name of the request's row."""
        return self._row.name

    def _hand_over_at_once(self, query: zenoh.Query) -> None:
        """Start a stop on the event loop before all waiting requests.

        While one waits for the loop, the next ones are answered from memory or queue, so that a flood delays
        no other robot's stop. The second copy of a request gets the answer to the first one.
        """
        if self._loop.is_closed() or (arrived := self._parse(query)) is None:
            return
        mark = self._mark(query)
        with self._counting:
            first, is_copy = not self._waiting, bool(mark) and mark in self._begun
            if mark and not is_copy:
                self._remember(mark, None)
        if not first and not is_copy and (answer := self._recall()) is not None:
            self._answer_repeated(arrived, mark, answer)
        elif self._waiting >= _MOST:
            self._turn_away(query)
        else:
            begin = partial(self._start, arrived)
            self._count(arrived.caller, 1)
            if first:
                self._loop.call_soon_threadsafe(begin)
            else:
                self._scheduler.add(self._queue, begin)

    def _parse(self, query: zenoh.Query) -> _Arrived | None:
        """Parse the key of a request; drop a wildcard that does not end like the row, and return None.

        `robomesh/**` queries all last values; it must not stop a robot.
        """
        text = str(query.key_expr)
        if keys.has_wildcard(text):
            if not self._row.wildcard:
                refused = codes.WILDCARD(key=text, request=self._row.name)
                return _Arrived(query, self._own, "*", "*", refused)
            if text.rpartition("/")[2] == self._own.last_chunk:
                return _Arrived(query, self._own, "", "*")
            query.drop()
            return None
        # Zenoh passes on only keys with as many chunks as the row's.
        chunk = "" if self._chunk_at is None else text.split("/")[self._chunk_at]
        try:
            key = keys.parse_key(text)
        except KeyNameError as error:
            self._ignored.note(REQUEST, text)
            refused = codes.INVALID(error.reason)
            return _Arrived(query, self._own, chunk, text.rpartition("/")[2], refused)
        return _Arrived(query, key, chunk, key.last_chunk)

    def _answer_repeated(self, arrived: _Arrived, mark: bytes, answer: Message) -> None:
        query = arrived.query
        with query:
            self._reply(query, arrived.key, answer)
            with self._counting:
                if mark:
                    self._remember(mark, answer)
                self._repeated += 1
                self._newest_repeated = query.payload, _encoding(query), answer

    def take_repeated(self) -> tuple[int, Message, Message] | None:
        """Return how many stops were answered from memory since the last call, the newest one, its answer."""
        with self._counting:
            count, self._repeated = self._repeated, 0
        if not count or self._newest_repeated is None:
            return None
        payload, encoding, answer = self._newest_repeated
        message = self._message(b"" if payload is None else payload.to_bytes(), encoding)
        return None if message is None else (count, message, answer)

    def _hand_over(self, query: zenoh.Query) -> None:
        """Queue a request for the event loop, or refuse it if too many are waiting."""
        if self._chunked.reply_chunk(query) or (arrived := self._parse(query)) is None:
            return
        if self._waiting >= _MOST or self._unanswered.get(arrived.caller, 0) >= self._most_of_one:
            self._turn_away(query)
        else:
            self._count(arrived.caller, 1)
            self._scheduler.add(self._queue, partial(self._start, arrived))

    def _turn_away(self, query: zenoh.Query) -> None:
        self.turned_away += 1
        with query:
            # Answering costs more than reading. Without an answer Zenoh ends the query empty.
            if self._busy_answers.take(time.monotonic()):
                _refuse(query, BusyError(codes.BUSY()))

    def _count(self, caller: str, more: int) -> None:
        with self._counting:
            self._waiting += more
            count = self._unanswered.get(caller, 0) + more
            if count:
                self._unanswered[caller] = count
            else:
                del self._unanswered[caller]

    def _start(self, arrived: _Arrived) -> None:
        if self._closed:  # arrived during `close`
            arrived.query.drop()
            return
        work = self._answer(arrived)
        task = begin_now(self._loop, work) if self._row.unread else self._loop.create_task(work)
        if task is None:
            self._end(arrived)
            return
        self._tasks.add(task)
        task.add_done_callback(lambda task: self._end(arrived, task))

    def _end(self, arrived: _Arrived, task: asyncio.Task[None] | None = None) -> None:
        if task is not None:
            self._tasks.discard(task)
        self.latencies.add(time.monotonic() - arrived.received_s)
        self._count(arrived.caller, -1)

    async def _answer(self, arrived: _Arrived) -> None:
        with arrived.query as query:
            try:
                answer = await self._handled(self._read(arrived), query)
            except RefusedError as error:
                self.over_quota += isinstance(error, QuotaError)
                _refuse(query, error)
            except (MessageError, KeyNameError) as error:
                _refuse(query, RefusedError(codes.INVALID(error.reason)))
            except Exception:
                log.exception("%s: a request failed", arrived.key)
                _refuse(query, RefusedError(codes.FAILED(request=self._row.name)))
            else:
                self._reply(query, arrived.key, answer)

    def _reply(self, query: zenoh.Query, key: keys.Key, answer: Message | bytes) -> None:
        """Reply in the form of the request."""
        if isinstance(answer, bytes):
            self._chunked.reply(query, str(key), answer, _OCTETS)
        else:
            as_json = is_json(_encoding(query))
            payload = encode(answer, as_json=as_json)
            self._chunked.reply(query, str(key), payload, JSON if as_json else PROTOBUF)

    async def _handled(self, request: Request, query: zenoh.Query) -> Message | bytes:
        """Return the handler's answer; both copies of a request sent over two links get the same one."""
        mark = self._mark(query)
        if not mark:
            return await self._handler(request)
        begun = self._begun.get(mark)
        if isinstance(begun, Message):
            return begun
        if begun is not None:
            return await asyncio.shield(begun)
        begun = self._loop.create_future()
        with self._counting:
            self._remember(mark, begun)
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

    def _mark(self, query: zenoh.Query) -> bytes:
        """Return the mark on both copies of a request; empty: it has no second copy."""
        if not self._row.both_links or query.attachment is None:
            return b""
        mark = query.attachment.to_bytes()
        return mark if len(mark) == MARK_BYTES else b""

    def _remember(self, mark: bytes, answer: "asyncio.Future[Message | bytes] | Message | None") -> None:
        self._begun[mark] = answer
        if len(self._begun) > _MOST_MARKS:
            del self._begun[next(iter(self._begun))]

    def _read(self, arrived: _Arrived) -> Request:
        query = arrived.query
        try:
            if arrived.refused is not None:
                raise RefusedError(arrived.refused)
            payload = query.payload.to_bytes() if query.payload is not None else b""
            message = self._message(payload, _encoding(query))
        except (MessageError, RefusedError) as error:
            reason = codes.INVALID(error.reason) if isinstance(error, MessageError) else error.reason
            self._on_refused(arrived.chunk, reason)
            raise RefusedError(reason) from None
        return Request(arrived.key, message, arrived.chunk, arrived.received_s, _within_s(query))

    def _message(self, payload: bytes, encoding: str) -> Message | None:
        schema = self._row.request
        if schema is None:
            return None
        try:
            if len(payload) > self._row.longest:
                detail = f"at most {self._row.longest} are permitted"
                raise MessageError(
                    codes.NOT_MESSAGE(count=len(payload), message=schema.__name__, detail=detail)
                )
            return decode_request(schema, payload, encoding)
        except MessageError:
            if self._row.unread:
                return schema()
            raise


def _refuse(query: zenoh.Query, error: RefusedError) -> None:
    """Reply with the reason of a refusal."""
    if isinstance(error, BusyError):
        when, old = BUSY, BUSY_TEXT
    elif isinstance(error, QuotaError):
        again_s = min(error.again_s, _LONGEST_AGAIN_S)
        when, old = f"{AGAIN_S}={again_s:.3f}", f"{QUOTA_TEXT}{again_s:.3f}"
    else:
        when, old = "", ""
    if old and query.parameters.get(CODES) is None:
        encoding = old  # older clients compare the whole encoding
    else:
        encoding = f"{TEXT};{to_parameters(error.reason, when)}"
    query.reply_err(str(error).encode(), encoding=encoding)


def _encoding(query: zenoh.Query) -> str:
    return str(query.encoding) if query.encoding is not None else ""


def _within_s(query: zenoh.Query) -> float | None:
    try:
        within_s = float(query.parameters.get(WITHIN) or "")
    except ValueError:
        return None
    return within_s if math.isfinite(within_s) and within_s > 0 else None
