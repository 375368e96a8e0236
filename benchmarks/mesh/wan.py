"""Sites over a wide area: emulated links (`tests/wan/link.py`) between network namespaces, real services.

A plant (controller, gateway, router), a hub (router), a control room (a monitor of the hub's router). The far
link is the one between plant and hub. All clocks are this machine's. Needs root, or another user that may
make network namespaces and TUN devices.

    ./dev run python -m benchmarks wan [--only delay,narrow,cut,kills,failover,frozen,bytes,border] [--json]

delay      80 ms round trip, with and without 1 % of the packets lost each way: delay of the joints in the
           room; delay from a request for a stop to the controller's socket, over both links (as for
           stops), and over one (as for other requests)
narrow     100, 20 and 2 Mbit/s, 40 ms each way, while publications like 8 Mbit/s of video use the link: delay
           and share of the joints, and share of the video; then 2 Mbit/s with a router that knows the rate
           (`line_mbit`), and meshes of 3 MB fetched over it, with and without that video; then a view of
           a moving arm, drawn by the plant's own renderer
cut        the link cut for 5 and 60 s: the delay until the room shows it, the delay until all is live again,
           and whether the count of lost messages is correct
kills      the plant's router killed with -9, 20 times: how soon the room has live joints and the last state
failover   a monitor with two routers, of which the connected one is killed: how long no message arrives
frozen     the plant's router frozen (SIGSTOP): the delay until the room notices, and until all is live again
bytes      bytes of a robot on the link, a topic at a time, also by TLS, and bytes of an idle mesh
border     all of a robot's topics and its far view watched from the hub, by TLS: bytes that cross the link,
           and the share that a slow border lets through

On a machine with other users, `chrt -r 5 python -m benchmarks wan` measures the line without their load.
"""

import contextlib
import os
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

from typer import Option

from benchmarks.harness.program import chosen
from benchmarks.harness.turns import percentile
from benchmarks.mesh.wan_bytes import bytes_per_topic, over_border
from tests.wan.network import Link, Network, missing
from tests.wan.sites import ARM, PORT, Probe, Site

PARTS = ("delay", "narrow", "cut", "kills", "failover", "frozen", "bytes", "border")
ROBOT = "robomesh/plant/arm"
JOINTS = f"{ROBOT}/joints"
CONTROLLER = f"{ROBOT}/controller"
EVENTS = f"{ROBOT}/events"
VIDEO = f"{ROBOT}/video/free"
ONE_WAY_MS = 40.0
# About as much as a few views of 1280 x 720; and the queue of a line's own router, 0.26 s at 2 Mbit/s.
VIDEO_MBIT = 8.0
QUEUE_BYTES = 64_000
NARROW_MBIT = 2
MESH = f"{ROBOT}/mesh/base"
SHAPE_BYTES = 3_000_000
START_S = 120.0


@dataclass
class Stage:
    """The running processes and links."""

    network: Network
    plant: Site
    hub: Site
    far: Link
    near: Link
    beside: Probe
    room: Probe
    stops: list[float] = field(default_factory=list)

    @property
    def at_hub(self) -> str:
        """Return the hub's router as the room reaches it."""
        return f"tcp/{self.near.far}:{PORT}"


@contextlib.contextmanager
def stage(*, told_mbit: float | None = None, moving: bool = False, **link: Any) -> Iterator[Stage]:
    """Start all processes, and wait until joints are live in the room.

    Args:
        moving: The arm swings without a command.
        told_mbit: The rate of its line that the plant's router knows [Mbit/s]; None: no rate.
    """
    with tempfile.TemporaryDirectory() as folder, Network() as network:
        hosts = {name: network.host(name) for name in ("plant", "hub", "room")}
        far = network.link(hosts["plant"], hosts["hub"])
        near = network.link(hosts["room"], hosts["hub"])
        hub = Site(hosts["hub"], "hub", Path(folder))
        hub.start("router")
        plant = Site(hosts["plant"], "plant", Path(folder), links=(f"tcp/{far.far}:{PORT}",), more=ARM)
        plant.router = "" if told_mbit is None else f"line_mbit = {told_mbit}"
        beside = plant.with_arm(moving=moving)
        room = Probe(hosts["room"], f"tcp/{near.far}:{PORT}")
        made = Stage(network, plant, hub, far, near, beside, room)
        read = threading.Thread(target=note_stops, args=(made,), daemon=True)
        read.start()
        for topic in (JOINTS, CONTROLLER, EVENTS):
            room.do("watch", topic)
        room.until(JOINTS, stale=False, within_s=60.0)
        far.change(**link)
        yield made
    read.join(5.0)


def note_stops(made: Stage) -> None:
    """Record when each stop was on the controller's socket."""
    output = made.plant.processes["controller"].stdout
    assert output is not None
    with contextlib.suppress(ValueError):  # closed
        for line in output:
            made.stops.append(float(line))


def quantiles(values: list[float]) -> dict[str, float]:
    """Return quantiles of durations [s], in ms."""
    if not values:
        return {"n": 0}
    names = {"p50": 50, "p90": 90, "p99": 99, "max": 100}
    return {"n": len(values)} | {name: round(1e3 * percentile(values, p), 2) for name, p in names.items()}


def joints_for(made: Stage, seconds: float, topic: str = JOINTS) -> list[tuple[float, float]]:
    """Return (arrival, delay after its source's time) [s] of each sample received."""
    made.room.do("samples", topic)
    time.sleep(seconds)
    return [(at, lag) for at, lag, live, *_ in made.room.do("samples", topic) if live]


# -------------------------------------------------------------------------- delay


def delay(seconds: float, stops: int) -> dict[str, Any]:
    """Measure 80 ms of round trip, with and without losses."""
    rows: dict[str, Any] = {}
    for loss in (0.0, 0.01):
        with stage(delay_ms=ONE_WAY_MS, loss=loss) as made:
            time.sleep(2.0)
            lags = [lag for _, lag in joints_for(made, seconds)]
            row = {"joints_ms": quantiles(lags), "joints_lost": made.room.do("state", JOINTS, JOINTS)["lost"]}
            for name, order in (
                ("stop_ms", ("ask", f"{ROBOT}/stop", {"by": "zhao"}, 5.0)),
                ("stop_over_one_link_ms", ("stop_over_one_link", f"{ROBOT}/stop")),
            ):
                row[name] = stops_asked(made, stops, order)
            rows[f"loss {loss:.0%}"] = row
    return rows


def stops_asked(made: Stage, number: int, order: tuple[Any, ...]) -> dict[str, Any]:
    """Measure from the request for a stop to its unit on the controller's socket."""
    took = []
    for _ in range(number):
        before = len(made.stops)
        began = made.room.do(*order)["began"]
        deadline = time.monotonic() + 5.0
        while len(made.stops) == before and time.monotonic() < deadline:
            time.sleep(0.002)
        if len(made.stops) > before:
            took.append(made.stops[before] - began)
        time.sleep(0.15)  # stops closer than 0.1 s share a unit
    return {"asked": number, **quantiles(took)}


# ------------------------------------------------------------------------- narrow


def narrow(seconds: float, meshes: int) -> dict[str, Any]:
    """Measure joints while video uses a narrow link, and meshes over it."""
    rows: dict[str, Any] = {}
    with stage(delay_ms=ONE_WAY_MS) as made:
        pour_video(made)
        for mbit in (100, 20, NARROW_MBIT):
            rows[f"{mbit} Mbit/s"] = beside_video(made, mbit, seconds)
    for video in (True, False):
        with stage(told_mbit=NARROW_MBIT, delay_ms=ONE_WAY_MS) as made:
            if video:
                pour_video(made)
                rows[f"{NARROW_MBIT} Mbit/s, told"] = beside_video(made, NARROW_MBIT, seconds)
            made.far.change(rate_bps=NARROW_MBIT * 1e6, queue_bytes=QUEUE_BYTES)
            rows["meshes beside video" if video else "meshes alone"] = fetch_shapes(made, meshes)
    with stage(told_mbit=NARROW_MBIT, moving=True, delay_ms=ONE_WAY_MS) as made:
        view = drawn_view(made)
        for mbit in (100, NARROW_MBIT):
            rows[f"{mbit} Mbit/s, told, a view of 1280 x 720"] = beside_video(made, mbit, seconds, view)
    return rows


def drawn_view(made: Stage) -> str:
    """Let the plant's own renderer draw for the room; return the view's key."""
    for service in ("kinematics", "renderer"):
        made.plant.start(service)
    wanted, deadline = {"of": "free", "width": 1280, "height": 720}, time.monotonic() + START_S
    while "answer" not in (asked := made.room.do("ask", f"{ROBOT}/views/room", wanted, 5.0)):
        if time.monotonic() > deadline:
            sys.exit(f"no view: {asked['error']}")
        time.sleep(0.5)
    key = f"{ROBOT}/{asked['answer']['topic']}"
    made.room.do("watch", key)
    made.room.wait_for("samples", key)
    return key


def pour_video(made: Stage) -> None:
    """Publish data like video at the plant, and watch it in the room."""
    made.beside.do("pour", "plant", "arm", "free", VIDEO_MBIT, 30.0)
    made.room.do("watch", VIDEO)


def beside_video(made: Stage, mbit: float, seconds: float, video: str = VIDEO) -> dict[str, Any]:
    """Measure joints and video over a line of that rate."""
    made.far.change(rate_bps=mbit * 1e6, queue_bytes=QUEUE_BYTES)
    time.sleep(5.0)
    made.room.do("samples", video)
    before = made.far.counters()["forth"]
    lags = [lag for _, lag in joints_for(made, seconds)]
    after = made.far.counters()["forth"]
    pictures = [each for each in made.room.do("samples", video) if each[2]]
    return {
        "joints_ms": quantiles(lags),
        "joints_share": round(len(lags) / (100 * seconds), 4),
        "pictures_per_s": round(len(pictures) / seconds, 1),
        "pictures_ms": quantiles([each[1] for each in pictures]),
        "mbit_per_s": round((after["bytes"] - before["bytes"]) * 8e-6 / seconds, 2),
        "overflowed": after["overflowed"] - before["overflowed"],
    }


def fetch_shapes(made: Stage, times: int) -> dict[str, Any]:
    """Return how many meshes arrived complete, the time for each, and the joints during the transfer."""
    sha256 = made.beside.do("hold_shape", "plant", "arm", SHAPE_BYTES)
    made.room.do("samples", JOINTS)
    answers = [made.room.do("shape", MESH, 10.0) for _ in range(times)]
    lags = [lag for _, lag, live, *_ in made.room.do("samples", JOINTS) if live]
    return {
        "whole": f"{sum(each.get('sha256') == sha256 for each in answers)} of {times}",
        "took_ms": quantiles([each["took_s"] for each in answers]),
        "joints_ms": quantiles(lags),
    }


# ---------------------------------------------------------------------------- cut


def cut(lengths: tuple[float, ...]) -> dict[str, Any]:
    """Cut the link and restore it."""
    rows: dict[str, Any] = {}
    with stage(delay_ms=ONE_WAY_MS) as made:
        for length in lengths:
            time.sleep(2.0)
            made.room.do("samples", JOINTS)
            lost_before = made.room.do("state", JOINTS, JOINTS)["lost"]
            made.far.change(cut=True)
            went = time.monotonic()
            stale = made.room.until(JOINTS, stale=True, within_s=length + 5.0) - went
            time.sleep(max(went + length - time.monotonic(), 0.0))
            made.far.change(cut=False)
            healed = time.monotonic()
            live = made.room.until(JOINTS, stale=False, within_s=60.0) - healed
            state = made.room.until(CONTROLLER, stale=False, within_s=60.0) - healed
            came = [each for each in made.room.do("samples", JOINTS) if each[0] > healed]
            gap = max(after[0] - before[0] for before, after in pairwise(came)) if came[1:] else 0.0
            lost = made.room.do("state", JOINTS, JOINTS)["lost"] - lost_before
            rows[f"{length:g} s"] = {
                "stale_after_s": round(stale, 3),
                "live_after_healing_s": round(live, 3),
                "controller_after_healing_s": round(state, 3),
                "counted_lost": lost,
                "expected_lost": round((length + live) * 100),
                "late_ones": sum(each[4] > 0.3 for each in came if each[4] is not None),
                "longest_gap_after_s": round(gap, 3),
            }
    return rows


# ---------------------------------------------------------------- kills, failover


def kill_router(times: int) -> dict[str, Any]:
    """Kill the plant's router and restart it."""
    took, state = [], []
    with stage(delay_ms=ONE_WAY_MS) as made:
        for _ in range(times):
            time.sleep(1.0)
            router = made.plant.processes["router"]
            made.room.do("samples", JOINTS)
            router.kill()
            router.wait()
            killed = time.monotonic()
            made.plant.start("router")
            while made.room.do("last", CONTROLLER, 1.0) is None:
                time.sleep(0.02)
            state.append(time.monotonic() - killed)
            came: list[float] = []
            while not came:  # except messages in flight
                came = [at for at, *_ in made.room.do("samples", JOINTS) if at > killed + 4e-3 * ONE_WAY_MS]
            took.append(came[0] - killed)
    return {"joints_again_ms": quantiles(took), "last_state_again_ms": quantiles(state)}


def failover(times: int) -> dict[str, Any]:
    """Kill the router that a monitor is connected to; the monitor knows two."""
    gaps = []
    with stage(delay_ms=ONE_WAY_MS) as made:
        second = made.network.host("second")
        there = made.network.link(second, made.hub.host)
        other = Site(second, "second", made.hub.folder, links=(f"tcp/{there.far}:{PORT}",))
        other.start("router")
        to_second = made.network.link(made.plant.host, second)
        monitor = Probe(made.plant.host, f"tcp/{to_second.far}:{PORT},tcp/127.0.0.1:{PORT}")
        monitor.do("watch", JOINTS)
        for _ in range(times):
            monitor.until(JOINTS, stale=False, within_s=30.0)
            time.sleep(3.0)
            monitor.do("samples", JOINTS)
            other.processes["router"].kill()
            other.processes["router"].wait()
            time.sleep(3.0)
            came = [each[0] for each in monitor.do("samples", JOINTS)]
            gaps.append(max(after - before for before, after in pairwise(came)))
            other.start("router")
            time.sleep(3.0)
            monitor.process.kill()
            monitor = Probe(made.plant.host, f"tcp/{to_second.far}:{PORT},tcp/127.0.0.1:{PORT}")
            monitor.do("watch", JOINTS)
    return {"gap_ms": quantiles(gaps)}


def frozen(times: int) -> dict[str, Any]:
    """Freeze the plant's router for 5 s."""
    noticed, well = [], []
    with stage(delay_ms=ONE_WAY_MS) as made:
        for _ in range(times):
            time.sleep(2.0)
            pid = made.plant.processes["router"].pid
            os.kill(pid, signal.SIGSTOP)
            froze = time.monotonic()
            while any("gateway" in each for each in made.room.do("present")):
                time.sleep(0.05)
            noticed.append(time.monotonic() - froze)
            time.sleep(max(froze + 5.0 - time.monotonic(), 0.0))
            os.kill(pid, signal.SIGCONT)
            thawed = time.monotonic()
            well.append(made.room.until(JOINTS, stale=False, within_s=60.0) - thawed)
    return {"given_up_ms": quantiles(noticed), "live_again_ms": quantiles(well)}


def measure(
    only: str = ",".join(PARTS),
    seconds: Annotated[float, Option(help="of joints, for each figure")] = 20.0,
    stops: int = 300,
    meshes: Annotated[int, Option(help="of 3 MB, fetched over 2 Mbit/s")] = 3,
    cuts: str = "5,60",
    kills: Annotated[int, Option(help="of the plant's router")] = 20,
) -> dict[str, Any]:
    names = chosen("--only", only, PARTS)
    if why := missing():
        sys.exit(why)
    wanted = {
        "delay": lambda: delay(seconds, stops),
        "narrow": lambda: narrow(seconds, meshes),
        "cut": lambda: cut(tuple(float(each) for each in cuts.split(","))),
        "kills": lambda: kill_router(kills),
        "failover": lambda: failover(5),
        "frozen": lambda: frozen(5),
        "bytes": lambda: bytes_per_topic(seconds / 2),
        "border": lambda: over_border(seconds / 2),
    }
    return {name: wanted[name]() for name in names}
