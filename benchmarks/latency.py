"""Latency: a controller writes a unit -> a monitor has the decoded joints, and -> a video packet shows it.

One robot at 100 Hz goes through the real gateway and router, each a separate process. In the same seconds a
bare Zenoh put -> subscriber uses the same router. Every clock is this machine's monotonic one, so all
processes must run here.

    ./dev run python benchmarks/latency.py [--seconds 60] [--video] [--json]

The bare message has the size of a joints message. Target: p50 at most 4 times the bare one, nothing lost.
"""

import argparse
import asyncio
import contextlib
import json
import multiprocessing
import os
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import zenoh

from robomesh.contract.endpoints import client_config
from robomesh.publications.subscription import Subscription
from robomesh.wire.session import SessionSettings, open_session
from robots.descriptions.description import load
from robots.kinematics.joints import joints_of

RATE_HZ = 100
# The counter is in the last joint, in steps that the protocol's text carries exactly.
STEP_DEG = 0.01
# The last joint goes back by 50 degrees then: the gateway shows no step that no drive can make.
STEPS = 5_000


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--video", action="store_true", help="also measure to the H.264 packet")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    result = measure(arguments.seconds, video=arguments.video)
    if arguments.json:
        print(json.dumps(result))
        return
    for name, row in result["latency_ms"].items():
        print(f"{name:<28} p50 {row['p50']:8.3f} ms   p99 {row['p99']:8.3f} ms   n {row['n']}")
    print(f"ratio of the medians: {result['ratio_p50']:.2f}; lost {result['lost']} of {result['sent']} units")


def measure(seconds: float, *, video: bool) -> dict[str, Any]:
    """Measure all figures in one run."""
    units = int(seconds * RATE_HZ)
    written = multiprocessing.RawArray("q", units + 1)
    put = multiprocessing.RawArray("q", units + 1)
    router, controller = free_port(), free_port()
    with tempfile.TemporaryDirectory() as folder:
        site = Path(folder) / "site.toml"
        endpoint = f"tcp/127.0.0.1:{router}"
        site.write_text(
            f'site = "bench"\n[router]\nlisten = ["{endpoint}"]\n'
            f'[[robot]]\nname = "arm"\nmodel = "pt600"\ncontroller = "tcp://127.0.0.1:{controller}"\n'
        )
        roles = ["router", "gateway", *(["kinematics", "renderer"] if video else [])]
        with contextlib.ExitStack() as stack:
            for role in roles:
                stack.enter_context(service(role, site, endpoint))
                until_connectable(router)
            go = multiprocessing.Event()
            for target, ports in (
                (controller_process, (controller, written)),
                (bare_process, (endpoint, put)),
            ):
                stack.enter_context(process(target, (*ports, units, go)))
            return asyncio.run(listen(endpoint, go, written, put, units, video=video))


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
            while not joints.keys or (pictures is not None and not pictures.keys):
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
        "unit -> joints decoded": [at - written[k] for k, at in states.items()],
        "bare put -> subscriber": [at - put[k] for k, at in bare],
    }
    if video:
        rows["unit -> H.264 packet"] = [
            at - written[sources[source]] for source, at in shown if source in sources
        ]
    table = {name: summary(values) for name, values in rows.items()}
    return {
        "latency_ms": table,
        "ratio_p50": table["unit -> joints decoded"]["p50"] / table["bare put -> subscriber"]["p50"],
        "sent": units,
        "received": len(states),
        "lost": units - len(states),
        "lost_on_the_mesh": lost,
        "cores": os.cpu_count(),
    }


async def take_joints(joints: Subscription, states: dict[int, int], sources: dict[int, int]) -> None:
    async for sample in joints:
        message = sample.message()
        at = time.monotonic_ns()
        k = round(message.joints[-1].position * 180 / 3.141592653589793 / STEP_DEG)
        if k > 0:
            k += round(message.joints[0].position * 180 / 3.141592653589793) * STEPS
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


def controller_process(port: int, written: Any, units: int, go: Any) -> None:
    """Run a controller of the original kind: positions only, with the counter in the joints."""
    joints = joints_of(load("pt600"))
    with socket.create_server(("127.0.0.1", port)) as server:
        client, _ = server.accept()
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        middle = ["0.00"] * (len(joints) - 2)
        while not go.is_set():
            client.sendall(f"1#ABSOLUTE.DEG*0.00;{';'.join(middle)};0.00@".encode())
            time.sleep(1 / RATE_HZ)
        begun = time.monotonic()
        for k in range(1, units + 1):
            wait(begun + k / RATE_HZ)
            turns, steps = divmod(k, STEPS)
            unit = f"1#ABSOLUTE.DEG*{turns}.00;{';'.join(middle)};{steps * STEP_DEG:.2f}@".encode()
            written[k] = time.monotonic_ns()
            client.sendall(unit)
        time.sleep(3.0)


def bare_process(endpoint: str, put: Any, units: int, go: Any) -> None:
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
            put[k] = time.monotonic_ns()
            publisher.put(k.to_bytes(8, "little") + filling, attachment=bytes(24))
        time.sleep(1.0)


def wait(until: float) -> None:
    while (left := until - time.monotonic()) > 0:
        time.sleep(left)


def summary(values: list[int]) -> dict[str, float]:
    """Return the median, 99th percentile and spread [ms] of durations [ns]."""
    if not values:
        return {"n": 0, "p50": float("nan"), "p99": float("nan"), "min": float("nan"), "max": float("nan")}
    ordered = sorted(value / 1e6 for value in values)
    return {
        "n": len(ordered),
        "p50": statistics.median(ordered),
        "p99": ordered[min(int(len(ordered) * 0.99), len(ordered) - 1)],
        "min": ordered[0],
        "max": ordered[-1],
    }


@contextlib.contextmanager
def service(role: str, site: Path, endpoint: str) -> Iterator[subprocess.Popen[bytes]]:
    attach = [] if role == "router" else ["--connect", endpoint]
    running = subprocess.Popen(
        [sys.executable, "-m", "services.command_line.main", role, "--site", str(site), *attach],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        yield running
    finally:
        running.terminate()
        try:
            running.wait(10)
        except subprocess.TimeoutExpired:  # a backlog, which the figures show
            running.kill()
            running.wait()


@contextlib.contextmanager
def process(target: Any, arguments: tuple[Any, ...]) -> Iterator[None]:
    running = multiprocessing.Process(target=target, args=arguments, daemon=True)
    running.start()
    try:
        yield
    finally:
        running.terminate()
        running.join(10)


def until_connectable(port: int) -> None:
    """Wait for the router."""
    while True:
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port)):
            return
        time.sleep(0.05)


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


if __name__ == "__main__":
    multiprocessing.set_start_method("spawn")
    main()
