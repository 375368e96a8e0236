"""The disk: open files are written each 0.05 s and synced each second, by threads that alone wait for it.

What a disk cannot take is given up in order: video, then what follows from the joints, the joints last.
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

from mcap_files import records
from mcap_files.capture import Capture
from mcap_files.recover import mend
from robomesh.topics import History, Topic
from services.recorder.settings import MIB, Marks

_WRITE_EVERY_S = 0.05
_SYNC_EVERY_S = 1.0
_LOOK_EVERY_S = 0.2
# Waiting to be written, of all files together: from here on less is taken.
_MOST_WAITING = (32 * MIB, 64 * MIB, 128 * MIB)
# Which a full disk's files are closed with.
_RESERVE = ".reserve"
_RESERVE_BYTES = MIB
# What can be computed again from the joints.
_DERIVED = frozenset({"frames", "kinematics"})


class Taken(IntEnum):
    """What of a robot's topics is recorded."""

    ALL = 0
    NO_VIDEO = 1
    STATES_ONLY = 2
    NOTHING = 3


def takes(taken: Taken, row: Topic) -> bool:
    """Whether a topic is recorded when that much is."""
    if row.history is History.KEY_FRAME:
        return taken < Taken.NO_VIDEO
    if row.name in _DERIVED:
        return taken < Taken.STATES_ONLY
    return taken < Taken.NOTHING


def words(error: OSError) -> str:
    """What a disk refused, for people."""
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return "no space left on the disk"
    return error.strerror or str(error)


class Disk:
    """The disk of a recorder's folder.

    Args:
        on_failed: Told, on another thread, of a file that could not be written.
    """

    def __init__(self, folder: Path, marks: Marks, on_failed: Callable[[Capture, OSError], None]) -> None:
        self.folder = folder
        self.free_bytes = 0
        self.taken = Taken.ALL
        self._marks, self._on_failed = marks, on_failed
        self._by_space = Taken.ALL
        self._captures: tuple[Capture, ...] = ()
        # Of the files' tuple; nobody waits for the disk with it.
        self._lock = threading.Lock()
        self._mending = threading.Lock()
        self._wrote_at = time.monotonic()
        self._closed = threading.Event()
        self.look()
        self._threads = [
            threading.Thread(target=work, args=(every_s,), name=work.__name__, daemon=True)
            for work, every_s in ((self._write, _WRITE_EVERY_S), (self._sync, _SYNC_EVERY_S))
        ]
        for thread in self._threads:
            thread.start()

    @property
    def behind_s(self) -> float:
        """How long what waits has waited, at most [s]."""
        waits = any(capture.waiting_bytes for capture in self._captures)
        return time.monotonic() - self._wrote_at if waits else 0.0

    @property
    def warned(self) -> bool:
        """Whether space runs short."""
        return self.free_bytes < self._marks.warn

    def weigh(self) -> Taken:
        """Look how much waits, and say what is recorded from now on."""
        waiting = sum(capture.waiting_bytes for capture in self._captures)
        self.taken = max(self._by_space, Taken(sum(waiting > most for most in _MOST_WAITING)))
        return self.taken

    def open(self, capture: Capture) -> None:
        """Write a file from now on."""
        with self._lock:
            self._captures = (*self._captures, capture)

    def close(self, capture: Capture, missed: Mapping[str, int]) -> None:
        """Write a file to its end; blocks.

        Raises:
            OSError: If the disk refuses, or has before; the file is given an end then, if there is any room.
        """
        if self._remove(capture):
            try:
                capture.finish(missed)
                return
            except OSError as error:
                capture.give_up(error)
                self._on_failed(capture, error)
        self.mend(capture, missed)
        raise capture.failure or OSError(errno.EBADF, "it was closed before")

    def mend(self, capture: Capture, missed: Mapping[str, int]) -> None:
        """Give a file that could not be written an end, if there is any room for it; blocks.

        One that the disk took nothing of is removed.
        """
        capture.give_up()
        with self._mending, contextlib.suppress(OSError, ValueError):
            (self.folder / _RESERVE).unlink(missing_ok=True)
            if capture.path.stat().st_size < len(records.MAGIC):
                capture.path.unlink()
            else:
                mend(capture.path, missed)

    def look(self) -> None:
        """See how much space there is."""
        folder = next(each for each in (self.folder, *self.folder.absolute().parents) if each.exists())
        self.free_bytes = free = shutil.disk_usage(folder).free
        self._by_space = Taken((free < self._marks.no_video) + (free < self._marks.states_only))
        reserve = self.folder / _RESERVE
        if free > 4 * _RESERVE_BYTES and self.folder.exists() and not reserve.exists():
            with contextlib.suppress(OSError), reserve.open("wb") as stream:
                os.posix_fallocate(stream.fileno(), 0, _RESERVE_BYTES)

    def end(self) -> None:
        """End the threads; files that are still open are closed before."""
        self._closed.set()
        for thread in self._threads:
            thread.join(1.0)  # a disk that hangs is not waited for
        with contextlib.suppress(OSError):
            (self.folder / _RESERVE).unlink()

    def _write(self, every_s: float) -> None:
        looked_at = 0.0
        while not self._closed.wait(every_s):
            for capture in self._captures:
                try:
                    capture.write_out()
                except OSError as error:
                    self._fail(capture, error)
            self._wrote_at = time.monotonic()
            if self._wrote_at - looked_at > _LOOK_EVERY_S:
                looked_at = self._wrote_at
                with contextlib.suppress(OSError):
                    self.look()

    def _sync(self, every_s: float) -> None:
        while not self._closed.wait(every_s):
            for capture in self._captures:
                try:
                    capture.sync()
                except OSError as error:
                    self._fail(capture, error)

    def _fail(self, capture: Capture, error: OSError) -> None:
        if self._remove(capture):  # else it was closed meanwhile
            capture.give_up(error)
            self._on_failed(capture, error)

    def _remove(self, capture: Capture) -> bool:
        """Write a file no more; whether it was written until now: only who removed it may end it."""
        with self._lock:
            there = capture in self._captures
            self._captures = tuple(each for each in self._captures if each is not capture)
        return there
