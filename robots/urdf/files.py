"""Lookup of the files that a URDF names: `package://`, `file://`, or a path relative to the URDF."""

import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from urllib.parse import unquote

Resolve = Callable[[str], Path | None]


def files_of(urdf: Path, packages: Sequence[Path] = (), *, confined: Path | None = None) -> Resolve:
    """Return a function from an address in the URDF to the file, or to None if the file does not exist.

    A package is looked for in the given folders (each may contain the package, or be the package), in
    ROS_PACKAGE_PATH and AMENT_PREFIX_PATH, and in the folders above the URDF.

    Args:
        confined: Find files in this folder only, and ignore the environment.
    """

    def resolve(address: str) -> Path | None:
        for path in _candidates(
            unquote(address), urdf.absolute(), packages, ask_environment=confined is None
        ):
            if _is_file(path) and (confined is None or path.resolve().is_relative_to(confined.resolve())):
                return path
        return None

    return resolve


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
