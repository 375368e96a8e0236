"""`robomesh up`: the whole site under the supervisor, with a ready line when the page shows the arm."""

import asyncio
import logging
import socket
import ssl
import urllib.error
import urllib.request
from collections.abc import Callable, Hashable
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path

from protocol_gateway.configuration.kinds import part_of
from protocol_gateway.seam.simulated import Simulated
from robomesh.contract.keys import robot_key
from robomesh.listen_address import own_addresses, split_address
from robomesh.service import service
from robomesh.texts import split_commas
from robomesh.wire.session import SessionSettings, open_session
from services.command_line import main
from services.command_line.service_settings.metrics_ports import (
    extra_with_metrics,
    first_address,
    with_metrics,
)
from services.command_line.service_settings.table import SERVICES
from services.command_line.terminal.output import print_line
from services.errors import SiteFileError
from services.pki import Folder
from services.pki.errors import KeysError
from services.router.router import check_ports_free
from services.site_file import site as site_file
from services.site_file.site import Site
from services.site_file.started_robots import may_start, read_started
from services.site_file.tables.robot import Robot
from services.supervisor import ENDS_WITHIN_S, SupervisedProgram, fork, supervise
from services.used_ports import check_free, is_used_by_child

log = logging.getLogger(__name__)

_CONSOLE_POLL_S = 0.1


def run(path: Path | None, metrics: str = "") -> None:
    """Run the site until Ctrl-C.

    Args:
        metrics: HOST:PORT of the first service's Prometheus endpoint; empty: the site file decides.
    """
    site = site_file.load(path)
    endpoint = ",".join(own_addresses(site.listened))
    metered = first_address(site, metrics)
    _check_ports_free(site)
    started = _Started(site, path, endpoint)
    # Otherwise the router would reopen while the services connect.
    started.entitle_ahead()
    every = with_metrics(programs(site, path, endpoint), metered)
    # Before the thread that writes the log, and before these levels, which are not for the services.
    forked = fork(every, main.main)
    _log_plain_lines()
    # The services log that they wait for their router.
    logging.getLogger("robomesh").setLevel(logging.ERROR)

    async def ready() -> None:
        await _until_page_shows_robots(site, endpoint)
        print_line(f"console {site.console.url}")

    service.run_until_signalled(
        supervise(
            every,
            ready=ready,
            write=_write,
            extra=extra_with_metrics(started.wanted, metered),
            forked=forked,
        ),
        ends_within_s=ENDS_WITHIN_S,
    )


def programs(site: Site, path: Path | None, endpoint: str) -> tuple[SupervisedProgram, ...]:
    """Every process of a site, the router first."""
    of_site, attach = _of_site(path), ("--connect", endpoint)
    simulators: list[SupervisedProgram] = []
    controllers: list[str] = []
    for robot in site.robot:
        if robot.simulated:
            simulator, controller = _simulator(robot, site.site, (*of_site, *attach))
            simulators.append(simulator)
            controllers += controller
    more = {"gateway": controllers, "console": ["--supervised"], "watch": ["--supervised"]}
    services = [
        _program(name, (*of_site, *attach, *more.get(name, ())))
        for name, row in SERVICES.items()
        # Without robots a service of robots would end immediately; robots started later bring their own.
        if name != "router" and (site.robot or not row.of_robots)
    ]
    return (_program("router", of_site), *simulators, *services)


def _program(name: str, options: tuple[str, ...]) -> SupervisedProgram:
    row = SERVICES[name]
    return SupervisedProgram(
        name=name,
        arguments=(name, *options),
        required=row.required,
        standby=row.standby,
        finishes=row.finishes,
        last=row.last,
    )


def _programs_of_started(
    robot: Robot, site: str, path: Path | None, endpoint: str
) -> tuple[SupervisedProgram, ...]:
    """Return the processes of a robot that was started from the page; it shares none with other robots."""
    attach = (*_of_site(path), "--connect", endpoint)
    simulator, controller = _simulator(robot, site, attach)
    options = (*attach, "--started", robot.name)
    programs = (_program("gateway", (*options, *controller)), _program("kinematics", options))
    return (
        replace(simulator, required=False),
        *(replace(each, name=f"{each.name} {robot.name}", required=False) for each in programs),
    )


def _of_site(path: Path | None) -> tuple[str, ...]:
    return ("--site", str(path)) if path is not None else ()


def _simulator(robot: Robot, site: str, attach: tuple[str, ...]) -> tuple[SupervisedProgram, tuple[str, ...]]:
    """Return a robot's simulated controller, and the gateway's option with its address."""
    port = _free_port()
    demo = ("--demo",) if robot.demo else ()
    codes = (option for code, type_ in robot.codes.items() for option in ("--code", f"{code}={type_}"))
    simulated = part_of(robot.protocol, "simulated", Simulated)
    assert simulated is not None  # the site file was checked
    started = simulated.started(robot.table, _free_port)
    controller = f"{'udp' if robot.kind.datagrams else 'tcp'}://127.0.0.1:{port}"
    controller += "".join(f",{name}={at}" for name, at in started.ports)
    protocol = ("--protocol", robot.protocol, *started.options)
    for_ = ("--for", f"{site}/{robot.name}", *attach)
    address = ("--robot", robot.model, "--listen", f"127.0.0.1:{port}")
    arguments = ("simulate", *address, *demo, *codes, *protocol, *for_)
    return (
        SupervisedProgram(name=f"simulate {robot.name}", arguments=arguments, last=True),
        ("--controller", f"{robot.name}={controller}"),
    )


class _Started:
    """The robots that were started from the page, for the supervisor to run."""

    def __init__(self, site: Site, path: Path | None, endpoint: str) -> None:
        self._site, self._path, self._endpoint = site, path, endpoint
        self._robots: tuple[Robot, ...] = ()
        self._entitled: list[str] | None = None
        self._problem = ""

    def wanted(self) -> dict[Hashable, Callable[[], tuple[SupervisedProgram, ...]]]:
        """Return the programs to run now, by a key for each robot that changes when its files are saved."""
        try:
            robots = read_started(self._site)
            self._entitle([robot.name for robot in robots])
            self._robots, self._problem = robots, ""
        except (SiteFileError, KeysError) as error:
            # A half-written file must not end a running robot.
            if str(error) != self._problem:
                _write(f"{error}; robots that were started before keep running")
            self._problem = str(error)
        return {
            (robot.name, robot.model, _version(Path(robot.model))): partial(
                _programs_of_started, robot, self._site.site, self._path, self._endpoint
            )
            for robot in self._robots
        }

    def entitle_ahead(self) -> None:
        """Add robots to the routers' rules before the router starts; `wanted` says what is wrong."""
        with suppress(SiteFileError, KeysError):
            self._entitle([robot.name for robot in read_started(self._site)])
        self._entitled = None

    def _entitle(self, names: list[str]) -> None:
        """Add robots to the routers' rules before their gateways publish.

        Robots that may be started are added ahead, because a router reopens for new rules, which stops
        motions: that way only the first start of a robot saved since then does it.
        """
        if names == self._entitled or self._site.keys.folder is None:
            return
        from services.pki import site_keys  # imports cryptography

        folder = Folder(self._site.keys.folder)
        # A folder with bundles only belongs to a machine without the page.
        if names or folder.principals.is_file():
            there, ahead = site_keys.entitled(folder), {*names, *may_start(self._site)}
            try:
                if not there.issuperset(names if self._entitled is not None else ahead):
                    site_keys.entitle(folder, [*ahead])
            except KeysError as error:
                if not there.issuperset(names):
                    raise
                _write(f"{error}; started robots run, and others are added to the rules when they start")
        self._entitled = names


def _version(file: Path) -> tuple[int, int, int]:
    try:
        stat = file.stat()
    except OSError:
        return 0, 0, 0
    return stat.st_ino, stat.st_mtime_ns, stat.st_size


def _check_ports_free(site: Site) -> None:
    """Check the ports before anything starts: a second site's processes would reach those of the first.

    Raises:
        ListenError: If another program uses one.
    """
    check_ports_free(site.listened)
    host, port = split_address(site.console.listen)
    check_free("the console", host, port, "choose another address with [console] listen")


async def _until_page_shows_robots(site: Site, endpoint: str) -> None:
    """Wait until the console serves, every robot is described, and the simulated robots publish frames."""
    async with open_session(
        SessionSettings(connect=split_commas(endpoint), tls=site.tls_of("console"))
    ) as session:
        for robot in site.robot:
            topic = "frames" if robot.simulated else "description"
            subscription = session.subscribe(robot_key(site.site, robot.name, topic))
            async for sample in subscription:
                if sample.live or topic == "description":
                    break
            subscription.close()
    while not await asyncio.to_thread(_own_console_answers, site):
        await asyncio.sleep(_CONSOLE_POLL_S)


def _own_console_answers(site: Site) -> bool:
    """Return whether this site's console serves; another program may have taken its port since the check."""
    _, port = split_address(site.console.listen)
    return _answers(site.console.url) and is_used_by_child(port)


def _answers(url: str) -> bool:
    # This checks that the console serves, not that its certificate is for this address.
    context = ssl.create_default_context() if url.startswith("https") else None
    if context is not None:
        context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    try:
        with urllib.request.urlopen(url, timeout=1.0, context=context):
            return True
    except (urllib.error.URLError, OSError):
        return False


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def _log_plain_lines() -> None:
    """Log plain lines to standard error, whose blocked or missing reader must not block the site."""
    service.log_to_stderr(logging.WARNING)
    for handler in logging.getLogger().handlers:
        handler.setFormatter(logging.Formatter("%(message)s"))
    log.setLevel(logging.INFO)


def _write(line: str) -> None:
    log.info("%s", line)
