"""What an earlier recorder left in a folder, and whose it is to make it whole."""

import fcntl
import os
from pathlib import Path

from mcap_files.capture import is_being_written
from mcap_files.recover import State, is_ours, state_of

_LOCK = ".lock"


def own(folder: Path) -> int | None:
    """Have a folder as one of its recorders alone, until the file that is returned is closed.

    Returns:
        None: another has it; a recorder that was killed has it no more.

    Raises:
        OSError: If the folder cannot be made, or has no locks.
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
    """How far a file that was left came; None: it is a stranger's, or being written. An empty one is removed.

    Raises:
        CaptureError: If it is no recording.
        OSError: If it cannot be read.
    """
    if is_being_written(path):
        return None
    if not path.stat().st_size:
        path.unlink()
        return None
    return state_of(path) if is_ours(path) else None
