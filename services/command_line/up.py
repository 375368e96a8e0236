"""`robomesh up`: the whole site under the supervisor, and a ready line when the arm is on the page."""

import asyncio
import logging
import socket
import sys
import urllib.error
import urllib.request
from pathlib import Path

from bus import service
from bus.keys import robot_key
from bus.session import SessionSettings, open_session
from services import site as site_file
from services.listen import split_address
from services.site import Site
from services.supervisor import Program, supervise

_CONSOLE_POLL_S = 0.1


def run(path: Path | None) -> None:
    """Run the site until Ctrl-C."""
    # The services say themselves that they wait for their router.
    logging.getLogger("bus").setLevel(logging.ERROR)
    site = site_file.load(path)
    endpoint = reachable(site.router.listen[0])

    async def ready() -> None:
        await _until_on_the_page(site, endpoint)
        print(f"console {_console_url(site)}", flush=True)

    service.run_until_signalled(supervise(programs(site, path, endpoint), ready=ready, write=_write))


def programs(site: Site, path: Path | None, endpoint: str) -> tuple[Program, ...]:
    """Every process of a site, the router first."""
    of_site = ("--site", str(path)) if path is not None else ()
    attach = ("--connect", endpoint)
    simulators, controllers = [], []
    for robot in site.robot:
        if robot.simulated:
            port = _free_port()
            arguments = ("simulate", "--robot", robot.model, "--listen", f"127.0.0.1:{port}")
            demo = ("--demo",) if robot.demo else ()
            codes = (
                option for code, type_ in robot.codes.items() for option in ("--code", f"{code}={type_}")
            )
            simulators.append(Program(name=f"simulate {robot.name}", arguments=(*arguments, *demo, *codes)))
            controllers += ["--controller", f"{robot.name}=tcp://127.0.0.1:{port}"]
    return (
        Program(name="router", arguments=("router", *of_site)),
        *simulators,
        Program(name="gateway", arguments=("gateway", *of_site, *attach, *controllers)),
        Program(name="kinematics", arguments=("kinematics", *of_site, *attach)),
        Program(name="console", arguments=("console", *of_site, *attach)),
        Program(name="recorder", arguments=("recorder", *of_site, *attach)),
        # Without OpenGL everything else runs.
        Program(name="renderer", arguments=("renderer", *of_site, *attach), needed=False),
    )


def reachable(endpoint: str) -> str:
    """A router's listening endpoint as one that its own machine can connect to."""
    protocol, _, rest = endpoint.partition("/")
    address, question, options = rest.partition("?")
    host, port = split_address(address)
    host = {"0.0.0.0": "127.0.0.1", "::": "[::1]"}.get(host, host)
    return f"{protocol}/{host}:{port}{question}{options}"


async def _until_on_the_page(site: Site, endpoint: str) -> None:
    """Until the console serves, every robot is described, and the simulated ones move."""
    async with open_session(SessionSettings(connect=(endpoint,), tls=site.tls)) as session:
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
    return f"http://{'127.0.0.1' if host in ('0.0.0.0', '::') else host}:{port}/"


def _answers(url: str) -> bool:
    try:
        with urllib.request.urlopen(url, timeout=1.0):
            return True
    except (urllib.error.URLError, OSError):
        return False


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def _write(line: str) -> None:
    print(line, file=sys.stderr, flush=True)
