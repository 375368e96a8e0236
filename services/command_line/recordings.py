"""`robomesh record` and `robomesh recordings`."""

import asyncio
import contextlib
import signal
from datetime import datetime
from pathlib import Path
from typing import Any

from bus.errors import NoAnswerError
from bus.keys import WHOLE_SITE, robot_key
from bus.schemas import robomesh_pb2 as schema
from bus.session import Session
from services.command_line import find
from services.errors import ServiceError

_Request = schema.RecorderRequest
_LOOK_EVERY_S = 2.0


class RecorderGoneError(ServiceError):
    """A recorder that went away while it recorded."""


def record(robot: str, name: str, router: str, as_json: bool) -> None:
    """Record until Ctrl-C, then print what it holds."""
    _print(find.run(_record(robot, name, router)), as_json)


async def _record(text: str, name: str, router: str) -> schema.Recording:
    async with find.attached(router) as session:
        robot = await find.find(session, text)
        key = robot_key(*robot, "recorder/request")
        begun = await session.ask(key, _Request(action=_Request.TRACE_ON, name=name), timeout_s=5.0)
        assert isinstance(begun, schema.Recording)
        print(f"recording {robot} as {begun.name}; Ctrl-C ends it", flush=True)
        await _until_ended(session, robot)
        done = await session.ask(key, _Request(action=_Request.TRACE_OFF), timeout_s=10.0)
        assert isinstance(done, schema.Recording)
        return done


async def _until_ended(session: Session, robot: find.Robot) -> None:
    """Until Ctrl-C; a second one ends the program.

    Raises:
        RecorderGoneError: If nobody records any more.
    """
    ended = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, ended.set)
    while not ended.is_set():
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(_LOOK_EVERY_S):
                await ended.wait()
        if not ended.is_set() and await _open_recording(session, robot) is None:
            raise RecorderGoneError(f"nobody records {robot} any more: is its recorder running?")
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.remove_signal_handler(number)


async def _open_recording(session: Session, robot: find.Robot) -> schema.Recording | None:
    try:
        answer = await session.ask(robot_key(robot.site, WHOLE_SITE, "recordings/list"))
    except NoAnswerError:
        return None
    assert isinstance(answer, schema.RecordingList)
    return next((each for each in answer.recordings if each.open and each.robot == robot.name), None)


def list_all(router: str, as_json: bool) -> None:
    """Print every recording of every site."""
    recordings = find.run(_list(router))
    if as_json:
        for recording in recordings:
            find.print_json(_values(recording))
        return
    if not recordings:
        print("nothing is recorded")
    for recording in recordings:
        _print(recording, as_json=False)


async def _list(router: str) -> list[schema.Recording]:
    async with find.attached(router) as session:
        sites = {key.site for key in await session.present() if key.service == "recorder"}
        found: list[schema.Recording] = []
        for site in sorted(sites):
            answer = await session.ask(robot_key(site, WHOLE_SITE, "recordings/list"), timeout_s=10.0)
            assert isinstance(answer, schema.RecordingList)
            found += answer.recordings
        return sorted(found, key=lambda recording: recording.start.ToNanoseconds(), reverse=True)


def info(file: Path, as_json: bool) -> None:
    """Print what a file holds."""
    from services.recorder.files import describe_file

    _print(describe_file(file), as_json)


def _print(recording: schema.Recording, as_json: bool) -> None:
    values = _values(recording)
    if as_json:
        find.print_json(values)
        return
    state = "recording now" if recording.open else recording.problem
    print(
        f"{values['start']}  {recording.site}/{recording.robot}  {recording.name}  "
        f"{values['duration_s']:.1f} s  {recording.bytes / 1e6:.2f} MB  {recording.file}"
        + (f"  ({state})" if state else "")
    )
    for topic in recording.topics:
        lost = f", {topic.lost} lost" if topic.lost else ""
        print(f"    {topic.topic}: {topic.messages}{lost}")


def _values(recording: schema.Recording) -> dict[str, Any]:
    start = datetime.fromtimestamp(recording.start.ToNanoseconds() * 1e-9).astimezone()
    return {
        "name": recording.name,
        "site": recording.site,
        "robot": recording.robot,
        "file": recording.file,
        "start": start.isoformat(timespec="milliseconds"),
        "duration_s": recording.duration.ToNanoseconds() * 1e-9,
        "bytes": recording.bytes,
        "open": recording.open,
        "problem": recording.problem,
        "topics": [
            {"topic": topic.topic, "messages": topic.messages, "lost": topic.lost}
            for topic in recording.topics
        ],
    }
