"""Simulator service: a simulated controller on a TCP port; on the mesh only for fault requests."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from controllers.simulated.demo import demo_tour
from controllers.simulated.errors import SimulatorError
from controllers.simulated.fault_table import UNIT_FAULTS
from controllers.simulated.faults import Faults
from controllers.simulated.serving import SimulatorSettings, listen, run, warn_beyond_loopback
from controllers.unit.simulated.controller import Controller
from controllers.unit.simulated.server import Server
from robomesh.listen_address import split_address
from robots.descriptions.description import load
from robots.kinematics.joints import joints_of


@dataclass(frozen=True, kw_only=True)
class Settings(SimulatorSettings):
    """Settings of a simulated controller.

    Attributes:
        rate_hz: State units a second.
        demo: Begins homed and moves until the first motion command.
        codes: Type codes, as in the site file; empty for names.
    """

    rate_hz: float = 100.0
    max_clients: int = 8
    codes: Mapping[int, str] = field(default_factory=dict)


async def serve(settings: Settings, *, ready: Callable[[str], None] | None = None) -> None:
    """Simulate a controller until cancelled.

    Args:
        ready: Called with the line `listening on HOST:PORT` once clients can connect.

    Raises:
        ListenError: If it cannot listen on that address.
        SimulatorError: If a setting is invalid.
        DescriptionError: If the robot is unknown.
    """
    because = "the controllers' old protocol has no TLS"
    warn_beyond_loopback(settings.listen, insecure=settings.insecure, because=because)
    faults = Faults(settings.faults, known=UNIT_FAULTS)
    server = _server(settings, faults)
    listener = await listen(server.new_client, settings.listen)
    try:
        if ready is not None:
            host = split_address(settings.listen)[0]
            ready(f"listening on {host}:{listener.sockets[0].getsockname()[1]}")
        await run(server.run(settings.rate_hz), mesh=settings.mesh, faults=faults)
    finally:
        listener.close()
        await server.close()


def _server(settings: Settings, faults: Faults) -> Server:
    if not 0.0 < settings.rate_hz <= 1000.0:
        raise SimulatorError(f"rate {settings.rate_hz:g} Hz is outside 0 to 1000 Hz")
    if settings.max_clients < 1:
        raise SimulatorError(f"a maximum of {settings.max_clients} clients is too low: 1 or more")
    description = load(settings.robot)
    joints = joints_of(description)

    def boot(now_s: float, *, demo: bool = False) -> Controller:
        tour = demo_tour(description) if demo else None
        return Controller(joints, codes=settings.codes, demo=tour, now_s=now_s)

    controller = boot(time.monotonic(), demo=settings.demo)
    return Server(controller, boot, faults, max_clients=settings.max_clients)
