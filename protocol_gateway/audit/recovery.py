"""Recovery of a log's end at the start of a gateway, with detection of damage.

    torn last line                    cut off: the gateway was killed while writing, before it confirmed it
    ... that may be a STOP or RESET   a stop may be lost
    any other damage                  a stop may be lost

If a stop may be lost, the gateway latches one (`AuditLog`) and continues in a new file. The damaged file
becomes an older part without changes, so that the next start does not find the same damage again.
"""

import contextlib
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

from protocol_gateway.audit.files import first_number, lines_of, older_parts
from protocol_gateway.authority.audit_entry import NO_PREVIOUS, chain_link, parse_line
from protocol_gateway.persistence.persisted_state import (
    EMPTY,
    PersistedState,
    apply_entry,
    may_change_state,
    may_change_stop,
    starts_file,
)
from protocol_gateway.seam.errors import AuditError

# Quotes within texts are escaped, so no text matches.
_REQUEST = re.compile(rb'"request":"[A-Z_]+"')


@dataclass(frozen=True, kw_only=True)
class LogEnd:
    """End of a log's live file; `first`: number of its first entry, `length`: bytes."""

    first: int = 1
    number: int = 0
    hash: str = NO_PREVIOUS
    length: int = 0
    state: PersistedState = EMPTY


class RecoveredLog(NamedTuple):
    """Result of the recovery.

    Attributes:
        problem: Damage as a sentence; empty: none.
        stop_may_be_lost: The damage may have held a stop.
        damaged: There is more damage than a torn last line.
    """

    end: LogEnd
    problem: str
    stop_may_be_lost: bool
    damaged: bool


class _Scan(NamedTuple):
    end: LogEnd
    torn: bytes
    damage: str


def find_end(live: Path) -> RecoveredLog:
    """Find the end of the live file; if it is damaged, use the last number of the older parts."""
    end, torn, damage = _scan(live)
    parts = older_parts(live)
    if parts and not end.length:
        damage = "its live file is empty or was missing, but older parts exist"
    elif parts and first_number(parts[-1]) >= end.first:
        damage = damage or f"its live file does not continue {parts[-1].name}"
    if parts and damage:
        end = _continued_after(end, parts[-1])
    problem = damage
    if torn:
        problem = f"a torn last line was cut off after entry {end.number}{damage and ', and '}{damage}"
    unknown = bool(torn) and (_REQUEST.search(torn) is None or may_change_stop(torn))
    return RecoveredLog(end, problem, bool(damage) or unknown, bool(damage))


def _continued_after(end: LogEnd, newest: Path) -> LogEnd:
    """Return the end of a damaged live file, with numbers after those of the newest part."""
    before, named = _scan(newest).end, first_number(newest)
    last_stop_id = max(end.state.last_stop_id, before.state.last_stop_id)
    return replace(
        end,
        first=max(end.first, named + 1) if end.length else named,
        number=max(end.number, before.number, named),
        hash=end.hash if end.length else before.hash,
        state=replace(end.state, last_stop_id=last_stop_id),
    )


def _scan(path: Path) -> _Scan:
    """Return the end of a file, the torn line after it, and other damage as a sentence."""
    first, number, last, length, state = 1, 0, NO_PREVIOUS, 0, EMPTY
    torn, damage = b"", ""
    with path.open("rb") as file:
        for line in lines_of(file):
            if not line.endswith(b"\n"):
                torn = line
                break
            link = chain_link(line)
            if not length and link is not None and link.intact and starts_file(line):
                first, number, last = link.number, link.number - 1, link.previous
            number += 1
            length = file.tell()
            if link is None:
                damage = damage or f"entry {number} cannot be read"
                continue
            if (link.number, link.previous, link.intact) != (number, last, True):
                damage = damage or f"the chain is broken at entry {number}"
                number = max(number, link.number) if link.intact else number
            last = link.hash
            if may_change_state(line):
                with contextlib.suppress(AuditError):
                    state = apply_entry(state, parse_line(line))
    return _Scan(LogEnd(first=first, number=number, hash=last, length=length, state=state), torn, damage)
