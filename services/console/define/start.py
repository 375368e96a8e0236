"""Starting a robot that was defined, as a simulated one of the site, and ending it."""

from services.console.define.errors import RefusedRequest
from services.errors import SiteFileError
from services.site_file.site import Robot, Site
from services.site_file.started_robots import read_started, robot_to_start, write_started


def started_names(site: Site) -> tuple[str, ...]:
    """Names of the robots that were started here; none where the file that says so cannot be read."""
    try:
        return tuple(robot.name for robot in read_started(site))
    except SiteFileError:
        return ()


def start(site: Site, name: str, *, can_start: bool) -> None:
    """Have the supervisor start a robot.

    Raises:
        RefusedRequest: If nobody would, or the site has one of that name.
    """
    if name in {robot.name for robot in site.robot}:
        raise RefusedRequest(
            409, f"the site {site.site} has a robot {name} already: save yours under another name"
        )
    robot = robot_to_start(site, name)
    if not can_start:
        model = (site.define.folder / robot.model).absolute() if "/" in robot.model else robot.model
        raise RefusedRequest(
            409,
            "nothing here can start a robot (robomesh up does). Put this into the site file and start its "
            f'services anew:\n\n[[robot]]\nname = "{name}"\nmodel = "{model}"\ncontroller = "simulated"',
        )
    robots = _read(site)
    if name in {each.name for each in robots}:
        raise RefusedRequest(409, f"{name} runs already; what is saved anew starts anew by itself")
    write_started(site, (*robots, robot))


def stop(site: Site, name: str) -> None:
    """Have the supervisor end a robot that was started so.

    Raises:
        RefusedRequest: If none was.
    """
    robots = _read(site)
    if name not in {robot.name for robot in robots}:
        if name in {robot.name for robot in site.robot}:
            raise RefusedRequest(409, f"{name} is in the site file: take it out there")
        raise RefusedRequest(409, f"{name} was not started from here")
    write_started(site, tuple(robot for robot in robots if robot.name != name))


def _read(site: Site) -> tuple[Robot, ...]:
    try:
        return read_started(site)
    except SiteFileError as error:
        raise RefusedRequest(409, f"{error}: mend or remove it") from None
