"""Chunked replies: long answers in parts, which the caller fetches at the rate of the line.

Zenoh drops a message longer than one batch if its fragments wait more than 51 ms for space in a link's
queue, so an answer of megabytes would never pass a slow line. Waiting there (`BLOCK`) would delay all
following messages at every router on the way, and close the link after 5 s. A chunk fits into a batch; a
lost chunk is requested again.

    get KEY?pieces                the answer, or its first chunk; attachment: a token and the answer's length
    get KEY?piece=TOKEN:OFFSET    the chunk at an offset
"""

import asyncio
import secrets
import struct
import time
from dataclasses import dataclass
from threading import Lock

import zenoh

from robomesh import reason_codes as codes
from robomesh.contract.messages import TEXT
from robomesh.contract.topics import Priority
from robomesh.errors import BrokenAnswerError
from robomesh.reasons import Reason
from robomesh.requests.replies import query

# Two chunks fit into one of Zenoh's batches.
CHUNK_BYTES = 30_000
_ASKING = "pieces"
_CHUNK = "piece"
_TOKEN_BYTES = 8
_OF_WHOLE = struct.Struct(f"<{_TOKEN_BYTES}sQ")
# Answers that an owner keeps while callers fetch them: total size, and time since the last request [s].
_KEPT_BYTES = 64 << 20
_KEPT_S = 60.0
# Times that a caller may fetch each chunk of its answer: chunks get lost, but the quota counts them once.
_TIMES = 4
_OFFSET_DIGITS = 12
# Most requests in parallel. Like TCP, each round doubles them until a chunk is lost; a loss halves them, and
# each further round adds one.
_MOST_AT_ONCE = 16
# Timeout of a chunk while the duration of a round is unknown [s].
_LOST_AFTER_S = 2.0
_SLACK_S = 0.5
# Wait after a loss [s], because Zenoh reports a missing owner immediately.
_AGAIN_S = 0.05
# No answer of the mesh is longer; a false length must not fill the caller's memory.
_LONGEST_BYTES = 256 << 20


@dataclass(frozen=True, slots=True)
class FirstChunk:
    """The first chunk of a long answer, with the token for the other chunks."""

    key: str
    data: bytes
    token: str
    length: int


@dataclass(slots=True)
class _Kept:
    """An answer that callers are fetching.

    Attributes:
        due: Chunks that the callers have not fetched yet; below zero: chunks sent beyond that.
        used: Time of the last request [s].
    """

    answer: bytes
    due: int = 0
    used: float = 0.0

    @property
    def chunks(self) -> int:
        """Number of chunks after the first."""
        return (len(self.answer) - 1) // CHUNK_BYTES


class ChunkedReplies:
    """An owner's answers that callers are fetching in chunks.

    Args:
        in_name: Requests carry the caller's name: an answer belongs to its caller and is sent a few times.
            Otherwise all callers share one copy of equal answers.
    """

    def __init__(self, *, in_name: bool) -> None:
        self._in_name = in_name
        self._kept: dict[str, _Kept] = {}
        self._lock = Lock()  # chunks are answered on Zenoh's thread
        self._timer: asyncio.TimerHandle | None = None

    def reply(self, query: zenoh.Query, key: str, answer: bytes, encoding: str) -> None:
        """Answer a request; with a first chunk if the answer is long and the caller accepts chunks.

        Called on the event loop.
        """
        if len(answer) <= CHUNK_BYTES or _ASKING not in _names(query):
            query.reply(key, answer, encoding=encoding)
            return
        whole = _OF_WHOLE.pack(bytes.fromhex(self._keep(answer)), len(answer))
        query.reply(key, answer[:CHUNK_BYTES], encoding=encoding, attachment=whole)

    def reply_chunk(self, query: zenoh.Query) -> bool:
        """Answer a request for a chunk; False: it is another request."""
        asked = query.parameters.get(_CHUNK)
        if asked is None:
            return False
        token, _, offset = asked.partition(":")
        readable = offset.isascii() and offset.isdigit() and len(offset) <= _OFFSET_DIGITS
        chunk = self._chunk(token, int(offset)) if readable else b""
        with query:
            if chunk:
                query.reply(str(query.key_expr), chunk)
            else:
                query.reply_err(b"this answer is no longer kept: repeat the request", encoding=TEXT)
        return True

    def _keep(self, answer: bytes) -> str:
        """Keep an answer for its caller and return its token."""
        with self._lock:
            token = self._token_of(answer)
            kept = self._kept.setdefault(token, _Kept(answer))
            kept.due, kept.used = max(kept.due, 0) + kept.chunks, time.monotonic()
            self._forget(token)
        if self._timer is None:
            self._forget_later()
        return token

    def _token_of(self, answer: bytes) -> str:
        if not self._in_name:
            for token, kept in self._kept.items():
                if kept.answer == answer:
                    return token
        return secrets.token_hex(_TOKEN_BYTES)

    def _chunk(self, token: str, offset: int) -> bytes:
        with self._lock:
            kept = self._kept.get(token)
            if kept is None or offset >= len(kept.answer):
                return b""
            kept.due, kept.used = kept.due - 1, time.monotonic()
            if self._in_name and kept.due <= -(_TIMES - 1) * kept.chunks:
                del self._kept[token]
            return kept.answer[offset : offset + CHUNK_BYTES]

    def _forget(self, asked_now: str = "") -> None:
        """Drop unused answers; above the size limit, first the fetched ones, then the least recently used."""
        now, length = time.monotonic(), sum(len(each.answer) for each in self._kept.values())
        # A caller that fetched all chunks may still miss a lost one, but an unfinished transfer would fail.
        order = sorted(self._kept, key=lambda each: (self._kept[each].due > 0, self._kept[each].used))
        for token in order:
            kept = self._kept[token]
            if token != asked_now and (length > _KEPT_BYTES or now - kept.used >= _KEPT_S):
                del self._kept[token]
                length -= len(kept.answer)

    def _forget_later(self) -> None:
        """Drop unused answers now and periodically, until none is left."""
        with self._lock:
            self._forget()
            waits = bool(self._kept)
        loop = asyncio.get_running_loop()
        self._timer = loop.call_later(_KEPT_S, self._forget_later) if waits else None


def selector(key: str) -> str:
    """Return the selector for a key that accepts a long answer in chunks."""
    return f"{key}?{_ASKING}"


def first_chunk(sample: zenoh.Sample) -> FirstChunk | None:
    """Return the first chunk in a reply; None: the reply is a complete answer."""
    attached = b"" if sample.attachment is None else sample.attachment.to_bytes()
    if len(attached) != _OF_WHOLE.size:
        return None
    token, length = _OF_WHOLE.unpack(attached)
    data = sample.payload.to_bytes()
    if len(data) != CHUNK_BYTES or not CHUNK_BYTES < length <= _LONGEST_BYTES:
        return None
    return FirstChunk(str(sample.key_expr), data, token.hex(), length)


async def fetch_whole(
    session: zenoh.Session, first: FirstChunk, priority: Priority, *, timeout_s: float
) -> bytes:
    """Fetch the rest of a long answer and return the whole, however long that takes while chunks arrive.

    Args:
        timeout_s: Longest time without a chunk [s].

    Raises:
        BrokenAnswerError: If the owner no longer keeps the answer, or no chunk arrived for `timeout_s`.
    """
    missing = list(range(CHUNK_BYTES, first.length, CHUNK_BYTES))
    taken = {0: first.data}
    at_once, patience_s, lossless = 1, _LOST_AFTER_S, True
    last_arrival = time.monotonic()
    while missing:
        began = time.monotonic()
        left_s = last_arrival + timeout_s - began
        if left_s <= 0:
            raise _broken(first, taken, codes.NO_FURTHER_PIECE(seconds=timeout_s))
        now, later = missing[:at_once], missing[at_once:]
        selectors = [f"{first.key}?{_CHUNK}={first.token}:{offset}" for offset in now]
        asked = [_ask(session, each, priority, min(patience_s, left_s)) for each in selectors]
        lost = []
        for offset, chunk in zip(now, await asyncio.gather(*asked), strict=True):
            if chunk is None:
                lost.append(offset)
            elif len(chunk) != min(CHUNK_BYTES, first.length - offset):
                # Refused, or an invalid answer of another program.
                raise _broken(first, taken, codes.PIECE_DROPPED())
            else:
                taken[offset], last_arrival = chunk, time.monotonic()
        missing = lost + later
        if lost:
            lossless, at_once = False, max(at_once // 2, 1)
            patience_s = max(patience_s, _LOST_AFTER_S) * (2 if len(lost) == len(now) else 1)
            await asyncio.sleep(_AGAIN_S)
        else:
            at_once = min(2 * at_once if lossless else at_once + 1, _MOST_AT_ONCE)
            patience_s = 2 * (time.monotonic() - began) + _SLACK_S
    return b"".join(taken[offset] for offset in sorted(taken))


def _broken(first: FirstChunk, taken: dict[int, bytes], why: Reason) -> BrokenAnswerError:
    length = sum(map(len, taken.values()))
    reason = codes.BROKEN_ANSWER(why, key=first.key, bytes=length, total=first.length)
    return BrokenAnswerError(reason)


async def _ask(session: zenoh.Session, selector: str, priority: Priority, timeout_s: float) -> bytes | None:
    """Request a chunk; return None if no reply arrived, and no bytes if the owner refused."""

    def read(reply: zenoh.Reply) -> bytes | None:
        if reply.ok is not None:
            return reply.ok.payload.to_bytes()
        # Zenoh's timeout error has another encoding.
        return b"" if reply.err is not None and str(reply.err.encoding) == TEXT else None

    found = await query(session, selector, read, priority=priority, timeout_s=timeout_s)
    return found[0] if found else None


def _names(query: zenoh.Query) -> list[str]:
    return str(query.parameters).split(";")
