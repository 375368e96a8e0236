"""Versions of a program: what a change adds to them, and when it is refused. No I/O; time is an argument.

A program is the list of its changes, and nothing is taken from that list: a rename, a deletion and a
restoration are versions too. The newest version that was not put aside is the current one, and says the
program's name, its text and whether it is deleted.
"""

import hashlib
import unicodedata
from collections.abc import Iterable
from dataclasses import dataclass, replace

from google.protobuf.timestamp_pb2 import Timestamp

from robomesh import reason_codes as codes
from robomesh.errors import RefusedError
from robomesh.schemas.robomesh_pb2 import ProgramRequest, ProgramVersion, StoredProgram
from robomesh.texts import is_file_title, one_line
from robots.programs import MOST_BYTES

MOST_VERSIONS = 1000
LONGEST_NAME = 60
_LONGEST_REASON = 500


@dataclass(frozen=True, slots=True)
class ProgramHistory:
    """A program and all its versions, oldest first; a new one has none yet."""

    id: str
    versions: tuple[ProgramVersion, ...] = ()

    @property
    def current(self) -> ProgramVersion:
        """The newest version that was not put aside."""
        return next(each for each in reversed(self.versions) if each.change != ProgramVersion.ASIDE)

    @property
    def is_deleted(self) -> bool:
        """True until a deleted program is restored."""
        return self.current.change == ProgramVersion.DELETED

    @property
    def message(self) -> StoredProgram:
        """The program in the published list."""
        return StoredProgram(id=self.id, current=self.current, versions=len(self.versions))

    def version(self, number: int) -> ProgramVersion:
        """Return a version by its number; 0: the current one.

        Raises:
            RefusedError: If there is none.
        """
        if not number:
            return self.current
        if number > len(self.versions):
            newest = len(self.versions)
            raise RefusedError(codes.PROGRAMS_VERSION(name=self.current.name, version=number, newest=newest))
        return self.versions[number - 1]

    def with_version(self, version: ProgramVersion) -> "ProgramHistory":
        """Return the program with a version that `changed` made."""
        return replace(self, versions=(*self.versions, version))


def sha256(text: str) -> str:
    """Return the hash that names a text, as the audit log writes it."""
    return hashlib.sha256(text.encode()).hexdigest()


def check_name(name: str) -> str:
    """Return a program's name, normalized.

    Raises:
        RefusedError: If it could not name a file, or shows as another name than it is.
    """
    normal = unicodedata.normalize("NFC", name).strip()
    if not is_file_title(normal, LONGEST_NAME):
        raise RefusedError(codes.PROGRAMS_NAME(name=one_line(name, LONGEST_NAME), most=LONGEST_NAME))
    return normal


def check_text(text: str) -> str:
    """Return a program's text. It may have errors: a program is saved while it is written.

    Raises:
        RefusedError: If it is longer than any program, or is no text.
    """
    if len(text.encode()) > MOST_BYTES:
        raise RefusedError(codes.PROGRAM_TOO_LONG(kib=MOST_BYTES // 1024))
    if "\0" in text:
        raise RefusedError(codes.PROGRAMS_NOT_TEXT())
    return text


def changed(program: ProgramHistory, asked: ProgramRequest, author: str, at_ns: int) -> ProgramVersion:
    """Return the version that a request adds; an existing one if there is nothing to add.

    A text that was written on an older version than the current one is put aside, so that neither author
    loses anything; any other change has to name the current version.

    Raises:
        RefusedError: If the request is invalid, or the program has changed meanwhile.
    """
    at = Timestamp()
    at.FromNanoseconds(at_ns)
    new = ProgramVersion(
        number=len(program.versions) + 1, timestamp=at, author=author, based_on=asked.based_on
    )
    if not program.versions:
        new.change, new.name = ProgramVersion.SAVED, check_name(asked.name)
        _set_text(new, asked.text)
        return new
    current = program.current
    new.name, new.sha256, new.bytes = current.name, current.sha256, current.bytes
    if asked.action == ProgramRequest.SAVE:
        _set_text(new, asked.text)
        # A repeated request, whose first answer was lost, must not become a second version.
        there = [each for each in program.versions if _same(each, new)]
        there += [] if program.is_deleted else [current]
        if (same := next((each for each in there if each.sha256 == new.sha256), None)) is not None:
            return same
        aside = asked.based_on != current.number or program.is_deleted
        new.change = ProgramVersion.ASIDE if aside else ProgramVersion.SAVED
    else:
        if asked.based_on != current.number:
            raise RefusedError(
                codes.PROGRAMS_CHANGED(name=current.name, author=current.author, version=current.number)
            )
        _change_otherwise(program, asked, new)
    if len(program.versions) >= MOST_VERSIONS and new.change != ProgramVersion.DELETED:
        raise RefusedError(codes.PROGRAMS_VERSIONS(name=current.name, most=MOST_VERSIONS))
    return new


def _change_otherwise(program: ProgramHistory, asked: ProgramRequest, new: ProgramVersion) -> None:
    """Complete the version that renames, deletes or restores a program."""
    match asked.action:
        case ProgramRequest.RENAME:
            new.change, new.name = ProgramVersion.RENAMED, check_name(asked.name)
        case ProgramRequest.DELETE:
            new.change, new.reason = ProgramVersion.DELETED, one_line(asked.reason, _LONGEST_REASON).strip()
            if not new.reason:
                raise RefusedError(codes.PROGRAMS_REASON())
        case ProgramRequest.RESTORE:
            of = program.version(asked.version)
            new.change, new.based_on = ProgramVersion.RESTORED, of.number
            new.sha256, new.bytes = of.sha256, of.bytes
            if asked.name:
                new.name = check_name(asked.name)
        case _:
            raise RefusedError(codes.INVALID(codes.OTHER(detail="the request has no action")))


def _set_text(version: ProgramVersion, text: str) -> None:
    version.sha256, version.bytes = sha256(check_text(text)), len(text.encode())


def _same(there: ProgramVersion, new: ProgramVersion) -> bool:
    """Return whether a version was put aside by the same request."""
    return (there.change, there.author, there.based_on) == (ProgramVersion.ASIDE, new.author, new.based_on)


def name_key(name: str) -> str:
    """Return what two names have in common if a file system could take them for one."""
    return unicodedata.normalize("NFC", name.casefold())


def sorted_by_name(programs: Iterable[ProgramHistory]) -> list[ProgramHistory]:
    """Return programs in the order of their names."""
    return sorted(programs, key=lambda each: (name_key(each.current.name), each.id))
