"""The robots that the page can open: library robots, and robots saved at this site."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from robots.descriptions.description import DESCRIPTION_FILE, LIBRARY, library_names
from robots.schema.bounded_toml import read_toml
from services.site_file.site import Site

Json = dict[str, Any]


def robot_folder(site: Site, name: str) -> Path | None:
    """Return a robot's folder, a saved robot before one of the library; None if there is none."""
    for folder in (site.define.folder, LIBRARY):
        # A name from the listing cannot be a path to another folder.
        if name in _names(folder):
            return folder / name
    return None


def listing(site: Site, running: frozenset[str]) -> Iterator[Json]:
    """Yield every robot that can be opened: name, title, origin, number of joints, whether it runs here.

    The number is None if the joints are in another file, which the console must not read itself.
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
        values = {}  # the page shows the error when the robot is opened
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
