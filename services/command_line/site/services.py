"""The commands that run one service: its part of the site file becomes its Settings."""

import logging
from collections.abc import Iterable
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING

from protocol_gateway.legacy.settings import LegacySettings
from robomesh import service
from robomesh.endpoints import DEFAULT_ROUTER
from robomesh.keys import WHOLE_SITE, check_name
from robomesh.session import SessionSettings
from services.command_line.connection_options import addresses, with_keys
from services.command_line.site.router import metrics_address
from services.errors import ServiceError
from services.site_file import site as site_file
from services.site_file.listen_address import reachable, same_address, split_address
from services.site_file.site import Robot, Site
from services.site_file.started_robots import read_started

if TYPE_CHECKING:
    from services.simulator.fault_requests import Mesh

logger = logging.getLogger(__name__)


class ControllerError(ServiceError):
    """A controller that nobody can tell where to find."""


def gateway(path: Path | None, connect: str, controllers: list[str], started: str, metrics: str = "") -> None:
    """Run the gateway of the site's robots, or of one that was started from the page."""
    from protocol_gateway import gateway as role
    from protocol_gateway.settings import RobotSettings
    from services.site_file.cells import cells_of

    site = _with(_begin(path), started)
    addresses, cells = _addresses(site, controllers), cells_of(site)
    robots = tuple(
        RobotSettings(
            name=robot.name,
            description=robot.model,
            host=addresses[robot.name][0],
            port=addresses[robot.name][1],
            protocol=robot.protocol,
            codes=robot.codes,
            accept_unknown=frozenset(robot.accept_unknown),
            stop_proven=robot.can_be_stopped,
            stale_after_s=robot.stale_after_s,
            reconnect_after_s=max(4.0, 2.0 * robot.stale_after_s),
            legacy_clients=_legacy_settings(robot),
            check=robot.check,
            cell=cells[robot.name],
        )
        for robot in site.robot
    )
    settings = role.Settings(
        site=site.site,
        robots=robots,
        audit_folder=site.audit.folder,
        audit_rotate_bytes=round(site.audit.rotate_mib * 2**20),
    )
    service.run(
        role.serve,
        settings,
        service="gateway",
        session_settings=_session(site, connect, "started" if started else "gateway"),
        present_for=_each_robot(site),
        metrics=metrics_address(site, metrics),
        ends_within_s=service.WRITES_WITHIN_S,
    )


def _legacy_settings(robot: Robot) -> LegacySettings | None:
    """Where old client programs attach to a robot; None: none may."""
    clients = robot.legacy_clients
    if clients is None:
        return None
    if warning := clients.warning(f"robot {robot.name}: legacy_clients"):
        logger.warning("%s", warning)
    return clients.settings


def kinematics(path: Path | None, connect: str, started: str, metrics: str = "") -> None:
    """Run the kinematics of the site's robots, or of one that was started from the page."""
    from services import kinematics as role
    from services.site_file.cells import cells_of

    site = _with(_begin(path), started)
    cells = cells_of(site)
    robots = tuple(
        role.RobotSettings(
            name=robot.name,
            cell_description=cells[robot.name],
            cell=robot.cell,
            simulated=robot.simulated,
            stale_after_s=robot.stale_after_s,
        )
        for robot in site.robot
    )
    service.run(
        role.serve,
        role.Settings(site=site.site, robots=robots, quotas=site.quotas.settings),
        service="kinematics",
        session_settings=_session(site, connect, "kinematics"),
        present_for=_each_robot(site),
        metrics=metrics_address(site, metrics),
    )


def recorder(path: Path | None, connect: str, metrics: str = "") -> None:
    """Run the recorder of the site."""
    from services import recorder as role

    site = _begin(path)
    settings = role.Settings(
        site=site.site,
        robots=tuple(robot.name for robot in site.robot),
        folder=site.recorder.folder,
        views=site.recorded_views,
        flight=role.flight_of(site.recorder.flight.model_dump()),
        split=role.Split(**site.recorder.split.model_dump()),
        marks=role.marks_of(site.recorder.free.model_dump()),
        quotas=site.quotas.settings,
        site_file="" if path is None else role.without_secrets(path.read_text(encoding="utf-8")),
    )
    service.run(
        role.serve,
        settings,
        service="recorder",
        session_settings=_session(site, connect, "recorder"),
        present_for=[(site.site, WHOLE_SITE)],
        metrics=metrics_address(site, metrics),
        ends_within_s=service.WRITES_WITHIN_S,
    )


def player(path: Path | None, connect: str, metrics: str = "") -> None:
    """Run the player of the site's recordings."""
    from services import player as role

    site = _begin(path)
    service.run(
        role.serve,
        role.Settings(site=site.site, folder=site.recorder.folder),
        service="player",
        session_settings=_session(site, connect, "player"),
        present_for=[(site.site, WHOLE_SITE)],
        metrics=metrics_address(site, metrics),
    )


def renderer(path: Path | None, connect: str, metrics: str = "") -> None:
    """Run the renderer of the site's robots."""
    from renderer import service as role

    site = _begin(path)
    settings = role.Settings(
        site=site.site,
        views=site.renderer.views,
        size=site.renderer.size,
        fps=site.renderer.fps,
        samples=site.renderer.anti_aliasing,
        shading=site.renderer.shading,
        device=site.renderer.device,
        most_views=site.renderer.most_views,
        quotas=site.quotas.settings,
    )
    service.run(
        role.serve,
        settings,
        service="renderer",
        session_settings=_session(site, connect, "renderer"),
        present_for=[(site.site, WHOLE_SITE)],
        metrics=metrics_address(site, metrics),
    )


def console(path: Path | None, connect: str, supervised: bool, metrics: str = "") -> None:
    """Serve the page."""
    from services.console import app as role
    from services.console.define.settings import DefineSettings

    site = _begin(path)
    tls = site.console.tls
    settings = role.Settings(
        site=site.site,
        listen=site.console.listen,
        insecure=site.console.insecure,
        hosts=site.console.hosts,
        accounts=site.console.accounts,
        certificate=None if tls is None else tls.certificate,
        key=None if tls is None else tls.key,
        define=DefineSettings(site=site, can_start=supervised),
    )
    service.run(
        role.serve,
        settings,
        service="console",
        session_settings=_session(site, connect, "console"),
        present_for=[(site.site, WHOLE_SITE)],
        metrics=metrics_address(site, metrics),
    )


def watch(path: Path | None, connect: str, metrics: str = "") -> None:
    """Hold the site's alarms, and look at the mesh."""
    from services import watch as role

    site = _begin(path)
    service.run(
        role.serve,
        role.Settings(site=site.site, folder=site.watch.folder),
        service="watch",
        session_settings=_session(site, connect, "watch"),
        present_for=[(site.site, WHOLE_SITE)],
        metrics=metrics_address(site, metrics),
    )


def simulate(
    *,
    robot: str,
    listen: str,
    rate_hz: float,
    max_clients: int,
    demo: bool,
    faults: tuple[str, ...],
    codes: list[str],
    insecure: bool,
    mesh: "Mesh | None",
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
        mesh=mesh,
    )
    service.run_until_signalled(role.serve(settings, ready=lambda line: print(line, flush=True)))


def mesh_of_simulator(text: str, path: Path | None, connect: str) -> "Mesh":
    """Where `--for SITE/ROBOT` can be asked for faults; the site file has the certificates for it."""
    from services.simulator.fault_requests import Mesh

    site, slash, robot = text.partition("/")
    if not slash:
        raise ControllerError(f"--for {text}: SITE/ROBOT is right, as in demo/pt600")
    check_name(site, "site")
    session = _session(site_file.load(path), connect, "simulator")
    return Mesh(site=site, robot=check_name(robot, "robot"), session=session)


def _code(text: str) -> tuple[int, str]:
    number, _, meaning = text.partition("=")
    try:
        return int(number), meaning
    except ValueError:
        raise ControllerError(f"--code {text}: NUMBER=TYPE is right, as in 2=ABSOLUTE.DEG") from None


def _begin(path: Path | None) -> Site:
    service.log_to_stderr()
    return site_file.load(path)


def _with(site: Site, started: str) -> Site:
    """The site with one robot only, that was started from the page; the site as it is without a name."""
    if not started:
        return site
    robots = tuple(robot for robot in read_started(site) if robot.name == started)
    if not robots:
        raise ControllerError(f"--started {started}: no such robot was started from the page of {site.site}")
    return site.model_copy(update={"robot": robots})


def _session(site: Site, connect: str, service: str) -> SessionSettings:
    """In the name of `--keys`, else of the site's own certificate for this service."""
    given = with_keys(connect)
    if given is not None:
        return given
    routers, tls = addresses(connect), site.tls_of(service)
    if tls is not None and routers == (DEFAULT_ROUTER,):
        routers = tuple(map(reachable, site.listened))
    return SessionSettings(connect=routers, tls=tls)


def _each_robot(site: Site) -> Iterable[tuple[str, str]]:
    return [(site.site, robot.name) for robot in site.robot]


def _addresses(site: Site, controllers: list[str]) -> dict[str, tuple[str, int]]:
    """Host and port of every robot's controller: the site file's, or the one given here.

    Raises:
        ControllerError: If one is missing, or of no robot, or is something else's too.
        ListenError: If one is none.
    """
    given: dict[str, str] = {}
    for text in controllers:
        name, _, address = text.partition("=")
        if name not in [robot.name for robot in site.robot]:
            raise ControllerError(
                f"--controller {text}: the site has no robot {name!r}; "
                f"it has {', '.join(robot.name for robot in site.robot) or 'none'}"
            )
        given[name] = address
    addresses: dict[str, str] = {}
    for robot in site.robot:
        address = given.get(robot.name, robot.controller)
        if address == "simulated":
            raise ControllerError(
                f"robot {robot.name}: its controller is simulated, and nobody said where: "
                f"--controller {robot.name}=tcp://HOST:PORT (robomesh up starts one by itself)"
            )
        addresses[robot.name] = address.removeprefix("tcp://")
    # What the site file says has been looked at; what is given here has not.
    taken = [(f"robot {name}'s controller", address) for name, address in addresses.items()]
    taken += [
        (f"robot {robot.name}'s legacy_clients", robot.legacy_clients.listen)
        for robot in site.robot
        if robot.legacy_clients is not None
    ]
    for (what, address), (other, another) in combinations(taken, 2):
        if same_address(address, another):
            raise ControllerError(f"{another} is given twice, to {what} and to {other}: each needs its own")
    return {name: split_address(address) for name, address in addresses.items()}
