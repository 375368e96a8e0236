"""A site with arms at rest: processor time and wake-ups of each service.

    ./dev run python -m benchmarks rest [--cases unit:1,unit:8,unit:100,rtde:8,hses:8] [--seconds 20] [--json]

The router and each service are separate processes. One more process simulates all controllers; the last
digits of every joint flicker as those of encoders do, by up to 0.001 degrees. A case is a protocol and a
number of arms. Its rows:

    at rest       no client; the flight recorder runs
    page          the same, and Chromium shows the page of one robot
    no recorder   the same as `at rest`, without the flight recorder
    every unit    the same as `at rest`, with `thin_at_rest = false`

Each row gives processor time [% of a core] and wake-ups (voluntary context switches) a second of each
process, and the bytes a second that reach the disk. `mesh` is the messages and bytes a second that a
subscriber to all keys but pictures receives afterwards. Peers, of the case's number of arms at 100 Hz in the
same run: bare Zenoh puts of a joint state's bytes to one subscriber through a router, and MQTT's through
mosquitto, if it is on PATH.

Target, eight arms by the unit protocol, no client: all services together at most 25 % of a core, of
which gateway 10, kinematics 3, recorder 3, renderer 0; the page adds at most 8 %.
"""

import asyncio
import contextlib
import json
import random
import shutil
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import psutil
import zenoh
from typer import Option

from benchmarks.harness.processes import START_S, process, program, until, until_connectable
from benchmarks.harness.sites import running_site
from benchmarks.page.browser import PATIENCE_MS, chromium
from robomesh.contract.endpoints import client_config, router_config
from robomesh.contract.topics import TOPICS
from robots.kinematics.motion import ArmState, Motion
from tests.ports import free_port
from web import build_page

SERVICES = ("gateway", "kinematics", "recorder", "renderer", "watch", "store", "console")
MODELS = {"unit": "pt600", "rtde": "puma560", "hses": "puma560"}
PULSES = [1000.0] * 6
HZ = 100
FLICKER_RAD = np.radians(0.001)
# Of what starts once: shapes, the first pictures, proofs of rest.
SETTLE_S = 15.0
# Name, more of each robot's table, more of the site file.
ROWS = (
    ("at rest", "", ""),
    ("no recorder", "", "[recorder.flight]\nminutes = 0\n"),
    ("every unit", "thin_at_rest = false\n", ""),
)
PICTURES = ("video", "image")
_BYTES = 190


def measure(
    cases: str = "unit:1,unit:8,unit:100,rtde:8,hses:8",
    seconds: float = 20.0,
    page: Annotated[bool, Option(help="also with the page open")] = True,
) -> Iterator[dict[str, Any]]:
    with contextlib.redirect_stdout(sys.stderr):
        build_page.build()
    for case in cases.split(","):
        protocol, _, arms = case.partition(":")
        yield {
            "case": case,
            **of_site(protocol, int(arms), seconds, page=page),
            "zenoh": bare_puts(int(arms), seconds),
            "mqtt": mqtt(int(arms), seconds),
        }


def of_site(protocol: str, arms: int, seconds: float, *, page: bool) -> dict[str, Any]:
    """Measure a site with these arms."""
    found: dict[str, Any] = {}
    ports = [free_port() for _ in range(arms)]
    with process(simulate, protocol, ports) as controllers:
        for name, each, more in ROWS:
            tables = "".join(table(protocol, number, port) + each for number, port in enumerate(ports))
            with running_site(*SERVICES, tables=tables + more) as site:
                pids = {name: each.pid for name, each in site.processes.items()}
                pids["(controllers)"] = controllers.pid or 0
                until_published(site.endpoint, arms)
                time.sleep(SETTLE_S)
                found[name] = during(pids, seconds, site.folder)
                if name != "at rest":
                    continue
                found["mesh"] = on_the_mesh(site.endpoint, seconds / 4)
                if page:
                    with chromium() as browser:
                        shown = browser.new_page()
                        shown.goto(f"http://{site.console}/#/bench/arm0", timeout=PATIENCE_MS)
                        time.sleep(SETTLE_S)
                        found["page"] = during(pids, seconds, site.folder)
    return found


def table(protocol: str, number: int, port: int) -> str:
    """Return the site file's table of an arm, alone in its cell."""
    return (
        f'[[robot]]\nname = "arm{number}"\nmodel = "{MODELS[protocol]}"\nprotocol = "{protocol}"\n'
        f'controller = "{"udp" if protocol == "hses" else "tcp"}://127.0.0.1:{port}"\n'
        + f"yaskawa.pulses_per_degree = {PULSES}\n"
        * (protocol == "hses")
    )


def until_published(endpoint: str, arms: int) -> None:
    """Wait until the kinematics of every arm is on the mesh."""
    with zenoh.open(client_config((endpoint,))) as session:
        until(
            lambda: len(list(session.get("robomesh/bench/*/kinematics"))) >= arms,
            within_s=START_S,
            each_s=1.0,
        )


def during(pids: dict[str, int], seconds: float, folder: Path) -> dict[str, Any]:
    """Return what the processes use within some seconds."""
    before, begun, size = usage(pids), time.monotonic(), size_of(folder)
    time.sleep(seconds)
    after, lasted = usage(pids), time.monotonic() - begun
    rows = {
        name: {
            "% of a core": 100 * (after[name][0] - before[name][0]) / lasted,
            "wake-ups/s": (after[name][1] - before[name][1]) / lasted,
        }
        for name in pids
    }
    ours = [row for name, row in rows.items() if not name.startswith("(")]
    rows["all services"] = {key: sum(row[key] for row in ours) for key in ours[0]}
    return {"processes": rows, "disk kB/s": (size_of(folder) - size) / lasted / 1e3}


def usage(pids: dict[str, int]) -> dict[str, tuple[float, int]]:
    """Return processor time [s] and wake-ups of each process and its children."""
    return {name: of_tree(pid) for name, pid in pids.items()}


def of_tree(pid: int) -> tuple[float, int]:
    cpu, wakes = 0.0, 0
    for each in (parent := psutil.Process(pid), *parent.children(recursive=True)):
        with contextlib.suppress(psutil.NoSuchProcess, FileNotFoundError):
            cpu += sum(each.cpu_times()[:2])
            for status in Path(f"/proc/{each.pid}/task").glob("*/status"):
                (line,) = (row for row in status.read_text().splitlines() if row.startswith("voluntary"))
                wakes += int(line.split()[1])
    return cpu, wakes


def size_of(folder: Path) -> int:
    with contextlib.suppress(FileNotFoundError):
        return sum(each.stat().st_size for each in folder.rglob("*") if each.is_file())
    return size_of(folder)


def on_the_mesh(endpoint: str, seconds: float) -> dict[str, dict[str, float]]:
    """Return messages and bytes a second of each topic."""
    messages, sizes = Counter[str](), Counter[str]()

    def count(sample: zenoh.Sample) -> None:
        topic = "/".join(str(sample.key_expr).split("/")[3:])
        topic = topic.partition("/")[0] if topic.startswith("health") else topic
        messages[topic] += 1
        sizes[topic] += len(sample.payload) + (0 if sample.attachment is None else len(sample.attachment))

    with zenoh.open(client_config((endpoint,))) as session:
        for name in TOPICS:
            if not name.startswith(PICTURES):
                session.declare_subscriber(f"robomesh/bench/*/{name}", count)
        time.sleep(seconds)
    rows = {
        topic: {"messages/s": number / seconds, "kB/s": sizes[topic] / seconds / 1e3}
        for topic, number in messages.most_common()
    }
    return {**rows, "all": {key: sum(row[key] for row in rows.values()) for key in ("messages/s", "kB/s")}}


# ---------------------------------------------------------------------------- controllers


def simulate(protocol: str, ports: list[int]) -> None:
    """Run simulated controllers at rest whose encoders flicker."""
    rest = Motion.state

    def flickering(self: Motion, now_s: float) -> ArmState:
        state = rest(self, now_s)
        noise = np.array([random.uniform(-FLICKER_RAD, FLICKER_RAD) for _ in state.positions])
        return ArmState(state.positions + noise, state.velocities, state.accelerations)

    Motion.state = flickering
    serve = server(protocol)

    async def all_of_them() -> None:
        await asyncio.gather(*(serve(f"127.0.0.1:{port}") for port in ports))

    asyncio.run(all_of_them())


def server(protocol: str) -> Callable[[str], Any]:
    """Return what simulates one controller."""
    model = MODELS[protocol]
    if protocol == "unit":
        from controllers.unit.simulated.service import Settings, serve

        return lambda listen: serve(Settings(robot=model, listen=listen))
    if protocol == "rtde":
        from controllers.universal_robots.simulated.service import UrSettings, serve_rtde

        return lambda listen: serve_rtde(UrSettings(robot=model, listen=listen))
    from controllers.yaskawa.simulated.start import HSES

    return lambda listen: HSES.prepare(
        {"robot": model, "listen": listen}, yaskawa=json.dumps({"pulses_per_degree": PULSES})
    )(lambda line: None)


# ---------------------------------------------------------------------------- peers


def bare_puts(arms: int, seconds: float) -> dict[str, Any]:
    """Measure as many puts of Zenoh with one subscriber, through a router."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with process(route, endpoint) as router:
        until_connectable(endpoint)
        with process(receive, endpoint) as subscriber, process(put, endpoint, arms) as publisher:
            pids = {
                "router": router.pid or 0,
                "publisher": publisher.pid or 0,
                "subscriber": subscriber.pid or 0,
            }
            time.sleep(3.0)
            return during(pids, seconds, Path("/nonexistent"))["processes"]


def route(endpoint: str) -> None:
    with zenoh.open(router_config((endpoint,))):
        time.sleep(3600)


def receive(endpoint: str) -> None:
    with zenoh.open(client_config((endpoint,))) as session:
        subscriber = session.declare_subscriber("arm/*", zenoh.handlers.RingChannel(1024))
        for _ in subscriber:
            pass


def put(endpoint: str, arms: int) -> None:
    with zenoh.open(client_config((endpoint,))) as session:
        publishers = [session.declare_publisher(f"arm/{number}") for number in range(arms)]
        at, payload = time.monotonic(), bytes(_BYTES)
        while True:
            at += 1 / HZ
            time.sleep(max(at - time.monotonic(), 0.0))
            for publisher in publishers:
                publisher.put(payload)


_LINES = f"""
import sys, time
at, lines = time.monotonic(), (b"0" * {_BYTES} + b"\\n") * int(sys.argv[1])
while True:
    at += 1 / {HZ}
    time.sleep(max(at - time.monotonic(), 0.0))
    sys.stdout.buffer.write(lines)
    sys.stdout.flush()
"""


def mqtt(arms: int, seconds: float) -> dict[str, Any] | str:
    """Measure as many publications of MQTT with one subscriber, through mosquitto."""
    if not all(map(shutil.which, ("mosquitto", "mosquitto_pub", "mosquitto_sub"))):
        return "mosquitto is not on PATH"
    port = str(free_port())
    with program("mosquitto", "-p", port) as broker:
        until_connectable(int(port))
        with (
            program("mosquitto_sub", "-p", port, "-t", "arm") as subscriber,
            program("mosquitto_pub", "-p", port, "-t", "arm", "-l", stdin=subprocess.PIPE) as publisher,
            program(sys.executable, "-c", _LINES, str(arms), stdout=publisher.stdin),
        ):
            time.sleep(3.0)
            pids = {"broker": broker.pid, "publisher": publisher.pid, "subscriber": subscriber.pid}
            return during(pids, seconds, Path("/nonexistent"))["processes"]
