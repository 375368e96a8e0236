"""Site with a simulated controller of Universal Robots' kind that the gateway may move."""

import contextlib

from controllers.universal_robots.interfaces.modes import RuntimeState
from controllers.universal_robots.settings import MotionSettings, UniversalRobotsSettings
from controllers.universal_robots.simulated import service
from controllers.universal_robots.simulated.service import UrSettings, serve_rtde
from tests.controllers.simulated_site import kept, remote, running
from tests.protocol_gateway.gateway_site import A, gateway

UR = {"description": "puma560", "protocol": "rtde", "up": False}


@contextlib.asynccontextmanager
async def controller(monkeypatch, **settings):
    """Run a simulated controller; yield its ports and its server, to look at it and to change it."""
    servers = kept(monkeypatch, service, "_server")
    async with running(serve_rtde, UrSettings(**settings)) as ports:
        yield ports, servers[-1]


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
    await remote(site)
    await site.lease(A.ACQUIRE)


def runs(server):
    """Return whether a program runs on the controller."""
    return server.controller.programs.state is not RuntimeState.STOPPED
