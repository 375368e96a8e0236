"""A program that controls an arm, starts another process in one of several ways, and then moves the arm.

python -m tests.robomesh.forking_script WAY ROUTER

Its children print their process ids, and live for two minutes.
"""

import multiprocessing
import os
import shlex
import subprocess
import sys
import time

import robomesh

_LIVES_S = 120
_SHELL = ["sh", "-c", f"echo child $$; exec sleep {_LIVES_S}"]


def live():
    print("child", os.getpid(), flush=True)
    time.sleep(_LIVES_S)


def fork():
    if not os.fork():
        live()
        os._exit(0)


def daemon():
    """Fork twice, as a program does that becomes a daemon."""
    if not os.fork():
        os.setsid()
        fork()
        os._exit(0)
    os.wait()


def start(method):
    multiprocessing.get_context(method).Process(target=live).start()


def use():
    """Let a child try what it inherited, and leave the block by an exit."""
    child = os.fork()
    if not child:
        for call in (arm.stop, arm.home, mesh.robots, states.__next__):
            try:
                call()
            except robomesh.SessionError as error:
                print(call.__name__, "->", type(error).__name__, flush=True)
        states.close()
        sys.exit(7)
    print("exit status", os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)


WAYS = {
    "none": lambda: None,
    "fork": fork,
    "daemon": daemon,
    "multiprocessing fork": lambda: start("fork"),
    "multiprocessing forkserver": lambda: start("forkserver"),
    "multiprocessing spawn": lambda: start("spawn"),
    "subprocess": lambda: subprocess.Popen(_SHELL),
    "subprocess, open files": lambda: subprocess.Popen(_SHELL, close_fds=False),
    "subprocess, preexec": lambda: subprocess.Popen(_SHELL, preexec_fn=os.setsid),
    "system": lambda: os.system(f"{shlex.join(_SHELL)} &"),
    "use": use,
}

if __name__ == "__main__":
    way, router = sys.argv[1:]
    mesh = robomesh.connect(router, timeout_s=20.0)
    robot = mesh.robot("arm")
    states = robot.topic("lease")
    with robot.control("script") as arm:
        arm.home()
        WAYS[way]()
        if way != "use":
            arm.speed(2)
        arm.move_joints([1.5, 0, 0, 0, 0])
        print("arrived", flush=True)
    mesh.close()
