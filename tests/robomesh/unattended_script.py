"""A script that starts a slow motion without waiting for it, and then does what its arguments say.

python -m tests.robomesh.unattended_script hung|waiting|forgetful ROUTER
"""

import sys
import time

import robomesh

what, router = sys.argv[1:]
mesh = robomesh.connect(router, timeout_s=20.0)
with mesh.robot("arm").control("script") as arm:
    arm.speed(2)
    arm.move_joints_deg([-100, 20, 30, 0, 0], wait=False)
    print("moving", flush=True)
    if what == "hung":
        time.sleep(600)
    if what == "forgetful":
        arm.stop("done")
