"""Print a robot's joints: the smallest monitor. Any Zenoh client in any language does the same.

./dev run python examples/joints.py
"""

import os
import sys
from contextlib import suppress

import zenoh
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates

ROUTER = sys.argv[1] if len(sys.argv) > 1 else "tcp/127.0.0.1:7447"

config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", f'["{ROUTER}"]')

try:
    session = zenoh.open(config)
except zenoh.ZError:
    sys.exit(f"not done: no router at {ROUTER}")
with (
    suppress(BrokenPipeError, KeyboardInterrupt),  # `| head`, Ctrl-C
    session,
    session.declare_subscriber("robomesh/*/*/joints/slow") as states,
):
    for sample in states:
        joints = JointStates.FromString(sample.payload.to_bytes()).joints
        words = " ".join(f"{joint.name} {joint.position:+.3f}" for joint in joints)
        os.write(1, f"{sample.key_expr} {words}\n".encode())
