"""Files that are there whole or not at all, and are their owner's only."""

import os
import tempfile
from pathlib import Path


def write_whole(path: Path, data: bytes) -> None:
    """Write a file in one step, readable by its owner alone; blocks until the disk has it.

    Raises:
        OSError: If it cannot be written; what was there stays.
    """
    # Made for its owner alone.
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=".", suffix=".new")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        Path(name).replace(path)
        # Its name too: a power cut must not bring back what was there before.
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)
    except OSError:
        Path(name).unlink(missing_ok=True)
        raise
