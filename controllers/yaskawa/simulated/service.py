"""Service of the simulated controller: listens for HSES."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass

from controllers.simulated.demo import demo_tour
from controllers.simulated.errors import SimulatorError
from controllers.simulated.faults import Faults
from controllers.simulated.serving import SimulatorSettings, cannot_listen, run, warn_beyond_loopback
from controllers.yaskawa.axes import Axes, YaskawaSettings, instance_of, with_factors
from controllers.yaskawa.simulated.controller import AXIS_NAMES, HsesController
from controllers.yaskawa.simulated.server import HSES_FAULTS, HsesServer
from protocol_gateway.seam.errors import GatewaySettingsError
from robomesh.listen_address import split_address
from robots.descriptions.description import load
from robots.kinematics.joints import joints_of

_CLOSED_CHECK_S = 0.05


@dataclass(frozen=True, kw_only=True)
class HsesSettings(SimulatorSettings):
    """Settings of a simulated controller of Yaskawa's kind, with at most eight joints.

    Attributes:
        yaskawa: As in the site file; None, or without pulses_per_degree: 1000 pulses a degree or millimetre.
        axis_count: Values of axes that it sends: 7 as FS100, 8 as later ones.
        sub_codes: Alarms have the texts of their sub-codes, as on DX200 and later.
        held_motions_go_on: A held motion goes on when HOLD ends; otherwise it is given up. Which of them a
            real controller does is not known.
    """

    yaskawa: YaskawaSettings | None = None
    axis_count: int = len(AXIS_NAMES)
    sub_codes: bool = True
    held_motions_go_on: bool = False


async def serve_hses(settings: HsesSettings, *, ready: Callable[[int], None] | None = None) -> None:
    """Simulate a controller until cancelled.

    Args:
        ready: Called with the port once clients can ask.

    Raises:
        ListenError: If it cannot listen on the address.
        SimulatorError: If a setting is invalid.
        DescriptionError: If the robot is unknown.
    """
    warn_beyond_loopback(settings.listen, insecure=settings.insecure, because="this protocol has no TLS")
    host, port = split_address(settings.listen)
    faults = Faults(settings.faults, known=HSES_FAULTS)
    server = _server(settings, faults)
    transport = await _listen(server, host, port)
    port = transport.get_extra_info("sockname")[1]

    async def follow_faults() -> None:
        nonlocal transport
        while True:
            await asyncio.sleep(_CLOSED_CHECK_S)
            if server.listens and transport.is_closing():
                transport = await _listen(server, host, port)
            elif not server.listens:
                transport.close()

    try:
        if ready is not None:
            ready(port)
        await run(server.run(), follow_faults(), mesh=settings.mesh, faults=faults)
    finally:
        transport.close()


async def _listen(server: HsesServer, host: str, port: int) -> asyncio.DatagramTransport:
    try:
        transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
            lambda: server, local_addr=(host, port)
        )
    except OSError as error:
        raise cannot_listen(f"{host}:{port}", error) from None
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
