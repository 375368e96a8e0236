"""Changes of recordings on request: rename, note, tags, delete; each is on the disk before its answer.

A deletion has three steps, so that a kill leaves the recording or its entry, never neither:

1. `<recording>.mcap` is renamed to `<recording>.deleting`, which nothing opens;
2. the deletion is written to the recording's changes: author, reason, bytes, SHA-256;
3. `<recording>.deleting` is removed.

The next start completes or takes back what a kill interrupted.
"""

import asyncio
import contextlib
import errno
import fcntl
import hashlib
import logging
import os
import time
from collections.abc import Awaitable, Callable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from robomesh import reason_codes as codes
from robomesh.contract.keys import WHOLE_SITE, check_name
from robomesh.contract.topics import check_operator
from robomesh.errors import BusyError, KeyNameError, RefusedError
from robomesh.reasons import Reason
from robomesh.recordings.changes import (
    DamagedChangesError,
    changed,
    changes_path,
    is_deleted,
    read_changes,
    set_labels,
    write_changes,
)
from robomesh.recordings.errors import RecordingError
from robomesh.recordings.files import describe_deleted, describe_unreadable
from robomesh.recordings.names import SUFFIX, files_in, find_file, is_file_name, robot_of
from robomesh.requests.server import Request
from robomesh.schemas import robomesh_pb2 as schema
from services.recorder.disk import error_text

log = logging.getLogger(__name__)

_DELETING = ".deleting"
_DAMAGED = ".damaged"
# A program that only lists recordings holds a file for a moment.
_LOCK_WITHIN_S, _LOCK_RETRY_S = 1.0, 0.05
_Change = schema.RecordingChange
_Request = schema.RecordingRequest
_NO_SPACE = (errno.ENOSPC, errno.EDQUOT)

# Called with a robot, or `-`, what happened, and further values of the event.
Report = Callable[[str, schema.Event.Severity, Reason, Mapping[str, str]], None]
_S = schema.Event.Severity


class _Changed(NamedTuple):
    """The answer to a request, and what an event says of it; None: nothing has changed."""

    recording: schema.Recording
    reason: Reason | None
    values: dict[str, str]


class RecordingChanges:
    """Changes of the recordings in a folder.

    Args:
        describe: Returns the description of a recording, by its file and how long the client waits [s].
        is_used: Returns the reason why a recording, by file and name, must not be deleted now, or None.
        free_reserve: Frees space on a full disk.
    """

    def __init__(
        self,
        folder: Path,
        *,
        describe: Callable[[str, float | None], Awaitable[schema.Recording]],
        is_used: Callable[[str, str], Reason | None],
        free_reserve: Callable[[], None],
        report: Report,
    ) -> None:
        self._folder, self._is_used, self._free_reserve = folder, is_used, free_reserve
        self._describe, self._report = describe, report
        self._damaged: list[Reason] = []
        self._one_at_a_time = asyncio.Lock()

    async def change(self, request: Request) -> schema.Recording:
        """Rename, note, tag or delete a recording; reply after the change is on disk.

        Raises:
            RefusedError: If that is not possible; nothing has changed then.
        """
        asked = request.message
        assert isinstance(asked, _Request)
        author = check_operator(request.chunk)
        async with self._one_at_a_time:
            now = await self._described(asked.file, author, request.within_s)
            if now.deleted:
                return now
            work = self._delete if asked.action == _Request.DELETE else self._label
            try:
                # A recorder that ends must not interrupt a change.
                done = await asyncio.shield(asyncio.to_thread(work, now, asked, author))
            except RecordingError as error:
                raise RefusedError(error.reason) from None
            finally:
                for damage in self._damaged:
                    self._report(WHOLE_SITE, _S.WARNING, damage, {})
                self._damaged.clear()
        if done.reason is not None:
            self._report(_robot_of(done.recording), _S.INFO, done.reason, done.values)
        return done.recording

    def recover(self) -> None:
        """Complete or take back the deletions and remove the partial files that a kill left; blocks.

        Raises:
            OSError: If the disk refuses.
        """
        for path in files_in(self._folder, ".*.new"):
            path.unlink(missing_ok=True)
        for path in files_in(self._folder, f"*{_DELETING}"):
            recording = path.with_suffix(SUFFIX)
            try:
                deleted = is_deleted(read_changes(recording))
            except DamagedChangesError as error:
                log.warning("%s", error)
                deleted = False
            # An empty one made room for its entry on a full disk.
            if deleted or not path.stat().st_size:
                path.unlink()
            elif not recording.exists():
                path.rename(recording)

    # ------------------------------------------------------------------

    async def _described(self, file: str, author: str, within_s: float | None) -> schema.Recording:
        """Return the known facts of a recording; of a damaged one, its file's name.

        Raises:
            BusyError: If reading it takes too long.
            RefusedError: If there is none.
        """
        recording = schema.Recording()
        try:
            recording.CopyFrom(await self._describe(file, within_s))
            return recording
        except BusyError:
            raise
        except RefusedError as error:
            return await asyncio.to_thread(self._unreadable, file, author, error)

    def _unreadable(self, file: str, author: str, error: RefusedError) -> schema.Recording:
        try:
            path = find_file(self._folder, file)
        except RecordingError:
            if (gone := self._deleted(file, author)) is not None:
                return gone  # a repeated request
            raise error from None
        return describe_unreadable(path, robot=robot_of(self._folder, path), problem=error.reason)

    def _label(self, now: schema.Recording, asked: schema.RecordingRequest, author: str) -> _Changed:
        path = find_file(self._folder, asked.file)
        changes = self._changes(path)
        change = changed(now, changes, asked, author, time.time_ns())
        if change.number <= len(changes):
            return _Changed(now, None, {})
        try:
            self._write(path, (*changes, change))
        except OSError as error:
            raise RefusedError(codes.RECORDING_DISK(detail=error_text(error))) from None
        old_name = now.name
        del now.history[:]
        set_labels(now, (*changes, change), history=True)
        return _Changed(now, _reason(change, now.name, old_name), {"file": path.name})

    def _delete(self, now: schema.Recording, asked: schema.RecordingRequest, author: str) -> _Changed:
        path = find_file(self._folder, asked.file)
        changes = self._changes(path)
        change = changed(now, changes, asked, author, time.time_ns())
        self._check_use(path, now.name)
        try:
            with _locked(path, now.name):
                change.bytes, change.sha256 = path.stat().st_size, _sha256(path)
                self._check_use(path, now.name)  # hashing a long file takes seconds
                self._remove(path, (*changes, change))
        except OSError as error:
            raise RefusedError(codes.RECORDING_DISK(detail=error_text(error))) from None
        gone = describe_deleted(path, (*changes, change), robot=robot_of(self._folder, path))
        gone.site, gone.robot = now.site, now.robot
        values = {"file": path.name, "sha256": change.sha256, "bytes": str(change.bytes)}
        return _Changed(gone, _reason(change, now.name, now.name, path.name), values)

    def _remove(self, path: Path, changes: tuple[schema.RecordingChange, ...]) -> None:
        deleting = path.with_suffix(_DELETING)
        path.rename(deleting)
        try:
            self._write(path, changes)
        except OSError as error:
            if error.errno not in _NO_SPACE:
                deleting.rename(path)
                raise
            # On a disk so full that not even the entry fits, the recording makes room for it. The lock keeps
            # the file open, so that removing its name alone would free nothing.
            os.truncate(deleting, 0)
            try:
                self._write(path, changes)
            except OSError as still:
                log.error("%s is deleted, but its entry cannot be written: %s", path, error_text(still))
        deleting.unlink(missing_ok=True)

    def _write(self, path: Path, changes: tuple[schema.RecordingChange, ...]) -> None:
        try:
            write_changes(path, changes)
        except OSError as error:
            if error.errno not in _NO_SPACE:
                raise
            self._free_reserve()
            write_changes(path, changes)

    def _changes(self, path: Path) -> tuple[schema.RecordingChange, ...]:
        """Read the changes; a damaged file is renamed, so that nothing overwrites it."""
        try:
            return read_changes(path)
        except DamagedChangesError as error:
            found = changes_path(path)
            with contextlib.suppress(OSError):
                found.replace(found.with_suffix(_DAMAGED))
            self._damaged.append(codes.RECORDING_LABELS_DAMAGED(detail=error))
            return ()

    def _check_use(self, path: Path, name: str) -> None:
        if (used := self._is_used(path.name, name)) is not None:
            raise RefusedError(used)

    def _deleted(self, file: str, author: str) -> schema.Recording | None:
        """Return a recording that the same author has deleted."""
        if not is_file_name(file):
            return None
        for path in (self._folder / file, *(each / file for each in sorted(self._folder.iterdir()))):
            with contextlib.suppress(DamagedChangesError):
                changes = read_changes(path)
                if is_deleted(changes) and changes[-1].author == author:
                    return describe_deleted(path, changes, robot=robot_of(self._folder, path))
        return None


@contextlib.contextmanager
def _locked(path: Path, name: str) -> Iterator[None]:
    """Lock a recording while the block runs; readers, players and captures of this machine hold its lock.

    Raises:
        RefusedError: If one of them has it open.
        OSError: If it cannot be opened.
    """
    file = os.open(path, os.O_RDWR | os.O_CLOEXEC)
    try:
        until_s = time.monotonic() + _LOCK_WITHIN_S
        while True:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                if time.monotonic() > until_s:
                    raise RefusedError(codes.RECORDING_PLAYED(name=name)) from None
                time.sleep(_LOCK_RETRY_S)
            except OSError:  # a disk without locks
                break
        yield
    finally:
        os.close(file)


def _sha256(path: Path) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _reason(change: schema.RecordingChange, name: str, old_name: str, file: str = "") -> Reason:
    """Return what an event says of a change."""
    author = change.author
    match change.change:
        case _Change.RENAMED:
            return codes.RECORDING_RENAMED(author=author, old=old_name, name=name)
        case _Change.NOTED:
            return codes.RECORDING_NOTED(author=author, name=name)
        case _Change.TAGGED if change.tags:
            return codes.RECORDING_TAGGED(author=author, name=name, tags=", ".join(change.tags))
        case _Change.TAGGED:
            return codes.RECORDING_UNTAGGED(author=author, name=name)
        case _:
            return codes.RECORDING_DELETED(
                author=author,
                name=name,
                reason=change.reason,
                file=file,
                bytes=change.bytes,
                sha256=change.sha256,
            )


def _robot_of(recording: schema.Recording) -> str:
    """Return the robot for an event: of a merged or damaged file, the whole site."""
    try:
        return check_name(recording.robot, "robot")
    except KeyNameError:
        return WHOLE_SITE
