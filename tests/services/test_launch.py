"""The routers that a service with a site file attaches to."""

import pytest

from robomesh.contract.endpoints import DEFAULT_ROUTER
from services.command_line.site.launch import session_settings
from services.site_file.site import Site
from services.site_file.tables.router import Router


@pytest.mark.parametrize(
    ("listen", "connect", "routers"),
    [
        (["tcp/127.0.0.1:7450"], DEFAULT_ROUTER, ("tcp/127.0.0.1:7450",)),
        (["tcp/0.0.0.0:7450"], DEFAULT_ROUTER, ("tcp/127.0.0.1:7450",)),
        # That of loopback is there before a network comes up.
        (
            ["tcp/10.0.0.7:7447", "tcp/[::1]:7448"],
            DEFAULT_ROUTER,
            ("tcp/[::1]:7448", "tcp/10.0.0.7:7447"),
        ),
        (
            ["tcp/127.0.0.1:7450"],
            "tcp/10.0.0.9:7447,tcp/10.0.0.8:7447",
            ("tcp/10.0.0.9:7447", "tcp/10.0.0.8:7447"),
        ),
    ],
)
def test_a_service_attaches_to_the_router_of_its_site_unless_it_is_told_another(listen, connect, routers):
    site = Site(site="hall", router=Router(listen=tuple(listen), insecure=True))
    assert session_settings(site, connect, "gateway").connect == routers
