"""Fill a recorder's disk to the last byte, and free space again.

    .venv/bin/python -m tests.soak.recorder_disk

A real router, a real recorder process on a tmpfs of 48 MiB of its own (a private mount namespace: as root,
or where users may have one), joints at 500 Hz, frames at 100 Hz, video of 2 MB/s. Then:

    below the mark video is given up, and said so; the joints go on without a gap
    a disk that is full ends the capture; the event is there within 1 s
    the recorder lives, and lists; what was written opens
    with room again it records again, every message
"""

import argparse
import asyncio
import json
import os
import random
import sys
import tempfile
import time
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path

import zenoh
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from mcap.reader import make_reader

from robomesh.contract.endpoints import router_config
from robomesh.errors import NoAnswerError
from robomesh.recordings.recovery.recover import State, state_of
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import Session, SessionSettings, open_session
from tests.ports import free_port

MIB = 1 << 20
SIZE_MIB, WARN_MIB, VIDEO_MIB, STATES_MIB = 48, 40, 24, 8
WITHIN_S = 60.0
SITE = f"""
site = "full"
[recorder]
folder = "disk/recordings"
flight = {{ minutes = 0 }}
free = {{ warn_mib = {WARN_MIB}, video_mib = {VIDEO_MIB}, states_mib = {STATES_MIB} }}
[[robot]]
name = "arm"
model = "pt600"
"""
KEY, JOINTS = "robomesh/full/arm/recorder/request", "robomesh/full/arm/joints"
VIDEO = "robomesh/full/arm/video/front"
_Request = schema.RecorderRequest


@dataclass
class Report:
    """Results; `problems`: sentences, empty: none."""

    events: list[str] = field(default_factory=list)
    told_after_s: float = -1.0
    joints_first: int = 0
    video_first: int = 0
    video_lost: int = 0
    joints_again: int = 0
    problems: list[str] = field(default_factory=list)


class Events:
    """Events of the recorder."""

    def __init__(self) -> None:
        self.said: list[tuple[float, schema.Event]] = []

    def take(self, sample: zenoh.Sample) -> None:
        """Store an event, on Zenoh's thread."""
        self.said.append((time.monotonic(), schema.Event.FromString(sample.payload.to_bytes())))

    async def wait_for(self, code: str, *, since: float = 0.0) -> float:
        """Return the time at which an event arrived."""
        async with asyncio.timeout(WITHIN_S):
            while True:
                for at, event in self.said:
                    if event.code == code and at >= since:
                        return at
                await asyncio.sleep(0.01)


async def publish(session: Session) -> None:
    """Publish joints, frames and video until cancelled."""
    names = ("joints", "frames", "video/front")
    joints, frames, video = (session.declare_publisher("full", "arm", name) for name in names)
    number = 0
    while True:
        message = JointStates()
        message.joints.add(name="waist", position=number)
        joints.put(message)
        if number % 5 == 0:
            frames.put(FrameTransforms())
            key = b"\x00\x00\x01\x67" if number % 500 == 0 else b"\x00\x00\x01\x41"
            video.put(CompressedVideo(data=key + random.randbytes(20_000), format="h264"))
        number += 1
        await asyncio.sleep(0.002)


def count(path: Path, topic: str) -> int:
    """Return the number of messages in a file, counted by the library's reader."""
    with path.open("rb") as stream:
        return sum(1 for _ in make_reader(stream).iter_messages(topics=[topic]))


def free(folder: Path) -> int:
    """Return the number of free bytes."""
    found = os.statvfs(folder)
    return found.f_bavail * found.f_frsize


async def begin(session: Session, name: str) -> schema.Recording:
    """Start a capture, as soon as there is a recorder."""
    asked = _Request(action=_Request.TRACE_ON, name=name, views=["front"])
    answer = await session.ask(KEY, asked, timeout_s=WITHIN_S)
    assert isinstance(answer, schema.Recording)
    return answer


async def fill(session: Session, events: Events, disk: Path, report: Report) -> None:
    """Fill the disk, free it again, and check the recorder after each step."""
    first = await begin(session, "first")
    path = disk / "recordings" / "arm" / first.file
    await events.wait_for("recorder.gives_up")
    await asyncio.sleep(1.0)
    ballast = disk / "ballast"
    with ballast.open("wb", buffering=0) as stream, suppress(OSError):
        while True:
            stream.write(bytes(4096))
    filled = time.monotonic()
    report.told_after_s = round(await events.wait_for("recorder.ended") - filled, 3)
    if report.told_after_s > 1.0:
        report.problems.append(f"told of the full disk after {report.told_after_s} s")
    await session.ask("robomesh/full/-/recordings/list", timeout_s=WITHIN_S)
    async with asyncio.timeout(WITHIN_S):
        while state_of(path) is State.UNFINISHED:  # its end is being written
            await asyncio.sleep(0.05)
    report.joints_first, report.video_first = count(path, JOINTS), count(path, VIDEO)
    recording = await session.last("robomesh/full/arm/recording")
    assert isinstance(recording, schema.Recording)
    lost = {topic.topic: topic.lost for topic in recording.topics}
    report.video_lost = lost[VIDEO]
    if not report.video_lost:
        report.problems.append("video was not given up")
    if not recording.problem:
        report.problems.append("the last recording is not said to have ended by itself")
    ballast.unlink()
    path.unlink()
    await events.wait_for("recorder.gives_up", since=time.monotonic() - 0.5)
    second = await begin(session, "second")
    await asyncio.sleep(1.0)
    done = await session.ask(KEY, _Request(action=_Request.TRACE_OFF), timeout_s=WITHIN_S)
    assert isinstance(done, schema.Recording)
    again = disk / "recordings" / "arm" / second.file
    async with asyncio.timeout(WITHIN_S):
        while state_of(again) is not State.INDEXED:
            await asyncio.sleep(0.05)
    report.joints_again = count(again, JOINTS)
    lost = {topic.topic: topic.lost for topic in done.topics}
    if not report.joints_again or lost[JOINTS]:
        report.problems.append(f"recorded again: {report.joints_again} joint states, {lost[JOINTS]} lost")


async def run(folder: Path) -> Report:
    """Run all steps in a folder."""
    report, events = Report(), Events()
    site, mount = folder / "site.toml", folder / "disk"
    site.write_text(SITE)
    mount.mkdir()
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    mounted = f"mount -t tmpfs -o size={SIZE_MIB}m none {mount} && exec "
    recorder = f"{sys.executable} -m services.command_line.main recorder --site {site} --connect {endpoint}"
    private = ["unshare", "-m"] if os.geteuid() == 0 else ["unshare", "-rm"]
    with zenoh.open(router_config((endpoint,))):
        process = await asyncio.create_subprocess_exec(*private, "sh", "-c", mounted + recorder)
        try:
            async with open_session(SessionSettings(connect=(endpoint,), wait_s=WITHIN_S)) as session:
                publishing = asyncio.create_task(publish(session))
                with session.zenoh_session.declare_subscriber("robomesh/full/*/events/recorder", events.take):
                    disk = Path(f"/proc/{process.pid}/root{mount}")
                    try:
                        await fill(session, events, disk, report)
                    except (TimeoutError, NoAnswerError) as error:
                        report.problems.append(f"{type(error).__name__}: {error}")
                publishing.cancel()
            if process.returncode is not None:
                report.problems.append(f"the recorder ended with {process.returncode}")
        finally:
            if process.returncode is None:
                process.terminate()
            await process.wait()
    report.events = [f"{schema.Event.Severity.Name(e.severity)} {e.code}: {e.text}" for _, e in events.said]
    return report


def main() -> None:
    """Run the program."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        report = asyncio.run(run(Path(folder)))
    print(json.dumps(asdict(report), indent=None if given.json else 2))
    sys.exit(1 if report.problems else 0)


if __name__ == "__main__":
    main()
