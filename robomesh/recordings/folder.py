"""Access to files in the recorder's folder by name, and to no file outside it."""

import re
from pathlib import Path

from robomesh import reason_codes as codes
from robomesh.recordings.channel_names import SUFFIX
from robomesh.recordings.errors import RecordingError

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.:+-]*")


def is_file_name(name: str) -> bool:
    """Return whether a recording can have this file name; it leads to no other folder."""
    return bool(_NAME.fullmatch(name)) and name.endswith(SUFFIX)


def robot_of(folder: Path, path: Path) -> str:
    """Return the robot in whose folder a file is; empty: it is in the recorder's own folder."""
    return path.parent.name if path.parent != folder else ""


def files_in(folder: Path, ending: str) -> list[Path]:
    """Return the files with an ending in a recorder's folder and in the robots' folders below it.

    Args:
        ending: A pattern of pathlib, of file names: "*.mcap".
    """
    return [*folder.glob(f"*/{ending}"), *folder.glob(ending)]


def find_file(folder: Path, name: str) -> Path:
    """Return the file with a name, in the folder or in a robot's folder below it.

    Raises:
        RecordingError: If there is none, or the name could lead outside the folder.
    """
    if not is_file_name(name):
        raise RecordingError(codes.RECORDING_UNKNOWN(name=name))
    for path in (folder / name, *sorted(folder.glob(f"*/{name}"))):
        if path.is_file() and path.resolve().is_relative_to(folder.resolve()):
            return path
    raise RecordingError(codes.RECORDING_UNKNOWN(name=name))
