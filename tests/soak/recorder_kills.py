"""Kill -9 a recorder repeatedly at random, and compare its files with a second subscriber's messages.

    .venv/bin/python -m tests.soak.recorder_kills --times 50

A real router, a real recorder process, and a publisher of 500 joint states a second that numbers them.
After each kill:

    the file is read as it was left: no number is missing before its end, and what the subscriber had
    received until the kill reaches at most 0.1 s further
    the next recorder makes it whole by itself, and mcap's own indexed reader finds the same numbers in it
"""

import argparse
import asyncio
import contextlib
import json
import random
import sys
import tempfile
import time
from collections.abc import AsyncIterator
from dataclasses import asdict, dataclass, field
from pathlib import Path

import zenoh
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from mcap.opcode import Opcode
from mcap.reader import make_reader

from robomesh.contract.endpoints import router_config
from robomesh.errors import NoAnswerError, RefusedError
from robomesh.recordings import records
from robomesh.recordings.recovery.recover import State, state_of
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import Session, SessionSettings, open_session
from tests.ports import free_port

KEY = "robomesh/kills/arm/recorder/request"
JOINTS = "robomesh/kills/arm/joints"
RATE_HZ = 500
MOST_LOST_S = 0.1
READY_S = 60.0

SITE = """
site = "kills"
[recorder]
flight = { minutes = 0 }
[[robot]]
name = "arm"
model = "pt600"
"""
_Request = schema.RecorderRequest


@dataclass
class Report:
    """Results; `problems`: sentences, empty: none."""

    kills: int = 0
    messages: int = 0
    worst_s: float = 0.0
    lost_s: list[float] = field(default_factory=list)
    most_lost_s: float = MOST_LOST_S
    recovered: int = 0
    torn: int = 0
    problems: list[str] = field(default_factory=list)


class Witness:
    """Second subscriber next to the recorder: the last number received, and its time."""

    def __init__(self) -> None:
        self.received: list[tuple[float, int]] = []

    def take(self, sample: zenoh.Sample) -> None:
        """Store a sample, on Zenoh's thread."""
        message = JointStates.FromString(sample.payload.to_bytes())
        self.received.append((time.monotonic(), int(message.joints[0].position)))


@contextlib.asynccontextmanager
async def running_recorder(site: Path, endpoint: str) -> AsyncIterator[asyncio.subprocess.Process]:
    """Yield a recorder process; it ends when the block is left."""
    command = [sys.executable, "-m", "services.command_line.main", "recorder"]
    with (site.parent / "recorder.log").open("ab") as log:
        process = await asyncio.create_subprocess_exec(
            *command, "--site", str(site), "--connect", endpoint, stderr=log
        )
    try:
        yield process
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()


async def publish(session: Session, numbers: list[int]) -> None:
    """Publish numbered states at the rate until cancelled."""
    publisher = session.declare_publisher("kills", "arm", "joints")
    begun, count = time.monotonic(), 0
    while True:
        while count < (time.monotonic() - begun) * RATE_HZ:
            message = JointStates()
            message.joints.add(name="waist", position=numbers[0])
            publisher.put(message)
            numbers[0] += 1
            count += 1
        await asyncio.sleep(0.002)


def numbers_as_left(path: Path) -> tuple[list[int], bool]:
    """Return the numbers in a file without an end, and whether its last record is torn."""
    found, channels, size = [], set(), 0
    with path.open("rb") as stream:
        for opcode, body, end in records.walk(stream):
            size = end
            if opcode == Opcode.CHANNEL and JOINTS.encode() in body:
                channels.add(int.from_bytes(body[:2], "little"))
            elif opcode == Opcode.MESSAGE and int.from_bytes(body[:2], "little") in channels:
                found.append(_number(body[records.MESSAGE.size :]))
    return found, size < path.stat().st_size


def numbers_indexed(path: Path) -> list[int]:
    """Return the numbers in a file, read by the library's indexed reader."""
    with path.open("rb") as stream:
        return [_number(m.data) for _, _, m in make_reader(stream).iter_messages(topics=[JOINTS])]


def _number(data: bytes) -> int:
    return int(JointStates.FromString(data).joints[0].position)


async def kill_once(session: Session, site: Path, endpoint: str, report: Report, *, after_s: float) -> None:
    """Start and kill one recorder, and check its file."""
    folder, witness = site.parent / "recordings" / "arm", Witness()
    before = set(folder.glob("*.mcap"))
    async with running_recorder(site, endpoint) as process:
        asked = _Request(action=_Request.TRACE_ON, name=f"kill-{report.kills}", views=["-"])
        async with asyncio.timeout(READY_S):
            while True:
                try:
                    await session.ask(KEY, asked)
                    break
                except NoAnswerError:
                    continue
                except RefusedError:  # it records already, and the answer was late
                    break
        with session.zenoh_session.declare_subscriber(JOINTS, witness.take):
            await asyncio.sleep(after_s)
            process.kill()
            killed = time.monotonic()
            await process.wait()
    report.kills += 1
    (path,) = set(folder.glob("*.mcap")) - before
    numbers, torn = numbers_as_left(path)
    report.torn += torn
    report.messages += len(numbers)
    judge(report, path, numbers, [(at, each) for at, each in witness.received if at <= killed], killed)
    # The next one recovers it.
    async with running_recorder(site, endpoint):
        async with asyncio.timeout(READY_S):
            while state_of(path) is not State.INDEXED:
                await asyncio.sleep(0.05)
    if numbers_indexed(path) != numbers:
        report.problems.append(f"{path.name}: recovered, but not what it held")
    report.recovered += 1


def judge(
    report: Report, path: Path, numbers: list[int], received: list[tuple[float, int]], killed: float
) -> None:
    """Compare an unfinished file with the messages of the second subscriber."""
    if not numbers:
        report.problems.append(f"{path.name}: holds nothing")
        return
    if numbers != list(range(numbers[0], numbers[-1] + 1)):
        report.problems.append(f"{path.name}: numbers are missing in it")
    after = [at for at, each in received if each > numbers[-1]]
    lost_s = killed - after[0] if after else 0.0
    report.lost_s.append(round(lost_s, 4))
    report.worst_s = max(report.worst_s, lost_s)
    if lost_s > report.most_lost_s:
        report.problems.append(f"{path.name}: the last {lost_s:.3f} s before the kill are not in it")


async def kills(
    times: int, folder: Path, *, seed: int, longest_s: float = 3.0, most_lost_s: float = MOST_LOST_S
) -> Report:
    """Kill so many recorders, one after the other."""
    report, chance = Report(most_lost_s=most_lost_s), random.Random(seed)
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    site = folder / "site.toml"
    site.write_text(SITE)
    with zenoh.open(router_config((endpoint,))):
        async with open_session(SessionSettings(connect=(endpoint,), wait_s=READY_S)) as session:
            publishing = asyncio.create_task(publish(session, [0]))
            for _ in range(times):
                await kill_once(session, site, endpoint, report, after_s=chance.uniform(0.3, longest_s))
            publishing.cancel()
    return report


def main() -> None:
    """Run the program."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--times", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--most-lost", type=float, default=MOST_LOST_S, metavar="S", help="before a kill")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        report = asyncio.run(kills(given.times, Path(folder), seed=given.seed, most_lost_s=given.most_lost))
    values = asdict(report)
    print(json.dumps(values) if given.json else "\n".join(f"{key}: {value}" for key, value in values.items()))
    sys.exit(1 if report.problems else 0)


if __name__ == "__main__":
    main()
