"""Check a teach program from the robot's current position.

    ./dev run python examples/check.py examples/square.program [ROBOT] [ROUTER]

Exit status 1 if the check finds a problem. The robot does not move.
"""

import signal
import sys
from pathlib import Path

import robomesh

if len(sys.argv) < 2:
    sys.exit("usage: ./dev run python examples/check.py FILE.program [ROBOT] [ROUTER]")
PROGRAM = Path(sys.argv[1])
ROBOT = sys.argv[2] if len(sys.argv) > 2 else "demo/pt600"
ROUTER = sys.argv[3] if len(sys.argv) > 3 else "tcp/127.0.0.1:7447"

try:
    with robomesh.connect(ROUTER) as mesh:
        result = mesh.robot(ROBOT).check(PROGRAM)
except robomesh.RobomeshError as error:
    sys.exit(f"not done: {error}")
signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # from here on `| head` may end it
for each in result.violations:
    print(f"line {each.line}, {each.time_s:.2f} s: {each.kind}: {each.text}")
print(f"{result.duration_s:.2f} s, {'nothing wrong' if result.ok else 'not as it should be'}")
sys.exit(0 if result.ok else 1)
