"""Service of the simulated controller: listens for RTDE, the primary interface, scripts and the dashboard."""

import asyncio
import contextlib
import logging
import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from controllers.simulated.demo import demo_tour
from controllers.simulated.errors import SimulatorError
from controllers.simulated.fault_requests import Mesh, answer_requests
from controllers.simulated.faults import Faults
from controllers.universal_robots.primary import PrimaryMessage
from controllers.universal_robots.rtde_messages import ControllerVersion
from controllers.universal_robots.simulated.controller import UrController
from controllers.universal_robots.simulated.fields import INPUTS
from controllers.universal_robots.simulated.server import UR_FAULTS, UrServer
from robomesh.errors import ListenError
from robomesh.listen_address import check_reach, split_address
from robots.description import load

logger = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class UrSettings:
    """Settings of a simulated controller of Universal Robots' kind.

    Attributes:
        robot: A library robot, or a path to a robot.toml or URDF, with six rotary joints.
        listen: `HOST:PORT` of RTDE; a real controller has 30004; port 0 takes a free one.
        primary: `HOST:PORT` of the primary interface; a real controller has 30011 for reading.
        scripts: Each `HOST:PORT` of the primary interface that takes scripts; on a real controller 30001,
            and 30002 and 30003, of which ur_rtde uses the last.
        dashboard: `HOST:PORT` of the dashboard, on a real controller 29999.
        version: Version of the software: 3 is CB3 with at most 125 Hz, 5 and above have at most 500 Hz.
        demo: A program runs and moves the arm.
        taken: Input fields that are in use by the controller itself, such as by a fieldbus.
        faults: Faults in the syntax of `controllers.simulated.faults`, of `UR_FAULTS`.
        insecure: May listen beyond loopback; these protocols have no TLS.
        mesh: Where to answer fault requests; None to stay off the mesh.
    """

    robot: str = "puma560"
    listen: str = "127.0.0.1:0"
    primary: str = "127.0.0.1:0"
    scripts: tuple[str, ...] = ("127.0.0.1:0",)
    dashboard: str = "127.0.0.1:0"
    version: tuple[int, int, int, int] = (5, 21, 0, 0)
    demo: bool = False
    taken: frozenset[str] = frozenset()
    faults: tuple[str, ...] = ()
    insecure: bool = False
    mesh: Mesh | None = None


class UrPorts(NamedTuple):
    """Ports of a simulated controller."""

    rtde: int
    primary: int
    dashboard: int
    scripts: tuple[int, ...]


async def serve_rtde(settings: UrSettings, *, ready: Callable[[UrPorts], None] | None = None) -> None:
    """Simulate a controller until cancelled.

    Args:
        ready: Called with the ports once clients can connect.

    Raises:
        ListenError: If it cannot listen on an address.
        SimulatorError: If a setting is invalid.
        DescriptionError: If the robot is unknown.
    """
    addresses = settings.listen, settings.primary, settings.dashboard, *settings.scripts
    for address in addresses:
        host, _ = split_address(address)
        remedy = "listen on 127.0.0.1, or take the risk with --insecure: these protocols have no TLS"
        if warning := check_reach(
            "the simulator", host, secured=False, insecure=settings.insecure, remedy=remedy
        ):
            logger.warning("%s", warning)
    faults = Faults(settings.faults, known=UR_FAULTS)
    server = _server(settings, faults)
    protocols = (
        server.new_rtde_client,
        server.new_monitor,
        server.new_dashboard_client,
        *(server.new_script_client for _ in settings.scripts),
    )
    with contextlib.ExitStack() as opened:
        opened.callback(server.close)
        listening = []
        for protocol, address in zip(protocols, addresses, strict=True):
            listener = await _listen(protocol, address)
            opened.callback(listener.close)
            listening.append(listener)
        if ready is not None:
            rtde, primary, dashboard, *scripts = (each.sockets[0].getsockname()[1] for each in listening)
            ready(UrPorts(rtde, primary, dashboard, tuple(scripts)))
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(server.run())
            if settings.mesh is not None:
                tasks.create_task(answer_requests(settings.mesh, faults))


async def _listen(protocol: Callable[[], asyncio.Protocol], address: str) -> asyncio.Server:
    host, port = split_address(address)
    try:
        return await asyncio.get_running_loop().create_server(protocol, host, port)
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno and error.errno > 0 else str(error)
        raise ListenError(f"the simulator cannot listen on {host}:{port}: {reason.lower()}") from None


def _server(settings: UrSettings, faults: Faults) -> UrServer:
    if unknown := sorted(settings.taken - INPUTS.keys()):
        raise SimulatorError(f"input field {unknown[0]} is unknown: speed_slider_mask is one")
    description = load(settings.robot)

    def boot(now_s: float, restarted: bool, announce: Callable[[PrimaryMessage], None]) -> UrController:
        tour = demo_tour(description) if settings.demo and not restarted else None
        return UrController(description, tour=tour, powered=not restarted, now_s=now_s, announce=announce)

    return UrServer(boot, faults, version=ControllerVersion(*settings.version), taken=settings.taken)
