"""Endpoints of every kind that Zenoh has: a router that listens on one is reached there."""

import pytest
import zenoh

from bus.endpoints import client_config, router_config, router_values
from tests.conftest import free_port


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
