"""The embedded router: a Zenoh session in router mode."""

import asyncio
import logging
from collections.abc import Callable
from dataclasses import dataclass

import zenoh

from bus.endpoints import Tls, first_line, router_config
from services.errors import ListenError
from services.listen import check_reach, split_address

log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What a router listens on, and the other sites' routers that it links to."""

    listen: tuple[str, ...] = ("tcp/127.0.0.1:7447",)
    connect: tuple[str, ...] = ()
    tls: Tls | None = None
    insecure: bool = False


async def serve(settings: Settings, *, ready: Callable[[str], None] | None = None) -> None:
    """Route until cancelled. The router itself is no client: it takes no session.

    Raises:
        ListenError: If an address is taken, or beyond loopback without TLS and `insecure`.
        SessionError: If an endpoint is not one of Zenoh's.
    """
    for endpoint in settings.listen:
        protocol, _, address = endpoint.partition("/")
        host, _ = split_address(address.partition("?")[0])
        warning = check_reach(
            f"the router ({endpoint})", host, secured=protocol in ("tls", "quic"), insecure=settings.insecure
        )
        if warning:
            log.warning(warning)
    config = router_config(settings.listen, settings.connect, settings.tls)
    try:
        router = await asyncio.to_thread(zenoh.open, config)
    except zenoh.ZError as error:
        raise ListenError(
            f"the router cannot listen on {', '.join(settings.listen)}: {first_line(error)}; "
            "is another one running there? Name another under [router] listen"
        ) from None
    try:
        if ready is not None:
            ready("routing on " + ", ".join(settings.listen))
        await asyncio.Event().wait()
    finally:
        await asyncio.to_thread(router.close)
