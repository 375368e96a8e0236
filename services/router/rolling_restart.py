"""Rolling restart: several routers of a site restart one after the other, so that one always serves."""

import asyncio

import zenoh

from robomesh.contract.certificate_identity import read_identity
from robomesh.contract.endpoints import Tls

_MAX_WAIT_S = 10.0
# Its clients reconnect within this time.
_SETTLED_S = 2.0
_CHECK_EVERY_S = 0.1


def neighbours(router: zenoh.Session, tls: Tls | None) -> frozenset[str]:
    """Return the ids of the site's other routers that are linked to this one, by their certificates."""
    own = None if tls is None else read_identity(tls.certificate)
    if own is None:
        return frozenset()
    routers = set(map(str, router.info.routers_zid()))
    return frozenset(
        zid
        for link in router.info.links()
        if (zid := str(link.zid)) in routers and (link.auth_identifier or "").endswith(f".{own.site}")
    )


async def wait_for_turn(
    router: zenoh.Session, tls: Tls | None, others: frozenset[str], *, settled_s: float = _SETTLED_S
) -> None:
    """Wait until the other routers with lower ids have restarted; a restarted router has a new id.

    The wait ends after ten seconds if one does not return. `settled_s` is the time for its clients to
    reconnect.
    """
    before = {zid for zid in others if zid < str(router.info.zid())}
    deadline = asyncio.get_running_loop().time() + _MAX_WAIT_S
    while before and asyncio.get_running_loop().time() < deadline:
        await asyncio.sleep(_CHECK_EVERY_S)
        now = await asyncio.to_thread(neighbours, router, tls)
        # The old ids are gone, and as many routers are present.
        if not before & now and len(now) >= len(others):
            await asyncio.sleep(settled_s)
            return
