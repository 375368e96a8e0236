"""The start of a simulated controller: its protocol's settings from the options of `robomesh simulate`."""

from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypedDict, TypeVar

from robomesh import service
from robomesh.keys import check_name
from services.command_line.output import print_line
from services.command_line.site.controllers import ControllerError
from services.command_line.site.launch import session_settings
from services.site_file import site as site_file
from services.site_file.listen_address import split_address

if TYPE_CHECKING:
    from pydantic import BaseModel

    from services.simulator.fault_requests import Mesh

    _Part = TypeVar("_Part", bound=BaseModel)


class _Common(TypedDict):
    """The settings that every protocol has."""

    robot: str
    listen: str
    demo: bool
    faults: tuple[str, ...]
    insecure: bool
    mesh: "Mesh | None"


class Options(TypedDict):
    """The options of `robomesh simulate` for single protocols."""

    rate: float
    max_clients: int
    code: list[str]
    primary: str
    scripts: list[str]
    dashboard: str
    yaskawa: str
    fanuc: str
    rmi: str
    path: str


_RTDE_PORT = 30004

# Runs a controller; calls the function with the line that says where it listens.
_Run = Callable[[Callable[[str], None]], Coroutine[Any, Any, None]]


def run(
    protocol: str,
    options: Options,
    *,
    robot: str,
    listen: str,
    demo: bool,
    faults: tuple[str, ...],
    insecure: bool,
    mesh: "Mesh | None",
) -> None:
    """Run a simulated controller until a signal.

    Args:
        robot, listen: Empty: the protocol's own.
        mesh: Result of `faults_mesh`.

    Raises:
        ControllerError: If an option is invalid.
    """
    service.log_to_stderr()
    row = _PROTOCOLS[protocol]
    common = _Common(
        robot=robot or row.robot,
        listen=listen or row.listen,
        demo=demo,
        faults=faults,
        insecure=insecure,
        mesh=mesh,
    )
    serve = row.prepare(common, options)
    service.run_until_signalled(serve(print_line))


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


def _unit(common: _Common, options: Options) -> _Run:
    from services.simulator.simulator import Settings, serve

    settings = Settings(
        **common,
        rate_hz=options["rate"],
        max_clients=options["max_clients"],
        codes=dict(map(_code, options["code"])),
    )
    return lambda tell: serve(settings, ready=tell)


def _rtde(common: _Common, options: Options) -> _Run:
    from services.simulator.universal_robots.service import UrPorts, UrSettings, serve_rtde

    host, port = split_address(common["listen"])

    def address(real: int) -> str:
        # A second controller has an address of its own, or free ports.
        return f"{host}:{real if port == _RTDE_PORT else 0}"

    primary, dashboard = options["primary"] or address(30011), options["dashboard"] or address(29999)
    scripts = tuple(options["scripts"] or map(address, (30001, 30002, 30003)))
    settings = UrSettings(**common, primary=primary, scripts=scripts, dashboard=dashboard)

    def line(ports: UrPorts) -> str:
        def at(text: str, *numbers: int) -> str:
            return f"{split_address(text)[0]}:{', '.join(map(str, numbers))}"

        return (
            f"listening on {host}:{ports.rtde}, primary interface on {at(primary, ports.primary)}, "
            f"scripts on {at(scripts[0], *ports.scripts)}, dashboard on {at(dashboard, ports.dashboard)}"
        )

    return lambda tell: serve_rtde(settings, ready=lambda ports: tell(line(ports)))


def _hses(common: _Common, options: Options) -> _Run:
    from services.simulator.yaskawa.service import HsesSettings, serve_hses
    from services.site_file.yaskawa import Yaskawa

    declared = _declared(Yaskawa, "yaskawa", options["yaskawa"])
    settings = HsesSettings(**common, yaskawa=None if declared is None else declared.settings)
    host = split_address(settings.listen)[0]
    return lambda tell: serve_hses(settings, ready=lambda port: tell(f"listening on udp {host}:{port}"))


def _snpx(common: _Common, options: Options) -> _Run:
    from services.simulator.fanuc.service import FanucPorts, SnpxSettings, serve_snpx
    from services.site_file.fanuc import Fanuc

    declared = _declared(Fanuc, "fanuc", options["fanuc"])
    settings = SnpxSettings(
        **common, rmi=options["rmi"], fanuc=None if declared is None else declared.settings
    )
    host = split_address(settings.listen)[0]

    def line(ports: FanucPorts) -> str:
        return f"listening on {host}:{ports.snpx}" + (f", RMI on {ports.rmi}" if ports.rmi else "")

    return lambda tell: serve_snpx(settings, ready=lambda ports: tell(line(ports)))


def _fanuc_ftp(common: _Common, options: Options) -> _Run:
    from services.simulator.fanuc.service import FtpSettings, serve_ftp
    from services.site_file.fanuc import Fanuc

    declared = _declared(Fanuc, "fanuc", options["fanuc"])
    settings = FtpSettings(**common, fanuc=None if declared is None else declared.settings)
    host = split_address(settings.listen)[0]
    return lambda tell: serve_ftp(settings, ready=lambda port: tell(f"listening on {host}:{port}"))


def _opcua(common: _Common, options: Options) -> _Run:
    from robomesh.extras import is_missing, missing

    if is_missing("asyncua"):
        raise ControllerError(missing("asyncua"))
    from services.simulator.opcua.service import OpcUaSimulatorSettings, serve_opcua

    settings = OpcUaSimulatorSettings(**common, path=options["path"])
    host, path = split_address(settings.listen)[0], settings.path.lstrip("/")
    return lambda tell: serve_opcua(
        settings, ready=lambda port: tell(f"listening on opc.tcp://{host}:{port}/{path}".rstrip("/"))
    )


class _Protocol(NamedTuple):
    """The robot and the address of a simulated controller unless they are given, and its start."""

    robot: str
    listen: str
    prepare: Callable[[_Common, Options], _Run]


# Ports of real controllers, or ports like them that need no rights.
_PROTOCOLS = {
    "unit": _Protocol("pt600", "127.0.0.1:5400", _unit),
    "rtde": _Protocol("puma560", f"127.0.0.1:{_RTDE_PORT}", _rtde),
    "hses": _Protocol("puma560", "127.0.0.1:10040", _hses),
    "snpx": _Protocol("puma560", "127.0.0.1:60008", _snpx),
    "fanuc-ftp": _Protocol("puma560", "127.0.0.1:2121", _fanuc_ftp),
    "opcua": _Protocol("puma560", "127.0.0.1:4840", _opcua),
}


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
