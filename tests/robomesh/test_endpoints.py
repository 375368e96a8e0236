"""Endpoints of every kind that Zenoh has: a router that listens on one is reached there."""

import os
import socket

import psutil
import pytest
import zenoh

from robomesh.endpoints import client_config, router_config, router_values
from robomesh.session import SessionSettings, open_session
from tests.conftest import free_port, run


async def nobody(request):
    """Answers no request."""


@pytest.mark.parametrize(
    "endpoint",
    ["tcp/127.0.0.1:{port}", "tcp/127.0.0.1:{port}#iface=lo", "ws/127.0.0.1:{port}", "udp/127.0.0.1:{port}"],
)
def test_a_client_reaches_a_router_at(endpoint):
    where = endpoint.format(port=free_port())
    with zenoh.open(router_config((where,))) as router, zenoh.open(client_config((where,))) as client:
        assert [str(each) for each in client.info.routers_zid()] == [str(router.info.zid())]


@pytest.mark.parametrize(
    ("endpoint", "made"),
    [
        ("tcp/127.0.0.1:1", "tcp/127.0.0.1:1#so_sndbuf=32768"),
        ("tcp/0.0.0.0:1", "tcp/0.0.0.0:1#so_sndbuf=212992"),
        ("tcp/0.0.0.0:1#iface=eth1", "tcp/0.0.0.0:1#iface=eth1;so_sndbuf=212992"),
        ("tcp/0.0.0.0:1#so_sndbuf=4000000", "tcp/0.0.0.0:1#so_sndbuf=4000000"),
    ],
)
def test_a_router_keeps_little_that_waits_to_be_sent_unless_told_otherwise(endpoint, made):
    assert router_values((endpoint,))["listen/endpoints"] == [made]


def held_bytes():
    """What each connected TCP socket of this process holds to send and to read, by its ports."""
    found = {}
    for each in psutil.Process().net_connections("tcp"):
        if each.raddr:
            with socket.socket(fileno=os.dup(each.fd)) as copy:
                kinds = socket.SO_SNDBUF, socket.SO_RCVBUF
                held = [copy.getsockopt(socket.SOL_SOCKET, kind) for kind in kinds]
            found[each.laddr.port, each.raddr.port] = held
    return found


def test_little_waits_on_the_connection_over_which_a_service_is_commanded(router):
    """So a service that reads slowly holds up who sends too much, and not the requests of others."""
    port = int(router.rpartition(":")[2])

    async def main():
        async with open_session(SessionSettings(connect=(router,), wait_s=5.0)) as session:
            before = held_bytes()
            session.answer("hall", "arm", "command/*", nobody)
            new = {ports: held for ports, held in held_bytes().items() if ports not in before}
            services = [held for (_, to), held in new.items() if to == port]
            routers = [held for (of, _), held in new.items() if of == port]
            assert len(services) == len(routers) == 2  # both links, and both ends are here
            assert max(*services[0], *services[1], routers[0][0], routers[1][0]) <= 2 * 32_768

    run(main())
