"""Simulator service: a simulated controller on a TCP port; on the mesh only for fault requests."""

import asyncio
import logging
import os
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from controllers.simulated.demo import demo_tour
from controllers.simulated.errors import SimulatorError
from controllers.simulated.fault_requests import Mesh, answer_requests
from controllers.simulated.fault_table import UNIT_FAULTS
from controllers.simulated.faults import Faults
from controllers.unit.simulated.controller import Controller
from controllers.unit.simulated.server import Server
from robomesh.errors import ListenError
from robomesh.listen_address import check_reach, split_address
from robots.description import load
from robots.joints import joints_of

logger = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of a simulated controller.

    Attributes:
        robot: A library robot, or a path to a robot.toml or URDF.
        listen: `HOST:PORT`; port 0 takes a free one.
        rate_hz: State units a second.
        demo: Begins homed and moves until the first motion command.
        faults: Faults in the syntax of `controllers.simulated.faults`.
        codes: Type codes, as in the site file; empty for names.
        insecure: May listen beyond loopback; the protocol has no TLS.
        mesh: Where to answer fault requests; None to stay off the mesh.
    """

    robot: str
    listen: str = "127.0.0.1:0"
    rate_hz: float = 100.0
    max_clients: int = 8
    demo: bool = False
    faults: tuple[str, ...] = ()
    codes: Mapping[int, str] = field(default_factory=dict)
    insecure: bool = False
    mesh: Mesh | None = None


async def serve(settings: Settings, *, ready: Callable[[str], None] | None = None) -> None:
    """Simulate a controller until cancelled.

    Args:
        ready: Called with the line `listening on HOST:PORT` once clients can connect.

    Raises:
        ListenError: If it cannot listen on that address.
        SimulatorError: If a setting is invalid.
        DescriptionError: If the robot is unknown.
    """
    host, port = split_address(settings.listen)
    remedy = "listen on 127.0.0.1, or take the risk with --insecure: the controllers' old protocol has no TLS"
    if warning := check_reach(
        "the simulator", host, secured=False, insecure=settings.insecure, remedy=remedy
    ):
        logger.warning("%s", warning)
    faults = Faults(settings.faults, known=UNIT_FAULTS)
    server = _server(settings, faults)
    loop = asyncio.get_running_loop()
    try:
        listener = await loop.create_server(server.new_client, host, port)
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno and error.errno > 0 else str(error)
        raise ListenError(f"the simulator cannot listen on {host}:{port}: {reason.lower()}") from None
    try:
        if ready is not None:
            ready(f"listening on {host}:{listener.sockets[0].getsockname()[1]}")
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(server.run(settings.rate_hz))
            if settings.mesh is not None:
                tasks.create_task(answer_requests(settings.mesh, faults))
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
