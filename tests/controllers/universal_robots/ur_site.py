"""Site with a simulated controller of Universal Robots' kind that the gateway may move."""

import asyncio
import contextlib

from controllers.universal_robots.modes import RuntimeState
from controllers.universal_robots.settings import MotionSettings, UniversalRobotsSettings
from controllers.universal_robots.simulated import service
from controllers.universal_robots.simulated.service import UrSettings, serve_rtde
from tests.protocol_gateway.gateway_site import STATE, A, C, gateway, until

UR = {"description": "puma560", "protocol": "rtde", "up": False}


@contextlib.asynccontextmanager
async def controller(monkeypatch, **settings):
    """Run a simulated controller; yield its ports and its server, to look at it and to change it."""
    servers = []
    make = service._server
    monkeypatch.setattr(service, "_server", lambda *given: servers.append(make(*given)) or servers[-1])
    ready = asyncio.get_running_loop().create_future()
    task = asyncio.create_task(serve_rtde(UrSettings(**settings), ready=ready.set_result))
    await asyncio.wait([ready, task], return_when=asyncio.FIRST_COMPLETED)
    try:
        yield await ready, servers[-1]
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


def others(ports):
    """Return the ports of the interfaces other than RTDE, as the site file names them."""
    return {"primary": ports.primary, "scripts": ports.scripts[0], "dashboard": ports.dashboard}


@contextlib.asynccontextmanager
async def movable(mesh, folder, at, *, motion=None, **robot):
    """Run a gateway that may move the arm, until it is in remote control and connected."""
    options = {"options": UniversalRobotsSettings(motion=motion or MotionSettings()), "ports": others(at)}
    async with gateway(mesh, folder, at.rtde, **UR, **options | {"simulated": True} | robot) as site:
        yield site


async def in_control(site):
    """Wait until the robot can be moved, and take control."""
    await until(lambda: site.seen.get("controller") and site.controller.mode == STATE.REMOTE)
    await until(lambda: site.joints)
    await site.lease(A.ACQUIRE, ttl_s=5)


async def move(site, *offsets, **fields):
    """Command a target by offsets from the present positions; return the target."""
    target = [here + by for here, by in zip(site.joints, (*offsets, *[0.0] * 6), strict=False)]
    await site.command(C.MOVE_ABSOLUTE, joint_positions=target, **fields)
    return target


def runs(server):
    """Return whether a program runs on the controller."""
    return server.controller.programs.state is not RuntimeState.STOPPED
