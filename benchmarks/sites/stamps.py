"""Shared stamps, frames without their joint state, and log times before publish times.

    ./dev run python -m benchmarks stamps MINUTES [--robots 4] [--burners 2] [--json]

`robomesh up` runs simulated robots at 100 Hz while other processes use all the CPU that they get. One robot
is recorded all the time, and a monitor receives the joints and frames of all robots. At the end:

- shared: joint states whose stamp is not after the previous one of the same publisher identity (target: 0)
- unmatched: frames without a joint state of the same stamp, while joint states arrived (target: 0)
- inversions: recorded messages whose log time is before their publish time (target: 0)
- rows, states: of the recording's CSV, and of its joints channel; repeated: equal times in it (target: 0)

Two identities of one publisher are two clocks (ARCHITECTURE.md); the result has their number.
"""

import asyncio
import contextlib
import csv
import subprocess
import sys
import tempfile
from collections import defaultdict
from datetime import datetime
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

from mcap.reader import make_reader
from typer import Argument

from benchmarks.harness.burners import burning
from benchmarks.harness.processes import until
from benchmarks.harness.sites import ROBOMESH
from benchmarks.sites.soak import SITE, Ports, site_file, up
from robomesh.schemas.robomesh_pb2 import RecorderRequest, Recording
from robomesh.wire.session import Session, SessionSettings, open_session
from tests.ports import free_port

RECORDED = "arm-0"
CLOSED_WITHIN_S = 60.0


def measure(minutes: Annotated[float, Argument()], robots: int = 4, burners: int = 2) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        ports = Ports(free_port(), free_port())
        with up(site_file(folder, robots, ports)), burning(burners):
            seen, file = asyncio.run(watch(ports, minutes * 60.0))
            path = folder / "recordings" / RECORDED / file
            until_closed(path)
            given = {"minutes": minutes, "robots": robots, "burners": burners}
            return {**given, **seen.result(), **recorded(path), **table(path, folder / "out.csv")}


class Seen:
    """Stamps of joints and frames, by robot and publisher identity, in order of arrival."""

    def __init__(self) -> None:
        self.joints: dict[tuple[str, int], list[int]] = defaultdict(list)
        self.frames: dict[str, list[int]] = defaultdict(list)

    def result(self) -> dict[str, Any]:
        spans = (later - earlier for stamps in self.joints.values() for earlier, later in pairwise(stamps))
        stamps_of: dict[str, set[int]] = defaultdict(set)
        for (robot, _), stamps in self.joints.items():
            stamps_of[robot].update(stamps)
        first = {robot: min(stamps) for robot, stamps in stamps_of.items()}
        frames = [
            stamp in stamps_of[robot]
            for robot, stamps in self.frames.items()
            for stamp in stamps
            if robot in first and stamp >= first[robot]
        ]
        return {
            "joints": sum(map(len, self.joints.values())),
            "identities": len(self.joints),
            "shared": sum(span <= 0 for span in spans),
            "frames": len(frames),
            "unmatched": frames.count(False),
        }


async def watch(ports: Ports, seconds: float) -> tuple[Seen, str]:
    """Watch and record for that time; return the stamps and the recording's file."""
    seen = Seen()
    async with open_session(SessionSettings(connect=(ports.router,))) as session:
        asked = RecorderRequest(action=RecorderRequest.TRACE_ON, name="stamps")
        key = f"robomesh/{SITE}/{RECORDED}/recorder/request"
        begun: Any = await session.ask(key, asked, timeout_s=60.0)
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                await asyncio.gather(take(session, "joints", seen), take(session, "frames", seen))
        asked.action = RecorderRequest.TRACE_OFF
        ended: Any = await session.ask(key, asked, timeout_s=60.0)
        assert isinstance(ended, Recording)
        return seen, str(begun.file)


async def take(session: Session, topic: str, seen: Seen) -> None:
    subscription = session.subscribe(f"robomesh/{SITE}/*/{topic}", newest=5000, history=False)
    async for sample in subscription:
        robot, header = sample.parsed.robot, sample.header
        if topic == "joints":
            seen.joints[robot, header.publisher].append(header.source_time_ns)
        else:
            seen.frames[robot].append(header.source_time_ns)


def until_closed(path: Path) -> None:
    """Wait until the recording is closed and indexed."""

    def closed() -> bool:
        with path.open("rb") as stream, contextlib.suppress(Exception):
            summary = make_reader(stream).get_summary()
            return bool(summary is not None and summary.chunk_indexes)
        return False

    until(closed, within_s=CLOSED_WITHIN_S, each_s=0.5)


def recorded(path: Path) -> dict[str, Any]:
    """Compare log times with publish times through the MCAP project's own reader."""
    messages = states = inversions = 0
    least_ns = sys.maxsize
    with path.open("rb") as stream:
        for _, channel, message in make_reader(stream).iter_messages():
            messages += 1
            states += channel.topic.endswith("/joints")
            inversions += message.log_time < message.publish_time
            least_ns = min(least_ns, message.log_time - message.publish_time)
    return {"messages": messages, "inversions": inversions, "least_ms": least_ns * 1e-6, "states": states}


def table(path: Path, out: Path) -> dict[str, Any]:
    """Return the rows of the recording's CSV, and how many of its times repeat one."""
    subprocess.run([*ROBOMESH, "recordings", "export", str(path), str(out)], check=True, capture_output=True)
    with out.open(newline="") as stream:
        times = [row["time"] for row in csv.DictReader(stream)]
    assert all(datetime.fromisoformat(time_text) for time_text in times)
    return {"rows": len(times), "repeated": len(times) - len(set(times))}
