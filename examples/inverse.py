"""Ask the mesh for joint positions that bring the tool to a point; the robot does not move.

    ./dev run python examples/inverse.py X Y Z [ROBOT] [ROUTER]      mm, the tool pointing down

Exit status 1 if the arm cannot reach it; the answer says why.
"""

import asyncio
import signal
import sys
from math import degrees

from robomesh.schemas.robomesh_pb2 import Description, InverseRequest
from robomesh.session import SessionSettings, open_session

try:
    X, Y, Z = (float(word) / 1000 for word in sys.argv[1:4])
except ValueError:
    sys.exit("usage: ./dev run python examples/inverse.py X Y Z [ROBOT] [ROUTER]      mm: 300 0 500")
ROBOT = sys.argv[4] if len(sys.argv) > 4 else "demo/pt600"
ROUTER = sys.argv[5] if len(sys.argv) > 5 else "tcp/127.0.0.1:7447"

# Tool to base, row by row, in metres: the tool's z points against the base's.
POSE = [1, 0, 0, X, 0, -1, 0, Y, 0, 0, -1, Z, 0, 0, 0, 1]


async def main() -> int:
    """Do it."""
    async with open_session(SessionSettings(connect=(ROUTER,), wait_s=2.0)) as session:
        robot = await session.last(f"robomesh/{ROBOT}/description")
        # Five joints cannot hold a tool any way round: its place and its axis they can.
        task = InverseRequest.POSITION_AND_AXIS_5D if len(robot.joints) < 6 else InverseRequest.POSE_6D
        request = InverseRequest(pose=POSE, task=task, all_solutions=True)
        answer = await session.ask(f"robomesh/{ROBOT}/kinematics/inverse", request, timeout_s=30.0)
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # from here on `| head` may end it
    for solution in answer.solutions:
        told = zip(robot.joints, solution.joint_positions, strict=True)
        print(
            " ".join(
                f"{joint.name} {degrees(value):.2f}"
                if joint.type == Description.Joint.ROTARY
                else f"{joint.name} {1000 * value:.2f}mm"
                for joint, value in told
            )
        )
    count = len(answer.solutions)
    solutions = "1 solution" if count == 1 else f"{count} solutions"
    print(answer.reason or f"{solutions}, the tool within {answer.residual_m:.1e} m")
    return 0 if answer.solutions else 1


sys.exit(asyncio.run(main()))
