"""Site with a simulated controller of Yaskawa's kind that the gateway may move."""

import contextlib
from dataclasses import replace

from controllers.yaskawa.axes import with_factors
from controllers.yaskawa.simulated import service
from controllers.yaskawa.simulated.service import HsesSettings, serve_hses
from tests.controllers.simulated_site import kept, remote, running
from tests.protocol_gateway.gateway_site import A, gateway, until
from tests.protocol_gateway.wire import wire

# More positions a second than by default, so that tests are short.
MOTION = replace(with_factors(None, 6), motion=True, rate_hz=60.0)
HSES = {"description": "puma560", "protocol": "hses", "up": False, "options": MOTION, "simulated": True}
HOLD, MOVE = 0x83, 0x8B


def command(datagram):
    """Return the command of a datagram of the gateway."""
    return int.from_bytes(datagram[24:26], "little")


def written(relay):
    """Return command, instance and value of each command that writes, of motions without a value."""
    found = []
    for each in relay.sent:
        if each[29] in (0x10, 0x02):
            value = int.from_bytes(each[32:36], "little") if command(each) == HOLD else None
            found.append((command(each), int.from_bytes(each[26:28], "little"), value))
    return found


def motions(relay):
    """Return the datagrams of motions."""
    return [each for each in relay.sent if command(each) == MOVE]


@contextlib.asynccontextmanager
async def controller(monkeypatch, **settings):
    """Run a simulated controller; yield its port and its server, to look at it and to change it."""
    servers = kept(monkeypatch, service, "_server")
    async with running(serve_hses, HsesSettings(**settings)) as port:
        yield port, servers[-1]


@contextlib.asynccontextmanager
async def movable(mesh, folder, port, **robot):
    """Run a gateway that may move the arm, with a wire between; yield site and wire."""
    async with wire(port, datagrams=True) as relay, gateway(mesh, folder, relay.port, **HSES | robot) as site:
        yield site, relay


async def in_control(site):
    """Wait until the robot can be moved, and take control."""
    await remote(site)
    await until(lambda: site.controller.capabilities.stops != site.controller.capabilities.NOT_NOW)
    # The axes of robot and base are asked for by then.
    await site.units(20)
    await site.lease(A.ACQUIRE)
