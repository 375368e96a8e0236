"""`robomesh alive`: a health check of a service, without a site file."""

import asyncio
from typing import Annotated

import typer

from robomesh.contract import keys
from robomesh.contract.endpoints import DEFAULT_ROUTER
from robomesh.contract.keys import PresenceKey
from robomesh.errors import RobomeshError
from robomesh.schemas.robomesh_pb2 import ClockRequest
from robomesh.wire import presence
from robomesh.wire.session import Session
from services.command_line.terminal import discovery
from services.command_line.terminal.options import Connect, command_group
from services.command_line.terminal.output import print_line

app = command_group()

_ROUTER = "router"
# Per answer: a service that takes longer is not usable.
_WITHIN_S = 2.0


@app.command()
def alive(
    service: Annotated[
        str, typer.Argument(metavar="[SITE/]SERVICE", help="As `list` shows it: router, gateway, ...")
    ],
    connect: Connect = DEFAULT_ROUTER,
) -> int:
    """Check that a service answers: exit status 0 or 1, for health checks."""
    problem = asyncio.run(_problem_of(service, connect))
    print_line(f"{service}: {problem or 'alive'}")
    return 0 if problem is None else 1


async def _problem_of(text: str, connect: str) -> str | None:
    """Return the service's problem; None: it answers."""
    site, _, service = text.rpartition("/")
    keys.check_chunk(service, "service")
    tokens = f"{keys.ROOT}/{keys.check_name(site, 'site') if site else '*'}/*/alive/{service}/*"
    try:
        async with discovery.attached(connect) as session:
            # A router is alive if a session attaches to it.
            return None if service == _ROUTER else await _silent_processes(session, tokens)
    except RobomeshError as error:
        return str(error)


async def _silent_processes(session: Session, tokens: str) -> str | None:
    """Ask every present process: Zenoh's threads keep a hung service present, but its own loop answers."""
    found = {who.id: who for who in await presence.present(session.zenoh_session, (tokens,))}
    answers = await asyncio.gather(*(_answers(session, who) for who in found.values()))
    silent = [identity for identity, answered in zip(found, answers, strict=True) if not answered]
    if silent:
        return f"{', '.join(silent)} does not answer within {_WITHIN_S:g} s"
    return None if found else "not present"


async def _answers(session: Session, who: PresenceKey) -> bool:
    try:
        key = keys.robot_key(who.site, keys.WHOLE_SITE, f"clock/{who.id}")
        await session.ask(key, ClockRequest(), timeout_s=_WITHIN_S)
    except RobomeshError:
        return False
    return True
