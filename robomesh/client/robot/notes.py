"""Notes on a robot's time: write, withdraw, list; kept by its site's store."""

import secrets
from dataclasses import dataclass, replace
from datetime import UTC, datetime

from google.protobuf.timestamp_pb2 import Timestamp

from robomesh import reason_codes as codes
from robomesh.client.robot.samples import utc
from robomesh.contract.keys import WHOLE_SITE, check_chunk, robot_key
from robomesh.errors import MessageError
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import Session

# The store answers when the disk has the note.
_TIMEOUT_S = 10.0
_MOST = 10_000
_Request = schema.NoteRequest


@dataclass(frozen=True, kw_only=True)
class Note:
    """A note of a person on a moment or a range of a robot's time.

    Attributes:
        id: Names the note in requests.
        author: Operator's name.
        begin, end: The range, UTC; `end` None: a moment.
        written: Time at which the site's store received it, UTC.
        withdrawn_by: Author or administrator who withdrew it; empty: not withdrawn.
    """

    id: str
    site: str
    robot: str
    author: str
    text: str
    begin: datetime
    end: datetime | None
    written: datetime
    withdrawn_by: str = ""


async def write_note(
    session: Session,
    place: tuple[str, str],
    text: str,
    *,
    begin: datetime | None,
    end: datetime | None,
    author: str,
) -> Note:
    """Write a note on a time of a robot, `place` being its site and name; see `AsyncRobot.note`."""
    request = _Request(action=_Request.WRITE, text=text, id=secrets.token_hex(8))
    if begin is not None:
        request.begin.CopyFrom(_timestamp(begin))
    if end is not None:
        request.end.CopyFrom(_timestamp(end))
    return await _change(session, place, request, author)


async def withdraw_note(session: Session, place: tuple[str, str], note: str, *, author: str) -> Note:
    """Withdraw a note by its id; see `AsyncRobot.withdraw_note`."""
    return await _change(session, place, _Request(action=_Request.WITHDRAW, id=note), author)


async def read_notes(
    session: Session, place: tuple[str, str], *, since: datetime | None, until: datetime | None
) -> list[Note]:
    """Return the notes of a robot; see `AsyncRobot.notes`."""
    site, robot = place
    query = schema.NoteQuery(robot=robot, most=_MOST)
    if since is not None:
        query.since.CopyFrom(_timestamp(since))
    if until is not None:
        query.until.CopyFrom(_timestamp(until))
    key = robot_key(site, WHOLE_SITE, "notes/read")
    answer = await session.ask(key, query, timeout_s=_TIMEOUT_S)
    assert isinstance(answer, schema.EventList)
    notes: dict[str, Note] = {}
    for event in answer.events:
        note = _note(place, event)
        there = notes.get(note.id)
        notes[note.id] = note if there is None else replace(there, withdrawn_by=note.withdrawn_by)
    return sorted(notes.values(), key=lambda each: each.begin)


async def _change(session: Session, place: tuple[str, str], request: schema.NoteRequest, author: str) -> Note:
    site, request.robot = place
    name = check_chunk(author or session.own_name)
    key = robot_key(site, WHOLE_SITE, f"notes/request/{name}")
    answer = await session.ask(key, request, timeout_s=_TIMEOUT_S)
    assert isinstance(answer, schema.Event)
    return _note(place, answer)


def _note(place: tuple[str, str], event: schema.Event) -> Note:
    site, robot = place
    note = event.note
    return Note(
        id=note.id,
        site=site,
        robot=robot,
        author=note.author,
        text=note.text,
        begin=_utc(note.begin),
        end=_utc(note.end) if note.HasField("end") else None,
        written=_utc(event.timestamp),
        withdrawn_by=event.values.get("by", "") if event.code == codes.NOTE_WITHDRAWN.name else "",
    )


def _timestamp(time: datetime) -> Timestamp:
    at = Timestamp()
    try:
        at.FromDatetime(time.astimezone(UTC))
    except (AttributeError, TypeError, ValueError, OverflowError):
        raise MessageError(f"{time!r} is no time: give a datetime; one without a zone is local") from None
    return at


def _utc(at: Timestamp) -> datetime:
    try:
        return utc(at.ToNanoseconds())
    except (ValueError, OverflowError, OSError):
        raise MessageError(f"a note's time is out of range: {at.seconds} s") from None
