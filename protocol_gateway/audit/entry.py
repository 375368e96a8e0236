"""A line of an audit log: an entry, JSON, chained by hashes to the entry before.

`hash` is the SHA-256 of the same object without `hash`, keys sorted, no blanks:

    {"hash":"5f…","number":7,"operator":"li","outcome":"ACCEPTED","previous":"c0…","repeated":0,
     "request":"MOVE_ABSOLUTE","source":"mesh","text":"","time_ns":1790000000000000000,"values":{"id":"3"}}

`previous` is the hash of the entry before, 64 zeros in the first, so a changed, missing or moved line
shows; a cut tail shows to whoever knows a later hash (the head, published on the mesh). The lease's
secret is never in it.
"""

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any, NamedTuple

from protocol_gateway.errors import AuditError
from robomesh.messages import reason_message
from robomesh.reasons import Reason
from robomesh.schemas import robomesh_pb2 as schema

NO_PREVIOUS = "0" * 64
# Reasons within reasons; a longer chain is not one that was written here.
_DEEPEST = 10

# Keys are sorted and quotes within texts are escaped, so these are the entry's own and not part of a text.
_CHAIN = re.compile(
    rb'\{"hash":"([0-9a-f]{64})",("number":([1-9]\d{0,17}),.*?"previous":"([0-9a-f]{64})".*\})\n'
)


class Outcome(StrEnum):
    """What became of a request. FAILED: accepted, but it did not reach the controller."""

    ACCEPTED = "ACCEPTED"
    REFUSED = "REFUSED"
    FAILED = "FAILED"


@dataclass(frozen=True, kw_only=True)
class Entry:
    """A line of the log; number, previous and hash are the log's to give.

    Attributes:
        time_ns: When it was asked, ns since the Unix epoch.
        source: Where it came from: "mesh", "gateway".
        values: What was asked for, as text.
        reason: Of the text, where it has a code.
        repeated: Of a flood: so many more requests like it, before it, have no entry of their own.
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


class ChainLink(NamedTuple):
    """What a line says of its place in the chain; `whole`: its hash is that of its bytes."""

    number: int
    previous: str
    hash: str
    intact: bool


def chain_entry(entry: Entry, *, number: int, previous: str) -> tuple[Entry, bytes]:
    """The entry in its place in the chain, and its line."""
    placed = replace(entry, number=number, previous=previous)
    row = {**vars(placed), "values": dict(entry.values)}
    del row["hash"], row["reason"]
    if entry.reason is not None:
        # The last of the keys, so that a torn line still says what was asked.
        row["why"] = _row_of(entry.reason)
    text = json.dumps(row, ensure_ascii=False, separators=(",", ":"), sort_keys=True)
    # Half a surrogate pair is no character, and must not keep the rest from being written.
    body = text.encode(errors="backslashreplace")
    own = hashlib.sha256(body).hexdigest()
    return replace(placed, hash=own), b'{"hash":"%s",%s\n' % (own.encode(), body[1:])


def chain_link(line: bytes) -> ChainLink | None:
    """A line's place in the chain, without reading the rest of it; None: it is no line of a log."""
    found = _CHAIN.fullmatch(line)
    if found is None:
        return None
    recorded, body, number, previous = found.groups()
    own = hashlib.sha256(b"{" + body).hexdigest()
    return ChainLink(int(number), previous.decode(), recorded.decode(), own == recorded.decode())


def parse_line(line: bytes) -> Entry:
    """An entry from its line.

    Raises:
        AuditError: If the line is not one.
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
        raise ValueError(f"reasons within reasons, more than {_DEEPEST}")
    values = row.get("values", {})
    for each in (row["code"], text, *values, *values.values()):
        each.encode()  # text, without half a surrogate pair
    causes = (_reason_of(cause, cause["text"], depth + 1) for cause in row.get("causes", ()))
    return Reason(row["code"], values, tuple(causes), text)


def _check(entry: Entry) -> None:
    texts = (entry.operator, entry.source, entry.request, entry.text)
    if not all(isinstance(text, str) for text in (*texts, *entry.values, *entry.values.values())):
        raise TypeError("a text is none")
    for text in (*texts, *entry.values, *entry.values.values()):
        text.encode()  # half a surrogate pair is no character
    if not all(type(n) is int and 0 <= n < 1 << 63 for n in (entry.time_ns, entry.repeated, entry.number)):
        raise TypeError("a number is none, or too large")
    for each in (entry.previous, entry.hash):
        bytes.fromhex(each)


def audit_entry(entry: Entry) -> schema.AuditEntry:
    """An entry as a message of the mesh."""
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
