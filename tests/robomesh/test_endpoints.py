"""Endpoints of all kinds, and the buffers of their connections."""

import os
import socket

import psutil
import pytest
import zenoh

from robomesh.contract.endpoints import client_config, router_config, router_values
from robomesh.wire.session import SessionSettings, open_session
from tests.ports import free_port


async def no_answer(request):
    """Answer no request."""


@pytest.mark.parametrize(
    "endpoint",
    ["tcp/127.0.0.1:{port}", "tcp/127.0.0.1:{port}#iface=lo", "ws/127.0.0.1:{port}", "udp/127.0.0.1:{port}"],
)
def test_client_reaches_router_at(endpoint):
    where = endpoint.format(port=free_port())
    with zenoh.open(router_config((where,))) as router, zenoh.open(client_config((where,))) as client:
        assert [str(each) for each in client.info.routers_zid()] == [str(router.info.zid())]


@pytest.mark.parametrize(
    ("endpoint", "expected"),
    [
        ("tcp/127.0.0.1:1", "tcp/127.0.0.1:1#so_sndbuf=32768"),
        ("tcp/0.0.0.0:1", "tcp/0.0.0.0:1#so_sndbuf=212992"),
        ("tcp/0.0.0.0:1#iface=eth1", "tcp/0.0.0.0:1#iface=eth1;so_sndbuf=212992"),
        ("tcp/0.0.0.0:1#so_sndbuf=4000000", "tcp/0.0.0.0:1#so_sndbuf=4000000"),
    ],
)
def test_listener_has_small_send_buffers_unless_set(endpoint, expected):
    assert router_values((endpoint,))["listen/endpoints"] == [expected]


def buffer_sizes():
    """Return send and receive buffer sizes of each connected TCP socket of this process, by its ports."""
    found = {}
    for each in psutil.Process().net_connections("tcp"):
        if each.raddr:
            with socket.socket(fileno=os.dup(each.fd)) as copy:
                kinds = socket.SO_SNDBUF, socket.SO_RCVBUF
                sizes = [copy.getsockopt(socket.SOL_SOCKET, kind) for kind in kinds]
            found[each.laddr.port, each.raddr.port] = sizes
    return found


async def test_connection_for_commands_has_small_buffers(router):
    """Check that a slow service slows down a flooding sender, and not the requests of other callers."""
    port = int(router.rpartition(":")[2])
    async with open_session(SessionSettings(connect=(router,), wait_s=5.0)) as session:
        before = buffer_sizes()
        session.answer("hall", "arm", "command/*", no_answer)
        new = {ports: sizes for ports, sizes in buffer_sizes().items() if ports not in before}
        services = [sizes for (_, to), sizes in new.items() if to == port]
        routers = [sizes for (of, _), sizes in new.items() if of == port]
        assert len(services) == len(routers) == 2  # two links, and both ends of each are in this process
        assert max(*services[0], *services[1], routers[0][0], routers[1][0]) <= 2 * 32_768
