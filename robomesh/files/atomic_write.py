"""Atomic file writes: a reader finds the old content or the new content, never a part of it."""

import contextlib
import os
import secrets
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO


def write_atomically(path: Path, data: bytes, *, mode: int = 0o600, fsync: bool = True) -> None:
    """Replace a file's content in one step; arguments and errors as for `open_atomically`."""
    with open_atomically(path, mode=mode, fsync=fsync) as file:
        file.write(data)


@contextlib.contextmanager
def open_atomically(path: Path, *, mode: int = 0o600, fsync: bool = True) -> Iterator[BinaryIO]:
    """Open a temporary file in the same folder; rename it to `path` when the block ends without an error.

    Args:
        mode: Permissions of the new file, reduced by the process's umask. By default only the owner reads it.
        fsync: Block until the disk has the content and the name, so that neither is lost in a power cut.
            False for a cache.

    Raises:
        OSError: If the file cannot be written. The old content remains and the temporary file is removed.
    """
    temporary = path.parent / f".{secrets.token_hex(8)}.new"
    descriptor = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, mode)
    try:
        with os.fdopen(descriptor, "wb") as file:
            yield file
            if fsync:
                # Before the rename: otherwise the name can reach the disk before the content.
                file.flush()
                os.fsync(file.fileno())
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
    if fsync:
        fsync_folder(path.parent)


def fsync_folder(folder: Path) -> None:
    """Block until the disk has the names in a folder."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
