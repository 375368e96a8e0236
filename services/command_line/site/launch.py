"""The start of one service: its row of the table makes its Settings from the site file."""

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from robomesh import service
from robomesh.client.connection import addresses
from robomesh.endpoints import DEFAULT_ROUTER
from robomesh.keys import WHOLE_SITE, check_name
from robomesh.session import SessionSettings
from services.command_line.connection_options import with_keys
from services.command_line.site.controllers import ControllerError
from services.command_line.site.metrics_ports import own_address
from services.command_line.site.services import SERVICES, Options
from services.site_file import site as site_file
from services.site_file.listen_address import reachable
from services.site_file.site import Site
from services.site_file.started_robots import read_started

if TYPE_CHECKING:
    from pydantic import BaseModel

    from services.simulator.fault_requests import Mesh

    _Part = TypeVar("_Part", bound=BaseModel)


def launch(name: str, options: Options, connect: str, metrics: str = "") -> None:
    """Run a service of the table, except the router, until a signal.

    Args:
        connect: The routers to attach to, separated by commas.
        metrics: HOST:PORT of the Prometheus endpoint; empty: none.
    """
    service.log_to_stderr()
    row, site = SERVICES[name], site_file.load(options.site_file)
    assert row.settings is not None
    if options.started:
        site = _only_started(site, options.started)
    # The gateways of robots that were started from the page share a certificate of their own.
    certificate = "started" if options.started and name == "gateway" else name
    # A service with work to finish gets more time than the default.
    ends = {"ends_within_s": service.WRITES_WITHIN_S} if row.finishes else {}
    service.run(
        import_module(row.module).serve,
        row.settings(site, options),
        service=name,
        session_settings=session_settings(site, connect, certificate),
        present_for=[
            (site.site, robot)
            for robot in ([each.name for each in site.robot] if row.of_robots else [WHOLE_SITE])
        ],
        metrics=own_address(site, metrics, name, started=bool(options.started)),
        **ends,
    )


def session_settings(site: Site, connect: str, certificate: str) -> SessionSettings:
    """Return a session with the certificate of `--keys`, else with the site's own for this service."""
    given = with_keys(connect)
    if given is not None:
        return given
    routers, tls = addresses(connect), site.tls_of(certificate)
    if tls is not None and routers == (DEFAULT_ROUTER,):
        routers = tuple(map(reachable, site.listened))
    return SessionSettings(connect=routers, tls=tls)


def _only_started(site: Site, name: str) -> Site:
    """Return the site with one robot only, which was started from the page."""
    robots = tuple(robot for robot in read_started(site) if robot.name == name)
    if not robots:
        raise ControllerError(f"--started {name}: no such robot was started from the page of {site.site}")
    # A started robot has no cell; fixtures of other cells name robots that this site lacks.
    fixtures = tuple(fixture for fixture in site.fixture if fixture.cell in {each.cell for each in robots})
    return site.model_copy(update={"robot": robots, "fixture": fixtures})


def faults_mesh(faults_for: str, site: Path | None, connect: str) -> "Mesh | None":
    """Return where a simulated controller answers fault requests; None: nowhere.

    Args:
        faults_for: SITE/ROBOT that accepts fault requests on the mesh, with the site file's certificates;
            empty: none.

    Raises:
        ControllerError: If it is not SITE/ROBOT.
    """
    from services.simulator.fault_requests import Mesh

    if not faults_for:
        return None
    site_name, slash, robot_name = faults_for.partition("/")
    if not slash:
        raise ControllerError(f"--for {faults_for}: SITE/ROBOT is right, as in demo/pt600")
    return Mesh(
        site=check_name(site_name, "site"),
        robot=check_name(robot_name, "robot"),
        session=session_settings(site_file.load(site), connect, "simulator"),
    )


def launch_simulator(
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
    """Run a simulated controller with the unit protocol."""
    from services.simulator import simulator

    service.log_to_stderr()
    settings = simulator.Settings(
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
    service.run_until_signalled(simulator.serve(settings, ready=lambda line: print(line, flush=True)))


def launch_rtde_simulator(
    *,
    robot: str,
    listen: str,
    primary: str,
    scripts: str,
    dashboard: str,
    demo: bool,
    faults: tuple[str, ...],
    insecure: bool,
    mesh: "Mesh | None",
) -> None:
    """Run a simulated controller with RTDE, the primary interface and the dashboard."""
    from services.simulator.universal_robots.service import UrPorts, UrSettings, serve_rtde
    from services.site_file.listen_address import split_address

    def ready(ports: UrPorts) -> None:
        hosts = (split_address(each)[0] for each in (listen, primary, scripts, dashboard))
        addresses = [f"{host}:{port}" for host, port in zip(hosts, ports, strict=True)]
        print(
            "listening on {}, primary interface on {}, scripts on {}, dashboard on {}".format(*addresses),
            flush=True,
        )

    service.log_to_stderr()
    settings = UrSettings(
        robot=robot,
        listen=listen,
        primary=primary,
        scripts=scripts,
        dashboard=dashboard,
        demo=demo,
        faults=faults,
        insecure=insecure,
        mesh=mesh,
    )
    service.run_until_signalled(serve_rtde(settings, ready=ready))


def launch_hses_simulator(
    *,
    robot: str,
    listen: str,
    yaskawa: str,
    demo: bool,
    faults: tuple[str, ...],
    insecure: bool,
    mesh: "Mesh | None",
) -> None:
    """Run a simulated controller with HSES."""
    from services.simulator.yaskawa.service import HsesSettings, serve_hses
    from services.site_file.listen_address import split_address
    from services.site_file.yaskawa import Yaskawa

    declared = _declared(Yaskawa, "yaskawa", yaskawa)

    def ready(port: int) -> None:
        print(f"listening on udp {split_address(listen)[0]}:{port}", flush=True)

    service.log_to_stderr()
    settings = HsesSettings(
        robot=robot,
        listen=listen,
        yaskawa=None if declared is None else declared.settings,
        demo=demo,
        faults=faults,
        insecure=insecure,
        mesh=mesh,
    )
    service.run_until_signalled(serve_hses(settings, ready=ready))


def launch_opcua_simulator(
    *,
    robot: str,
    listen: str,
    path: str,
    demo: bool,
    faults: tuple[str, ...],
    insecure: bool,
    mesh: "Mesh | None",
) -> None:
    """Run a simulated controller with an OPC UA server."""
    from robomesh.extras import is_missing, missing

    if is_missing("asyncua"):
        raise ControllerError(missing("asyncua"))
    from services.simulator.opcua.service import OpcUaSimulatorSettings, serve_opcua
    from services.site_file.listen_address import split_address

    def ready(port: int) -> None:
        host, _ = split_address(listen)
        print(f"listening on opc.tcp://{host}:{port}/{path.lstrip('/')}".rstrip("/"), flush=True)

    service.log_to_stderr()
    settings = OpcUaSimulatorSettings(
        robot=robot, listen=listen, path=path, demo=demo, faults=faults, insecure=insecure, mesh=mesh
    )
    service.run_until_signalled(serve_opcua(settings, ready=ready))


def launch_snpx_simulator(
    *,
    robot: str,
    listen: str,
    rmi: str,
    fanuc: str,
    demo: bool,
    faults: tuple[str, ...],
    insecure: bool,
    mesh: "Mesh | None",
) -> None:
    """Run a simulated controller with SNPX and RMI."""
    from services.simulator.fanuc.service import FanucPorts, SnpxSettings, serve_snpx
    from services.site_file.fanuc import Fanuc
    from services.site_file.listen_address import split_address

    declared = _declared(Fanuc, "fanuc", fanuc)

    def ready(ports: FanucPorts) -> None:
        and_rmi = f", RMI on {ports.rmi}" if ports.rmi else ""
        print(f"listening on {split_address(listen)[0]}:{ports.snpx}{and_rmi}", flush=True)

    service.log_to_stderr()
    settings = SnpxSettings(
        robot=robot,
        listen=listen,
        rmi=rmi,
        fanuc=None if declared is None else declared.settings,
        demo=demo,
        faults=faults,
        insecure=insecure,
        mesh=mesh,
    )
    service.run_until_signalled(serve_snpx(settings, ready=ready))


def launch_ftp_simulator(
    *,
    robot: str,
    listen: str,
    fanuc: str,
    demo: bool,
    faults: tuple[str, ...],
    insecure: bool,
    mesh: "Mesh | None",
) -> None:
    """Run a simulated controller of FANUC's kind that is read by FTP."""
    from services.simulator.fanuc.service import FtpSettings, serve_ftp
    from services.site_file.fanuc import Fanuc
    from services.site_file.listen_address import split_address

    declared = _declared(Fanuc, "fanuc", fanuc)

    def ready(port: int) -> None:
        print(f"listening on {split_address(listen)[0]}:{port}", flush=True)

    service.log_to_stderr()
    settings = FtpSettings(
        robot=robot,
        listen=listen,
        fanuc=None if declared is None else declared.settings,
        demo=demo,
        faults=faults,
        insecure=insecure,
        mesh=mesh,
    )
    service.run_until_signalled(serve_ftp(settings, ready=ready))


def _declared(part: "type[_Part]", option: str, text: str) -> "_Part | None":
    """Return a table of the site file that an option gives as JSON; None: it is empty.

    Raises:
        ControllerError: If it is invalid.
    """
    from pydantic import ValidationError

    from services.site_file.validation_errors import problem_text

    try:
        return part.model_validate_json(text) if text else None
    except ValidationError as error:
        problem = error.errors()[0]
        where = ".".join(map(str, problem["loc"]))
        raise ControllerError(f"--{option} {where}: {problem_text(problem)}") from None


def _code(text: str) -> tuple[int, str]:
    number, _, meaning = text.partition("=")
    try:
        return int(number), meaning
    except ValueError:
        raise ControllerError(f"--code {text}: NUMBER=TYPE is right, as in 2=ABSOLUTE.DEG") from None
