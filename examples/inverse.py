"""Ask the mesh for joint positions that bring the tool to a point; the robot does not move.

    ./dev run python examples/inverse.py X Y Z [ROBOT] [ROUTER]      mm, the tool pointing down

Exit status 1 if the arm cannot reach it; the answer says why.
"""

import signal
import sys

import robomesh

try:
    X, Y, Z = (float(word) / 1000 for word in sys.argv[1:4])
except ValueError:
    sys.exit("usage: ./dev run python examples/inverse.py X Y Z [ROBOT] [ROUTER]      mm: 300 0 500")
ROBOT = sys.argv[4] if len(sys.argv) > 4 else "demo/pt600"
ROUTER = sys.argv[5] if len(sys.argv) > 5 else "tcp/127.0.0.1:7447"

# Tool to base, row by row, in metres: the tool's z points against the base's.
POSE = [[1, 0, 0, X], [0, -1, 0, Y], [0, 0, -1, Z], [0, 0, 0, 1]]

try:
    with robomesh.connect(ROUTER) as mesh:
        robot = mesh.robot(ROBOT)
        result = robot.inverse(POSE, all_solutions=True)
        joints = robot.description().joints
        solutions = [robot.degrees(each) for each in result.solutions]
except robomesh.RobomeshError as error:
    sys.exit(f"not done: {error}")
signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # from here on `| head` may end it
units = ["mm" if joint.type == joint.PRISMATIC else "" for joint in joints]
for solution in solutions:
    told = zip(joints, solution, units, strict=True)
    print(" ".join(f"{joint.name} {value:.2f}{unit}" for joint, value, unit in told))
count = len(solutions)
found = "1 solution" if count == 1 else f"{count} solutions"
print(result.reason or f"{found}, the tool within {result.residual_m:.1e} m")
sys.exit(0 if solutions else 1)
