"""The recorder's folder: files by their names, and nothing outside it."""

import re
from pathlib import Path

from mcap_files.channel_names import SUFFIX
from mcap_files.errors import RecordingError

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.:+-]*")


def find_file(folder: Path, name: str) -> Path:
    """The file of that name, in the folder or in a robot's folder below it.

    Raises:
        RecordingError: If there is none, or the name could lead elsewhere.
    """
    if not _NAME.fullmatch(name) or not name.endswith(SUFFIX):
        raise RecordingError(f"no recording {name!r}: a file's name is right, as recordings/list tells it")
    for path in (folder / name, *sorted(folder.glob(f"*/{name}"))):
        if path.is_file() and path.resolve().is_relative_to(folder.resolve()):
            return path
    raise RecordingError(f"no recording {name!r} here: recordings/list tells which there are")
