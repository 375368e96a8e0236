"""Control of a robot for a program: acquire a lease, renew it, release it."""

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
    """A lease that the program holds.

    Attributes:
        lease: The holder's secret, for commands.
        now_ns: The gateway's clock when it granted the lease [ns since the Unix epoch].
        renewing: Task that renews the lease; ends when the gateway refuses, with the reason as its result.
    """

    lease: str
    now_ns: int
    renewing: asyncio.Task[str]


@asynccontextmanager
async def control(session: Session, site: str, robot: str, operator: str) -> AsyncIterator[Control]:
    """Hold control of a robot while the block runs; a killed program loses it with its session.

    Raises:
        RefusedError: If another operator has control.
        NoAnswerError: If no gateway answers.
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
        # Keep trying after a late answer: the lease outlives three of them.
        try:
            await session.ask(key, renewal, timeout_s=0.5)
        except (NoAnswerError, BusyError):
            pass
        except BusError as error:
            return str(error)
