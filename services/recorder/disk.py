"""Disk access: only its threads wait for the disk; they write open files each 0.05 s and sync each second.

What a slow or full disk cannot take is dropped in order: video, then data derived from the joints, then all.
"""

import contextlib
import errno
import os
import shutil
import threading
import time
from collections.abc import Callable, Mapping
from enum import IntEnum
from pathlib import Path

from robomesh import reason_codes as codes
from robomesh.contract.topics import History, Topic
from robomesh.reasons import Reason
from robomesh.recordings import records
from robomesh.recordings.recovery.recover import close_in_place
from robomesh.recordings.writing.capture import Capture
from services.recorder.settings import MIB, FreeSpace

_WRITE_EVERY_S = 0.05
_SYNC_EVERY_S = 1.0
_CHECK_SPACE_EVERY_S = 0.2
# Bytes that wait to be written, over all files; each threshold raises the recording level by one.
_MOST_WAITING = (32 * MIB, 64 * MIB, 128 * MIB)
# A file that is deleted to make room for the ends of files on a full disk.
_RESERVE = ".reserve"
_RESERVE_BYTES = MIB
# Topics that can be computed again from the joints.
_DERIVED = frozenset({"frames", "kinematics"})


class RecordingLevel(IntEnum):
    """The topics of a robot that are recorded."""

    ALL = 0
    NO_VIDEO = 1
    STATES_ONLY = 2
    NOTHING = 3


def is_recorded(level: RecordingLevel, row: Topic) -> bool:
    """Return whether a topic is recorded at this level."""
    if row.history is History.KEY_FRAME:
        return level < RecordingLevel.NO_VIDEO
    if row.name in _DERIVED:
        return level < RecordingLevel.STATES_ONLY
    return level < RecordingLevel.NOTHING


def ended_by(error: OSError) -> Reason:
    """Return the reason for which a disk error ended a recording."""
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return codes.RECORDING_DISK_FULL()
    return codes.RECORDING_DISK_FAILED(detail=error_text(error))


def error_text(error: OSError) -> str:
    """Return a disk error as text for the operator."""
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return "no space left on the disk"
    return error.strerror or str(error)


class Disk:
    """The disk of a recorder's folder.

    Args:
        on_failed: Called, on another thread, with a file that could not be written.
    """

    def __init__(
        self, folder: Path, limits: FreeSpace, on_failed: Callable[[Capture, OSError], None]
    ) -> None:
        self.folder = folder
        self.free_bytes = 0
        self.level = RecordingLevel.ALL
        self._limits, self._on_failed = limits, on_failed
        self._level_by_space = RecordingLevel.ALL
        self._captures: tuple[Capture, ...] = ()
        # Guards the tuple of files; never held while waiting for the disk.
        self._lock = threading.Lock()
        self._repairing = threading.Lock()
        self._wrote_at = time.monotonic()
        self._closed = threading.Event()
        self.check_space()
        self._threads = [
            threading.Thread(target=work, args=(every_s,), name=work.__name__, daemon=True)
            for work, every_s in ((self._write, _WRITE_EVERY_S), (self._sync, _SYNC_EVERY_S))
        ]
        for thread in self._threads:
            thread.start()

    @property
    def behind_s(self) -> float:
        """Upper bound of the age of waiting data [s]."""
        waits = any(capture.waiting_bytes for capture in self._captures)
        return time.monotonic() - self._wrote_at if waits else 0.0

    @property
    def is_low(self) -> bool:
        """True if free space is below the warning mark."""
        return self.free_bytes < self._limits.warn_mib * MIB

    def update_level(self) -> RecordingLevel:
        """Set the recording level from the waiting bytes and the free space, and return it."""
        waiting = sum(capture.waiting_bytes for capture in self._captures)
        self.level = max(self._level_by_space, RecordingLevel(sum(waiting > most for most in _MOST_WAITING)))
        return self.level

    def open(self, capture: Capture) -> None:
        """Start writing a file."""
        with self._lock:
            self._captures = (*self._captures, capture)

    def close(self, capture: Capture, missed: Mapping[str, int]) -> None:
        """Write a file to its end; blocks.

        Raises:
            OSError: If a write fails or failed earlier; the file is then repaired if there is room.
        """
        if self._remove(capture):
            try:
                capture.finish(missed)
                return
            except OSError as error:
                capture.give_up(error)
                self._on_failed(capture, error)
        self.repair(capture, missed)
        raise capture.failure or OSError(errno.EBADF, "the file was already closed")

    def repair(self, capture: Capture, missed: Mapping[str, int]) -> None:
        """Append a valid end to a file that could not be written, if there is room; blocks.

        A file without any content is removed.
        """
        capture.give_up()
        with self._repairing, contextlib.suppress(OSError, ValueError):
            self.free_reserve()
            if capture.path.stat().st_size < len(records.MAGIC):
                capture.path.unlink()
            else:
                close_in_place(capture.path, missed)

    def free_reserve(self) -> None:
        """Delete the reserve file; `check_space` makes it again once there is room."""
        (self.folder / _RESERVE).unlink(missing_ok=True)

    def check_space(self) -> None:
        """Measure the free space, and create the reserve file if there is room."""
        folder = next(each for each in (self.folder, *self.folder.absolute().parents) if each.exists())
        self.free_bytes = free = shutil.disk_usage(folder).free
        self._level_by_space = RecordingLevel(
            (free < self._limits.video_mib * MIB) + (free < self._limits.states_mib * MIB)
        )
        reserve = self.folder / _RESERVE
        if free > 4 * _RESERVE_BYTES and self.folder.exists() and not reserve.exists():
            with contextlib.suppress(OSError), reserve.open("wb") as stream:
                os.posix_fallocate(stream.fileno(), 0, _RESERVE_BYTES)

    def end(self) -> None:
        """Stop the threads; the caller has closed all files before."""
        self._closed.set()
        for thread in self._threads:
            thread.join(1.0)  # do not wait for a disk that hangs
        with contextlib.suppress(OSError):
            (self.folder / _RESERVE).unlink()

    def _write(self, every_s: float) -> None:
        checked_at = 0.0
        while not self._closed.wait(every_s):
            for capture in self._captures:
                try:
                    capture.write_out()
                except OSError as error:
                    self._fail(capture, error)
            self._wrote_at = time.monotonic()
            if self._wrote_at - checked_at > _CHECK_SPACE_EVERY_S:
                checked_at = self._wrote_at
                with contextlib.suppress(OSError):
                    self.check_space()

    def _sync(self, every_s: float) -> None:
        while not self._closed.wait(every_s):
            for capture in self._captures:
                try:
                    capture.sync()
                except OSError as error:
                    self._fail(capture, error)

    def _fail(self, capture: Capture, error: OSError) -> None:
        if self._remove(capture):  # otherwise another thread has closed it
            capture.give_up(error)
            self._on_failed(capture, error)

    def _remove(self, capture: Capture) -> bool:
        """Stop writing a file; return whether it was open: only the caller that gets True may end it."""
        with self._lock:
            was_open = capture in self._captures
            self._captures = tuple(each for each in self._captures if each is not capture)
        return was_open
