"""`robomesh up`: the whole site under the supervisor, and a ready line when the arm is on the page."""

import asyncio
import logging
import socket
import ssl
import urllib.error
import urllib.request
from collections.abc import Callable, Hashable
from dataclasses import replace
from functools import partial
from pathlib import Path

from robomesh import service
from robomesh.keys import robot_key
from robomesh.session import SessionSettings, open_session
from services.command_line.site.metrics_ports import extra_with_metrics, with_metrics
from services.command_line.site.router import metrics_address
from services.errors import SiteFileError
from services.pki import Folder
from services.pki.errors import KeysError
from services.site_file import site as site_file
from services.site_file.listen_address import reachable, split_address
from services.site_file.site import Robot, Site
from services.site_file.started_robots import may_start, read_started
from services.supervisor import ENDS_WITHIN_S, Program, supervise

log = logging.getLogger(__name__)

_CONSOLE_POLL_S = 0.1
_STOPS_AND_AUDIT = "stopping its robots and completing the audit log"


def run(path: Path | None, metrics: str = "") -> None:
    """Run the site until Ctrl-C.

    Args:
        metrics: HOST:PORT of the first service's numbers for Prometheus; empty: nobody serves them.
    """
    _say_lines_as_they_are()
    # The services say themselves that they wait for their router.
    logging.getLogger("robomesh").setLevel(logging.ERROR)
    site = site_file.load(path)
    endpoint = reachable(site.listened[0])
    metered = metrics_address(site, metrics)

    async def ready() -> None:
        await _until_on_the_page(site, endpoint)
        print(f"console {_console_url(site)}", flush=True)

    service.run_until_signalled(
        supervise(
            with_metrics(programs(site, path, endpoint), metered),
            ready=ready,
            write=_write,
            extra=extra_with_metrics(_Started(site, path, endpoint).wanted, metered),
        ),
        ends_within_s=ENDS_WITHIN_S,
    )


def programs(site: Site, path: Path | None, endpoint: str) -> tuple[Program, ...]:
    """Every process of a site, the router first."""
    of_site, attach = _of_site(path), ("--connect", endpoint)
    simulators: list[Program] = []
    controllers: list[str] = []
    for robot in site.robot:
        if robot.simulated:
            simulator, controller = _simulator(robot, site.site, (*of_site, *attach))
            simulators.append(simulator)
            controllers += controller
    # Of a site without robots they would end at once; robots that are started later bring their own.
    of_robots = (
        Program(
            name="gateway",
            arguments=("gateway", *of_site, *attach, *controllers),
            finishes=_STOPS_AND_AUDIT,
        ),
        Program(name="kinematics", arguments=("kinematics", *of_site, *attach)),
    )
    return (
        Program(name="router", arguments=("router", *of_site), standby=True, last=True),
        *simulators,
        *(of_robots if site.robot else ()),
        Program(name="console", arguments=("console", *of_site, *attach, "--supervised")),
        Program(
            name="recorder", arguments=("recorder", *of_site, *attach), finishes="closing its recordings"
        ),
        Program(name="player", arguments=("player", *of_site, *attach), required=False),
        Program(name="watch", arguments=("watch", *of_site, *attach), required=False),
        # Without OpenGL everything else runs.
        Program(name="renderer", arguments=("renderer", *of_site, *attach), required=False),
    )


def _programs_of_started(robot: Robot, site: str, path: Path | None, endpoint: str) -> tuple[Program, ...]:
    """The processes of a robot that was started from the page: all its own, so that no other notices."""
    attach = (*_of_site(path), "--connect", endpoint)
    simulator, controller = _simulator(robot, site, attach)
    name = robot.name
    rest = (*attach, "--started", name)
    return (
        replace(simulator, required=False),
        Program(
            name=f"gateway {name}",
            arguments=("gateway", *rest, *controller),
            required=False,
            finishes=_STOPS_AND_AUDIT,
        ),
        Program(name=f"kinematics {name}", arguments=("kinematics", *rest), required=False),
    )


def _of_site(path: Path | None) -> tuple[str, ...]:
    return ("--site", str(path)) if path is not None else ()


def _simulator(robot: Robot, site: str, attach: tuple[str, ...]) -> tuple[Program, tuple[str, ...]]:
    """A robot's simulated controller, and how the gateway is told where it is."""
    port = _free_port()
    demo = ("--demo",) if robot.demo else ()
    codes = (option for code, type_ in robot.codes.items() for option in ("--code", f"{code}={type_}"))
    for_ = ("--for", f"{site}/{robot.name}", *attach)
    arguments = ("simulate", "--robot", robot.model, "--listen", f"127.0.0.1:{port}", *demo, *codes, *for_)
    return (
        Program(name=f"simulate {robot.name}", arguments=arguments, last=True),
        ("--controller", f"{robot.name}=tcp://127.0.0.1:{port}"),
    )


class _Started:
    """The robots that were started from the page, as the supervisor follows them."""

    def __init__(self, site: Site, path: Path | None, endpoint: str) -> None:
        self._site, self._path, self._endpoint = site, path, endpoint
        self._robots: tuple[Robot, ...] = ()
        self._entitled: list[str] | None = None
        self._problem = ""

    def wanted(self) -> dict[Hashable, Callable[[], tuple[Program, ...]]]:
        """What is to run now, a key for each robot as its files are: saved anew, it is another."""
        try:
            robots = read_started(self._site)
            self._entitle([robot.name for robot in robots])
            self._robots, self._problem = robots, ""
        except (SiteFileError, KeysError) as error:
            # Half a change by somebody's editor ends no robot: what runs, runs on.
            if str(error) != self._problem:
                _write(f"{error}; the robots that were started before stay as they are")
            self._problem = str(error)
        return {
            (robot.name, robot.model, _version(Path(robot.model))): partial(
                _programs_of_started, robot, self._site.site, self._path, self._endpoint
            )
            for robot in self._robots
        }

    def _entitle(self, names: list[str]) -> None:
        """Tell the routers for whom their gateways may speak, before they do.

        Those that may be started are named ahead, because routers open anew for new rules, which stops
        motions: only the first start of one that was saved since then does that.
        """
        if names == self._entitled or self._site.keys.folder is None:
            return
        from services.pki import authority  # only what changes keys needs the package that makes them

        folder = Folder(self._site.keys.folder)
        # Where only bundles were brought, nobody was started from the page.
        if names or folder.principals.is_file():
            there, ahead = authority.entitled(folder), {*names, *may_start(self._site)}
            try:
                if not there.issuperset(names if self._entitled is not None else ahead):
                    authority.entitle(folder, [*ahead])
            except KeysError as error:
                if not there.issuperset(names):
                    raise
                _write(f"{error}; the robots that were started run, others are named when they are started")
        self._entitled = names


def _version(file: Path) -> tuple[int, int, int]:
    try:
        stat = file.stat()
    except OSError:
        return 0, 0, 0
    return stat.st_ino, stat.st_mtime_ns, stat.st_size


async def _until_on_the_page(site: Site, endpoint: str) -> None:
    """Until the console serves, every robot is described, and the simulated ones move."""
    async with open_session(SessionSettings(connect=(endpoint,), tls=site.tls_of("console"))) as session:
        for robot in site.robot:
            topic = "frames" if robot.simulated else "description"
            subscription = session.subscribe(robot_key(site.site, robot.name, topic))
            async for sample in subscription:
                if sample.live or topic == "description":
                    break
            subscription.close()
    while not await asyncio.to_thread(_answers, _console_url(site)):
        await asyncio.sleep(_CONSOLE_POLL_S)


def _console_url(site: Site) -> str:
    host, port = split_address(site.console.listen)
    host = "127.0.0.1" if host in ("0.0.0.0", "::") else host
    return f"{site.console.scheme}://{f'[{host}]' if ':' in host else host}:{port}/"


def _answers(url: str) -> bool:
    # Whether it serves is asked, not whether its certificate is for this address.
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


def _say_lines_as_they_are() -> None:
    """A terminal that is held, or whose reader has gone, must hold no site: restarts go on unseen."""
    service.log_to_stderr(logging.WARNING)
    for handler in logging.getLogger().handlers:
        handler.setFormatter(logging.Formatter("%(message)s"))
    log.setLevel(logging.INFO)


def _write(line: str) -> None:
    log.info("%s", line)
