"""Take control of a robot, send it home, wait until it arrives, release control.

    ./dev run python examples/home.py [ROBOT] [ROUTER]

Control is a lease, which is renewed while the block runs; the robot stops if it expires.
"""

import asyncio
import signal
import sys

from robomesh.lease import control
from robomesh.schemas.robomesh_pb2 import CommandRequest
from robomesh.session import SessionSettings, open_session

ROBOT = sys.argv[1] if len(sys.argv) > 1 else "demo/pt600"
ROUTER = sys.argv[2] if len(sys.argv) > 2 else "tcp/127.0.0.1:7447"
OPERATOR = "example"


async def main() -> None:
    """Do it."""
    async with (
        open_session(SessionSettings(connect=(ROUTER,), wait_s=2.0)) as session,
        control(session, *ROBOT.split("/"), OPERATOR) as own,
    ):
        command = CommandRequest(lease=own.lease, id=1, command=CommandRequest.HOME)
        # By the gateway's clock: a command held up on the way must not move an arm later.
        command.not_after.FromNanoseconds(own.now_ns + 2_000_000_000)
        print((await session.ask(f"robomesh/{ROBOT}/command/{OPERATOR}", command)).text)
        async for sample in session.subscribe(f"robomesh/{ROBOT}/lease", newest=20):
            if sample.live and not sample.message().motion:
                break


asyncio.run(main())
signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # nobody may read any more
print("home")
