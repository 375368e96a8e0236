"""Robots that were started from the page: a small site file of additions, beside the saved robots.

The console writes it, `robomesh up` follows it: each robot gets its simulator, gateway and kinematics
as processes of its own, now and whenever the site comes up.
"""

from pathlib import Path

from pydantic import ValidationError

from robomesh.atomic_write import write_atomically
from robots.bounded_toml import read_toml
from robots.description import DESCRIPTION_FILE, library_names
from services.errors import SiteFileError
from services.site_file.site import Robot, Site

STARTED_FILE = "started.toml"


def read_started(site: Site) -> tuple[Robot, ...]:
    """The robots that were started, whether their descriptions are right or not.

    Raises:
        SiteFileError: If the file is there and wrong, or names a robot that the site has already.
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
        raise SiteFileError(f"{path}: {where}: {detail['msg'].removeprefix('Value error, ')}") from None
    own = {robot.name for robot in site.robot}
    if added.site != site.site:
        raise SiteFileError(f"{path}: site = {added.site!r}: it is the site {site.site!r} that starts these")
    for robot in added.robot:
        if robot.name in own:
            raise SiteFileError(f"{path}: robot {robot.name!r}: the site file has one of that name")
        if not robot.simulated:
            raise SiteFileError(f"{path}: robot {robot.name!r}: only simulated ones are started from here")
        if robot.cell:
            raise SiteFileError(
                f"{path}: robot {robot.name!r}: cells are the site file's; take cell out here"
            )
    return tuple(
        robot.model_copy(update={"model": str(site.define.folder / robot.model)})
        if robot.model.endswith((".toml", ".urdf"))
        else robot
        for robot in added.robot
    )


def may_start(site: Site) -> tuple[str, ...]:
    """Names of the robots that the page may start: started, saved, or the library's; none of the site file's.

    Raises:
        SiteFileError: If the file of those that were started is wrong.
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
    """The entry for a saved robot, or for one of the library.

    Its model is a path relative to the folder of saved robots.
    """
    saved = (site.define.folder / name / DESCRIPTION_FILE).is_file()
    return Robot(name=name, model=f"{name}/{DESCRIPTION_FILE}" if saved else name)


def write_started(site: Site, robots: tuple[Robot, ...]) -> None:
    """Replace the file in one step.

    Args:
        robots: As `read_started` and `robot_to_start` give them.

    Raises:
        OSError: If it cannot be written; what was there stays.
    """
    folder = site.define.folder
    lines = ["# Robots started from the page; robomesh up follows this file.", f'site = "{site.site}"']
    for robot in robots:
        model = Path(robot.model)
        # Names hold nothing that TOML would need escaped.
        own = model.relative_to(folder).as_posix() if model.is_relative_to(folder) else robot.model
        lines += ["", "[[robot]]", f'name = "{robot.name}"', f'model = "{own}"', 'controller = "simulated"']
    folder.mkdir(parents=True, exist_ok=True)
    write_atomically(folder / STARTED_FILE, "\n".join([*lines, ""]).encode())
