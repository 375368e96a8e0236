"""Site with a simulated controller of FANUC's kind that the gateway may move."""

import contextlib
import itertools
import json
import time

from controllers.fanuc.axes import FanucSettings
from controllers.fanuc.simulated import service
from controllers.fanuc.simulated.rmi_program import ProgramStatus
from controllers.fanuc.simulated.service import SnpxSettings, serve_snpx
from tests.controllers.simulated_site import kept, remote, running
from tests.protocol_gateway.gateway_site import A, gateway, until

FANUC = {"description": "puma560", "protocol": "snpx", "up": False}
# More positions a second than by default, so that tests are short.
MOVES = FanucSettings(assignments="own", j23=1, motion=True, speed_percent=100.0, rate_hz=60.0)


@contextlib.asynccontextmanager
async def controller(monkeypatch, **settings):
    """Run a simulated controller; yield its ports and RMI's server, to look at it and to change it."""
    servers = kept(monkeypatch, service, "RmiServer")
    async with running(serve_snpx, SnpxSettings(**{"rmi": "127.0.0.1:0", **settings})) as ports:
        yield ports, servers[-1]


@contextlib.asynccontextmanager
async def movable(mesh, folder, at, *, motion=MOVES, session=None, **robot):
    """Run a gateway that may move the arm."""
    ports = {"rmi": at.rmi} | ({"rmi_session": session} if session else {})
    options = {"options": motion, "ports": ports}
    async with gateway(mesh, folder, at.snpx, **FANUC, **options | {"simulated": True} | robot) as site:
        yield site


async def in_control(site):
    """Wait until the state is known, take control, and wait until RMI is connected."""
    await remote(site)
    await site.lease(A.ACQUIRE)
    await until(lambda: site.controller.capabilities.stops == site.controller.capabilities.OURS)


def positions(server):
    return server.controller.positions(time.monotonic())


def runs(server):
    """Return whether RMI_MOVE is in the controller."""
    return server.controller.rmi is not None and server.controller.rmi.status is not ProgramStatus.ABORTED


def tour(server):
    """Return the targets of a program of an operator."""
    here = positions(server)
    return itertools.cycle([here + 0.3, here])


def packets(parts):
    """Return the JSON objects that were sent."""
    return [json.loads(line) for line in b"".join(parts).split(b"\r\n") if line]
