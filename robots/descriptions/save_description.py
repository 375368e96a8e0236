"""Writer of a robot's folder: its robot.toml and shape files.

The new folder is written completely next to the old one, then the two are exchanged in one atomic step.
If the process is killed or the disk is full, the folder holds the old robot or the new one, never a mixture.
"""

import ctypes
import errno
import fcntl
import glob
import hashlib
import io
import json
import os
import re
import secrets
import shutil
import sys
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from math import isfinite
from pathlib import Path, PurePosixPath
from typing import Any

from robomesh import reason_codes as codes
from robomesh.reasons import Reason
from robots.descriptions.description import DESCRIPTION_FILE
from robots.descriptions.description_text import description_text
from robots.schema.bounded_toml import read_toml
from robots.schema.errors import DescriptionError, RobotExistsError, SaveError
from robots.schema.robot_toml import ROBOT_NAME

_AT_FDCWD = -100
_RENAME_EXCHANGE = 2
# A fixed date, so that archives of the same robot are byte-identical.
_ZIP_DATE = (1980, 1, 1, 0, 0, 0)


@dataclass(frozen=True)
class Saved:
    """A robot that was written.

    Attributes:
        path: Its robot.toml.
        revision: The folder's `revision_of`.
    """

    path: Path
    revision: str


def write_description(
    values: Mapping[str, Any],
    files: Mapping[str, bytes | Path],
    folder: Path,
    *,
    overwrite: bool = False,
    replaces: str = "",
) -> Saved:
    """Save a robot as `folder/<name>/robot.toml` with its files in the same folder.

    Args:
        values: The robot.toml's values by key name; its `name` names the folder.
        files: Content, or a file to copy, by path relative to the robot's folder.
        overwrite: Replace an existing robot of this name; the comments of its robot.toml stay.
        replaces: Replace an existing robot only if it still has this revision.

    Raises:
        RobotExistsError: If a robot of that name exists and may not be replaced.
        SaveError: If the robot cannot be written; an existing folder is unchanged.
        DescriptionError: If the name or a file's path is invalid.
    """
    target = folder / _checked_name(values.get("name"))
    return write_folder(values, files, target, overwrite=overwrite, replaces=replaces)


def write_folder(
    values: Mapping[str, Any],
    files: Mapping[str, bytes | Path],
    target: Path,
    *,
    overwrite: bool = False,
    replaces: str = "",
) -> Saved:
    """Save a robot like `write_description`, in a folder of any name."""
    if target.is_dir():
        target = target.resolve()  # replace the folder, not a symbolic link to it
    folder = target.parent
    problems = [str(reason) for path in files if (reason := refused_path(path))]
    if problems:
        raise DescriptionError(target, problems)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with _exclusive_lock(folder):
            for left in folder.glob(f".{glob.escape(target.name)}.*.saving"):
                _remove(left)  # from a save that was killed
            before = _robot_there(target)
            if before is not None and not overwrite and (not replaces or revision_of(target) != replaces):
                raise RobotExistsError(target, changed=bool(replaces))
            fresh = folder / f".{target.name}.{secrets.token_hex(4)}.saving"
            try:
                _write_folder(fresh, _content(values, files, before or ""))
                revision = revision_of(fresh)
                _put_in_place(fresh, target, exchange=before is not None)
            finally:
                # After the exchange this is the old robot; after an error, the incomplete new one.
                shutil.rmtree(fresh, ignore_errors=True)
    except OSError as error:
        raise SaveError(target, error.strerror or str(error)) from error
    return Saved(target / DESCRIPTION_FILE, revision)


def revision_of(folder: Path) -> str:
    """Return a hash of the names and contents of all files in a folder."""
    rows = []
    for path in sorted(folder.rglob("*")):
        if path.is_symlink():
            held = f"to {path.readlink()}"
        elif path.is_file():
            with path.open("rb") as file:
                held = hashlib.file_digest(file, "sha256").hexdigest()
        else:
            continue
        rows.append((str(path.relative_to(folder)), held))
    return hashlib.sha256(json.dumps(rows).encode()).hexdigest()


def zip_description(values: Mapping[str, Any], files: Mapping[str, bytes | Path]) -> bytes:
    """Return a robot's folder as a zip archive.

    Raises:
        DescriptionError: If the name or a file's path is invalid.
        SaveError: If a file cannot be read.
    """
    name = _checked_name(values.get("name"))
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as zipped:
        for path, data in _content(values, files).items():
            if reason := refused_path(path):
                raise DescriptionError(name, [str(reason)])
            try:
                data = data.read_bytes() if isinstance(data, Path) else data
            except OSError as error:
                raise SaveError(Path(path), str(error.strerror)) from error
            entry = zipfile.ZipInfo(f"{name}/{path}", _ZIP_DATE)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            zipped.writestr(entry, data)
    return archive.getvalue()


def refused_path(path: str) -> Reason | None:
    """Return why a path is not that of a file in a robot's folder; None if it is valid."""
    parts = path.split("/")
    if not path or path.startswith("/") or "\\" in path or not path.isprintable():
        return codes.DEFINE_PATH(path=path)
    if any(part in ("", ".", "..") for part in parts) or re.match(r"[A-Za-z]:", path):
        return codes.DEFINE_PATH(path=path)
    if len(path.encode()) > 400 or any(len(part.encode()) > 200 for part in parts):
        return codes.DEFINE_PATH_TOO_LONG(path=path)
    return None


def _checked_name(name: object) -> str:
    if not isinstance(name, str) or len(name) > 100 or not re.fullmatch(ROBOT_NAME, name):
        raise DescriptionError(
            "robot.toml",
            [f"name = {name!r}: lower-case letters, digits, '_' and '-', beginning with a letter or digit"],
        )
    return name


def _content(
    values: Mapping[str, Any], files: Mapping[str, bytes | Path], before: str = ""
) -> dict[str, bytes | Path]:
    """Return all files of a robot's folder, the robot.toml first; a given file of that name is ignored."""
    others = {path: each for path, each in files.items() if path != DESCRIPTION_FILE}
    return {DESCRIPTION_FILE: description_text(values, before).encode(), **others}


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink()


def _robot_there(target: Path) -> str | None:
    """Return the text of the existing robot.toml; None if the target does not exist.

    Raises:
        SaveError: If the target exists and is not a robot's folder.
    """
    try:
        return (target / DESCRIPTION_FILE).read_text(encoding="utf-8", errors="replace")
    except (FileNotFoundError, NotADirectoryError):
        if target.exists() or target.is_symlink():
            raise SaveError(target, "exists and is not a robot's folder; choose another name") from None
        return None


def _write_folder(fresh: Path, files: Mapping[str, bytes | Path]) -> None:
    """Write all files and sync them to the disk."""
    fresh.mkdir()
    folders = {fresh}
    for path, content in files.items():
        file = fresh.joinpath(*PurePosixPath(path).parts)
        file.parent.mkdir(parents=True, exist_ok=True)
        folders |= {parent for parent in file.parents if fresh in parent.parents}
        if isinstance(content, Path):
            shutil.copyfile(content, file)
        else:
            file.write_bytes(content)
        _sync(file)
    for each in folders:
        _sync(each)


def _put_in_place(fresh: Path, target: Path, *, exchange: bool) -> None:
    if exchange:
        libc = ctypes.CDLL(None, use_errno=True)
        names = os.fsencode(fresh), os.fsencode(target)
        if libc.renameat2(_AT_FDCWD, names[0], _AT_FDCWD, names[1], _RENAME_EXCHANGE) != 0:
            number = ctypes.get_errno()
            if number in (errno.EINVAL, errno.ENOSYS):
                raise SaveError(
                    target, "this file system cannot exchange folders atomically; save under another name"
                )
            raise OSError(number, os.strerror(number))
    else:
        fresh.rename(target)
    _sync(target.parent)


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextmanager
def _exclusive_lock(folder: Path) -> Iterator[None]:
    """Hold an exclusive lock on a folder; the kernel releases it if the process is killed."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


def read_robot(folder: Path) -> tuple[dict[str, Any], dict[str, Path]]:
    """Return the values of a saved robot.toml, and the robot's other files by relative path; not validated.

    Raises:
        DescriptionError: If the robot.toml cannot be read, or has a value that JSON cannot hold: a date, nan,
            inf.
    """
    source = folder / DESCRIPTION_FILE
    try:
        values = read_toml(source)
    except OSError as error:
        raise DescriptionError(source, [f"cannot be read: {error.strerror}"]) from error
    except ValueError as error:
        raise DescriptionError(source, [f"is not TOML: {error}"]) from error
    if problems_found := list(_unrepresentable(values)):
        raise DescriptionError(source, problems_found)
    files = {
        path.relative_to(folder).as_posix(): path
        for path in sorted(folder.rglob("*"))
        if path.is_file() and not path.is_symlink() and path != source
    }
    return values, {path: file for path, file in files.items() if refused_path(path) is None}


def _unrepresentable(value: Any, place: str = "") -> Iterator[str]:
    """Yield a problem for each TOML value that JSON cannot hold."""
    if isinstance(value, dict):
        for key, each in value.items():
            yield from _unrepresentable(each, f"{place} {key}".lstrip())
    elif isinstance(value, list):
        for number, each in enumerate(value):
            yield from _unrepresentable(each, f"{place} {number + 1}")
    elif not isinstance(value, str | int | float) or (isinstance(value, float) and not isfinite(value)):
        yield f"{place} = {value}: must be a string, a finite number, true or false"
    elif isinstance(value, int) and abs(value) > sys.float_info.max:
        yield f"{place}: is a number with more than 308 digits"
