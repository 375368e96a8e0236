"""Service of the simulated controller: listens for SNPX and RMI, or for FTP."""

import asyncio
import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from controllers.fanuc.axes import Axes, FanucSettings, with_defaults
from controllers.fanuc.data import AXES
from controllers.fanuc.rmi.messages import PORT
from controllers.fanuc.simulated.controller import SnpxController
from controllers.fanuc.simulated.ftp_server import FTP_FAULTS, FtpServer
from controllers.fanuc.simulated.memory import Entry
from controllers.fanuc.simulated.rmi_server import RmiServer
from controllers.fanuc.simulated.server import SNPX_FAULTS, SnpxServer
from controllers.simulated.demo import demo_tour
from controllers.simulated.errors import SimulatorError
from controllers.simulated.faults import Faults
from controllers.simulated.serving import (
    SimulatorSettings,
    cannot_listen,
    listen,
    run,
    warn_beyond_loopback,
)
from protocol_gateway.seam.errors import GatewaySettingsError
from robomesh.listen_address import split_address
from robots.descriptions.description import load
from robots.kinematics.joints import joints_of

_BECAUSE = "these protocols have no TLS"


@dataclass(frozen=True, kw_only=True)
class SnpxSettings(SimulatorSettings):
    """Settings of a simulated controller of FANUC's kind, with at most eight joints.

    Attributes:
        fanuc: As in the site file; undeclared: as `with_defaults` says.
        rmi: `HOST:PORT` of RMI; a real controller has 16001, and then sessions have 16002, here otherwise any
            free one. Empty: it has no RMI.
        shared: All connections have one table of assignments.
    """

    rmi: str = ""
    fanuc: FanucSettings | None = None
    shared: bool = False


class FanucPorts(NamedTuple):
    """Ports of a simulated controller; 0: it has no RMI."""

    snpx: int
    rmi: int = 0
    session: int = 0


async def serve_snpx(settings: SnpxSettings, *, ready: Callable[[FanucPorts], None] | None = None) -> None:
    """Simulate a controller until cancelled.

    Args:
        ready: Called with the ports once clients can connect.

    Raises:
        ListenError: If it cannot listen on the address.
        SimulatorError: If a setting is invalid.
        DescriptionError: If the robot is unknown.
    """
    addresses = [settings.listen, *([settings.rmi] if settings.rmi else ())]
    for address in addresses:
        warn_beyond_loopback(address, insecure=settings.insecure, because=_BECAUSE)
    faults = Faults(settings.faults, known=SNPX_FAULTS)
    server = _server(settings, faults)
    rmi = RmiServer(server)
    made = [server.new_client, *([rmi.new_starter, rmi.new_session] if settings.rmi else ())]
    if settings.rmi:
        host, port = split_address(settings.rmi)
        addresses.append(f"{host}:{PORT + 1 if port == PORT else 0}")
    async with contextlib.AsyncExitStack() as listeners:
        listeners.callback(server.close)
        listeners.callback(rmi.close)
        ports = []
        for each, address in zip(made, addresses, strict=True):
            listening = await listen(each, address)
            listeners.callback(listening.close)
            ports.append(listening.sockets[0].getsockname()[1])
        found = FanucPorts(*ports)
        rmi.session_port = found.session
        if ready is not None:
            ready(found)
        await run(server.run(), rmi.run(), mesh=settings.mesh, faults=faults)


@dataclass(frozen=True, kw_only=True)
class FtpSettings(SimulatorSettings):
    """Settings of a simulated controller of FANUC's kind that is read by FTP; `fanuc` as for SNPX."""

    fanuc: FanucSettings | None = None


async def serve_ftp(settings: FtpSettings, *, ready: Callable[[int], None] | None = None) -> None:
    """Simulate a controller that is read by FTP until cancelled.

    Args:
        ready: Called with the port once clients can connect.

    Raises:
        ListenError: If it cannot listen on the address.
        SimulatorError: If a setting is invalid.
        DescriptionError: If the robot is unknown.
    """
    warn_beyond_loopback(settings.listen, insecure=settings.insecure, because=_BECAUSE)
    faults = Faults(settings.faults, known=FTP_FAULTS)
    controlled = _server(SnpxSettings(robot=settings.robot, fanuc=settings.fanuc, demo=settings.demo), faults)
    server = FtpServer(controlled)
    host, port = split_address(settings.listen)
    try:
        listening = await asyncio.start_server(server.serve, host, port)
    except OSError as error:
        raise cannot_listen(settings.listen, error) from None
    async with contextlib.AsyncExitStack() as listeners:
        listeners.callback(controlled.close)
        listeners.callback(listening.close)
        if ready is not None:
            ready(listening.sockets[0].getsockname()[1])
        await run(controlled.run(), mesh=settings.mesh, faults=faults)


def _server(settings: SnpxSettings, faults: Faults) -> SnpxServer:
    description = load(settings.robot)
    joints = joints_of(description)
    if len(joints) >= AXES:
        raise SimulatorError(
            f"robot {description.name} has {len(joints)} joints, this controller has at most {AXES - 1} axes"
        )
    declared = with_defaults(settings.fanuc, joints.types)
    try:
        axes = Axes(declared, joints.types)
        entered = declared.table.assignments if declared.assignments == "pendant" else ()
    except GatewaySettingsError as error:
        raise SimulatorError(str(error)) from None

    def boot(restarted: bool) -> SnpxController:
        return SnpxController(
            description,
            axes,
            group=declared.group,
            tour=demo_tour(description) if settings.demo and not restarted else None,
            servo_on=not restarted,
        )

    return SnpxServer(
        boot,
        faults,
        shared=settings.shared,
        entered=[
            Entry(each.first_word, each.variable.words, str(each.variable), each.multiply) for each in entered
        ],
    )
