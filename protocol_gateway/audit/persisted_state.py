"""What a gateway must remember across its own restart: the stop that was latched, and whose motion may still
run. It is in the audit log; the latch and the newest stop's number are in the latch file (`latch`) too, which
a full disk takes. Where that one knows a newer stop, it wins.

A log's live file begins with an entry ROTATE that carries what the older files leave behind, so that
a start reads one file, however long the log has become.
"""

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, NamedTuple

from protocol_gateway.audit.entry import Entry, Outcome
from protocol_gateway.audit.latch import LatchState
from protocol_gateway.authority.lease_rules import Authority, Stop

ROTATE = "ROTATE"
UNKNOWN = "audit log damaged: whether a stop was latched is not known"
LATCH_UNKNOWN = "latch file damaged: whether a stop was latched is not known"
_MOTIONS = ("HOME", "RESUME", "MOVE_ABSOLUTE", "MOVE_RELATIVE")
_LEASE_ENDS = ("RELEASE", "EXPIRE", "REVOKE", "TAKE", "ACCEPT")
_STOPS = tuple(f'"request":"{name}"'.encode() for name in ("STOP", "RESET", ROTATE))
_REQUESTS = tuple(f'"request":"{name}"'.encode() for name in (*_MOTIONS, *_LEASE_ENDS))


@dataclass(frozen=True, kw_only=True)
class Memory:
    """What a log leaves behind.

    Attributes:
        cleared: A stop whose RESET is written down, but may not have been sent.
        mover: Who commanded motion under a lease of which no end is written: the gateway was killed.
    """

    stop: Stop | None = None
    cleared: Stop | None = None
    last_stop_id: int = 0
    mover: str = ""

    @property
    def authority(self) -> Authority:
        """Nobody in control, the last stop latched if none reset it."""
        return Authority(stop=self.stop, last_stop_id=self.last_stop_id)


NOTHING = Memory()


def concerns(line: bytes) -> bool:
    """Whether a log's line may change what is remembered; quicker than to parse it."""
    return concerns_stop(line) or any(request in line for request in _REQUESTS)


def concerns_stop(line: bytes) -> bool:
    """Whether a log's line, or a part of one, may change whether a stop is latched."""
    return any(request in line for request in _STOPS)


def begins_file(line: bytes) -> bool:
    """Whether a log's line is one with which a new file begins."""
    return _STOPS[-1] in line


def follow(memory: Memory, entry: Entry) -> Memory:
    """What is remembered after one more entry."""
    number = _number(entry.values.get("stop_id", ""))
    # Stops that were counted in a flood are written after newer ones.
    if entry.request == "STOP" and number > memory.last_stop_id:
        reason = entry.values.get("reason", "")
        latched = Stop(id=number, by=entry.operator, reason=reason, since_ns=entry.time_ns)
        return replace(memory, stop=latched, last_stop_id=number, mover="")
    if entry.request in _MOTIONS and entry.outcome is Outcome.ACCEPTED:
        return replace(memory, mover=entry.operator)
    if entry.request in _LEASE_ENDS and entry.outcome is Outcome.ACCEPTED:
        return replace(memory, mover="")
    if entry.request == "RESET" and entry.outcome is Outcome.ACCEPTED:
        if memory.stop is not None and memory.stop.id == number:
            return replace(memory, stop=None, cleared=memory.stop)
        return replace(memory, cleared=None)
    if entry.request == "RESET" and entry.outcome is Outcome.FAILED:
        # It was written down before it was sent, and then it was not sent.
        return replace(memory, stop=memory.stop or memory.cleared, cleared=None)
    if entry.request == ROTATE:
        return _carried_by(entry.values)
    return memory


def with_stop(
    memory: Memory, *, number: int, by: str, since_ns: int, reason: str = UNKNOWN
) -> tuple[Memory, Stop]:
    """What a damaged log leaves behind, with the stop that is latched because one may be lost."""
    stop = Stop(id=number, by=by, reason=reason, since_ns=since_ns)
    return replace(memory, stop=stop, last_stop_id=stop.id), stop


class Merged(NamedTuple):
    """What log and latch file leave behind together.

    Attributes:
        unwritten: A stop that only the latch file knows: the gateway was killed before its entry was written.
        unsent: A stop whose RESET is written down, and may not have been sent: the gateway was killed before
            it wrote either. It stays latched.
    """

    memory: Memory
    unwritten: Stop | None = None
    unsent: Stop | None = None


def merged(memory: Memory, kept: LatchState | None) -> Merged:
    """Combine what the log's entries say with what the latch file holds."""
    if kept is None:
        return Merged(memory)
    last = max(memory.last_stop_id, kept.reserved)
    if kept.last_stop_id > memory.last_stop_id:
        memory = replace(memory, stop=kept.stop, cleared=None, last_stop_id=last, mover="")
        return Merged(memory, unwritten=kept.stop)
    if kept.last_stop_id == memory.last_stop_id and kept.stop is not None and memory.stop is None:
        memory = replace(memory, stop=kept.stop, cleared=None, last_stop_id=last)
        return Merged(memory, unsent=kept.stop)
    return Merged(replace(memory, last_stop_id=last))


def remembered(entries: Iterable[Entry]) -> Authority:
    """The authority that a log leaves behind; oldest entry first."""
    memory = NOTHING
    for entry in entries:
        memory = follow(memory, entry)
    return memory.authority


def carried(memory: Memory) -> dict[str, str]:
    """A memory as an entry's values."""
    rows = {"stop": _text(memory.stop), "cleared": _text(memory.cleared), "mover": memory.mover}
    return {name: row for name, row in rows.items() if row} | {"last_stop_id": str(memory.last_stop_id)}


def _carried_by(values: Mapping[str, str]) -> Memory:
    return Memory(
        stop=_stop(values.get("stop", "")),
        cleared=_stop(values.get("cleared", "")),
        last_stop_id=_number(values.get("last_stop_id", "")),
        mover=values.get("mover", ""),
    )


def _number(text: str) -> int:
    return int(text) if text.isdecimal() and len(text) < 19 else 0


def _text(stop: Stop | None) -> str:
    # The time of sending is on a monotonic clock, which a restart of the machine resets.
    return "" if stop is None else json.dumps(asdict(replace(stop, sent_s=None)), ensure_ascii=False)


def _stop(text: str) -> Stop | None:
    if not text:
        return None
    try:
        row: dict[str, Any] = json.loads(text)
        return Stop(**row)
    except (ValueError, TypeError, RecursionError):
        return None  # somebody changed that line: `verify` tells
