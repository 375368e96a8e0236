"""Files that an earlier recorder left unfinished, and the lock that decides which recorder recovers them."""

import fcntl
import os
from pathlib import Path

from robomesh.recordings.recovery.recover import State, is_ours, state_of
from robomesh.recordings.writing.capture import is_being_written

_LOCK = ".lock"


def lock_folder(folder: Path) -> int | None:
    """Take the folder's exclusive lock; closing the returned file descriptor releases it, as does a kill.

    Returns:
        The file descriptor, or None if another recorder holds the lock.

    Raises:
        OSError: If the folder cannot be created, or does not support locks.
    """
    folder.mkdir(parents=True, exist_ok=True)
    file = os.open(folder / _LOCK, os.O_WRONLY | os.O_CREAT, 0o644)
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(file)
        if isinstance(error, BlockingIOError):
            return None
        raise
    return file


def left_state(path: Path) -> State | None:
    """Return the state of a left file; None if another program wrote it or it is being written.

    An empty file is removed.

    Raises:
        CaptureError: If it is not a recording.
        OSError: If it cannot be read.
    """
    if is_being_written(path):
        return None
    if not path.stat().st_size:
        path.unlink()
        return None
    return state_of(path) if is_ours(path) else None
