"""Long answers, in pieces: whoever asks takes them at the pace of the line between.

A message longer than one of Zenoh's batches is dropped when its fragments wait longer than 51 ms for places
in a link's queue: an answer of megabytes would never pass a slow line. To wait there (`BLOCK`) would hold up
what comes behind it at every router on the way, and close the link after 5 s. A piece finds its place or is
lost alone, and what was lost is asked for again.

    get KEY?pieces                the answer, or its first piece; attached: a token, and how long the whole is
    get KEY?piece=TOKEN:OFFSET    the piece that begins there
"""

import asyncio
import secrets
import struct
import time
from dataclasses import dataclass
from threading import Lock

import zenoh

from robomesh.endpoints import first_line
from robomesh.errors import BrokenAnswerError, NoAnswerError
from robomesh.messages import TEXT

# Two of them fit into one of Zenoh's batches.
PIECE_BYTES = 30_000
_ASKING = "pieces"
_PIECE = "piece"
_TOKEN_BYTES = 8
_OF_WHOLE = struct.Struct(f"<{_TOKEN_BYTES}sQ")
# What an owner keeps for those who are still taking it: this much, for so long after it was last asked for.
_KEPT_BYTES = 64 << 20
_KEPT_S = 60.0
# An answer of one name's gives out its pieces so many times: some are lost, but its quota counts it once.
_TIMES = 4
_OFFSET_DIGITS = 12
# At once, as TCP does it: twice as many a round until something is lost; then half, and one more a round.
_MOST_AT_ONCE = 16
# What has not come by then counts as lost, while nobody knows how long a round takes.
_LOST_AFTER_S = 2.0
_SLACK_S = 0.5
# Zenoh says at once that there is no owner.
_AGAIN_S = 0.05
# No answer of the mesh is longer; whoever says so must not fill the asker's memory.
_LONGEST_BYTES = 256 << 20


@dataclass(frozen=True, slots=True)
class First:
    """The first piece of a long answer, and what names the others."""

    key: str
    data: bytes
    token: str
    length: int


@dataclass(slots=True)
class _Kept:
    """An answer that is being taken.

    Attributes:
        due: Pieces that those who asked have yet to take; below zero: so many were given out beyond that.
        used: When it was last asked for [s].
    """

    answer: bytes
    due: int = 0
    used: float = 0.0

    @property
    def pieces(self) -> int:
        """How many there are behind the first."""
        return (len(self.answer) - 1) // PIECE_BYTES


class LongAnswers:
    """An owner's answers that somebody is taking in pieces.

    Args:
        in_name: They are asked for in a name: each belongs to whoever asked, and is given out a few times.
            Otherwise the same answer is kept once for all who ask.
    """

    def __init__(self, *, in_name: bool) -> None:
        self._in_name = in_name
        self._kept: dict[str, _Kept] = {}
        self._lock = Lock()  # pieces are answered on Zenoh's thread
        self._timer: asyncio.TimerHandle | None = None

    def reply(self, query: zenoh.Query, key: str, answer: bytes, encoding: str) -> None:
        """Answer a request, by a first piece where the whole is long and who asks takes pieces.

        Called on the event loop.
        """
        if len(answer) <= PIECE_BYTES or _ASKING not in _names(query):
            query.reply(key, answer, encoding=encoding)
            return
        whole = _OF_WHOLE.pack(bytes.fromhex(self._keep(answer)), len(answer))
        query.reply(key, answer[:PIECE_BYTES], encoding=encoding, attachment=whole)

    def reply_piece(self, query: zenoh.Query) -> bool:
        """Answer a question for a piece; False: it is none."""
        asked = query.parameters.get(_PIECE)
        if asked is None:
            return False
        token, _, offset = asked.partition(":")
        readable = offset.isascii() and offset.isdigit() and len(offset) <= _OFFSET_DIGITS
        piece = self._piece(token, int(offset)) if readable else b""
        with query:
            if piece:
                query.reply(str(query.key_expr), piece)
            else:
                query.reply_err(b"no such piece of an answer is here: ask anew", encoding=TEXT)
        return True

    def _keep(self, answer: bytes) -> str:
        """Keep an answer for one who asked; its token."""
        with self._lock:
            token = self._token_of(answer)
            kept = self._kept.setdefault(token, _Kept(answer))
            kept.due, kept.used = max(kept.due, 0) + kept.pieces, time.monotonic()
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

    def _piece(self, token: str, offset: int) -> bytes:
        with self._lock:
            kept = self._kept.get(token)
            if kept is None or offset >= len(kept.answer):
                return b""
            kept.due, kept.used = kept.due - 1, time.monotonic()
            if self._in_name and kept.due <= -(_TIMES - 1) * kept.pieces:
                del self._kept[token]
            return kept.answer[offset : offset + PIECE_BYTES]

    def _forget(self, asked_now: str = "") -> None:
        """What is unused; and where it is too much, first what was taken, then what waits longest."""
        now, length = time.monotonic(), sum(len(each.answer) for each in self._kept.values())
        # Whoever took all of it may have lost a piece, but who is still taking has lost all without it.
        order = sorted(self._kept, key=lambda each: (self._kept[each].due > 0, self._kept[each].used))
        for token in order:
            kept = self._kept[token]
            if token != asked_now and (length > _KEPT_BYTES or now - kept.used >= _KEPT_S):
                del self._kept[token]
                length -= len(kept.answer)

    def _forget_later(self) -> None:
        """An owner that nobody asks any more keeps nothing."""
        with self._lock:
            self._forget()
            waits = bool(self._kept)
        loop = asyncio.get_running_loop()
        self._timer = loop.call_later(_KEPT_S, self._forget_later) if waits else None


def selector(key: str) -> str:
    """What asks for a key and takes a long answer in pieces."""
    return f"{key}?{_ASKING}"


def first_of(sample: zenoh.Sample) -> First | None:
    """What a reply is the first piece of; None: it is whole."""
    attached = b"" if sample.attachment is None else sample.attachment.to_bytes()
    if len(attached) != _OF_WHOLE.size:
        return None
    token, length = _OF_WHOLE.unpack(attached)
    data = sample.payload.to_bytes()
    if len(data) != PIECE_BYTES or not PIECE_BYTES < length <= _LONGEST_BYTES:
        return None
    return First(str(sample.key_expr), data, token.hex(), length)


async def whole(session: zenoh.Session, first: First, priority: zenoh.Priority, *, timeout_s: float) -> bytes:
    """Take the rest of a long answer, however long that takes, as long as pieces come.

    Args:
        timeout_s: How long none may come [s].

    Raises:
        BrokenAnswerError: If its owner has it no more, or no piece came for so long.
    """
    missing = list(range(PIECE_BYTES, first.length, PIECE_BYTES))
    taken = {0: first.data}
    at_once, patience_s, lossless = 1, _LOST_AFTER_S, True
    came = time.monotonic()
    while missing:
        began = time.monotonic()
        left_s = came + timeout_s - began
        if left_s <= 0:
            raise _broken(first, taken, f"then none for {timeout_s:g} s")
        now, later = missing[:at_once], missing[at_once:]
        selectors = [f"{first.key}?{_PIECE}={first.token}:{offset}" for offset in now]
        asked = [_ask(session, each, priority, min(patience_s, left_s)) for each in selectors]
        lost = []
        for offset, piece in zip(now, await asyncio.gather(*asked), strict=True):
            if piece is None:
                lost.append(offset)
            elif len(piece) != min(PIECE_BYTES, first.length - offset):
                # Refused, or another's nonsense.
                raise _broken(first, taken, "then its owner had it no more: ask again")
            else:
                taken[offset], came = piece, time.monotonic()
        missing = lost + later
        if lost:
            lossless, at_once = False, max(at_once // 2, 1)
            patience_s = max(patience_s, _LOST_AFTER_S) * (2 if len(lost) == len(now) else 1)
            await asyncio.sleep(_AGAIN_S)
        else:
            at_once = min(2 * at_once if lossless else at_once + 1, _MOST_AT_ONCE)
            patience_s = 2 * (time.monotonic() - began) + _SLACK_S
    return b"".join(taken[offset] for offset in sorted(taken))


def _broken(first: First, taken: dict[int, bytes], why: str) -> BrokenAnswerError:
    came = sum(map(len, taken.values()))
    return BrokenAnswerError(f"{first.key}: {came} of {first.length} bytes came, {why}")


async def _ask(
    session: zenoh.Session, asked: str, priority: zenoh.Priority, timeout_s: float
) -> bytes | None:
    """A piece; None: nothing came; empty: it was refused."""
    loop = asyncio.get_running_loop()
    done: asyncio.Future[bytes | None] = loop.create_future()
    answers: list[bytes] = []

    def on_reply(reply: zenoh.Reply) -> None:
        if reply.ok is not None:
            answers.append(reply.ok.payload.to_bytes())
        # Zenoh's own, that the time is over, has another encoding.
        elif reply.err is not None and str(reply.err.encoding) == TEXT:
            answers.append(b"")

    def finish() -> None:
        if not done.done():
            done.set_result(answers[0] if answers else None)

    def on_end() -> None:
        if not loop.is_closed():
            loop.call_soon_threadsafe(finish)

    try:
        session.get(
            asked,
            zenoh.handlers.Callback(on_reply, on_end),
            target=zenoh.QueryTarget.ALL,
            consolidation=zenoh.ConsolidationMode.NONE,
            congestion_control=zenoh.CongestionControl.DROP,
            priority=priority,
            timeout=timeout_s,
        )
    except zenoh.ZError as error:
        raise NoAnswerError(f"{asked} could not be asked: {first_line(error)}") from None
    return await done


def _names(query: zenoh.Query) -> list[str]:
    return str(query.parameters).split(";")
