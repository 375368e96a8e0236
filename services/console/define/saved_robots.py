"""The robots that can be opened: the library's, and those that were saved at this site."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from robots.bounded_toml import read_toml
from robots.description import DESCRIPTION_FILE, LIBRARY, library_names
from services.site_file.site import Site

Json = dict[str, Any]


def robot_folder(site: Site, name: str) -> Path | None:
    """The folder of a robot, a saved one before the library's; None: there is none."""
    for folder in (site.define.folder, LIBRARY):
        # A name is one of a listing, so it cannot lead elsewhere.
        if name in _names(folder):
            return folder / name
    return None


def listing(site: Site, running: frozenset[str]) -> Iterator[Json]:
    """Every robot that can be opened: name, title, origin, number of joints, whether it runs here.

    The number is None where it is in another file, which is not for the console itself to read.
    """
    saved = _names(site.define.folder)
    for name in saved:
        yield _row(site.define.folder / name, name, "site", running=name in running)
    for name in library_names():
        if name not in saved:
            yield _row(LIBRARY / name, name, "library", running=name in running)


def _names(folder: Path) -> list[str]:
    return sorted(path.parent.name for path in folder.glob(f"[!.]*/{DESCRIPTION_FILE}"))


def _row(folder: Path, name: str, origin: str, *, running: bool) -> Json:
    try:
        values = read_toml(folder / DESCRIPTION_FILE)
    except (OSError, ValueError):
        values = {}  # what is wrong with it is told when it is opened
    return {
        "name": name,
        "title": str(values.get("title") or name),
        "origin": origin,
        "joints": _joint_count(values),
        "running": running,
    }


def _joint_count(values: Json) -> int | None:
    joints = values.get("joint")
    if "urdf" in values:
        return None
    return len(joints) if isinstance(joints, list) else 0
