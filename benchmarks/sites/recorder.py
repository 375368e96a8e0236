"""The recorder: messages a second from the mesh into files without loss, and the time to read any second.

    ./dev run python -m benchmarks recorder [--seconds 10] [--peers-python PYTHON] [--json]

A router, a recorder and publishers, all separate processes on this machine. Each row gives the number of
messages that were published, that the finished and indexed files hold, and that the files report as lost,
and the CPU time of the recorder. Rows:

    one robot's joints, at the named rate   10,000 to 100,000 a second in one file
    all topics of 100 robots at 100 Hz      joints 100, frames 60, kinematics 20, controller, lease, program
                                            1 Hz each; a hundred files at the same time

For comparison, the bare writers run in a loop in one process: ours (to the system, each 4 ms; without an
index), mcap's, foxglove-sdk's. Then a file of 1 GB: the time to the first message of each topic at random
seconds of it.

Target: 100,000 messages/s and the hundred robots with no loss; any second within 50 ms.
"""

import asyncio
import json
import multiprocessing
import random
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import zenoh
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from typer import Option

from benchmarks.harness.processes import cpu_s, rss_mib
from benchmarks.harness.program import say
from benchmarks.harness.sites import running_site
from benchmarks.harness.turns import percentile
from robomesh.contract import topics
from robomesh.contract.endpoints import client_config
from robomesh.contract.header import Header, pack
from robomesh.recordings.files import describe_file
from robomesh.recordings.reading import RecordingFile
from robomesh.recordings.recovery.recover import State, state_of
from robomesh.recordings.recovery.rewrite import rewrite
from robomesh.recordings.writing.capture import Capture
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import SessionSettings, open_session

SITE = "bench"
WITHIN_S = 60.0
RATES = (10_000, 25_000, 50_000, 75_000, 100_000)
WRITTEN = 300_000
SIZE = 188
SEEKS = 60
# Messages a second of each topic of a robot.
ALL = {"joints": 100, "frames": 60, "kinematics": 20, "controller": 1, "lease": 1, "program": 1}

_Request = schema.RecorderRequest


def measure(
    seconds: Annotated[float, Option(help="of each row")] = 10.0,
    rates: Annotated[str, Option(help="messages a second of one robot")] = ",".join(map(str, RATES)),
    robots: int = 100,
    megabytes: Annotated[int, Option(help="of the file that is searched; 0: none")] = 1000,
    peers_python: Annotated[str, Option(help="a Python that has mcap and foxglove-sdk")] = "",
) -> dict[str, Any]:
    result: dict[str, Any] = {}
    result["one_robot"] = [record(1, {"joints": int(each)}, seconds) for each in rates.split(",") if each]
    if robots:
        result["all_topics"] = record(robots, ALL, seconds)
    result["writers"] = writers(peers_python)
    if megabytes:
        result["seek"] = seek(megabytes)
    return result


def payloads() -> dict[str, bytes]:
    """Return a message of each topic, as large as a real arm's."""
    joints = JointStates()
    for number in range(6):
        joints.joints.add(name=f"joint_{number}", position=0.1 * number, velocity=0.01)
    frames = FrameTransforms()
    for number in range(9):
        each = frames.transforms.add(
            parent_frame_id=f"{SITE}/arm", child_frame_id=f"{SITE}/arm/link_{number}"
        )
        each.timestamp.GetCurrentTime()
        each.translation.x, each.rotation.w = 0.1, 1.0
    rest = {name: topics.topic(name).schema().SerializeToString() + bytes(60) for name in ALL}
    return rest | {"joints": joints.SerializeToString(), "frames": frames.SerializeToString()}


def record(robots: int, rates: dict[str, int], seconds: float) -> dict[str, Any]:
    """Record the topics of a number of robots at those rates, into a file for each robot."""
    names = [f"arm-{number}" for number in range(robots)]
    tables = "".join(f'[[robot]]\nname = "{name}"\nmodel = "pt600"\n' for name in names)
    flight = "[recorder]\nflight = { minutes = 0 }\n"
    with running_site("recorder", tables=flight + tables, name=SITE) as site:
        pid = site.processes["recorder"].pid
        return asyncio.run(_record(site.endpoint, pid, names, rates, seconds, site.folder / "recordings"))


async def _record(
    endpoint: str, pid: int, names: Sequence[str], rates: dict[str, int], seconds: float, folder: Path
) -> dict[str, Any]:
    async with open_session(SessionSettings(connect=(endpoint,), wait_s=WITHIN_S)) as session:
        for name in names:
            key = f"robomesh/{SITE}/{name}/recorder/request"
            asked = _Request(action=_Request.TRACE_ON, name="bench", views=["-"])
            await session.ask(key, asked, timeout_s=WITHIN_S)
        before = cpu_s(pid)
        # Spawned: a fork of a process that has a session hangs.
        publisher = multiprocessing.get_context("spawn").Process(
            target=publish, args=(endpoint, list(names), rates, seconds), daemon=True
        )
        publisher.start()
        await asyncio.to_thread(publisher.join)
        await asyncio.sleep(1.0)
        used, memory = cpu_s(pid) - before, rss_mib(pid)
        for name in names:
            key = f"robomesh/{SITE}/{name}/recorder/request"
            await session.ask(key, _Request(action=_Request.TRACE_OFF), timeout_s=WITHIN_S)
        files = sorted(await asyncio.to_thread(folder.glob, "*/*.mcap"))
        while any(state_of(file) is not State.INDEXED for file in files):
            await asyncio.sleep(0.1)
    published = sum(round(rate * seconds) for rate in rates.values()) * len(names)
    told = [topic for file in files for topic in describe_file(file).topics]
    return {
        "robots": len(names),
        "messages_per_s": sum(rates.values()) * len(names),
        "published": published,
        "in_files": sum(topic.messages for topic in told),
        "told_lost": sum(topic.lost for topic in told),
        "cpu_percent": round(100 * used / (seconds + 1.0), 1),
        "cpu_us_per_message": round(1e6 * used / published, 2),
        "rss_mib": round(memory, 1),
    }


def publish(endpoint: str, names: list[str], rates: dict[str, int], seconds: float) -> None:
    """Publish at those rates, evenly, in this process."""
    messages = payloads()
    with zenoh.open(client_config((endpoint,), None)) as session:
        work = []
        for name in names:
            for topic, rate in rates.items():
                row = topics.topic(topic)
                publisher = session.declare_publisher(
                    f"robomesh/{SITE}/{name}/{topic}",
                    congestion_control=zenoh.CongestionControl.DROP,
                    priority=getattr(zenoh.Priority, row.priority.value),
                )
                work.append([publisher, messages[topic], rate, 0])
        time.sleep(2.0)  # until the router knows the subscribers
        begun = time.perf_counter()
        while (passed := time.perf_counter() - begun) < seconds + 0.5:
            for each in work:
                publisher, data, rate, done = each
                due = min(int(passed * rate), round(rate * seconds))
                for number in range(done + 1, due + 1):
                    publisher.put(data, attachment=pack(Header(1, number, time.time_ns())))
                each[3] = due
            time.sleep(0.002)
        time.sleep(0.5)


def writers(peers_python: str) -> dict[str, Any]:
    """Return the messages a second that the writers take, without a mesh."""
    found: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        row, data = topics.topic("joints"), (bytes(range(256)) * 2)[:SIZE]
        capture = Capture(Path(folder) / "ours.mcap", {"site": SITE}, start_ns=0)
        begun = time.perf_counter()
        for number in range(WRITTEN):
            capture.add("topic", row, Header(1, number, number), data, received_ns=number + 1)
            if number % 400 == 0:
                capture.hand_over()
                capture.write_out()
        capture.finish({})
        written = time.perf_counter()
        rewrite([capture.path], capture.path)
        found["ours"] = {"messages_per_s": round(WRITTEN / (written - begun))}
        found["ours, indexed and checked afterwards"] = {
            "messages_per_s": round(WRITTEN / (time.perf_counter() - written))
        }
        if peers_python:
            program = Path(__file__).with_name("recorder_peers.py")
            command = [peers_python, str(program), str(WRITTEN), str(SIZE), folder]
            try:
                done = subprocess.run(command, check=True, capture_output=True, timeout=300)
                found |= json.loads(done.stdout)
            except (OSError, subprocess.SubprocessError) as error:
                say(f"no peers: {error}")
    return found


def seek(megabytes: int) -> dict[str, Any]:
    """Return how soon the messages at any second of a long recording with video are read."""
    chance = random.Random(1)
    messages, frame = payloads(), 20_000
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "long.mcap"
        capture = Capture(
            path, {"site": SITE, "robot": "arm", "name": "long", "started_by": "bench"}, start_ns=0
        )
        hundredths = round(megabytes * 1e6 / frame / 30 * 100)
        for tick in range(hundredths):
            now_ns = 1_000_000_000 + tick * 10_000_000
            for name, every in (("joints", 1), ("frames", 2), ("kinematics", 5), ("controller", 100)):
                if tick % every == 0:
                    key = f"robomesh/{SITE}/arm/{name}"
                    header = Header(1, tick, now_ns)
                    capture.add(key, topics.topic(name), header, messages[name], received_ns=now_ns)
            if tick % 10 in (0, 3, 6):
                key, row = f"robomesh/{SITE}/arm/video/front", topics.topic("video/front")
                capture.add(key, row, Header(1, tick, now_ns), chance.randbytes(frame), received_ns=now_ns)
            if tick % 100 == 0:
                capture.hand_over()
                capture.write_out()
        capture.finish({})
        begun = time.perf_counter()
        rewrite([path], path)
        indexed_s = time.perf_counter() - begun
        opened: list[float] = []
        took: list[float] = []
        begun = time.perf_counter()
        with RecordingFile(path) as file:
            opened.append(time.perf_counter() - begun)
            for _ in range(SEEKS):
                at_ns = 1_000_000_000 * chance.randint(1, hundredths // 100 - 1)
                begun = time.perf_counter()
                for topic in file.topics:
                    if next(iter(file.messages([topic], start_ns=at_ns)), None) is None:
                        sys.exit(f"nothing of {topic} at {at_ns}")
                took.append(time.perf_counter() - begun)
        return {
            "file_mb": round(path.stat().st_size / 1e6),
            "duration_s": hundredths // 100,
            "indexed_s": round(indexed_s, 1),
            "open_ms": round(1e3 * opened[0], 1),
            "topics": len(file.topics),
            "seek_ms": {
                "p50": round(1e3 * statistics.median(took), 1),
                "p99": round(1e3 * percentile(took, 99), 1),
            },
        }
