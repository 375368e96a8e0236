"""Requests: asked with a time-out, answered on the event loop, refused in words."""

import asyncio
import logging
import math
import secrets
import time
from collections import Counter
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from threading import Lock

import zenoh
from google.protobuf.message import Message

from bus import keys, pieces, topics
from bus.endpoints import ON_THE_SECOND_LINK, first_line, settle
from bus.errors import (
    BrokenAnswerError,
    BusyError,
    MessageError,
    NoAnswerError,
    QuotaError,
    RefusedError,
)
from bus.latencies import Latencies
from bus.messages import JSON, PROTOBUF, TEXT, decode, decode_request, encode, is_json

log = logging.getLogger(__name__)

_OCTETS = "application/octet-stream"
_AGAIN_S = 0.05
# Of one owner's row so many have no answer yet, and so many of them are one asker's.
_MOST = 256
_MOST_OF_ONE = 16
# Of a request that is asked over both links: what marks its two copies, and how many marks are known.
_MARK_BYTES = 8
_MOST_MARKS = 256
_BUSY = "too many requests wait for this owner already: ask again, and less often"
_BUSY_TEXT = f"{TEXT};busy"
# Behind it: when to ask again [s].
_QUOTA_TEXT = f"{TEXT};quota="


@dataclass(frozen=True, slots=True)
class Request:
    """A request as its handler sees it.

    Attributes:
        message: Of the request's schema; None where it has none.
        chunk: What stood in the place of the row's first `*`: the operator, the view, the mesh.
        received_ns: When it came, before it waited for anything; ns since the Unix epoch.
    """

    key: keys.Key
    message: Message | None
    chunk: str
    received_ns: int = 0

    @property
    def asker(self) -> str:
        """In whose name it is asked, where its row is `in_name`."""
        return self.key.topic.rpartition("/")[2]


Handler = Callable[[Request], Awaitable[Message | bytes]]
# What stood in the place of the row's `*`, and why no handler has seen the request.
OnRefused = Callable[[str, str], None]


@dataclass(frozen=True, slots=True)
class Answer:
    """One owner's answer to a request that may have many owners."""

    key: str
    message: Message | None
    error: str | None


class Answerer:
    """Answers a request's key by a coroutine, none on Zenoh's thread.

    Some at a time, and so many of one asker: who floods an owner is told so, takes no other's place and
    delays no stop.

    Args:
        on_refused: Told of what cannot be read, or meant: no handler sees it.

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
        on_refused: OnRefused = lambda chunk, text: None,
    ) -> None:
        self._row = topics.request(name)
        self._own = keys.Key(site, robot, name)
        self._handler = handler
        self._on_refused = on_refused
        self._loop = asyncio.get_running_loop()
        self._tasks: set[asyncio.Task[None]] = set()
        self._begun: dict[bytes, asyncio.Future[Message | bytes]] = {}
        self._long = pieces.LongAnswers(in_name=self._row.in_name)
        # By the last chunk that was asked, so by asker where the row has a place for one.
        self._unanswered = Counter[str]()
        self._most_of_one = _MOST_OF_ONE if "*" in name else _MOST
        self._counting = Lock()  # Zenoh's thread counts up, the loop's down
        self.turned_away = self.over_quota = 0
        self.latencies = Latencies()
        self._closed = False
        # `*` in the row is the asker's: one chunk.
        self._queryable = session.declare_queryable(keys.robot_key(site, robot, name), self._hand_over)

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
    def name(self) -> str:
        """Of its row."""
        return self._row.name

    def _hand_over(self, query: zenoh.Query) -> None:
        if self._long.reply_piece(query):
            return
        received_ns = time.time_ns()
        asker = _last_chunk(str(query.key_expr))
        with self._counting:
            busy = self._unanswered.total() >= _MOST or self._unanswered[asker] >= self._most_of_one
            if not busy or self._row.unread:  # a stop is a stop
                self._unanswered[asker] += 1
            else:
                self.turned_away += 1
        if busy and not self._row.unread:
            with query:
                query.reply_err(_BUSY.encode(), encoding=_BUSY_TEXT)
        elif not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._start, query, asker, received_ns)

    def _start(self, query: zenoh.Query, asker: str, received_ns: int) -> None:
        task = self._loop.create_task(self._answer(query, received_ns))
        self._tasks.add(task)
        task.add_done_callback(lambda task: self._done(task, asker, received_ns))

    def _done(self, task: asyncio.Task[None], asker: str, received_ns: int) -> None:
        self._tasks.discard(task)
        self.latencies.add((time.time_ns() - received_ns) * 1e-9)
        with self._counting:
            self._unanswered[asker] -= 1
            if not self._unanswered[asker]:
                del self._unanswered[asker]

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
            except QuotaError as error:
                self.over_quota += 1
                query.reply_err(str(error).encode(), encoding=f"{_QUOTA_TEXT}{error.again_s:.3f}")
                return
            except (RefusedError, MessageError) as error:
                query.reply_err(str(error).encode(), encoding=TEXT)
                return
            except Exception:
                log.exception("%s: a request failed", key)
                query.reply_err(
                    f"{self._row.name} failed at its owner; its log says why".encode(), encoding=TEXT
                )
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
        if not self._row.both_links or len(mark) != _MARK_BYTES:
            return await self._handler(request)
        begun = self._begun.get(mark)
        if begun is None:
            begun = self._begun[mark] = asyncio.ensure_future(self._handler(request))
            if len(self._begun) > _MOST_MARKS:
                del self._begun[next(iter(self._begun))]
        return await begun

    def _read(self, key: keys.Key, query: zenoh.Query, encoding: str, received_ns: int) -> Request:
        asked, chunk = str(query.key_expr), _chunk(self._row.name, key.topic)
        try:
            if keys.has_wildcard(asked) and not self._row.wildcard:
                raise RefusedError(f"{asked} has a wildcard: ask one {self._row.name} by its whole key")
            payload = query.payload.to_bytes() if query.payload is not None else b""
            return Request(key, self._message(payload, encoding), chunk, received_ns)
        except (RefusedError, MessageError) as error:
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
            return keys.parse_key(asked)
        last = self._own.topic.rsplit("/", 1)[-1]
        return self._own if not self._row.wildcard or asked.rsplit("/", 1)[-1] == last else None


def _last_chunk(asked: str) -> str:
    """Whose place a request takes; all wildcards share one, however they are spelt."""
    return "*" if keys.has_wildcard(asked) else asked.rpartition("/")[2]


def _chunk(row: str, name: str) -> str:
    for pattern, chunk in zip(row.split("/"), name.split("/"), strict=True):
        if pattern == "*":
            return chunk
    return ""


async def ask_all(
    session: zenoh.Session,
    key: str,
    payload: bytes,
    *,
    timeout_s: float,
    silent_s: float | None = None,
) -> list[tuple[str, bytes | None, RefusedError | BrokenAnswerError | None]]:
    """Every owner's (key, answer bytes, error); exactly one of the two is there.

    Args:
        timeout_s: How long owners may take to answer [s].
        silent_s: How long nothing more of a long answer may come [s]; None: as long.
    """
    loop = asyncio.get_running_loop()
    row = topics.request(keys.parse_key(key).topic)
    if row.priority in ON_THE_SECOND_LINK:
        # In a thread, which keeps no order: never before a command.
        await asyncio.to_thread(settle, session, row.priority)
    priorities = (row.priority, ON_THE_SECOND_LINK[0]) if row.both_links else (row.priority,)
    mark = secrets.token_bytes(_MARK_BYTES) if row.both_links else None
    asked = [loop.create_future() for _ in priorities]
    for priority, done in zip(priorities, asked, strict=True):
        try:
            _get(session, key, payload, priority, mark, timeout_s, done)
        except zenoh.ZError as error:
            raise NoAnswerError(f"{key} could not be asked: {first_line(error)}") from None
    answers: _Answers = []
    for done in asyncio.as_completed(asked):
        answers = max(answers, await done, key=len)
        if answers:
            break
    silent_s = timeout_s if silent_s is None else silent_s
    found: list[tuple[str, bytes | None, RefusedError | BrokenAnswerError | None]] = []
    for owner, answer, refused in answers:
        if not isinstance(answer, pieces.First):
            found.append((owner, answer, refused))
            continue
        try:
            whole = await pieces.whole(session, answer, _zenoh(row.priority), timeout_s=silent_s)
            found.append((owner, whole, None))
        except BrokenAnswerError as error:
            found.append((owner, None, error))
    return found


_Answers = list[tuple[str, bytes | pieces.First | None, RefusedError | None]]


def _get(
    session: zenoh.Session,
    key: str,
    payload: bytes,
    priority: topics.Priority,
    mark: bytes | None,
    timeout_s: float,
    done: asyncio.Future[_Answers],
) -> None:
    """Ask, and hand every owner's answer over when the last is there, or the time is over."""
    loop = done.get_loop()
    answers: _Answers = []

    def on_reply(reply: zenoh.Reply) -> None:
        if reply.ok is not None:
            # Zenoh sees to it that it is a key that was asked.
            if not keys.has_wildcard(str(reply.ok.key_expr)):
                answer = pieces.first_of(reply.ok) or reply.ok.payload.to_bytes()
                answers.append((str(reply.ok.key_expr), answer, None))
        elif reply.err is not None and (encoding := str(reply.err.encoding)).startswith(TEXT):
            answers.append((key, None, _refused(reply.err.payload.to_string(), encoding)))

    def finish() -> None:
        if not done.done():
            done.set_result(answers)

    def on_end() -> None:
        if not loop.is_closed():
            loop.call_soon_threadsafe(finish)

    session.get(
        pieces.selector(key),
        zenoh.handlers.Callback(on_reply, on_end),
        payload=payload,
        encoding=PROTOBUF,
        attachment=mark,
        # Else one who calls himself complete would be asked in the owner's place.
        target=zenoh.QueryTarget.ALL,
        consolidation=zenoh.ConsolidationMode.NONE,
        # The default, BLOCK, would stall joint states on a full link.
        congestion_control=zenoh.CongestionControl.DROP,
        priority=_zenoh(priority),
        timeout=timeout_s,
    )


def _zenoh(priority: topics.Priority) -> zenoh.Priority:
    found: zenoh.Priority = getattr(zenoh.Priority, priority.value)
    return found


def _refused(text: str, encoding: str) -> RefusedError:
    """What an owner's refusal means, by how it is encoded."""
    if encoding == _BUSY_TEXT:
        return BusyError(text)
    if encoding.startswith(_QUOTA_TEXT):
        try:
            again_s = float(encoding.removeprefix(_QUOTA_TEXT))
        except ValueError:
            again_s = math.nan
        if math.isfinite(again_s):  # else another's nonsense: a refusal all the same
            return QuotaError(text, again_s=max(again_s, _AGAIN_S))
    return RefusedError(text)


async def ask_bytes(session: zenoh.Session, key: str, payload: bytes, *, timeout_s: float) -> bytes:
    """The one answer to a request, as bytes.

    An owner who is busy or starting, or has forgotten a long answer before it was taken, is asked again, and
    so is one whose quota gives something in time. A long answer that has begun may take longer.

    Raises:
        RefusedError: With the owner's words.
        BusyError: If the owner had no place for it, until the end.
        QuotaError: If the quota gives nothing before the end.
        NoAnswerError: If nobody answered in time.
        BrokenAnswerError: If nothing more of a long answer came for the whole of that time.
    """
    loop = asyncio.get_running_loop()
    deadline = loop.time() + timeout_s
    again: BusyError | QuotaError | BrokenAnswerError | None = None
    while (left_s := deadline - loop.time()) > 0:
        # Zenoh answers at once that there is no owner.
        again, again_s = None, _AGAIN_S
        for _, answer, error in await ask_all(session, key, payload, timeout_s=left_s, silent_s=timeout_s):
            if isinstance(error, BusyError | BrokenAnswerError):
                again = error
            elif isinstance(error, QuotaError) and error.again_s < deadline - loop.time():
                again, again_s = error, error.again_s
            elif error is not None:
                raise error
            elif answer is not None:
                return answer
        await asyncio.sleep(min(again_s, left_s))
    if again is not None:
        raise again
    raise NoAnswerError(f"nobody answered {key} within {timeout_s:g} s: is its service running?")


def decode_answer(key: str, payload: bytes) -> Message:
    """An answer by the request table.

    Raises:
        MessageError: If the bytes are not that message.
    """
    schema = topics.request(keys.parse_key(key).topic).answer
    if schema is None:
        raise MessageError(f"{key} answers with plain bytes")
    return decode(schema, payload)
