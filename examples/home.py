"""Take control of a robot, send it home, wait until it arrives, release control.

./dev run python examples/home.py [ROBOT] [ROUTER]
"""

import sys

import robomesh

ROBOT = sys.argv[1] if len(sys.argv) > 1 else "demo/pt600"
ROUTER = sys.argv[2] if len(sys.argv) > 2 else "tcp/127.0.0.1:7447"

try:
    with robomesh.connect(ROUTER) as mesh, mesh.robot(ROBOT).control("example") as arm:
        arm.home()  # Ctrl-C stops the robot
except robomesh.RobomeshError as error:
    sys.exit(f"not done: {error}")
print("home")
