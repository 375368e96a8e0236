"""Check a teach program from the robot's current position.

    ./dev run python examples/check.py examples/square.program [ROBOT] [ROUTER]

Exit status 1 if the check finds a problem. The robot does not move.
"""

import asyncio
import signal
import sys
from pathlib import Path

from robomesh.schemas.robomesh_pb2 import CheckRequest
from robomesh.session import SessionSettings, open_session

if len(sys.argv) < 2:
    sys.exit("usage: ./dev run python examples/check.py FILE.program [ROBOT] [ROUTER]")
PROGRAM = Path(sys.argv[1]).read_text()
ROBOT = sys.argv[2] if len(sys.argv) > 2 else "demo/pt600"
ROUTER = sys.argv[3] if len(sys.argv) > 3 else "tcp/127.0.0.1:7447"


async def main() -> int:
    """Do it."""
    async with open_session(SessionSettings(connect=(ROUTER,), wait_s=2.0)) as session:
        key = f"robomesh/{ROBOT}/kinematics/check/{session.own_name}"
        answer = await session.ask(key, CheckRequest(program=PROGRAM), timeout_s=30.0)
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # from here on `| head` may end it
    for each in answer.violations:
        print(f"line {each.line}, {each.time_s:.2f} s: {each.kind}: {each.text}")
    print(f"{answer.duration_s:.2f} s, {'nothing wrong' if answer.ok else 'not as it should be'}")
    return 0 if answer.ok else 1


sys.exit(asyncio.run(main()))
