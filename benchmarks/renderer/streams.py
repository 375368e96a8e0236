"""The renderer's streams: the delay of the first picture, the picture rate, and the cost of each watcher.

    ./dev run python -m benchmarks streams [--size 1280x720] [--seconds 8] [--views 1,2,4] [--device N]
        [--json]

The program starts a site: router, a robot that moves at 100 Hz, kinematics, and the renderer in a separate
process, whose CPU is measured. This process watches the streams. More than four views are requested ones,
around the robot, with at most 10 pictures a second.
"""

import asyncio
import math
import os
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import zenoh
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from typer import Option

from benchmarks.harness.processes import cpu_s, process
from renderer import service
from robomesh.contract.endpoints import router_config
from robomesh.contract.quotas import DEFAULT_QUOTAS
from robomesh.schemas.robomesh_pb2 import View, ViewAnswer, ViewRequest
from robomesh.wire.session import Session, SessionSettings, open_session
from services import kinematics
from tests.cells import single_arm
from tests.ports import free_port

JOINTS = ("waist", "shoulder", "elbow", "wrist", "roll")
VIEWS = ("front", "top", "left", "free")
ARM = "robomesh/hall/arm"
# Requested views in full size have the capacity of an eighth of these, or of three eighths at 10 a second,
# which is the least that counts: 96, if no other view was asked for.
_MANY, _MOST_HZ, _MOST_ASKED = 256, 10.0, 32
_FIRST_WITHIN_S = 30.0


def measure(
    size: str = "1280x720",
    seconds: Annotated[float, Option(help="of each step")] = 8.0,
    views: Annotated[str, Option(help="numbers of views, each with one watcher")] = "1,2,4",
    device: Annotated[int | None, Option(help="number of the EGL device")] = None,
) -> dict[str, Any]:
    width, height = (int(part) for part in size.split("x"))
    steps = [(int(count), 1) for count in views.split(",")] + [(1, 2), (1, 4)]
    with tempfile.TemporaryDirectory() as folder:
        endpoint = f"tcp/127.0.0.1:{free_port()}"
        settings = SessionSettings(connect=(endpoint,), wait_s=10.0)
        wanted = service.Settings(
            site="hall",
            size=(width, height),
            folder=Path(folder),
            device=device,
            most_views=_MANY,
            quotas=replace(DEFAULT_QUOTAS, views=_MANY),
        )
        with zenoh.open(router_config((endpoint,))), process(render, settings, wanted) as renderer:
            return {**asyncio.run(watch(settings, renderer.pid, seconds, steps)), "size": size}


def render(settings: SessionSettings, wanted: service.Settings) -> None:
    async def serve() -> None:
        async with open_session(settings) as session:
            await service.serve(session, wanted)

    asyncio.run(serve())


async def watch(
    settings: SessionSettings, renderer: int | None, seconds: float, steps: list[tuple[int, int]]
) -> dict[str, Any]:
    async with open_session(settings) as robot, open_session(settings) as monitor:
        arm = single_arm(simulated=True)
        tasks = [
            asyncio.create_task(kinematics.serve(robot, kinematics.Settings(site="hall", robots=(arm,)))),
            asyncio.create_task(move(robot)),
        ]
        try:
            while await monitor.last(f"{ARM}/image/front", timeout_s=5.0) is None:
                pass
            result: dict[str, Any] = {"first_ms": {}, "rates": []}
            result["first_ms"]["own view"] = [
                await first_ms(monitor, f"{ARM}/video/{view}") for _ in range(5) for view in VIEWS
            ]
            if max(views for views, _ in steps) < _MOST_ASKED:
                result["first_ms"]["a view that was asked for"] = [
                    await asked_ms(monitor, number) for number in range(8)
                ]
            for views, watchers in steps:
                result["rates"].append(await rates(monitor, renderer, views, watchers, seconds))
            return result
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)


async def move(robot: Session) -> None:
    publisher = robot.declare_publisher("hall", "arm", "joints")
    for tick in range(10_000_000):
        message = JointStates()
        message.timestamp.GetCurrentTime()
        for number, name in enumerate(JOINTS):
            message.joints.add(name=name, position=(1.4 if number == 1 else 0.0) + 0.5 * math.sin(tick / 60))
        publisher.put(message)
        await asyncio.sleep(0.01)


async def first_ms(monitor: Session, key: str) -> float:
    """Return the time from subscribing to the first live packet."""
    await asyncio.sleep(0.3)  # until the previous watcher has left
    began = time.monotonic()
    video = monitor.subscribe(key, history=False)
    async with asyncio.timeout(10):
        sample = await anext(video)
    video.close()
    return (sample.received - began) * 1e3


async def asked_ms(monitor: Session, number: int) -> float:
    """Return the time from a request for a private view, of an unused size, to its first packet."""
    began = time.monotonic()
    request = ViewRequest(of="free", width=480 + 16 * number, height=320)
    answer = await monitor.ask(f"{ARM}/views/{monitor.own_name}", request, timeout_s=5.0)
    assert isinstance(answer, ViewAnswer)
    video = monitor.subscribe(f"{ARM}/{answer.topic}", history=False)
    async with asyncio.timeout(10):
        sample = await anext(video)
    video.close()
    return (sample.received - began) * 1e3


async def rates(
    monitor: Session, renderer: int | None, views: int, watchers: int, seconds: float
) -> dict[str, Any]:
    """Return pictures a second of each view, and the renderer's CPU as a share of a core."""
    topics = [f"video/{view}" for view in VIEWS[:views]]
    topics += [await requested(monitor, number) for number in range(views - len(topics))]
    watched = [
        monitor.subscribe(f"{ARM}/{topic}", newest=4, history=False)
        for topic in topics
        for _ in range(watchers)
    ]
    counts = [0] * len(watched)

    async def count(number: int) -> None:
        async for _ in watched[number]:
            counts[number] += 1

    tasks = [asyncio.create_task(count(number)) for number in range(len(watched))]
    # A view's first picture opens its encoder, the second draws the backdrop that is kept.
    until = time.monotonic() + _FIRST_WITHIN_S
    while min(counts) < 2 and time.monotonic() < until:
        await asyncio.sleep(0.1)
    await asyncio.sleep(1.0)
    counts[:] = [0] * len(watched)
    began, cpu = time.monotonic(), cpu_s(renderer)
    await asyncio.sleep(seconds)
    took, used = time.monotonic() - began, cpu_s(renderer) - cpu
    for task in tasks:
        task.cancel()
    for video in watched:
        video.close()
    await asyncio.sleep(0.5)
    return {
        "views": views,
        "watchers": watchers,
        "rates": [count / took for count in counts],
        "cores": used / took,
        "load": os.getloadavg()[0],
    }


async def requested(monitor: Session, number: int) -> str:
    """Return the topic of a view that was requested in the size and rate of the renderer's own."""
    angle = number / 3.0
    view = View(projection=View.PERSPECTIVE)
    view.eye.x, view.eye.y, view.eye.z = 2.4 * math.cos(angle), 2.4 * math.sin(angle), 1.2
    view.target.z = 0.45
    request = ViewRequest(view=view, fps=_MOST_HZ)
    answer = await monitor.ask(f"{ARM}/views/{monitor.own_name}", request, timeout_s=5.0)
    assert isinstance(answer, ViewAnswer)
    return answer.topic
