"""Live kinematics: delay and cost of the poses and clearances that one process publishes for ten arms.

    ./dev run python -m benchmarks live_kinematics [--robots 10] [--seconds 20] [--checks] [--json]

Each cell has two arms, a table, a post and a fence. One of them is within the warning distance, so that all
parts are measured. Router, gateway, kinematics and controllers are separate processes; joints arrive at
100 Hz and differ each time. A latency is from when the gateway had the unit (`kinematics` carries this as its
source time) until a monitor's subscriber has the message; CPU is user and system time of all the service's
threads. With --checks a client also asks for one program check after another, which worker processes do.

Target, for 10 robots: p99 under 20 ms, at most half a core.
"""

import asyncio
import contextlib
import multiprocessing
import time
from typing import Annotated, Any

from typer import Option

from benchmarks.harness.processes import cpu_s, rss_mib, until
from benchmarks.harness.sites import robot, running_site
from benchmarks.harness.turns import summary
from benchmarks.harness.unit_controllers import RATE_HZ, running_controllers
from robomesh.errors import RobomeshError
from robomesh.publications.subscription import Sample, Subscription
from robomesh.schemas.robomesh_pb2 import CheckRequest, KinematicState
from robomesh.wire.session import Session, SessionSettings, open_session

WARM_UP_S = 3.0
PROGRAM = "repeat 3\n  move_joints 30 60 -60 20 0\n  move_joints -30 80 -40 -20 0\nend\n"


def measure(
    robots: int = 10,
    seconds: float = 20.0,
    checks: Annotated[bool, Option("--checks", help="check programs during the measurement")] = False,
) -> dict[str, Any]:
    """Measure one run."""
    units = int((seconds + WARM_UP_S + 2.0) * RATE_HZ)
    written, go = multiprocessing.RawArray("q", robots * units), multiprocessing.Event()
    with (
        running_controllers(robots, written, units, go) as ports,
        running_site("gateway", "kinematics", tables=cells(ports)) as site,
    ):
        pid = site.processes["kinematics"].pid
        return asyncio.run(listen(site.endpoint, go, pid, robots, seconds, checks=checks))


def cells(ports: list[int]) -> str:
    """Return a cell for each two robots, a few metres apart."""
    text = ""
    for number, port in enumerate(ports):
        cell, y = number // 2, 0.45 if number % 2 else -0.45
        pose = f"pose = {{ xyz = [{cell * 3000}.0, {y * 1000}, 0.0] }}\n"
        text += robot(f"arm-{number}", port, f'cell = "{cell}"\ncheck = "off"\n{pose}')
    for cell in range((len(ports) + 1) // 2):
        for name, shape, (x, y, z) in (
            ("table", "box = [400.0, 1800.0, 300.0]", (600, 0, 150)),
            ("post", "cylinder = [40.0, 1000.0]", (-500, 0, 500)),
            ("fence", "box = [20.0, 1800.0, 1000.0]", (-700, 0, 500)),
        ):
            text += (
                f'[[fixture]]\ncell = "{cell}"\nname = "{name}-{cell}"\n{shape}\n'
                f"pose = {{ xyz = [{cell * 3000 + x}.0, {y}.0, {z}.0] }}\n"
            )
    return text


async def listen(
    endpoint: str, go: Any, process: int, robots: int, seconds: float, *, checks: bool
) -> dict[str, Any]:
    """Receive each robot's kinematics with the arrival time."""
    came: list[tuple[Sample, int]] = []
    checked: list[float] = []
    async with open_session(SessionSettings(connect=(endpoint,), wait_s=20.0)) as session:
        states = session.subscribe("robomesh/bench/*/kinematics", newest=10_000, history=False)
        taking = [asyncio.create_task(take(states, came))]
        await asyncio.to_thread(until, lambda: len(states.ages_s()) == robots)
        if checks:
            taking.append(asyncio.create_task(ask_checks(session, checked)))
        go.set()
        await asyncio.sleep(WARM_UP_S)
        came.clear()
        checked.clear()
        lost_before = states.total_lost
        begun, cpu_before = time.monotonic(), cpu_s(process)
        await asyncio.sleep(seconds)
        took_s, cpu = time.monotonic() - begun, cpu_s(process) - cpu_before
        kept, memory = [*came], rss_mib(process)
        lost = states.total_lost - lost_before
        for task in taking:
            task.cancel()
        await asyncio.wait(taking)
    messages = [KinematicState.FromString(sample.payload) for sample, _ in kept]
    return {
        "robots": robots,
        "latency_ms": summary([at - sample.header.source_time_ns for sample, at in kept]),
        "rate_hz": len(kept) / took_s / robots,
        "with_clearance": sum(message.HasField("clearance") for message in messages) / len(messages),
        "near": sum(message.clearance.distance < 0.05 for message in messages) / len(messages),
        "lost": lost,
        "cpu_share": cpu / took_s,
        "rss_mib": memory,
        "checks": len(checked) if checks else None,
    }


async def take(states: Subscription, came: list[tuple[Sample, int]]) -> None:
    async for sample in states:
        if sample.live:
            # The gateway's clock is this machine's.
            came.append((sample, time.time_ns() - int((time.monotonic() - sample.received) * 1e9)))


async def ask_checks(session: Session, checked: list[float]) -> None:
    while True:
        with contextlib.suppress(RobomeshError):
            await session.ask(
                f"robomesh/bench/arm-0/kinematics/check/{session.own_name}",
                CheckRequest(program=PROGRAM),
                timeout_s=60.0,
            )
            checked.append(time.monotonic())
