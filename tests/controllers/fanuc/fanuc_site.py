"""Site with a simulated controller of FANUC's kind that the gateway may move."""

import asyncio
import contextlib
import itertools
import json
import time

from controllers.fanuc.axes import FanucSettings
from controllers.fanuc.simulated import service
from controllers.fanuc.simulated.rmi_program import ProgramStatus
from controllers.fanuc.simulated.service import SnpxSettings, serve_snpx
from tests.protocol_gateway.gateway_site import STATE, A, C, gateway, until

FANUC = {"description": "puma560", "protocol": "snpx", "up": False}
# More positions a second than by default, so that tests are short.
MOVES = FanucSettings(assignments="own", j23=1, motion=True, speed_percent=100.0, rate_hz=60.0)


@contextlib.asynccontextmanager
async def controller(monkeypatch, **settings):
    """Run a simulated controller; yield its ports and RMI's server, to look at it and to change it."""
    servers = []
    make = service.RmiServer
    monkeypatch.setattr(service, "RmiServer", lambda *given: servers.append(make(*given)) or servers[-1])
    ready = asyncio.get_running_loop().create_future()
    task = asyncio.create_task(
        serve_snpx(SnpxSettings(**{"rmi": "127.0.0.1:0", **settings}), ready=ready.set_result)
    )
    await asyncio.wait([ready, task], return_when=asyncio.FIRST_COMPLETED)
    try:
        yield await ready, servers[-1]
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


@contextlib.asynccontextmanager
async def movable(mesh, folder, at, *, motion=MOVES, session=None, **robot):
    """Run a gateway that may move the arm."""
    ports = {"rmi": at.rmi} | ({"rmi_session": session} if session else {})
    options = {"options": motion, "ports": ports}
    async with gateway(mesh, folder, at.snpx, **FANUC, **options | {"simulated": True} | robot) as site:
        yield site


async def in_control(site):
    """Wait until the state is known, take control, and wait until RMI is connected."""
    await until(lambda: site.seen.get("controller") and site.controller.mode == STATE.REMOTE)
    await until(lambda: site.joints)
    await site.lease(A.ACQUIRE, ttl_s=5)
    await until(lambda: site.controller.capabilities.stops == site.controller.capabilities.OURS)


async def move(site, *offsets, **fields):
    """Command a target by offsets from the present positions; return the target."""
    target = [here + by for here, by in zip(site.joints, (*offsets, *[0.0] * 6), strict=False)]
    await site.command(C.MOVE_ABSOLUTE, joint_positions=target, **fields)
    return target


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
