"""Service of the simulated controller: listens for RTDE, the primary interface, scripts and the dashboard."""

import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from controllers.simulated.demo import demo_tour
from controllers.simulated.errors import SimulatorError
from controllers.simulated.faults import Faults
from controllers.simulated.serving import SimulatorSettings, listen, run, warn_beyond_loopback
from controllers.universal_robots.interfaces.primary import PrimaryMessage
from controllers.universal_robots.interfaces.rtde_messages import ControllerVersion
from controllers.universal_robots.simulated.controller import UrController
from controllers.universal_robots.simulated.fields import INPUTS
from controllers.universal_robots.simulated.server import UR_FAULTS, UrServer
from robots.descriptions.description import load


@dataclass(frozen=True, kw_only=True)
class UrSettings(SimulatorSettings):
    """Settings of a simulated controller of Universal Robots' kind, with six rotary joints.

    Attributes:
        listen: `HOST:PORT` of RTDE.
        primary: `HOST:PORT` of the primary interface; a real controller has 30011 for reading.
        scripts: Each `HOST:PORT` of the primary interface that takes scripts; on a real controller 30001,
            and 30002 and 30003, of which ur_rtde uses the last.
        dashboard: `HOST:PORT` of the dashboard, on a real controller 29999.
        version: Version of the software: 3 is CB3 with at most 125 Hz, 5 and above have at most 500 Hz.
        taken: Input fields that are in use by the controller itself, such as by a fieldbus.
    """

    primary: str = "127.0.0.1:0"
    scripts: tuple[str, ...] = ("127.0.0.1:0",)
    dashboard: str = "127.0.0.1:0"
    version: tuple[int, int, int, int] = (5, 21, 0, 0)
    taken: frozenset[str] = frozenset()


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
        warn_beyond_loopback(address, insecure=settings.insecure, because="these protocols have no TLS")
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
            listener = await listen(protocol, address)
            opened.callback(listener.close)
            listening.append(listener)
        if ready is not None:
            rtde, primary, dashboard, *scripts = (each.sockets[0].getsockname()[1] for each in listening)
            ready(UrPorts(rtde, primary, dashboard, tuple(scripts)))
        await run(server.run(), mesh=settings.mesh, faults=faults)


def _server(settings: UrSettings, faults: Faults) -> UrServer:
    if unknown := sorted(settings.taken - INPUTS.keys()):
        raise SimulatorError(f"input field {unknown[0]} is unknown: speed_slider_mask is one")
    description = load(settings.robot)

    def boot(now_s: float, restarted: bool, announce: Callable[[PrimaryMessage], None]) -> UrController:
        tour = demo_tour(description) if settings.demo and not restarted else None
        return UrController(description, tour=tour, powered=not restarted, now_s=now_s, announce=announce)

    return UrServer(boot, faults, version=ControllerVersion(*settings.version), taken=settings.taken)
