"""Service of the simulated controller: listens for SNPX and RMI, or for FTP."""

import asyncio
import contextlib
import logging
import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

from controllers.fanuc.axes import Axes, FanucSettings
from controllers.fanuc.data import AXES
from controllers.fanuc.rmi import PORT
from controllers.fanuc.simulated.controller import SnpxController
from controllers.fanuc.simulated.ftp_server import FTP_FAULTS, FtpServer
from controllers.fanuc.simulated.memory import Entry
from controllers.fanuc.simulated.rmi_server import RmiServer
from controllers.fanuc.simulated.server import SNPX_FAULTS, SnpxServer
from controllers.simulated.demo import demo_tour
from controllers.simulated.errors import SimulatorError
from controllers.simulated.fault_requests import Mesh, answer_requests
from controllers.simulated.faults import Faults
from protocol_gateway.errors import GatewaySettingsError
from robomesh.errors import ListenError
from robomesh.listen_address import check_reach, split_address
from robots.description import load
from robots.joints import JointType, joints_of

logger = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class SnpxSettings:
    """Settings of a simulated controller of FANUC's kind.

    Attributes:
        robot: A library robot, or a path to a robot.toml or URDF, of at most eight joints.
        listen: `HOST:PORT`; a real controller has 60008; port 0 takes a free one.
        fanuc: As in the site file; undeclared: as `with_defaults` says.
        rmi: `HOST:PORT` of RMI; a real controller has 16001, and then sessions have 16002, here otherwise any
            free one. Empty: it has no RMI.
        shared: All connections have one table of assignments.
        demo: A program runs and moves the arm.
        faults: Faults in the syntax of `controllers.simulated.faults`, of `SNPX_FAULTS`.
        insecure: May listen beyond loopback; this protocol has no TLS.
        mesh: Where to answer fault requests; None to stay off the mesh.
    """

    robot: str = "puma560"
    listen: str = "127.0.0.1:0"
    rmi: str = ""
    fanuc: FanucSettings | None = None
    shared: bool = False
    demo: bool = False
    faults: tuple[str, ...] = ()
    insecure: bool = False
    mesh: Mesh | None = None


def with_defaults(declared: FanucSettings | None, joint_types: tuple[JointType, ...]) -> FanucSettings:
    """Return the settings of a simulated controller: as declared, and what the site file leaves open.

    It keeps a table of assignments for each connection, and axis 3 contains axis 2 if both turn.
    """
    settings = declared or FanucSettings()
    if settings.assignments is None:
        settings = replace(settings, assignments="own")
    if settings.j23 is None:
        turn = all(each is JointType.ROTARY for each in joint_types)
        settings = replace(settings, j23=1 if turn else 0)
    return settings


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
        _warn_beyond_loopback(address, settings.insecure)
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
            listening = await _listen(each, address)
            listeners.callback(listening.close)
            ports.append(listening.sockets[0].getsockname()[1])
        found = FanucPorts(*ports)
        rmi.session_port = found.session
        if ready is not None:
            ready(found)
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(server.run())
            tasks.create_task(rmi.run())
            if settings.mesh is not None:
                tasks.create_task(answer_requests(settings.mesh, faults))


@dataclass(frozen=True, kw_only=True)
class FtpSettings:
    """Settings of a simulated controller of FANUC's kind that is read by FTP.

    Attributes:
        listen: `HOST:PORT`; a real controller has 21; port 0 takes a free one.
        faults: Faults in the syntax of `controllers.simulated.faults`, of `FTP_FAULTS`.

    The others are those of `SnpxSettings`.
    """

    robot: str = "puma560"
    listen: str = "127.0.0.1:0"
    fanuc: FanucSettings | None = None
    demo: bool = False
    faults: tuple[str, ...] = ()
    insecure: bool = False
    mesh: Mesh | None = None


async def serve_ftp(settings: FtpSettings, *, ready: Callable[[int], None] | None = None) -> None:
    """Simulate a controller that is read by FTP until cancelled.

    Args:
        ready: Called with the port once clients can connect.

    Raises:
        ListenError: If it cannot listen on the address.
        SimulatorError: If a setting is invalid.
        DescriptionError: If the robot is unknown.
    """
    _warn_beyond_loopback(settings.listen, settings.insecure)
    faults = Faults(settings.faults, known=FTP_FAULTS)
    controlled = _server(SnpxSettings(robot=settings.robot, fanuc=settings.fanuc, demo=settings.demo), faults)
    server = FtpServer(controlled)
    host, port = split_address(settings.listen)
    try:
        listening = await asyncio.start_server(server.serve, host, port)
    except OSError as error:
        raise _cannot_listen(settings.listen, error) from None
    async with contextlib.AsyncExitStack() as listeners:
        listeners.callback(controlled.close)
        listeners.callback(listening.close)
        if ready is not None:
            ready(listening.sockets[0].getsockname()[1])
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(controlled.run())
            if settings.mesh is not None:
                tasks.create_task(answer_requests(settings.mesh, faults))


def _warn_beyond_loopback(address: str, insecure: bool) -> None:
    remedy = "listen on 127.0.0.1, or take the risk with --insecure: these protocols have no TLS"
    host, _ = split_address(address)
    if warning := check_reach("the simulator", host, secured=False, insecure=insecure, remedy=remedy):
        logger.warning("%s", warning)


def _cannot_listen(address: str, error: OSError) -> ListenError:
    reason = os.strerror(error.errno) if error.errno and error.errno > 0 else str(error)
    return ListenError(f"the simulator cannot listen on {address}: {reason.lower()}")


async def _listen(made: Callable[[], asyncio.Protocol], address: str) -> asyncio.Server:
    host, port = split_address(address)
    try:
        return await asyncio.get_running_loop().create_server(made, host, port)
    except OSError as error:
        raise _cannot_listen(address, error) from None


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
