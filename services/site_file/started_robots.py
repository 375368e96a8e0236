"""Robots that were started from the page: a small site file next to the saved robots.

The console writes it and `robomesh up` follows it: each robot gets its own simulator, gateway and kinematics
processes, now and at every start of the site.
"""

from pathlib import Path

from pydantic import ValidationError

from protocol_gateway.seam.table import problem_text
from robomesh.files.atomic_write import write_atomically
from robots.descriptions.description import DESCRIPTION_FILE, library_names
from robots.schema.bounded_toml import read_toml
from services.errors import SiteFileError
from services.site_file.site import Site
from services.site_file.tables.robot import Robot

STARTED_FILE = "started.toml"


def read_started(site: Site) -> tuple[Robot, ...]:
    """Read the started robots; their descriptions are not checked.

    Raises:
        SiteFileError: If the file is invalid, or names a robot of the site file.
    """
    path = site.define.folder / STARTED_FILE
    try:
        values = read_toml(path)
    except FileNotFoundError:
        return ()
    except OSError as error:
        raise SiteFileError(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise SiteFileError(f"{path}: not TOML: {error}") from None
    try:
        added = Site.model_validate(values)
    except ValidationError as error:
        detail = error.errors()[0]
        where = ".".join(map(str, detail["loc"]))
        raise SiteFileError(f"{path}: {where}: {problem_text(detail)}") from None
    own = {robot.name for robot in site.robot}
    if added.site != site.site:
        raise SiteFileError(f"{path}: site = {added.site!r}: should be {site.site!r}")
    for robot in added.robot:
        if robot.name in own:
            raise SiteFileError(f"{path}: robot {robot.name!r}: the site file has a robot with that name")
        if not robot.simulated:
            raise SiteFileError(
                f"{path}: robot {robot.name!r}: only simulated robots can be started from the page"
            )
        if robot.cell:
            raise SiteFileError(
                f"{path}: robot {robot.name!r}: cells belong in the site file; remove cell here"
            )
    return tuple(
        robot.model_copy(update={"model": str(site.define.folder / robot.model)})
        if robot.model.endswith((".toml", ".urdf"))
        else robot
        for robot in added.robot
    )


def may_start(site: Site) -> tuple[str, ...]:
    """Return the names of the robots that the page may start: started, saved or library robots.

    Robots of the site file are excluded.

    Raises:
        SiteFileError: If the file of started robots is invalid.
    """
    started = {robot.name for robot in read_started(site)}
    saved = {file.parent.name for file in site.define.folder.glob(f"[!.]*/{DESCRIPTION_FILE}")}
    names = started | saved.union(library_names()) - {robot.name for robot in site.robot}
    return tuple(sorted(filter(_is_name, names)))


def _is_name(text: str) -> bool:
    try:
        Robot(name=text, model=text)
    except ValidationError:
        return False
    return True


def robot_to_start(site: Site, name: str) -> Robot:
    """Return the entry for a saved robot or a library robot.

    Its model is a path relative to the folder of saved robots.
    """
    saved = (site.define.folder / name / DESCRIPTION_FILE).is_file()
    return Robot(name=name, model=f"{name}/{DESCRIPTION_FILE}" if saved else name)


def write_started(site: Site, robots: tuple[Robot, ...]) -> None:
    """Replace the file of started robots.

    Args:
        robots: Entries from `read_started` and `robot_to_start`.

    Raises:
        OSError: If it cannot be written; the old file remains.
    """
    folder = site.define.folder
    lines = ["# Robots started from the page; robomesh up follows this file.", f'site = "{site.site}"']
    for robot in robots:
        model = Path(robot.model)
        # Names contain no character that TOML would escape.
        own = model.relative_to(folder).as_posix() if model.is_relative_to(folder) else robot.model
        lines += ["", "[[robot]]", f'name = "{robot.name}"', f'model = "{own}"', 'controller = "simulated"']
    folder.mkdir(parents=True, exist_ok=True)
    write_atomically(folder / STARTED_FILE, "\n".join([*lines, ""]).encode())
