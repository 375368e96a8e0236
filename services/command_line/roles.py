"""The commands that run one service: its part of the site file becomes its Settings."""

from collections.abc import Iterable
from pathlib import Path

from bus import service
from bus.keys import WHOLE_SITE
from bus.session import SessionSettings
from services import site as site_file
from services.errors import ServiceError
from services.listen import split_address
from services.site import Site


class ControllerError(ServiceError):
    """A controller that nobody can tell where to find."""


def router(path: Path | None) -> None:
    """Run the router of the site."""
    from services import router as role

    site = _begin(path)
    settings = role.Settings(
        listen=site.router.listen,
        connect=site.router.connect,
        tls=site.tls,
        insecure=site.router.insecure,
    )
    service.run_until_signalled(role.serve(settings, ready=print))


def gateway(path: Path | None, connect: str, controllers: list[str]) -> None:
    """Run the gateway of the site's robots."""
    from protocol_gateway import gateway as role
    from protocol_gateway.robot import RobotSettings

    site = _begin(path)
    addresses = _addresses(site, controllers)
    robots = tuple(
        RobotSettings(
            name=robot.name,
            description=robot.model,
            host=addresses[robot.name][0],
            port=addresses[robot.name][1],
            codes=robot.codes,
            accept_unknown=frozenset(robot.accept_unknown),
            stop_proven=robot.can_be_stopped,
            stale_after_s=robot.stale_after_s,
            reconnect_after_s=max(4.0, 2.0 * robot.stale_after_s),
        )
        for robot in site.robot
    )
    settings = role.Settings(site=site.site, robots=robots, audit_folder=site.audit.folder)
    service.run(
        role.serve,
        settings,
        service="gateway",
        session_settings=_session(site, connect),
        present_for=_each_robot(site),
    )


def kinematics(path: Path | None, connect: str) -> None:
    """Run the kinematics of the site's robots."""
    from robots.poses import pose_matrix
    from robots.schema import Units
    from services import kinematics as role

    site = _begin(path)
    robots = tuple(
        role.RobotSettings(
            name=robot.name,
            model=robot.model,
            base_to_site=pose_matrix(robot.pose, Units()),
            cell=robot.cell,
            simulated=robot.simulated,
        )
        for robot in site.robot
    )
    service.run(
        role.serve,
        role.Settings(site=site.site, robots=robots),
        service="kinematics",
        session_settings=_session(site, connect),
        present_for=_each_robot(site),
    )


def recorder(path: Path | None, connect: str) -> None:
    """Run the recorder of the site."""
    from services import recorder as role

    site = _begin(path)
    names = tuple(robot.name for robot in site.robot)
    service.run(
        role.serve,
        role.Settings(site=site.site, robots=names, folder=site.recorder.folder),
        service="recorder",
        session_settings=_session(site, connect),
        present_for=[(site.site, WHOLE_SITE)],
    )


def renderer(path: Path | None, connect: str) -> None:
    """Run the renderer of the site's robots."""
    from renderer import service as role

    site = _begin(path)
    settings = role.Settings(
        site=site.site,
        robots=tuple(robot.name for robot in site.robot),
        views=site.renderer.views,
        size=site.renderer.size,
        fps=site.renderer.fps,
    )
    service.run(
        role.serve,
        settings,
        service="renderer",
        session_settings=_session(site, connect),
        present_for=[(site.site, WHOLE_SITE)],
    )


def console(path: Path | None, connect: str) -> None:
    """Serve the page."""
    from services.console import console as role

    site = _begin(path)
    settings = role.Settings(
        site=site.site,
        listen=site.console.listen,
        insecure=site.console.insecure,
        hosts=site.console.hosts,
    )
    service.run(
        role.serve,
        settings,
        service="console",
        session_settings=_session(site, connect),
        present_for=[(site.site, WHOLE_SITE)],
    )


def simulate(
    robot: str,
    listen: str,
    rate_hz: float,
    max_clients: int,
    demo: bool,
    faults: tuple[str, ...],
    codes: list[str],
    insecure: bool,
) -> None:
    """Run a simulated controller."""
    from services.simulator import simulator as role

    service.log_to_stderr()
    settings = role.Settings(
        robot=robot,
        listen=listen,
        rate_hz=rate_hz,
        max_clients=max_clients,
        demo=demo,
        faults=faults,
        codes=dict(_code(text) for text in codes),
        insecure=insecure,
    )
    service.run_until_signalled(role.serve(settings, ready=lambda line: print(line, flush=True)))


def _code(text: str) -> tuple[int, str]:
    number, _, meaning = text.partition("=")
    try:
        return int(number), meaning
    except ValueError:
        raise ControllerError(f"--code {text}: NUMBER=TYPE is right, as in 2=ABSOLUTE.DEG") from None


def _begin(path: Path | None) -> Site:
    service.log_to_stderr()
    return site_file.load(path)


def _session(site: Site, connect: str) -> SessionSettings:
    return SessionSettings(connect=(connect,), tls=site.tls)


def _each_robot(site: Site) -> Iterable[tuple[str, str]]:
    return [(site.site, robot.name) for robot in site.robot]


def _addresses(site: Site, controllers: list[str]) -> dict[str, tuple[str, int]]:
    """Host and port of every robot's controller: the site file's, or the one given here."""
    given: dict[str, str] = {}
    for text in controllers:
        name, _, address = text.partition("=")
        if name not in [robot.name for robot in site.robot]:
            raise ControllerError(
                f"--controller {text}: the site has no robot {name!r}; "
                f"it has {', '.join(robot.name for robot in site.robot) or 'none'}"
            )
        given[name] = address
    addresses = {}
    for robot in site.robot:
        address = given.get(robot.name, robot.controller)
        if address == "simulated":
            raise ControllerError(
                f"robot {robot.name}: its controller is simulated, and nobody said where: "
                f"--controller {robot.name}=tcp://HOST:PORT (robomesh up starts one by itself)"
            )
        addresses[robot.name] = split_address(address.removeprefix("tcp://"))
    return addresses
