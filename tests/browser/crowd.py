"""Many robots on the mesh, published by one process: the load for a page of two hundred robots.

`crowd` runs this file in a separate process, so that it takes no time from the test or the measurement.
"""

import asyncio
import contextlib
import json
import math
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path

if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).parents[2])

import numpy as np
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates

from robomesh.requests.server import Request
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import Session, SessionSettings, open_session
from robots.descriptions.description import load
from robots.descriptions.glb import link_glbs
from robots.descriptions.urdf.write import to_urdf
from robots.kinematics.joints import Joints
from robots.kinematics.model import build_model
from services.kinematics.descriptions import describe

State = schema.ControllerState
BEAT_S = 0.2
STATE_BEATS = 5  # a state and a lease a second
STARTED_S = 60.0


class Crowd:
    """Robots `r000`, `r001`, ... of another process, which all move.

    Attributes:
        watched: `site/robot` of the robots with a subscriber of their slow joint states.
    """

    def __init__(self, process: "subprocess.Popen[str]") -> None:
        self._process = process
        self.watched: set[str] = set()
        self._started = threading.Event()
        self._listening = threading.Thread(target=self._listen, name="crowd")
        self._listening.start()

    def _listen(self) -> None:
        assert self._process.stdout
        for line in self._process.stdout:
            self.watched = set(json.loads(line))
            self._started.set()

    def wait_started(self) -> None:
        assert self._started.wait(STARTED_S), "the crowd did not start: its traceback is above"

    def mark(self, state: str, names: Sequence[str]) -> None:
        """Mark robots as `faulty` or `silent`; all others of the crowd are not."""
        assert self._process.stdin
        print(json.dumps([state, list(names)]), file=self._process.stdin, flush=True)

    def end(self) -> None:
        assert self._process.stdin
        self._process.stdin.close()
        try:
            self._process.wait(20)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._listening.join(20)
        if self._process.stdout:
            self._process.stdout.close()


@contextlib.contextmanager
def crowd(endpoint: str, sites: Sequence[str], count: int) -> Iterator[Crowd]:
    """Yield a crowd on the mesh of that router."""
    command = [sys.executable, __file__, endpoint, str(count), *sites]
    held = Crowd(subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True))
    try:
        held.wait_started()
        yield held
    finally:
        held.end()


async def publish(session: Session, names: Sequence[str], states: dict[str, set[str]]) -> None:
    """Publish the robots' states; print the robots with a subscriber of slow joint states at each change.

    Args:
        states: The robots in each state that `Crowd.mark` gave them.
    """
    description = load("pt600")
    model = build_model(description)
    shapes = link_glbs(description)
    about = describe(
        description,
        urdf=to_urdf(description),
        shapes=shapes,
        base_to_site=np.eye(4),
        cell="a",
        simulated=True,
    )

    async def mesh(request: Request) -> bytes:
        return shapes[request.chunk]

    publishers = {}
    for name in names:
        site, robot = name.split("/")
        for service in ("gateway", "kinematics"):
            session.declare_presence(site, robot, service)
        session.answer(site, robot, "mesh/*", mesh)
        topics = ("description", "controller", "lease", "joints/slow")
        publishers[name] = {topic: session.declare_publisher(site, robot, topic) for topic in topics}
        publishers[name]["description"].put(about)
        await asyncio.sleep(0)
    loop = asyncio.get_running_loop()
    began, health_key = loop.time(), 0
    watched = None
    while True:
        before, watched = watched, {name for name in names if publishers[name]["joints/slow"].watched}
        if watched != before:
            print(json.dumps(sorted(watched)), flush=True)
        for i, name in enumerate(names):
            if name in states["silent"]:
                continue
            if (health_key + i) % STATE_BEATS == 0:
                state = _state(i, faulty=name in states["faulty"])
                publishers[name]["controller"].put(state)
                publishers[name]["lease"].put(_lease(i))
            if name in watched:
                publishers[name]["joints/slow"].put(_joints(model.joints, loop.time() - began + i))
        health_key += 1
        await asyncio.sleep(BEAT_S)


def _lease(i: int) -> schema.Lease:
    lease = schema.Lease(holder="" if i % 7 else "li")
    lease.since.GetCurrentTime()
    return lease


def _state(i: int, *, faulty: bool) -> State:
    state = State(
        link=State.UP,
        mode=State.REMOTE,
        activity=State.FAULT if faulty else State.MOVING if i % 3 else State.IDLE,
        fault="axis 2: following error" if faulty else "",
        homed=State.YES,
        last_unit_age_s=0.01,
    )
    state.timestamp.GetCurrentTime()
    return state


def _joints(joints: Joints, seconds: float) -> JointStates:
    message = JointStates()
    message.timestamp.GetCurrentTime()
    limits = zip(joints.names, joints.lower, joints.upper, strict=True)
    for i, (name, lower, upper) in enumerate(limits):
        at = (lower + upper) / 2 + (upper - lower) / 5 * math.sin(0.7 * seconds + i)
        message.joints.add(name=name, position=at)
    return message


async def main(endpoint: str, count: str, *sites: str) -> None:
    """Publish until stdin ends."""
    names = [f"{sites[i % len(sites)]}/r{i:03d}" for i in range(int(count))]
    states: dict[str, set[str]] = {"faulty": set(), "silent": set()}
    async with open_session(SessionSettings(connect=(endpoint,), wait_s=20.0)) as session:
        publishing = asyncio.create_task(publish(session, names, states))
        publishing.add_done_callback(lambda task: task.cancelled() or task.result())
        while not publishing.done() and (line := await asyncio.to_thread(sys.stdin.readline)):
            state, chosen = json.loads(line)
            states[state] = set(chosen)
        publishing.cancel()
        await asyncio.gather(publishing, return_exceptions=True)


if __name__ == "__main__":
    asyncio.run(main(*sys.argv[1:]))
