"""Counting of refusal floods and stop floods for the audit log. No I/O; time is an argument.

    the first 5 of a kind within a second   an entry each
    further ones                            counted: one entry a second, with their number
    kinds beyond the 30th                   counted together, with the name "*"
    repeats of a stop                       counted together, from the first

A kind is an operator, a host and a request. A flood must neither fill the disk nor make the log unreadable,
even under many invented names. Accepted requests are never counted, except stops, because a repeated stop
changes nothing.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from protocol_gateway.authority.audit_entry import Entry, Outcome
from protocol_gateway.seam.text_limits import LONGEST_SENTENCE
from robomesh import reason_codes as codes
from robomesh.texts import one_line

IN_FULL = 5
WINDOW_S = 1.0
MOST_KINDS = 30

STOP = "STOP"
_MANY = "*"


@dataclass
class _Kind:
    began_s: float
    in_full: int = 0
    counted: int = 0
    last: Entry | None = None


class FloodCounter:
    """Counter that decides which entries of one robot are written, and which are counted."""

    def __init__(self) -> None:
        self._kinds: dict[tuple[str, str, str], _Kind] = {}
        self._stop_id = ""

    def admits(self, entry: Entry, now_s: float) -> bool:
        """Return whether to write an entry; otherwise it is counted."""
        if entry.outcome is not Outcome.REFUSED and entry.request != STOP:
            return True
        name = (entry.operator, _host(entry.source), entry.request)
        stop_id = entry.values.get("stop_id", "") if entry.request == STOP else ""
        repeat = stop_id != "" and stop_id == self._stop_id
        if repeat:
            name = (_MANY, _MANY, STOP)
        elif stop_id:
            self._stop_id = stop_id
        if name not in self._kinds and len(self._kinds) >= MOST_KINDS:
            # Stops are not counted with other requests, because the last stop's number must be in the log.
            name = (_MANY, _MANY, STOP if entry.request == STOP else _MANY)
        kind = self._kinds.setdefault(name, _Kind(now_s))
        if not kind.counted and now_s - kind.began_s >= WINDOW_S:
            kind.began_s, kind.in_full = now_s, 0
        if kind.in_full < IN_FULL and not repeat:
            kind.in_full += 1
            return True
        kind.counted += 1 + entry.repeated
        kind.last = entry
        return False

    def counts(self, now_s: float, *, request: str = "") -> Iterator[Entry]:
        """Yield the entries of counted requests, of one request name or of all; call it each second."""
        for name, kind in list(self._kinds.items()):
            if request not in ("", name[2]):
                continue
            if kind.counted and kind.last is not None:
                yield _count(kind.last, kind.counted - 1, many=name[0] == _MANY)
                # The kind stays counted until it pauses for a second.
                kind.counted, kind.last, kind.began_s = 0, None, now_s
            elif now_s - kind.began_s >= WINDOW_S:
                del self._kinds[name]


def _host(source: str) -> str:
    """Return a source without its port, which differs for each connection."""
    host, _, port = source.rpartition(":")
    return host if port.isdecimal() else source


def _count(last: Entry, more: int, *, many: bool) -> Entry:
    if not more:
        return last
    if not many:
        return replace(last, repeated=more)
    ending = " (the last of many callers)"
    text = one_line(last.text, LONGEST_SENTENCE - len(ending)) + ending
    reason = None if last.reason is None else codes.LAST_OF_MANY(last.reason)
    return replace(last, repeated=more, text=text, reason=reason)
