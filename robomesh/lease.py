"""Control of a robot, for a program that acts for somebody: taken, renewed, given back."""

import asyncio
import contextlib
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass

from robomesh.errors import BusError, BusyError, NoAnswerError
from robomesh.keys import robot_key
from robomesh.presence import OPERATOR, session_of
from robomesh.schemas.robomesh_pb2 import LeaseAnswer, LeaseRequest
from robomesh.session import Session

_TTL_S = 2.0


@dataclass(frozen=True)
class Control:
    """Control that somebody has.

    Attributes:
        lease: The holder's secret, for commands.
        now_ns: The gateway's clock when it was given [ns since the Unix epoch].
        renewing: Ends when it can be renewed no more; its result is why.
    """

    lease: str
    now_ns: int
    renewing: asyncio.Task[str]


@asynccontextmanager
async def control(session: Session, site: str, robot: str, operator: str) -> AsyncIterator[Control]:
    """Have control while the block runs. Killed, we lose it with our session.

    Raises:
        RefusedError: If somebody else has it.
        NoAnswerError: If there is no gateway.
    """
    key = robot_key(site, robot, f"lease/request/{operator}")
    identity = session_of(operator)
    token = session.declare_presence_of(site, robot, OPERATOR, identity)
    try:
        wanted = LeaseRequest(action=LeaseRequest.ACQUIRE, ttl_s=_TTL_S, session=identity)
        answer = await session.ask(key, wanted)
        assert isinstance(answer, LeaseAnswer)
        renewing = asyncio.create_task(_renew(session, key, answer.lease))
        try:
            yield Control(answer.lease, answer.now.ToNanoseconds(), renewing)
        finally:
            renewing.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await renewing
            release = LeaseRequest(action=LeaseRequest.RELEASE, lease=answer.lease)
            with contextlib.suppress(BusError):
                await session.ask(key, release, timeout_s=1.0)
    finally:
        token.undeclare()


async def _renew(session: Session, key: str, lease: str) -> str:
    renewal = LeaseRequest(action=LeaseRequest.RENEW, lease=lease, ttl_s=_TTL_S)
    while True:
        await asyncio.sleep(_TTL_S / 4)
        # One late answer is no reason to let go; the lease outlives three of them.
        try:
            await session.ask(key, renewal, timeout_s=0.5)
        except (NoAnswerError, BusyError):
            pass
        except BusError as error:
            return str(error)
