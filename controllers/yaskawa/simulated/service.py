"""Service of the simulated controller: listens for HSES."""

import asyncio
import logging
import os
from collections.abc import Callable
from dataclasses import dataclass, replace

from controllers.simulated.demo import demo_tour
from controllers.simulated.errors import SimulatorError
from controllers.simulated.fault_requests import Mesh, answer_requests
from controllers.simulated.faults import Faults
from controllers.yaskawa.axes import Axes, YaskawaSettings, instance_of
from controllers.yaskawa.simulated.controller import AXIS_NAMES, HsesController
from controllers.yaskawa.simulated.server import HSES_FAULTS, HsesServer
from protocol_gateway.errors import GatewaySettingsError
from robomesh.errors import ListenError
from robomesh.listen_address import check_reach, split_address
from robots.description import load
from robots.joints import joints_of

logger = logging.getLogger(__name__)

_PULSES_PER_DEGREE = 1000.0
_CLOSED_CHECK_S = 0.05


@dataclass(frozen=True, kw_only=True)
class HsesSettings:
    """Settings of a simulated controller of Yaskawa's kind.

    Attributes:
        robot: A library robot, or a path to a robot.toml or URDF, of at most eight joints.
        listen: `HOST:PORT`; a real controller has 10040; port 0 takes a free one.
        yaskawa: As in the site file; None, or without pulses_per_degree: 1000 pulses a degree or millimetre.
        axis_count: Values of axes that it sends: 7 as FS100, 8 as later ones.
        sub_codes: Alarms have the texts of their sub-codes, as on DX200 and later.
        demo: A job runs and moves the arm.
        held_motions_go_on: A held motion goes on when HOLD ends; otherwise it is given up. Which of them a
            real controller does is not known.
        faults: Faults in the syntax of `controllers.simulated.faults`, of `HSES_FAULTS`.
        insecure: May listen beyond loopback; this protocol has no TLS.
        mesh: Where to answer fault requests; None to stay off the mesh.
    """

    robot: str = "puma560"
    listen: str = "127.0.0.1:0"
    yaskawa: YaskawaSettings | None = None
    axis_count: int = len(AXIS_NAMES)
    sub_codes: bool = True
    demo: bool = False
    held_motions_go_on: bool = False
    faults: tuple[str, ...] = ()
    insecure: bool = False
    mesh: Mesh | None = None


def with_factors(declared: YaskawaSettings | None, joints: int) -> YaskawaSettings:
    """Return the settings of a simulated controller: as declared, with its own factors if there are none."""
    settings = declared or YaskawaSettings()
    if settings.pulses_per_degree:
        return settings
    return replace(settings, pulses_per_degree=(_PULSES_PER_DEGREE,) * joints)


async def serve_hses(settings: HsesSettings, *, ready: Callable[[int], None] | None = None) -> None:
    """Simulate a controller until cancelled.

    Args:
        ready: Called with the port once clients can ask.

    Raises:
        ListenError: If it cannot listen on the address.
        SimulatorError: If a setting is invalid.
        DescriptionError: If the robot is unknown.
    """
    host, port = split_address(settings.listen)
    remedy = "listen on 127.0.0.1, or take the risk with --insecure: this protocol has no TLS"
    if warning := check_reach(
        "the simulator", host, secured=False, insecure=settings.insecure, remedy=remedy
    ):
        logger.warning("%s", warning)
    faults = Faults(settings.faults, known=HSES_FAULTS)
    server = _server(settings, faults)
    transport = await _listen(server, host, port)
    port = transport.get_extra_info("sockname")[1]
    try:
        if ready is not None:
            ready(port)
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(server.run())
            if settings.mesh is not None:
                tasks.create_task(answer_requests(settings.mesh, faults))
            while True:
                await asyncio.sleep(_CLOSED_CHECK_S)
                if server.listens and transport.is_closing():
                    transport = await _listen(server, host, port)
                elif not server.listens:
                    transport.close()
    finally:
        transport.close()


async def _listen(server: HsesServer, host: str, port: int) -> asyncio.DatagramTransport:
    try:
        transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
            lambda: server, local_addr=(host, port)
        )
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno and error.errno > 0 else str(error)
        raise ListenError(f"the simulator cannot listen on {host}:{port}: {reason.lower()}") from None
    return transport


def _server(settings: HsesSettings, faults: Faults) -> HsesServer:
    description = load(settings.robot)
    joints = joints_of(description)
    if len(joints) > settings.axis_count:
        raise SimulatorError(
            f"robot {description.name} has {len(joints)} joints, "
            f"this controller has {settings.axis_count} axes"
        )
    declared = with_factors(settings.yaskawa, len(joints))
    try:
        axes, instance = Axes(declared, joints.types), instance_of(declared.group)
    except GatewaySettingsError as error:
        raise SimulatorError(str(error)) from None

    def boot(restarted: bool) -> HsesController:
        return HsesController(
            description,
            axes,
            tour=demo_tour(description) if settings.demo and not restarted else None,
            servo_on=not restarted,
            axis_count=settings.axis_count,
            held_motions_go_on=settings.held_motions_go_on,
        )

    return HsesServer(boot, faults, instance=instance, sub_codes=settings.sub_codes)
