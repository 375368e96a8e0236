"""`robomesh alive`: whether a service answers now; for health checks, so it reads no site file."""

import asyncio

from robomesh import keys, presence
from robomesh.errors import BusError
from robomesh.keys import PresenceKey
from robomesh.schemas.robomesh_pb2 import ClockRequest
from robomesh.session import Session
from services.command_line import discovery

_ROUTER = "router"
# All of it: what takes longer is not alive to whoever waits for it.
_WITHIN_S = 2.0


def run(service: str, connect: str) -> int:
    """0: every process of the service that is present answers; 1: one does not, or there is none."""
    problem = asyncio.run(_look(service, connect))
    print(f"{service}: {problem or 'alive'}")
    return 0 if problem is None else 1


async def _look(text: str, connect: str) -> str | None:
    """What is wrong with it; None: nothing."""
    site, _, service = text.rpartition("/")
    keys.check_chunk(service, "service")
    tokens = f"{keys.ROOT}/{keys.check_name(site, 'site') if site else '*'}/*/alive/{service}/*"
    try:
        async with discovery.attached(connect) as session:
            # Attached to a router is what its own clients want of it.
            return None if service == _ROUTER else await _problem(session, tokens)
    except BusError as error:
        return str(error)


async def _problem(session: Session, tokens: str) -> str | None:
    """Presence is told by Zenoh's threads, answers by the service's own loop, where a hang shows."""
    found = {who.id: who for who in await presence.present(session.zenoh_session, tokens)}
    answers = await asyncio.gather(*(_answers(session, who) for who in found.values()))
    silent = [identity for identity, answered in zip(found, answers, strict=True) if not answered]
    if silent:
        return f"{', '.join(silent)} does not answer within {_WITHIN_S:g} s"
    return None if found else "none is present"


async def _answers(session: Session, who: PresenceKey) -> bool:
    try:
        key = keys.robot_key(who.site, keys.WHOLE_SITE, f"clock/{who.id}")
        await session.ask(key, ClockRequest(), timeout_s=_WITHIN_S)
    except BusError:
        return False
    return True
