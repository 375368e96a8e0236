"""Lookup of the files that a URDF names: `package://`, `file://`, or a path relative to the URDF."""

import os
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from urllib.parse import unquote

# Longer paths are possible nowhere.
_LONGEST_ADDRESS = 4096

Resolve = Callable[[str], Path | None]


def files_of(urdf: Path, packages: Sequence[Path] = (), *, confined: Path | None = None) -> Resolve:
    """Return a function from an address in the URDF to the file, or to None if the file does not exist.

    Without such a file, backslashes are taken for slashes, and upper and lower case for equal, as on Windows,
    if exactly one file fits.

    A package is looked for in the given folders (each may contain the package, or be the package), in
    ROS_PACKAGE_PATH and AMENT_PREFIX_PATH, and in the folders above the URDF.

    Args:
        confined: Find files in this folder only, and ignore the environment.
    """

    names = lru_cache(_names)

    @lru_cache
    def resolve(address: str) -> Path | None:
        if len(address) > _LONGEST_ADDRESS:
            return None
        named = unquote(address)
        for text, is_windows in ((named, False), (named.replace("\\", "/"), True)):
            for candidate in _candidates(text, urdf.absolute(), packages, ask_environment=confined is None):
                path = _as_on_windows(candidate, names) if is_windows else candidate
                if _is_file(path) and (confined is None or path.resolve().is_relative_to(confined.resolve())):
                    return path
        return None

    return resolve


def is_exact(path: Path, address: str) -> bool:
    """Return whether a file has the path in an address, letter by letter."""
    scheme, colon, rest = unquote(address).partition("://")
    parts = (rest if colon else scheme).removeprefix("file:").split("/")
    last = parts[len(parts) - parts[::-1].index("..") :] if ".." in parts else parts
    wanted = [part for part in last if part not in ("", ".")]
    return [*path.parts[-len(wanted) :]] == wanted


def _candidates(
    address: str, urdf: Path, packages: Sequence[Path], *, ask_environment: bool
) -> Iterator[Path]:
    scheme, colon, rest = address.partition("://")
    if not colon:
        yield urdf.parent / address.removeprefix("file:")
    elif scheme == "file":
        yield urdf.parent / rest
    elif scheme in ("package", "model"):
        package, _, inside = rest.partition("/")
        for folder in (*packages, *(_from_environment() if ask_environment else ()), *urdf.parents):
            yield folder / package / inside
            if folder.name == package:
                yield folder / inside


def _from_environment() -> Iterator[Path]:
    for folder in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep):
        if folder:
            yield Path(folder)
    for folder in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        if folder:
            yield Path(folder) / "share"


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # the name is too long or has a zero byte
        return False


def _as_on_windows(path: Path, names: Callable[[Path], dict[str, list[str]]]) -> Path:
    """Return the path with the only names that differ in the case of letters at most."""
    found = Path(path.anchor)
    for part in path.parts[1:]:
        fitting = [] if part == ".." or _exists(found / part) else names(found).get(part.casefold(), [])
        found /= fitting[0] if len(fitting) == 1 else part
    return found


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):
        return False


def _names(folder: Path) -> dict[str, list[str]]:
    """Return the names in a folder, by their form without case."""
    names: dict[str, list[str]] = {}
    try:
        for each in folder.iterdir():
            names.setdefault(each.name.casefold(), []).append(each.name)
    except OSError:
        return {}
    return names
