"""Latency: a controller writes a unit -> a monitor has the decoded joints, and -> a video packet shows it.

One robot at 100 Hz goes through the real gateway and router, each a separate process. In the same seconds a
bare Zenoh put -> subscriber uses the same router. Every clock is this machine's monotonic one, so all
processes must run here.

    ./dev run python -m benchmarks latency [--seconds 60] [--video] [--json]

The bare message has the size of a joints message. Target: p50 at most 4 times the bare one, nothing lost.
"""

import asyncio
import multiprocessing
import time
from typing import Annotated, Any

import zenoh
from typer import Option

from benchmarks.harness.processes import process
from benchmarks.harness.sites import robot, running_site
from benchmarks.harness.turns import summary
from benchmarks.harness.unit_controllers import RATE_HZ, number_in, running_controllers, wait
from robomesh.contract.endpoints import client_config
from robomesh.publications.subscription import Subscription
from robomesh.wire.session import SessionSettings, open_session


def measure(
    seconds: float = 60.0,
    video: Annotated[bool, Option("--video", help="also measure to the H.264 packet")] = False,
) -> dict[str, Any]:
    """Measure all figures in one run."""
    units = int(seconds * RATE_HZ)
    written, put = (multiprocessing.RawArray("q", units) for _ in range(2))
    go = multiprocessing.Event()
    services = ("gateway", "kinematics", "renderer") if video else ("gateway",)
    with (
        running_controllers(1, written, units, go) as (port,),
        running_site(*services, tables=robot("arm", port)) as site,
        process(put_bare, site.endpoint, put, units, go),
    ):
        return asyncio.run(listen(site.endpoint, go, written, put, units, video=video))


async def listen(
    endpoint: str, go: Any, written: Any, put: Any, units: int, *, video: bool
) -> dict[str, Any]:
    """Receive joints, bare messages and video packets, each with its arrival time."""
    async with open_session(SessionSettings(connect=(endpoint,), wait_s=20.0)) as session:
        joints = session.subscribe("robomesh/bench/arm/joints", newest=10_000, history=False)
        bare: list[tuple[int, int]] = []
        subscriber = session.zenoh_session.declare_subscriber("bare", zenoh.handlers.RingChannel(10_000))
        pictures = None
        if video:
            pictures = session.subscribe("robomesh/bench/arm/video/free", newest=1000, history=False)
            await asyncio.sleep(4.0)  # shaders, meshes
        # On a busy machine the services need longer than that.
        async with asyncio.timeout(60.0):
            while not joints.received or (pictures is not None and not pictures.received):
                await asyncio.sleep(0.1)
        await asyncio.sleep(1.0)
        taking = [asyncio.create_task(asyncio.to_thread(take_bare, subscriber, bare, units))]
        states: dict[int, int] = {}
        sources: dict[int, int] = {}
        lost_before = joints.lost("robomesh/bench/arm/joints")
        taking.append(asyncio.create_task(take_joints(joints, states, sources)))
        shown: list[tuple[int, int]] = []
        if pictures is not None:
            taking.append(asyncio.create_task(take_video(pictures, shown)))
        go.set()
        await asyncio.sleep(units / RATE_HZ + 2.0)
        for task in taking:
            task.cancel()
        subscriber.undeclare()
        lost = joints.lost("robomesh/bench/arm/joints") - lost_before
    rows = {
        "unit -> joints decoded": [at - written[k - 1] for k, at in states.items()],
        "bare put -> subscriber": [at - put[k - 1] for k, at in bare],
    }
    if video:
        rows["unit -> H.264 packet"] = [
            at - written[sources[source] - 1] for source, at in shown if source in sources
        ]
    table = {name: summary(values) for name, values in rows.items()}
    return {
        "latency_ms": table,
        "ratio_p50": table["unit -> joints decoded"]["p50"] / table["bare put -> subscriber"]["p50"],
        "sent": units,
        "received": len(states),
        "lost": units - len(states),
        "lost_on_the_mesh": lost,
    }


async def take_joints(joints: Subscription, states: dict[int, int], sources: dict[int, int]) -> None:
    async for sample in joints:
        message: Any = sample.message()
        at = time.monotonic_ns()
        if k := number_in(message.joints):
            states[k] = at
            sources[sample.header.source_time_ns] = k


async def take_video(pictures: Subscription, shown: list[tuple[int, int]]) -> None:
    seen = set()
    async for sample in pictures:
        if sample.live and sample.header.source_time_ns not in seen:
            seen.add(sample.header.source_time_ns)
            shown.append((sample.header.source_time_ns, time.monotonic_ns()))


def take_bare(subscriber: Any, bare: list[tuple[int, int]], units: int) -> None:
    for sample in subscriber:
        bare.append((int.from_bytes(sample.payload.to_bytes()[:8], "little"), time.monotonic_ns()))
        if len(bare) == units:
            return


def put_bare(endpoint: str, put: Any, units: int, go: Any) -> None:
    """Measure plain Zenoh: the same size, rate, priority and router, offset by half a period."""
    with zenoh.open(client_config((endpoint,))) as session:
        publisher = session.declare_publisher(
            "bare", priority=zenoh.Priority.REAL_TIME, congestion_control=zenoh.CongestionControl.DROP
        )
        filling = bytes(160)
        go.wait()
        begun = time.monotonic() + 0.5 / RATE_HZ
        for k in range(1, units + 1):
            wait(begun + k / RATE_HZ)
            put[k - 1] = time.monotonic_ns()
            publisher.put(k.to_bytes(8, "little") + filling, attachment=bytes(24))
        time.sleep(1.0)
