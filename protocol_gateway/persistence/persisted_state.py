"""State that a gateway preserves across a restart: the latched stop, and the operator of a running motion.

It is in the audit log. The latch and the newest stop's number are also in the latch file (`latch`), which can
be written on a full disk; if that has a newer stop, it wins. A log's live file begins with a ROTATE entry,
which holds the state after the older files, so that a start reads only one file.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from protocol_gateway.authority.audit_entry import Entry, Outcome
from protocol_gateway.authority.lease_rules import Authority, LatchedStop
from protocol_gateway.persistence.latch_file import LatchState

ROTATE = "ROTATE"
UNKNOWN = "audit log damaged: whether a stop was latched is not known"
LATCH_UNKNOWN = "latch file damaged: whether a stop was latched is not known"
_MOTIONS = ("HOME", "RESUME", "MOVE_ABSOLUTE", "MOVE_RELATIVE")
_LEASE_ENDS = ("RELEASE", "EXPIRE", "REVOKE", "TAKE", "ACCEPT")
_STOPS = tuple(f'"request":"{name}"'.encode() for name in ("STOP", "RESET", ROTATE))
_REQUESTS = tuple(f'"request":"{name}"'.encode() for name in (*_MOTIONS, *_LEASE_ENDS))


@dataclass(frozen=True, kw_only=True)
class PersistedState:
    """State after the entries of a log.

    Attributes:
        cleared: A stop with a RESET in the log that may not have been sent.
        mover: Operator who commanded motion under a lease that has no end in the log, because the gateway
            was killed.
    """

    stop: LatchedStop | None = None
    cleared: LatchedStop | None = None
    last_stop_id: int = 0
    mover: str = ""

    @property
    def authority(self) -> Authority:
        """Authority without a lease, with the stop that was not reset."""
        return Authority(stop=self.stop, last_stop_id=self.last_stop_id)


EMPTY = PersistedState()


def may_change_state(line: bytes) -> bool:
    """Return whether a log's line may change the state, without parsing it."""
    return may_change_stop(line) or any(request in line for request in _REQUESTS)


def may_change_stop(line: bytes) -> bool:
    """Return whether a log's line, or a part of one, may latch or clear a stop."""
    return any(request in line for request in _STOPS)


def starts_file(line: bytes) -> bool:
    """Return whether a log's line is a ROTATE entry, which begins a new file."""
    return _STOPS[-1] in line


def apply_entry(state: PersistedState, entry: Entry) -> PersistedState:
    """Return the state after one more entry."""
    number = _number(entry.values.get("stop_id", ""))
    # Counted stops of a flood are written after newer ones, so an older number changes nothing.
    if entry.request == "STOP" and number > state.last_stop_id:
        reason = entry.values.get("reason", "")
        latched = LatchedStop(id=number, by=entry.operator, reason=reason, since_ns=entry.time_ns)
        return replace(state, stop=latched, last_stop_id=number, mover="")
    if entry.request in _MOTIONS and entry.outcome is Outcome.ACCEPTED:
        return replace(state, mover=entry.operator)
    if entry.request in _LEASE_ENDS and entry.outcome is Outcome.ACCEPTED:
        return replace(state, mover="")
    if entry.request == "RESET" and entry.outcome is Outcome.ACCEPTED:
        if state.stop is not None and state.stop.id == number:
            return replace(state, stop=None, cleared=state.stop)
        return replace(state, cleared=None)
    if entry.request == "RESET" and entry.outcome is Outcome.FAILED:
        # The accepted RESET was written before it was sent, but then it was not sent.
        return replace(state, stop=state.stop or state.cleared, cleared=None)
    if entry.request == ROTATE:
        return _from_values(entry.values)
    return state


def with_latched_stop(
    state: PersistedState, *, number: int, by: str, since_ns: int, reason: str = UNKNOWN
) -> tuple[PersistedState, LatchedStop]:
    """Return the state with a new latched stop, for a damaged log that may have lost one."""
    stop = LatchedStop(id=number, by=by, reason=reason, since_ns=since_ns)
    return replace(state, stop=stop, last_stop_id=stop.id), stop


class MergedState(NamedTuple):
    """State from log and latch file together.

    Attributes:
        unwritten: A stop only in the latch file, because the gateway was killed before it wrote the entry.
        unsent: A stop with a RESET in the log that may not have been sent, because the gateway was killed
            before it wrote the outcome. The stop stays latched.
    """

    state: PersistedState
    unwritten: LatchedStop | None = None
    unsent: LatchedStop | None = None


def merge(state: PersistedState, latch: LatchState | None) -> MergedState:
    """Combine what the log's entries say with what the latch file holds."""
    if latch is None:
        return MergedState(state)
    last = max(state.last_stop_id, latch.reserved)
    if latch.last_stop_id > state.last_stop_id:
        state = replace(state, stop=latch.stop, cleared=None, last_stop_id=last, mover="")
        return MergedState(state, unwritten=latch.stop)
    if latch.last_stop_id == state.last_stop_id and latch.stop is not None and state.stop is None:
        state = replace(state, stop=latch.stop, cleared=None, last_stop_id=last)
        return MergedState(state, unsent=latch.stop)
    return MergedState(replace(state, last_stop_id=last))


def to_values(state: PersistedState) -> dict[str, str]:
    """Convert a state to an entry's values."""
    rows = {"stop": _text(state.stop), "cleared": _text(state.cleared), "mover": state.mover}
    return {name: row for name, row in rows.items() if row} | {"last_stop_id": str(state.last_stop_id)}


def _from_values(values: Mapping[str, str]) -> PersistedState:
    return PersistedState(
        stop=_stop(values.get("stop", "")),
        cleared=_stop(values.get("cleared", "")),
        last_stop_id=_number(values.get("last_stop_id", "")),
        mover=values.get("mover", ""),
    )


def _number(text: str) -> int:
    return int(text) if text.isdecimal() and len(text) < 19 else 0


def _text(stop: LatchedStop | None) -> str:
    # The time of sending is on a monotonic clock, which a restart of the machine resets.
    return "" if stop is None else json.dumps(stop.kept(), ensure_ascii=False)


def _stop(text: str) -> LatchedStop | None:
    if not text:
        return None
    try:
        row: dict[str, Any] = json.loads(text)
        return LatchedStop(**row)
    except (ValueError, TypeError, RecursionError):
        return None  # a changed line: `verify` reports it
