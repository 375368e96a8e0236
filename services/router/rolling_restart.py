"""Several routers of a site open anew one after the other, so that one of them always serves."""

import asyncio

import zenoh

from robomesh.certificate_identity import read_identity
from robomesh.endpoints import Tls

_LONGEST_S = 10.0
# Its clients come back to it within this.
_SETTLED_S = 2.0
_LOOK_S = 0.1


def neighbours(router: zenoh.Session, tls: Tls | None) -> frozenset[str]:
    """Ids of the other routers of the site that are linked to this one, by the certificates they show."""
    own = None if tls is None else read_identity(tls.certificate)
    if own is None:
        return frozenset()
    routers = set(map(str, router.info.routers_zid()))
    return frozenset(
        zid
        for link in router.info.links()
        if (zid := str(link.zid)) in routers and (link.auth_identifier or "").endswith(f".{own.site}")
    )


async def our_turn(
    router: zenoh.Session, tls: Tls | None, others: frozenset[str], *, settled_s: float = _SETTLED_S
) -> None:
    """Wait for those of the others whose ids are lower than ours, until each has been opened anew.

    Each opening has a new id. Whoever does not come back is waited for ten seconds; who does has
    `settled_s` for its clients.
    """
    before = {zid for zid in others if zid < str(router.info.zid())}
    deadline = asyncio.get_running_loop().time() + _LONGEST_S
    while before and asyncio.get_running_loop().time() < deadline:
        await asyncio.sleep(_LOOK_S)
        now = await asyncio.to_thread(neighbours, router, tls)
        # Gone, and somebody in its place.
        if not before & now and len(now) >= len(others):
            await asyncio.sleep(settled_s)
            return
