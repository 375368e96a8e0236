"""Files of one robot's programs: a file of versions each, one of runs, and a file for each text.

    <id>.json             versions of a program, oldest first
    runs.json             texts that ran without being saved, oldest first
    texts/<sha256>.prog   a text

A text is on the disk before a version names it, and each file is replaced in one step: after a kill or a
power cut there is the state before a change or after it, and perhaps a text that no version names.
"""

import json
from collections.abc import Iterable, Iterator
from pathlib import Path

from google.protobuf.json_format import MessageToDict, ParseDict, ParseError

from robomesh.files.atomic_write import write_atomically
from robomesh.schemas.robomesh_pb2 import ProgramVersion
from services.store.history import ProgramHistory, sha256

_RUNS = "runs"
_ENDING = ".json"
_DAMAGED = ".damaged"


class DamagedError(Exception):
    """A file that is not what this module writes; the text names it."""


class ProgramFiles:
    """The folder of one robot's programs. Its methods block until the disk has what they write.

    Methods raise OSError if the disk refuses; the files are unchanged then.
    """

    def __init__(self, folder: Path) -> None:
        self._folder, self._texts = folder, folder / "texts"

    def programs(self) -> Iterator[ProgramHistory | DamagedError]:
        """Read all programs; a damaged file is renamed, so that nothing overwrites it."""
        for path in sorted(self._folder.glob(f"*{_ENDING}")):
            if path.stem != _RUNS:
                yield self._program(path)

    def runs(self) -> tuple[ProgramVersion, ...] | DamagedError:
        """Read the texts that ran."""
        path = self._folder / f"{_RUNS}{_ENDING}"
        try:
            return tuple(_versions(path)) if path.exists() else ()
        except DamagedError as error:
            return self._set_aside(path, error)

    def _program(self, path: Path) -> ProgramHistory | DamagedError:
        try:
            versions = tuple(_versions(path))
            numbers = [each.number for each in versions]
            if not versions or numbers != [*range(1, len(versions) + 1)]:
                raise DamagedError(f"{path}: its versions are not numbered from 1")
            if versions[0].change == ProgramVersion.ASIDE:
                raise DamagedError(f"{path}: it begins with a version that was put aside")
            return ProgramHistory(path.stem, versions)
        except DamagedError as error:
            return self._set_aside(path, error)

    def _set_aside(self, path: Path, error: DamagedError) -> DamagedError:
        path.replace(path.with_suffix(_DAMAGED))
        return error

    def write_program(self, program: ProgramHistory, text: str | None) -> None:
        """Write a program whose newest version is new.

        Args:
            text: Its text; None: the text is there already.
        """
        self._write(program.id, program.versions, text)

    def write_runs(self, runs: Iterable[ProgramVersion], text: str | None) -> None:
        """Write the texts that ran; see `write_program`."""
        self._write(_RUNS, runs, text)

    def text(self, version: ProgramVersion) -> str:
        """Read a version's text.

        Raises:
            DamagedError: If it is not the text that the version names.
        """
        path = self._text_path(version.sha256)
        try:
            text = path.read_bytes().decode()
        except (FileNotFoundError, UnicodeDecodeError):
            text = None
        if text is None or sha256(text) != version.sha256:
            raise DamagedError(f"{path}: is missing or is another text")
        return text

    def remove_text(self, hash_: str) -> None:
        """Remove a text that no version names."""
        self._text_path(hash_).unlink(missing_ok=True)

    def remove_unnamed(self, named: frozenset[str]) -> None:
        """Remove what an interrupted change left, unless a damaged file might name it."""
        for path in (*self._folder.glob(".*.new"), *self._texts.glob(".*.new")):
            path.unlink(missing_ok=True)
        if next(self._folder.glob(f"*{_DAMAGED}"), None) is None:
            for path in self._texts.glob("*.prog"):
                if path.stem not in named:
                    path.unlink(missing_ok=True)

    def _text_path(self, hash_: str) -> Path:
        return self._texts / f"{hash_}.prog"

    def _write(self, stem: str, versions: Iterable[ProgramVersion], text: str | None) -> None:
        values = {"versions": [MessageToDict(each) for each in versions]}
        data = json.dumps(values, ensure_ascii=False, indent=1).encode()
        self._texts.mkdir(parents=True, exist_ok=True)
        if text is not None:
            write_atomically(self._text_path(sha256(text)), text.encode())
        try:
            write_atomically(self._folder / f"{stem}{_ENDING}", data)
        except OSError:
            if text is not None:
                self.remove_text(sha256(text))  # a full disk needs the space
            raise


def _versions(path: Path) -> list[ProgramVersion]:
    try:
        rows = json.loads(path.read_bytes())["versions"]
        versions = [ParseDict(row, ProgramVersion()) for row in rows]
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError, ParseError) as error:
        raise DamagedError(f"{path}: {error or type(error).__name__}") from None
    if not all(len(each.sha256) == 64 and each.sha256.isalnum() and each.name for each in versions):
        raise DamagedError(f"{path}: a version without a name or a text")
    return versions
