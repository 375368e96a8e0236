"""Client side of requests: send a request to its owner, wait with a timeout, return its answer."""

import asyncio
import math
import secrets
from contextlib import suppress
from dataclasses import dataclass

import zenoh
from google.protobuf.message import Message

from robomesh import reason_codes as codes
from robomesh.contract import keys, topics
from robomesh.contract.endpoints import ON_THE_SECOND_LINK, wait_until_declared
from robomesh.contract.messages import PROTOBUF, TEXT, decode
from robomesh.errors import (
    BrokenAnswerError,
    BusyError,
    MessageError,
    NoAnswerError,
    QuotaError,
    RefusedError,
    RobomeshError,
)
from robomesh.reasons import Reason, pairs_of, reason_of
from robomesh.requests import chunked_replies
from robomesh.requests.replies import query
from robomesh.requests.server import AGAIN_S, BUSY, CODES, MARK_BYTES, OLD_AGAIN_S, WITHIN

_AGAIN_S = 0.05


@dataclass(frozen=True, slots=True)
class Answer:
    """One owner's answer to a request that may have many owners."""

    key: str
    message: Message | None
    error: str | None


async def ask_all(
    session: zenoh.Session,
    key: keys.Key,
    payload: bytes,
    *,
    timeout_s: float,
    silent_s: float | None = None,
) -> list[tuple[str, bytes | None, RefusedError | BrokenAnswerError | None]]:
    """Send a request and return (key, answer bytes, error) of each owner; either bytes or error is None.

    Args:
        timeout_s: Time for the owners to answer [s].
        silent_s: Longest gap between the chunks of a long answer [s]; None: `timeout_s`.
    """
    row, asked = topics.request(key.topic), str(key)
    if row.priority in ON_THE_SECOND_LINK:
        # A thread does not keep the order of requests. No command has such a priority.
        await asyncio.to_thread(wait_until_declared, session, row.priority)
    priorities = (row.priority, ON_THE_SECOND_LINK[0]) if row.both_links else (row.priority,)
    mark = secrets.token_bytes(MARK_BYTES) if row.both_links else None
    queries = [_query(session, asked, payload, priority, mark, timeout_s) for priority in priorities]
    answers: list[_Answer] = []
    for replies in asyncio.as_completed(queries):
        answers = max(answers, await replies, key=len)
        if answers:
            break
    silent_s = timeout_s if silent_s is None else silent_s
    found: list[tuple[str, bytes | None, RefusedError | BrokenAnswerError | None]] = []
    for owner, answer, refused in answers:
        if not isinstance(answer, chunked_replies.FirstChunk):
            found.append((owner, answer, refused))
            continue
        try:
            whole = await chunked_replies.fetch_whole(session, answer, row.priority, timeout_s=silent_s)
            found.append((owner, whole, None))
        except BrokenAnswerError as error:
            found.append((owner, None, error))
    return found


_Answer = tuple[str, bytes | chunked_replies.FirstChunk | None, RefusedError | None]


def _query(
    session: zenoh.Session,
    key: str,
    payload: bytes,
    priority: topics.Priority,
    mark: bytes | None,
    timeout_s: float,
) -> asyncio.Future[list[_Answer]]:
    """Send a request; return a future for the owners' answers."""

    def read(reply: zenoh.Reply) -> _Answer | None:
        if reply.ok is not None:
            # Zenoh checks that the key matches the request's.
            if keys.has_wildcard(str(reply.ok.key_expr)):
                return None
            return (
                str(reply.ok.key_expr),
                chunked_replies.first_chunk(reply.ok) or reply.ok.payload.to_bytes(),
                None,
            )
        if reply.err is not None and (encoding := str(reply.err.encoding)).startswith(TEXT):
            return key, None, _refused(reply.err.payload.to_bytes(), encoding)
        return None

    return query(
        session,
        f"{chunked_replies.selector(key)};{WITHIN}={timeout_s:.3f};{CODES}",
        read,
        priority=priority,
        timeout_s=timeout_s,
        payload=payload,
        encoding=PROTOBUF,
        attachment=mark,
    )


def _refused(words: bytes, encoding: str) -> RefusedError:
    """Return an owner's refusal. Older owners and other programs send no code."""
    text = words.decode(errors="replace")
    parameters = pairs_of(encoding.partition(";")[2])
    reason: Reason | str = reason_of(parameters, text) or text
    if BUSY in parameters:
        return BusyError(reason, text=text)
    for name in (AGAIN_S, OLD_AGAIN_S):
        with suppress(ValueError):
            again_s = float(parameters.get(name, ""))
            if math.isfinite(again_s):
                return QuotaError(reason, again_s=max(again_s, _AGAIN_S))
    return RefusedError(reason, text=text)


async def ask_bytes(session: zenoh.Session, key: keys.Key, payload: bytes, *, timeout_s: float) -> bytes:
    """Send a request to its one owner and return the answer as bytes.

    Repeats the request while the owner is starting or busy, if it dropped a long answer before the transfer
    ended, and if the quota allows a repetition before the deadline. A long answer that has begun may take
    longer than `timeout_s`.

    Raises:
        RefusedError: If the owner refused; with its sentence.
        BusyError: If the owner was busy until the deadline.
        QuotaError: If the quota is used up until after the deadline.
        NoAnswerError: If no answer arrived in time.
        BrokenAnswerError: If a long answer began and no further piece arrived for `timeout_s`.
    """
    loop = asyncio.get_running_loop()
    deadline = loop.time() + timeout_s
    again: BusyError | QuotaError | BrokenAnswerError | None = None
    while (left_s := deadline - loop.time()) > 0:
        # Zenoh reports a missing owner immediately. If an earlier attempt reached a busy owner, raise that
        # attempt's error instead.
        again_s = _AGAIN_S
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
    raise NoAnswerError(codes.NO_ANSWER(key=key, seconds=timeout_s))


def answer_of(owner: keys.Key, answer: bytes | None, refused: RobomeshError | None) -> Answer:
    """Return one owner's decoded answer, or its error; bytes that cannot be decoded are an error too."""
    if answer is None:
        return Answer(str(owner), None, None if refused is None else str(refused))
    try:
        return Answer(str(owner), decode_answer(owner, answer), None)
    except RobomeshError as error:  # one invalid answer must not hide the others
        return Answer(str(owner), None, str(error))


def decode_answer(key: keys.Key, payload: bytes) -> Message:
    """Decode an answer by the request table.

    Raises:
        MessageError: If the bytes are not the table's message.
    """
    schema = topics.request(key.topic).answer
    if schema is None:
        raise MessageError(f"{key} answers with plain bytes")
    return decode(schema, payload)
