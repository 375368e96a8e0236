"""Entry of an audit log, and its line: JSON, chained to the previous entry by its hash.

`hash` is the SHA-256 of the same object without `hash`, keys sorted, no blanks:

    {"hash":"5f…","number":7,"operator":"li","outcome":"ACCEPTED","previous":"c0…","repeated":0,
     "request":"MOVE_ABSOLUTE","source":"mesh","text":"","time_ns":1790000000000000000,"values":{"id":"3"}}

`previous` is the hash of the previous entry, 64 zeros in the first. So a changed, missing or moved line is
detected; a truncated log is detected with a later hash (the head, published on the mesh). An entry never
holds the lease's secret.
"""

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any, NamedTuple

from protocol_gateway.seam.errors import AuditError
from protocol_gateway.seam.text_limits import LONGEST_SENTENCE
from robomesh.contract.messages import reason_message
from robomesh.reasons import Reason
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.texts import one_line

GATEWAY = "gateway"
"""Operator and source of the gateway's own entries."""
# Sources of requests over the mesh, of a program's steps and end, and of a jog's.
MESH = "mesh"
PROGRAM = "program"
JOG = "jog"

NO_PREVIOUS = "0" * 64
# Most levels of reasons within reasons; the gateway writes fewer.
_DEEPEST = 10

# Keys are sorted and quotes within texts are escaped, so these matches cannot be part of a text.
_CHAIN = re.compile(
    rb'\{"hash":"([0-9a-f]{64})",("number":([1-9]\d{0,17}),.*?"previous":"([0-9a-f]{64})".*\})\n'
)


class Outcome(StrEnum):
    """Outcome of a request. FAILED: accepted, but it did not reach the controller."""

    ACCEPTED = "ACCEPTED"
    REFUSED = "REFUSED"
    FAILED = "FAILED"


@dataclass(frozen=True, kw_only=True)
class Entry:
    """Entry of the log; the log assigns number, previous and hash.

    Attributes:
        time_ns: Time of the request, ns since the Unix epoch.
        source: Source of the request: "mesh", "gateway".
        values: Values of the request, as text.
        reason: Reason of the text, if it has a code.
        repeated: Number of similar requests before it that have no entry, in a flood.
    """

    time_ns: int
    operator: str
    source: str
    request: str
    outcome: Outcome
    text: str = ""
    reason: Reason | None = None
    values: Mapping[str, str] = field(default_factory=dict)
    repeated: int = 0
    number: int = 0
    previous: str = NO_PREVIOUS
    hash: str = ""


def entry_of(
    request: str,
    *,
    time_ns: int,
    operator: str,
    source: str,
    outcome: Outcome,
    text: str,
    why: Reason | None = None,
    **values: object,
) -> Entry:
    """Create an entry; empty values are omitted, long ones shortened."""
    return Entry(
        time_ns=time_ns,
        operator=operator,
        source=source,
        request=request,
        outcome=outcome,
        text=text,
        reason=why,
        values={
            name: one_line(str(value), LONGEST_SENTENCE)
            for name, value in values.items()
            if value not in ("", 0)
        },
    )


class ChainLink(NamedTuple):
    """Position of a line in the chain; `intact`: its hash matches its bytes."""

    number: int
    previous: str
    hash: str
    intact: bool


def chain_entry(entry: Entry, *, number: int, previous: str) -> tuple[Entry, bytes]:
    """Return the entry with its position in the chain, and its line."""
    placed = replace(entry, number=number, previous=previous)
    row = {**vars(placed), "values": dict(entry.values)}
    del row["hash"], row["reason"]
    if entry.reason is not None:
        # Sorted last, so that a torn line still holds the request.
        row["why"] = _row_of(entry.reason)
    text = json.dumps(row, ensure_ascii=False, separators=(",", ":"), sort_keys=True)
    # An unpaired surrogate is escaped, so that the entry can be written.
    body = text.encode(errors="backslashreplace")
    own = hashlib.sha256(body).hexdigest()
    return replace(placed, hash=own), b'{"hash":"%s",%s\n' % (own.encode(), body[1:])


def chain_link(line: bytes) -> ChainLink | None:
    """Return a line's position in the chain, without parsing the rest; None: not a line of a log."""
    found = _CHAIN.fullmatch(line)
    if found is None:
        return None
    recorded, body, number, previous = found.groups()
    own = hashlib.sha256(b"{" + body).hexdigest()
    return ChainLink(int(number), previous.decode(), recorded.decode(), own == recorded.decode())


def parse_line(line: bytes) -> Entry:
    """Parse an entry from its line.

    Raises:
        AuditError: If the line is not an entry.
    """
    try:
        row = json.loads(line)
        reason = _reason_of(row.pop("why"), row["text"]) if "why" in row else None
        entry = Entry(**{**row, "outcome": Outcome(row["outcome"])}, reason=reason)
        _check(entry)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise AuditError(f"not an audit entry: {line[:80]!r} ({error})") from None
    return entry


def _row_of(reason: Reason) -> dict[str, Any]:
    row: dict[str, Any] = {"code": reason.code}
    if reason.values:
        row["values"] = dict(reason.values)
    if reason.causes:
        row["causes"] = [{**_row_of(cause), "text": cause.text} for cause in reason.causes]
    return row


def _reason_of(row: Mapping[str, Any], text: str, depth: int = 1) -> Reason:
    if depth > _DEEPEST:
        raise ValueError(f"more than {_DEEPEST} levels of reasons within reasons")
    values = row.get("values", {})
    for each in (row["code"], text, *values, *values.values()):
        each.encode()  # raises for an unpaired surrogate
    causes = (_reason_of(cause, cause["text"], depth + 1) for cause in row.get("causes", ()))
    return Reason(row["code"], values, tuple(causes), text)


def _check(entry: Entry) -> None:
    texts = (entry.operator, entry.source, entry.request, entry.text)
    if not all(isinstance(text, str) for text in (*texts, *entry.values, *entry.values.values())):
        raise TypeError("a text is not a string")
    for text in (*texts, *entry.values, *entry.values.values()):
        text.encode()  # raises for an unpaired surrogate
    if not all(type(n) is int and 0 <= n < 1 << 63 for n in (entry.time_ns, entry.repeated, entry.number)):
        raise TypeError("a number is missing or out of range")
    for each in (entry.previous, entry.hash):
        bytes.fromhex(each)


def entry_message(entry: Entry) -> schema.AuditEntry:
    """Convert an entry to a message of the mesh."""
    message = schema.AuditEntry(
        number=entry.number,
        operator=entry.operator,
        source=entry.source,
        request=entry.request,
        values=entry.values,
        outcome=entry.outcome.value,
        text=entry.text,
        repeated_count=entry.repeated,
        previous=bytes.fromhex(entry.previous),
        hash=bytes.fromhex(entry.hash),
    )
    message.timestamp.FromNanoseconds(entry.time_ns)
    if entry.reason is not None:
        message.reason.CopyFrom(reason_message(entry.reason))
    return message
