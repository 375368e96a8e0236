"""Faults of a controller: the state that the gateway shows, the delay until it does, and the recovery time.

    ./dev run python -m benchmarks faults [--only freeze,flood] [--rounds 3] [--json]

Router, gateway and simulator are separate processes; a request starts and ends each fault while
they run. This program is a monitor and takes the times: from the answer to the request until the state and
the event arrive. If the units stop, `stale_s` is the time from the last joints message until the link is
shown as silent or down.

Target: stale within 1 s of the last unit; every fault shown, and recovered from without an operator.
"""

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass, field
from typing import Annotated, Any

from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from typer import Option

from benchmarks.harness.processes import program
from benchmarks.harness.program import ROOT, chosen
from benchmarks.harness.sites import ROBOMESH, robot, running_site
from robomesh.contract.keys import robot_key
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import Session, SessionSettings, open_session
from tests.ports import free_port

STATE = schema.ControllerState
LONGEST_S = 20.0
CALM_S = 1.5
Shown = Callable[["Seen"], bool]


@dataclass
class Seen:
    """The states and events that the monitor received."""

    controller: STATE = field(default_factory=STATE)
    events: list[str] = field(default_factory=list)
    last_joints_s: float = 0.0
    joints: int = 0
    newer_s: float = 0.0


@dataclass(frozen=True)
class Row:
    """The state and event that a fault must show."""

    state: str
    shown: Shown
    event: str = ""
    ceases: bool = False  # no more usable units arrive


def link(state: int, text: str = "") -> Shown:
    return lambda seen: seen.controller.link == state and text in seen.controller.link_text


ROWS = {
    "freeze": Row("SILENT, then DOWN", link(STATE.SILENT), "link.silent", ceases=True),
    "garbage": Row(
        "malformed counted", lambda s: s.controller.counters.units_malformed > 0, "unit.malformed"
    ),
    "split": Row("UP, nothing malformed", link(STATE.UP)),
    "flood": Row("flooding", lambda s: s.controller.health.flooding, "link.flooding"),
    "deluge": Row("SILENT", link(STATE.SILENT, "sends far too much"), "link.deluge", ceases=True),
    "drop": Row("DOWN", link(STATE.DOWN, "closed the connection"), "link.down"),
    "jump": Row("motion", lambda s: "motion.foreign" in s.events, "motion.foreign"),
    "corrupt": Row("SILENT", link(STATE.SILENT, "far beyond its limits"), "controller.joint_values"),
    "local": Row("mode LOCAL", lambda s: s.controller.mode == STATE.LOCAL, "controller.local"),
    "fault": Row("activity FAULT", lambda s: s.controller.activity == STATE.FAULT, "controller.fault"),
    "mute": Row("mode UNKNOWN", lambda s: s.controller.mode == STATE.MODE_UNKNOWN, "status.gone"),
    "joints": Row(
        "SILENT", link(STATE.SILENT, "the description has 5"), "controller.joint_count", ceases=True
    ),
    "restart": Row("DOWN", link(STATE.DOWN), "link.down"),
    "refuse": Row("DOWN", link(STATE.DOWN, "too many clients"), "link.down", ceases=True),
    "burst": Row("SILENT", link(STATE.SILENT), "link.silent", ceases=True),
    "bare": Row("mode UNKNOWN", lambda s: s.controller.mode == STATE.MODE_UNKNOWN, "status.gone"),
}


def measure(
    only: Annotated[str, Option(metavar="NAME,NAME")] = ",".join(ROWS), rounds: int = 1
) -> dict[str, Any]:
    """Measure every fault, one after the other."""
    names, port = chosen("--only", only, ROWS), free_port()
    # The simulated controller accepts requests for faults over the mesh.
    simulate = ("simulate", "--listen", f"127.0.0.1:{port}", "--for", "bench/arm")
    with (
        running_site("gateway", tables=robot("arm", port)) as site,
        program(*ROBOMESH, *simulate, "--connect", site.endpoint, cwd=ROOT),
    ):
        return asyncio.run(watch(site.endpoint, names * rounds))


async def watch(endpoint: str, names: list[str]) -> dict[str, Any]:
    settings = SessionSettings(connect=(endpoint,), wait_s=20.0)
    async with open_session(settings) as session, seeing(session) as seen:
        rows = [await one(session, seen, name) for name in names]
    return {
        "faults": rows,
        "most_stale_s": max((row["stale_s"] for row in rows if "stale_s" in row), default=0.0),
        "newer_s": seen.newer_s,
    }


@contextlib.asynccontextmanager
async def seeing(session: Session) -> AsyncIterator[Seen]:
    """Start a monitor of the robot."""
    seen = Seen()

    async def take(topic: str) -> None:
        async for sample in session.subscribe(robot_key("bench", "arm", topic), newest=10_000):
            message = sample.message()
            if isinstance(message, STATE):
                seen.controller = message
            elif isinstance(message, schema.Event):
                seen.events.append(message.code)
            elif isinstance(message, JointStates) and sample.live:
                seen.last_joints_s = time.monotonic()
                seen.joints += 1
                newer_s = message.timestamp.ToNanoseconds() * 1e-9 - time.time()
                seen.newer_s = max(seen.newer_s, newer_s)

    tasks = [asyncio.create_task(take(topic)) for topic in ("controller", "events", "joints")]
    try:
        yield seen
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def one(session: Session, seen: Seen, name: str) -> dict[str, Any]:
    """Start a fault, wait until it shows, end it, and wait for the recovery."""
    row = ROWS[name]
    await until(lambda: well(seen), "well before")
    await asyncio.sleep(CALM_S)
    seen.events.clear()
    await ask(session, name)
    begin_s = time.monotonic()
    await until(lambda: row.shown(seen) and (not row.event or row.event in seen.events), name)
    shown_s = time.monotonic()
    result: dict[str, Any] = {"fault": name, "state": row.state, "event": row.event}
    result["shown_s"] = shown_s - begin_s
    if row.ceases:
        result["stale_s"] = shown_s - seen.last_joints_s
    await asyncio.sleep(CALM_S)
    before = seen.joints
    await ask(session, name, off=True)
    end_s = time.monotonic()
    await until(lambda: well(seen) and seen.joints > before, f"{name} is over")
    result["recovered_s"] = time.monotonic() - end_s
    return result


def well(seen: Seen) -> bool:
    state = seen.controller
    return (
        state.link == STATE.UP
        and state.mode == STATE.REMOTE
        and state.activity != STATE.FAULT
        and not state.health.flooding
    )


async def ask(session: Session, name: str, *, off: bool = False) -> None:
    request = schema.FaultRequest(fault=name, off=off)
    await session.ask(robot_key("bench", "arm", "simulator/fault"), request, timeout_s=5.0)


async def until(condition: Callable[[], bool], what: str) -> None:
    try:
        async with asyncio.timeout(LONGEST_S):
            while not condition():
                await asyncio.sleep(0.002)
    except TimeoutError:
        raise SystemExit(f"{what}: not seen within {LONGEST_S:g} s") from None
