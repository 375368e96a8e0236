"""Take control of a robot, send it home, wait until it is there, give control back.

    ./dev run python examples/home.py [ROBOT] [ROUTER]

Control is a lease: it must be renewed while the motion runs, and the robot stops when it is not.
"""

import asyncio
import sys

from bus.schemas.robomesh_pb2 import CommandRequest, LeaseRequest
from bus.session import Session, SessionSettings, open_session

ROBOT = sys.argv[1] if len(sys.argv) > 1 else "demo/pt600"
ROUTER = sys.argv[2] if len(sys.argv) > 2 else "tcp/127.0.0.1:7447"
OPERATOR = "example"


async def renew(session: Session, lease: str) -> None:
    """Renew the lease until cancelled."""
    while True:
        await asyncio.sleep(0.5)
        await session.ask(
            f"robomesh/{ROBOT}/lease/request/{OPERATOR}",
            LeaseRequest(action=LeaseRequest.RENEW, lease=lease, ttl_s=2.0),
        )


async def main() -> None:
    """Do it."""
    async with open_session(SessionSettings(connect=(ROUTER,), wait_s=2.0)) as session:
        request = f"robomesh/{ROBOT}/lease/request/{OPERATOR}"
        answer = await session.ask(request, LeaseRequest(action=LeaseRequest.ACQUIRE, ttl_s=2.0))
        renewing = asyncio.create_task(renew(session, answer.lease))
        command = CommandRequest(lease=answer.lease, id=1, command=CommandRequest.HOME)
        # By the gateway's clock: a command held up on the way must not move an arm later.
        command.not_after.FromNanoseconds(answer.now.ToNanoseconds() + 2_000_000_000)
        print((await session.ask(f"robomesh/{ROBOT}/command/{OPERATOR}", command)).text)
        async for sample in session.subscribe(f"robomesh/{ROBOT}/lease", newest=20):
            if sample.live and not sample.message().motion:
                break
        renewing.cancel()
        await session.ask(request, LeaseRequest(action=LeaseRequest.RELEASE, lease=answer.lease))
        print("home")


asyncio.run(main())
