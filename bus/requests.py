"""Requests: asked with a time-out, answered on the event loop, refused in words."""

import asyncio
import logging
from collections.abc import Awaitable, Callable
from dataclasses import dataclass

import zenoh
from google.protobuf.message import Message

from bus import keys, topics
from bus.endpoints import ON_THE_SECOND_LINK, first_line, settle
from bus.errors import MessageError, NoAnswerError, RefusedError
from bus.messages import JSON, PROTOBUF, TEXT, decode, decode_request, encode, is_json

log = logging.getLogger(__name__)

_OCTETS = "application/octet-stream"
_AGAIN_S = 0.05


@dataclass(frozen=True, slots=True)
class Request:
    """A request as its handler sees it.

    Attributes:
        message: Of the request's schema; None where it has none.
        chunk: What stood in the place of the row's `*`: the operator, the view, the mesh.
    """

    key: keys.Key
    message: Message | None
    chunk: str


Handler = Callable[[Request], Awaitable[Message | bytes]]


@dataclass(frozen=True, slots=True)
class Answer:
    """One owner's answer to a request that may have many owners."""

    key: str
    message: Message | None
    error: str | None


class Answerer:
    """Answers a request's key by a coroutine; many at a time, none on Zenoh's thread."""

    def __init__(self, session: zenoh.Session, site: str, robot: str, name: str, handler: Handler) -> None:
        self._row = topics.request(name)
        self._own = keys.Key(site, robot, name)
        self._handler = handler
        self._loop = asyncio.get_running_loop()
        self._tasks: set[asyncio.Task[None]] = set()
        self._closed = False
        # `*` in the row is the asker's: one chunk.
        self._queryable = session.declare_queryable(keys.robot_key(site, robot, name), self._hand_over)

    def close(self) -> None:
        """Answer no more."""
        if self._closed:
            return
        self._closed = True
        self._queryable.undeclare()
        for task in self._tasks:
            task.cancel()

    def _hand_over(self, query: zenoh.Query) -> None:
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._start, query)

    def _start(self, query: zenoh.Query) -> None:
        task = self._loop.create_task(self._answer(query))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _answer(self, query: zenoh.Query) -> None:
        asked = str(query.key_expr)
        with query:
            key = self._own_key(asked)
            if key is None:
                return
            try:
                if "*" in asked and not self._row.wildcard:
                    raise RefusedError(f"{asked} has a wildcard: ask one {self._row.name} by its whole key")
                encoding = str(query.encoding) if query.encoding is not None else ""
                payload = query.payload.to_bytes() if query.payload is not None else b""
                message = self._read(payload, encoding)
                chunk = _chunk(self._row.name, key.topic)
                answer = await self._handler(Request(key, message, chunk))
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
                query.reply(str(key), answer, encoding=_OCTETS)
            else:
                query.reply(str(key), encode(answer, as_json=as_json), encoding=JSON if as_json else PROTOBUF)

    def _read(self, payload: bytes, encoding: str) -> Message | None:
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
        if "*" not in asked:
            return keys.parse_key(asked)
        last = self._own.topic.rsplit("/", 1)[-1]
        return self._own if not self._row.wildcard or asked.rsplit("/", 1)[-1] == last else None


def _chunk(row: str, name: str) -> str:
    for pattern, chunk in zip(row.split("/"), name.split("/"), strict=True):
        if pattern == "*":
            return chunk
    return ""


async def ask_all(
    session: zenoh.Session, key: str, payload: bytes, *, timeout_s: float
) -> list[tuple[str, bytes | None, str | None]]:
    """Every owner's (key, answer bytes, error text); exactly one of the two is there."""
    loop = asyncio.get_running_loop()
    done: asyncio.Future[None] = loop.create_future()
    answers: list[tuple[str, bytes | None, str | None]] = []

    def on_reply(reply: zenoh.Reply) -> None:
        if reply.ok is not None:
            answers.append((str(reply.ok.key_expr), reply.ok.payload.to_bytes(), None))
        elif reply.err is not None and str(reply.err.encoding).startswith(TEXT):
            answers.append((key, None, reply.err.payload.to_string()))

    def finish() -> None:
        if not done.done():
            done.set_result(None)

    def on_end() -> None:
        if not loop.is_closed():
            loop.call_soon_threadsafe(finish)

    row = topics.request(keys.parse_key(key).topic)
    if row.priority in ON_THE_SECOND_LINK:
        # In a thread, which keeps no order: never before a command.
        await asyncio.to_thread(settle, session, row.priority)
    try:
        session.get(
            key,
            zenoh.handlers.Callback(on_reply, on_end),
            payload=payload,
            encoding=PROTOBUF,
            consolidation=zenoh.ConsolidationMode.NONE,
            # The default, BLOCK, would stall joint states on a full link.
            congestion_control=zenoh.CongestionControl.DROP,
            priority=getattr(zenoh.Priority, row.priority.value),
            timeout=timeout_s,
        )
    except zenoh.ZError as error:
        raise NoAnswerError(f"{key} could not be asked: {first_line(error)}") from None
    await done
    return answers


async def ask_bytes(session: zenoh.Session, key: str, payload: bytes, *, timeout_s: float) -> bytes:
    """The one answer to a request, as bytes.

    Raises:
        RefusedError: With the owner's words.
        NoAnswerError: If nobody answered in time.
    """
    loop = asyncio.get_running_loop()
    deadline = loop.time() + timeout_s
    while (left_s := deadline - loop.time()) > 0:
        for _, answer, error in await ask_all(session, key, payload, timeout_s=left_s):
            if error is not None:
                raise RefusedError(error)
            if answer is not None:
                return answer
        # Zenoh answers at once that there is no owner; it may be starting.
        await asyncio.sleep(min(_AGAIN_S, left_s))
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
