"""Name, note and tags that people give a recording: the list of its changes, in a file beside it.

    <recording>.mcap            stays byte for byte as it was recorded
    <recording>.changes.json    its changes, oldest first; stays when the recording is deleted

As with a stored program, nothing is taken from the list, and a deletion is a change too.
"""

import json
import unicodedata
from collections.abc import Iterable, Sequence
from functools import lru_cache
from pathlib import Path

from google.protobuf.json_format import MessageToDict, ParseDict, ParseError
from google.protobuf.timestamp_pb2 import Timestamp

from robomesh import reason_codes as codes
from robomesh.errors import RefusedError
from robomesh.files.atomic_write import write_atomically
from robomesh.recordings.names import SUFFIX
from robomesh.schemas.robomesh_pb2 import Recording, RecordingChange, RecordingRequest
from robomesh.texts import DIRECTION, is_file_title, one_line

CHANGES = ".changes.json"
LONGEST_NAME = 60
LONGEST_NOTE = 2000
LONGEST_TAG = 40
MOST_TAGS = 20
MOST_CHANGES = 1000
_LONGEST_REASON = 500
# A file of all possible changes; another program may have written more.
_MOST_BYTES = 16 << 20


class DamagedChangesError(Exception):
    """A file that is not what this module writes; the text names it."""


def changes_path(recording: Path) -> Path:
    """Return the path of a recording's changes."""
    return recording.with_name(recording.name.removesuffix(SUFFIX) + CHANGES)


def recording_path(changes: Path) -> Path:
    """Return the path of the recording to which a file of changes belongs."""
    return changes.with_name(changes.name.removesuffix(CHANGES) + SUFFIX)


def changes_json(changes: Iterable[RecordingChange]) -> bytes:
    """Return the content of a file of changes."""
    values = {"changes": [MessageToDict(each) for each in changes]}
    return json.dumps(values, ensure_ascii=False, indent=1).encode()


def write_changes(recording: Path, changes: Iterable[RecordingChange]) -> None:
    """Replace a recording's changes in one step; block until the disk has them.

    Raises:
        OSError: If the disk refuses; the earlier changes remain.
    """
    write_atomically(changes_path(recording), changes_json(changes), mode=0o644)


def read_changes(recording: Path) -> tuple[RecordingChange, ...]:
    """Return a recording's changes, oldest first; it may be deleted.

    Raises:
        DamagedChangesError: If they cannot be read.
    """
    path = changes_path(recording)
    try:
        found = path.stat()
    except FileNotFoundError:
        return ()
    except OSError as error:
        raise DamagedChangesError(f"{path}: {error.strerror}") from None
    return _read(path, found.st_ino, found.st_size, found.st_mtime_ns)


# Listing many recordings costs only a `stat` each.
@lru_cache(maxsize=4096)
def _read(path: Path, inode: int, size: int, mtime_ns: int) -> tuple[RecordingChange, ...]:
    if size > _MOST_BYTES:
        raise DamagedChangesError(f"{path}: {size} bytes are too many")
    try:
        rows = json.loads(path.read_bytes())["changes"]
        changes = tuple(ParseDict(row, RecordingChange()) for row in rows)
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError, ParseError) as error:
        raise DamagedChangesError(f"{path}: {error or type(error).__name__}") from None
    if [each.number for each in changes] != [*range(1, len(changes) + 1)]:
        raise DamagedChangesError(f"{path}: its changes are not numbered from 1")
    return changes


def is_deleted(changes: Sequence[RecordingChange]) -> bool:
    """Return whether the newest change is the deletion."""
    return bool(changes) and changes[-1].change == RecordingChange.DELETED


def set_labels(recording: Recording, changes: Sequence[RecordingChange], *, history: bool = False) -> None:
    """Set the name, note and tags of a recording's description from its changes.

    Args:
        history: Add the changes too.
    """
    if not changes:
        return
    newest = changes[-1]
    recording.name = newest.name or recording.name
    recording.note, recording.changes = newest.note, newest.number
    recording.tags[:] = newest.tags
    if history:
        recording.history.extend(changes)


def changed(
    now: Recording, changes: Sequence[RecordingChange], asked: RecordingRequest, author: str, at_ns: int
) -> RecordingChange:
    """Return the change that a request adds; the newest one if there is nothing to add.

    Args:
        now: The recording's description.

    Raises:
        RefusedError: If the request is invalid, or the recording was changed meanwhile.
    """
    newest = changes[-1] if changes else RecordingChange()
    new = RecordingChange(name=newest.name, note=newest.note, tags=newest.tags)
    match asked.action:
        case RecordingRequest.RENAME:
            new.change, new.name = RecordingChange.RENAMED, check_title(asked.name)
            same = new.name == now.name
        case RecordingRequest.NOTE:
            new.change, new.note = RecordingChange.NOTED, check_note(asked.note)
            same = new.note == now.note
        case RecordingRequest.TAG:
            new.change = RecordingChange.TAGGED
            new.tags[:] = check_tags(asked.tags)
            same = new.tags == now.tags
        case RecordingRequest.DELETE:
            new.change, new.reason = RecordingChange.DELETED, one_line(asked.reason, _LONGEST_REASON).strip()
            if not new.reason:
                raise RefusedError(codes.RECORDING_REASON())
            # Its name is that of the file, which will be gone.
            new.name, same = now.name, False
        case _:
            raise RefusedError(codes.INVALID(codes.OTHER(detail="the request has no action")))
    if same:  # also a repeated request, whose first answer was lost
        return newest
    if asked.based_on != len(changes):
        raise RefusedError(codes.RECORDING_CONFLICT(author=newest.author or "-", name=now.name))
    if len(changes) >= MOST_CHANGES and new.change != RecordingChange.DELETED:
        raise RefusedError(codes.RECORDING_CHANGES(name=now.name, most=MOST_CHANGES))
    new.number, new.author = len(changes) + 1, author
    at = Timestamp()
    at.FromNanoseconds(at_ns)
    new.timestamp.CopyFrom(at)
    return new


def check_title(name: str) -> str:
    """Return a recording's new name, normalized.

    Raises:
        RefusedError: If it could not name a file, or shows as another name than it is.
    """
    normal = unicodedata.normalize("NFC", name).strip()
    if not is_file_title(normal, LONGEST_NAME):
        raise RefusedError(codes.RECORDING_TITLE(name=one_line(name, LONGEST_NAME), most=LONGEST_NAME))
    return normal


def check_note(note: str) -> str:
    """Return a note, normalized: lines of printable characters.

    Raises:
        RefusedError: If it is too long.
    """
    if len(note) > LONGEST_NOTE:
        raise RefusedError(codes.RECORDING_NOTE(count=len(note), most=LONGEST_NOTE))
    lines = unicodedata.normalize("NFC", note).splitlines()
    return "\n".join(one_line(line, LONGEST_NOTE).rstrip() for line in lines).strip()


def check_tags(tags: Iterable[str]) -> list[str]:
    """Return tags, normalized, each once, in their order.

    Raises:
        RefusedError: If one is invalid, or there are too many.
    """
    found: dict[str, str] = {}
    for tag in tags:
        normal = unicodedata.normalize("NFC", tag).strip()
        if (
            not 0 < len(normal) <= LONGEST_TAG
            or not normal.isprintable()
            or "," in normal
            or any(each in DIRECTION for each in normal)
        ):
            raise RefusedError(codes.RECORDING_TAG(tag=one_line(tag, LONGEST_TAG), most=LONGEST_TAG))
        found.setdefault(normal.casefold(), normal)
    if len(found) > MOST_TAGS:
        raise RefusedError(codes.RECORDING_TAGS(count=len(found), most=MOST_TAGS))
    return [*found.values()]
