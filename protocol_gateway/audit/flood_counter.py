"""A flood of refusals, or of stops, is written into the audit log as a count. No I/O; time is an argument.

    the first 5 of a kind within a second   an entry each
    more of it                              counted: one entry a second, with how many it stands for
    kinds beyond the 30th                   counted together, as those of "*"

A kind is who asked, from which host, and what: a flood must neither fill the disk nor keep the log from
being read, and whoever floods under ever new names no more than others. What is accepted is never
counted, stops excepted: any number of them latches the same robot.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from protocol_gateway.audit.entry import Entry, Outcome
from protocol_gateway.foreign_text import LONGEST_SENTENCE, one_line
from robomesh import reason_codes as codes

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
    """Which entries of one robot are written, and which are counted."""

    def __init__(self) -> None:
        self._kinds: dict[tuple[str, str, str], _Kind] = {}

    def admits(self, entry: Entry, now_s: float) -> bool:
        """Whether an entry is to be written; else it is counted."""
        if entry.outcome is not Outcome.REFUSED and entry.request != STOP:
            return True
        name = (entry.operator, _host(entry.source), entry.request)
        if name not in self._kinds and len(self._kinds) >= MOST_KINDS:
            # The last stop's number has to be in the log, so stops are never counted with anything else.
            name = (_MANY, _MANY, STOP if entry.request == STOP else _MANY)
        kind = self._kinds.setdefault(name, _Kind(now_s))
        if not kind.counted and now_s - kind.began_s >= WINDOW_S:
            kind.began_s, kind.in_full = now_s, 0
        if kind.in_full < IN_FULL:
            kind.in_full += 1
            return True
        kind.counted += 1
        kind.last = entry
        return False

    def counts(self, now_s: float, *, request: str = "") -> Iterator[Entry]:
        """The entries of what was counted, of one request or of all; to be asked for each second."""
        for name, kind in list(self._kinds.items()):
            if request not in ("", name[2]):
                continue
            if kind.counted and kind.last is not None:
                yield _count(kind.last, kind.counted - 1, many=name[0] == _MANY)
                # It goes on to be counted, unless there is a second's peace.
                kind.counted, kind.last, kind.began_s = 0, None, now_s
            elif now_s - kind.began_s >= WINDOW_S:
                del self._kinds[name]


def _host(source: str) -> str:
    """Where something came from, without its port: each connection has another."""
    host, _, port = source.rpartition(":")
    return host if port.isdecimal() else source


def _count(last: Entry, more: int, *, many: bool) -> Entry:
    if not more:
        return last
    if not many:
        return replace(last, repeated=more)
    ending = " (the last of many askers)"
    text = one_line(last.text, LONGEST_SENTENCE - len(ending)) + ending
    reason = None if last.reason is None else codes.LAST_OF_MANY(last.reason)
    return replace(last, repeated=more, text=text, reason=reason)
