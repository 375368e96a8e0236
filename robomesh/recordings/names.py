"""Names of channels, and of the files in the recorder's folder."""

import re
from collections.abc import Mapping
from pathlib import Path

from robomesh import reason_codes as codes
from robomesh.contract.keys import WHOLE_SITE, Key, parse_key
from robomesh.errors import KeyNameError
from robomesh.recordings.errors import RecordingError

# Endings: of a recording, and of one that is being rewritten.
SUFFIX = ".mcap"
INDEXING = ".indexing"
FLIGHT_FOLDER = ".flight"
# Channel with the robot's URDF for viewers; all other channels of our recorder are keys of the mesh.
ROBOT_DESCRIPTION = "/robot_description"
_FILE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.:+-]*")


def topic_name(channel: str) -> str:
    """Return a channel's topic below its robot: "joints"; of another program's channel, its whole name."""
    try:
        return parse_key(channel).topic
    except KeyNameError:
        return channel.strip("/")


def is_recorders(channel: str) -> bool:
    """Return whether our recorder writes a channel of this name."""
    try:
        return channel == ROBOT_DESCRIPTION or bool(parse_key(channel))
    except KeyNameError:
        return False


def robot_channels(messages: Mapping[str, int], file: str) -> dict[str, str]:
    """Return the channels of the robot in a file, by topic below it: "joints".

    Args:
        messages: Number of messages by channel.

    Raises:
        RecordingError: If several robots have messages.
    """
    keys: dict[str, Key] = {}
    for channel in sorted(messages):
        try:
            key = parse_key(channel)
        except KeyNameError:
            continue
        if key.robot != WHOLE_SITE:
            keys[channel] = key
    robots = sorted({key[:2] for channel, key in keys.items() if messages[channel]})
    if len(robots) > 1:
        names = ", ".join(f"{site}/{robot}" for site, robot in robots)
        raise RecordingError(codes.RECORDING_SEVERAL_ROBOTS(file=file, robots=names))
    robots = robots or [key[:2] for key in keys.values()][:1]
    return {key.topic: channel for channel, key in keys.items() if key[:2] in robots}


def is_file_name(name: str) -> bool:
    """Return whether a recording can have this file name; it leads to no other folder."""
    return bool(_FILE_NAME.fullmatch(name)) and name.endswith(SUFFIX)


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
