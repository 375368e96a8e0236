"""Notes of people on a moment or a range of a robot's time: rules, and a file for each robot.

    <robot>/notes.jsonl   an event a line, oldest first: a note, or its withdrawal

Lines are only ever appended. A kill or a power cut leaves complete lines, and perhaps a part of the last one,
which is removed at the next start.
"""

import contextlib
import errno
import json
import os
import re
import secrets
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from google.protobuf.json_format import MessageToDict, ParseDict, ParseError
from google.protobuf.timestamp_pb2 import Timestamp

from robomesh import reason_codes as codes
from robomesh.contract.messages import reason_message
from robomesh.errors import RefusedError
from robomesh.files.atomic_write import fsync_folder
from robomesh.reasons import Reason
from robomesh.schemas.robomesh_pb2 import Event, EventList, Note, NoteQuery, NoteRequest
from robomesh.texts import one_line
from services.store.settings import MIB

LONGEST_TEXT = 500
_ID = re.compile(r"[A-Za-z0-9-]{8,64}")
# A page's clock may be ahead of the store's.
_FUTURE_NS = 5 * 10**9
_USUAL, _MOST = 1000, 10_000


class _Line(NamedTuple):
    """A line of a robot's file, as the event's bytes, with its note's range [ns since the Unix epoch]."""

    id: str
    begin_ns: int
    end_ns: int
    event: bytes


@dataclass
class _Robot:
    """Notes of one robot, oldest first; `notes` and `withdrawn` are the events' places in `lines`, by id."""

    path: Path
    lines: list[_Line] = field(default_factory=list)
    notes: dict[str, int] = field(default_factory=dict)
    withdrawn: dict[str, int] = field(default_factory=dict)

    def event(self, place: int) -> Event:
        return Event.FromString(self.lines[place].event)

    def add(self, event: Event) -> None:
        """Add an event that is on the disk."""
        note = event.note
        begin_ns = note.begin.ToNanoseconds()
        end_ns = note.end.ToNanoseconds() if note.HasField("end") else begin_ns
        places = self.withdrawn if event.code == codes.NOTE_WITHDRAWN.name else self.notes
        places[note.id] = len(self.lines)
        self.lines.append(_Line(note.id, begin_ns, end_ns, event.SerializeToString()))


class NoteBook:
    """Notes of a site. Its methods block on the disk; one at a time may be called.

    Args:
        folder: The site's folder, with a folder for each robot.
        most_bytes: Quota of all notes.
    """

    def __init__(self, folder: Path, *, most_bytes: int) -> None:
        self._folder, self._most_bytes = folder, most_bytes
        self._robots: dict[str, _Robot] = {}
        self.bytes = 0

    @property
    def count(self) -> int:
        """Number of notes, with withdrawn ones."""
        return sum(len(robot.notes) for robot in self._robots.values())

    def open(self, robot: str) -> Reason | None:
        """Read a robot's notes, once; return what is damaged.

        Raises:
            OSError: If the disk refuses.
        """
        if robot in self._robots:
            return None
        found = self._robots[robot] = _Robot(self._folder / robot / "notes.jsonl")
        try:
            data = found.path.read_bytes()
        except FileNotFoundError:
            return None
        complete = data.rfind(b"\n") + 1
        if complete < len(data):
            os.truncate(found.path, complete)
        self.bytes += complete
        damaged = 0
        for line in data[:complete].splitlines():
            event = _parsed(line)
            if event is None:
                damaged += 1
            else:
                found.add(event)
        return codes.NOTES_DAMAGED(count=damaged, file=found.path) if damaged else None

    def newest(self, robot: str, most: int) -> list[Event]:
        """Return the newest events of a robot, oldest first."""
        return [Event.FromString(line.event) for line in self._robots[robot].lines[-most:]]

    def read(self, asked: NoteQuery) -> EventList:
        """Return notes with their withdrawals, in the order in which they were written.

        Raises:
            RefusedError: If there is no such robot.
        """
        robot = self._robot(asked.robot)
        since_ns = asked.since.ToNanoseconds() if asked.HasField("since") else None
        until_ns = asked.until.ToNanoseconds() if asked.HasField("until") else None
        most = min(asked.most or _USUAL, _MOST)
        places = [
            place
            for place in robot.notes.values()
            if (since_ns is None or robot.lines[place].end_ns >= since_ns)
            and (until_ns is None or robot.lines[place].begin_ns < until_ns)
        ][-most:]
        ids = [robot.lines[place].id for place in places]
        places += [robot.withdrawn[id_] for id_ in ids if id_ in robot.withdrawn]
        return EventList(events=[robot.event(place) for place in sorted(places)])

    def write(self, asked: NoteRequest, author: str, at_ns: int) -> tuple[Event, bool]:
        """Write a note; return its event, and whether it is new: a repeated request adds nothing.

        Raises:
            RefusedError: If the request is not possible; nothing has changed then.
        """
        robot = self._robot(asked.robot)
        note = _note(asked, author, at_ns)
        place = robot.notes.get(note.id)
        if place is not None:
            there = robot.event(place)
            if (there.note.author, there.note.text) != (author, note.text):
                raise RefusedError(codes.NOTES_ID_TAKEN(robot=asked.robot, id=note.id))
            return there, False
        reason = codes.NOTE_WRITTEN(author=author, text=note.text)
        return self._append(robot, _event(reason, note, at_ns)), True

    def withdraw(
        self, asked: NoteRequest, by: str, at_ns: int, *, administrator: bool = False
    ) -> tuple[Event, bool]:
        """Withdraw a note; return the event, and whether it is new.

        Args:
            administrator: `by` may withdraw the notes of every author.

        Raises:
            RefusedError: If the request is not possible; nothing has changed then.
        """
        robot = self._robot(asked.robot)
        place = robot.notes.get(asked.id)
        if place is None:
            raise RefusedError(codes.NOTES_UNKNOWN(robot=asked.robot, id=one_line(asked.id, 64) or "''"))
        note = robot.event(place).note
        if note.author != by and not administrator:
            raise RefusedError(codes.NOTES_AUTHOR(author=note.author))
        if note.id in robot.withdrawn:
            return robot.event(robot.withdrawn[note.id]), False
        reason = codes.NOTE_WITHDRAWN(by=by, author=note.author, text=note.text)
        return self._append(robot, _event(reason, note, at_ns)), True

    def _robot(self, name: str) -> _Robot:
        if name not in self._robots:
            raise RefusedError(codes.PROGRAMS_ROBOT(site=self._folder.name, robot=one_line(name, 64)))
        return self._robots[name]

    def _append(self, robot: _Robot, event: Event) -> Event:
        """Return an event after the disk has its line."""
        line = json.dumps(MessageToDict(event), ensure_ascii=False).encode() + b"\n"
        # A withdrawal is always possible: its note took as much.
        if event.code == codes.NOTE_WRITTEN.name and self.bytes + len(line) > self._most_bytes:
            raise RefusedError(codes.NOTES_FULL(most_mib=self._most_bytes / MIB))
        try:
            _append(robot.path, line)
        except OSError as error:
            raise RefusedError(codes.PROGRAMS_DISK(detail=error.strerror or error)) from None
        self.bytes += len(line)
        robot.add(event)
        return event


def _note(asked: NoteRequest, author: str, at_ns: int) -> Note:
    """Return the note that a request writes."""
    count = len(asked.text.strip())
    text = one_line(asked.text.strip(), 10 * LONGEST_TEXT)  # direction characters become longer
    if not count or len(text) > LONGEST_TEXT:
        raise RefusedError(codes.NOTES_TEXT(most=LONGEST_TEXT, count=max(count, len(text))))
    if asked.id and not _ID.fullmatch(asked.id):
        raise RefusedError(codes.NOTES_ID(id=one_line(asked.id, 64)))
    note = Note(id=asked.id or secrets.token_hex(8), author=author, text=text)
    begin_ns = asked.begin.ToNanoseconds() if asked.HasField("begin") else at_ns
    note.begin.FromNanoseconds(begin_ns)
    last_ns = begin_ns
    if asked.HasField("end"):
        last_ns = asked.end.ToNanoseconds()
        if last_ns < begin_ns:
            raise RefusedError(codes.NOTES_RANGE(seconds=(begin_ns - last_ns) * 1e-9))
        if last_ns > begin_ns:
            note.end.CopyFrom(asked.end)
    if last_ns > at_ns + _FUTURE_NS:
        raise RefusedError(codes.NOTES_FUTURE(seconds=(last_ns - at_ns) * 1e-9))
    return note


def _event(reason: Reason, note: Note, at_ns: int) -> Event:
    at = Timestamp()
    at.FromNanoseconds(at_ns)
    return Event(
        timestamp=at,
        severity=Event.INFO,
        code=reason.code,
        text=reason.text,
        source="store",
        values={**reason.values, "id": note.id},
        reason=reason_message(reason),
        note=note,
    )


def _parsed(line: bytes) -> Event | None:
    """Return the event of a line; None: it is damaged."""
    with contextlib.suppress(ValueError, TypeError, AttributeError, RecursionError, ParseError):
        event = ParseDict(json.loads(line), Event(), ignore_unknown_fields=True)
        if event.code in (codes.NOTE_WRITTEN.name, codes.NOTE_WITHDRAWN.name) and event.note.id:
            return event
    return None


def _append(path: Path, line: bytes) -> None:
    """Append a line and wait for the disk; without it, the file is unchanged."""
    path.parent.mkdir(parents=True, exist_ok=True)
    is_new = not path.exists()
    file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC, 0o600)
    try:
        size = os.fstat(file).st_size
        try:
            if os.write(file, line) < len(line):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            os.fsync(file)
        except OSError:
            os.ftruncate(file, size)
            raise
    finally:
        os.close(file)
    if is_new:
        fsync_folder(path.parent)
