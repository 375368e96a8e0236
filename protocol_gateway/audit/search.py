"""Search in a robot's audit log, for the command line and the request `audit/find`."""

import asyncio
import json
import re
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from protocol_gateway.audit.files import lines_of, open_files
from protocol_gateway.authority.audit_entry import Entry, Outcome, entry_message, parse_line
from protocol_gateway.seam.errors import AuditError
from robomesh import reason_codes as codes
from robomesh.contract.enum_names import enum_name
from robomesh.errors import RefusedError
from robomesh.requests.server import Request
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.texts import one_line

MOST = 10_000
DEFAULT_MOST = 1000
# Most pending searches, because each may read the whole log.
_MOST_SEARCHES = 8

_TIME = re.compile(rb'"time_ns":(\d{1,19}),"values":')
# A search in the background releases the interpreter regularly.
_LINES_AT_ONCE = 200
_PAUSE_S = 0.0005
# After a search the next one waits nine times as long, at most a second: stops need the interpreter.
_REST_TIMES, _MOST_REST_S = 9.0, 1.0


@dataclass(frozen=True, kw_only=True)
class Query:
    """Search filter; an empty value or None matches everything.

    Attributes:
        since_ns: Earliest time of the request, ns since the Unix epoch; `until_ns`: latest time.
        most: Maximum number of entries; the newest are returned.
    """

    operator: str = ""
    request: str = ""
    outcome: Outcome | None = None
    since_ns: int | None = None
    until_ns: int | None = None
    most: int = DEFAULT_MOST


def matches(entry: Entry, query: Query) -> bool:
    """Return whether an entry matches a query."""
    return (
        query.operator in ("", entry.operator)
        and query.request in ("", entry.request)
        and query.outcome in (None, entry.outcome)
        and (query.since_ns is None or entry.time_ns >= query.since_ns)
        and (query.until_ns is None or entry.time_ns <= query.until_ns)
    )


def find(live: Path, query: Query, *, in_background: bool = False) -> list[Entry]:
    """Find the newest matching entries of a log and its older parts; oldest first.

    Args:
        in_background: Yield regularly, because the search runs in a thread of a gateway.

    Raises:
        OSError: If the log cannot be read.
    """
    may_match = _filter(query)
    found: deque[bytes] = deque()
    for file in open_files(live, newest_first=True):
        here: deque[bytes] = deque(maxlen=query.most - len(found))
        for number, line in enumerate(lines_of(file)):
            if may_match(line):
                here.append(line)
            if in_background and number % _LINES_AT_ONCE == 0:
                time.sleep(_PAUSE_S)
        found.extendleft(reversed(here))
        if len(found) >= query.most:
            break
    entries = []
    for line in found:
        try:
            entry = parse_line(line)
        except AuditError:
            continue  # a changed line: `verify` reports it
        if matches(entry, query):
            entries.append(entry)
    return entries


def _filter(query: Query) -> Callable[[bytes], bool]:
    """Return a function that excludes lines that cannot match, without parsing them."""
    words = {"operator": query.operator, "request": query.request, "outcome": query.outcome or ""}
    needles = [
        f'"{name}":{json.dumps(word, ensure_ascii=False)}'.encode(errors="backslashreplace")
        for name, word in words.items()
        if word
    ]
    since_ns, until_ns = query.since_ns, query.until_ns

    def may_match(line: bytes) -> bool:
        if not all(needle in line for needle in needles):
            return False
        found_time = _TIME.search(line)
        if found_time is None:
            return False
        time_ns = int(found_time[1])
        return (since_ns is None or time_ns >= since_ns) and (until_ns is None or time_ns <= until_ns)

    return may_match


class SearchServer:
    """Handler of `audit/find` for a robot's log: one search at a time, in a thread."""

    def __init__(self, live: Path) -> None:
        self._live = live
        self._lock = asyncio.Lock()
        self._pending = 0
        self._next_s = 0.0

    async def answer(self, request: Request) -> schema.AuditList:
        """Return the matching entries.

        Raises:
            RefusedError: If too many searches are pending, or the log cannot be read.
        """
        assert isinstance(request.message, schema.AuditQuery)
        query = query_of(request.message)
        if self._pending >= _MOST_SEARCHES:
            raise RefusedError(codes.AUDIT_SEARCHES(count=_MOST_SEARCHES))
        self._pending += 1
        try:
            async with self._lock:
                await asyncio.sleep(self._next_s - time.monotonic())
                began_s = time.monotonic()
                try:
                    return await asyncio.to_thread(self._list, query)
                finally:
                    now_s = time.monotonic()
                    self._next_s = now_s + min(_REST_TIMES * (now_s - began_s), _MOST_REST_S)
        except OSError as error:
            raise RefusedError(codes.AUDIT_UNREADABLE(file=self._live.name, detail=error.strerror)) from None
        finally:
            self._pending -= 1

    def _list(self, query: Query) -> schema.AuditList:
        return schema.AuditList(
            entries=[entry_message(entry) for entry in find(self._live, query, in_background=True)]
        )


def query_of(message: schema.AuditQuery) -> Query:
    """Convert a message to a query.

    Raises:
        RefusedError: If it asks for too many entries.
    """
    if message.most > MOST:
        raise RefusedError(codes.AUDIT_TOO_MANY(count=message.most, most=MOST))
    outcomes = schema.AuditEntry.Outcome
    return Query(
        operator=one_line(message.operator),
        request=one_line(message.request),
        outcome=Outcome(enum_name(outcomes, message.outcome)) if message.HasField("outcome") else None,
        since_ns=message.since.ToNanoseconds() if message.HasField("since") else None,
        until_ns=message.until.ToNanoseconds() if message.HasField("until") else None,
        most=message.most or DEFAULT_MOST,
    )
