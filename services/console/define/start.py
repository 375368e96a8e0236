"""Starting and stopping a defined robot as a simulated robot of the site."""

from robomesh import reason_codes as codes
from services.console.common.errors import RefusedRequest
from services.errors import SiteFileError
from services.site_file.site import Site
from services.site_file.started_robots import read_started, robot_to_start, write_started
from services.site_file.tables.robot import Robot


def started_names(site: Site) -> tuple[str, ...]:
    """Return the names of the started robots; none if their file cannot be read."""
    try:
        return tuple(robot.name for robot in read_started(site))
    except SiteFileError:
        return ()


def start(site: Site, name: str, *, can_start: bool) -> None:
    """Make the supervisor start a robot.

    Raises:
        RefusedRequest: If there is no supervisor, or the site has a robot with that name.
    """
    if name in {robot.name for robot in site.robot}:
        raise RefusedRequest(409, codes.DEFINE_SITE_HAS(site=site.site, name=name))
    robot = robot_to_start(site, name)
    if not can_start:
        model = (site.define.folder / robot.model).absolute() if "/" in robot.model else robot.model
        raise RefusedRequest(409, codes.DEFINE_NO_SUPERVISOR(name=name, model=model))
    robots = _read(site)
    if name in {each.name for each in robots}:
        raise RefusedRequest(409, codes.DEFINE_RUNS(name=name))
    write_started(site, (*robots, robot))


def stop(site: Site, name: str) -> None:
    """Make the supervisor stop a started robot.

    Raises:
        RefusedRequest: If it was not started from the page.
    """
    robots = _read(site)
    if name not in {robot.name for robot in robots}:
        if name in {robot.name for robot in site.robot}:
            raise RefusedRequest(409, codes.DEFINE_IN_SITE_FILE(name=name))
        raise RefusedRequest(409, codes.DEFINE_NOT_STARTED(name=name))
    write_started(site, tuple(robot for robot in robots if robot.name != name))


def _read(site: Site) -> tuple[Robot, ...]:
    try:
        return read_started(site)
    except SiteFileError as error:
        raise RefusedRequest(409, codes.DEFINE_STARTED_UNREADABLE(detail=error)) from None
