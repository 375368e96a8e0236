"""Flight recorder: the last minutes are saved after an event, also when the recorder was killed."""

import asyncio
import json
import threading
import time
from types import SimpleNamespace

from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from robomesh import reason_codes as codes
from robomesh.contract.header import Header
from robomesh.contract.topics import topic
from robomesh.recordings.files import describe_file
from robomesh.recordings.recovery.rewrite import rewrite
from robomesh.recordings.writing.capture import Capture
from robomesh.schemas import robomesh_pb2 as schema
from services.recorder import flight
from services.recorder.settings import Flight
from tests.conftest import run
from tests.refusals import refused
from tests.services.recording import (
    KEY,
    WITHIN_S,
    Ask,
    next_event,
    put_states,
    recording_site,
    until,
    until_indexed,
)

S = schema.Event.Severity
SAVED = "arm/*.mcap"
JOINTS = "robomesh/site/arm/joints"


def positions(path):
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        decoded = reader.iter_decoded_messages(topics=["robomesh/site/arm/joints"])
        return [message.joints[0].position for _, _, _, message in decoded]


async def saved(folder):
    """Wait for the only saved file and return its path."""
    await until(lambda: len(list(folder.glob(SAVED))) == 1)
    (path,) = folder.glob(SAVED)
    await until_indexed(path)
    return path


async def test_an_event_saves_the_messages_before_and_after_it(mesh, tmp_path, monkeypatch):
    # The test ends the save itself, because a busy machine may take any time.
    ended = threading.Event()
    monkeypatch.setattr(flight.FlightRecorder, "_is_too_long", lambda recorder, now: ended.is_set())
    async with recording_site(mesh, tmp_path, flight=Flight(after_s=600.0)) as session:
        joints = session.declare_publisher("site", "arm", "joints")
        events = session.declare_publisher("site", "arm", "events")
        await until(lambda: joints.watched and events.watched)
        await put_states(joints, range(50), hz=500)
        events.put(event(S.WARNING, "not severe enough"))
        events.put(event(S.ERROR, "drive 3 failed"))
        await put_states(joints, range(50, 100), hz=500)
        events.put(event(S.ERROR, "drive 4 failed"))
        await put_states(joints, range(100, 120), hz=500)
        while await joints_listed(session) < 120:
            await asyncio.sleep(0.02)
        ended.set()
        path = await saved(tmp_path)
        # A second save holds only later messages.
        await put_states(joints, range(200, 210), hz=500)
        answer = await session.ask(KEY, Ask(action=Ask.SAVE, name="by-hand"), timeout_s=WITHIN_S)
        assert (answer.name, answer.cause, answer.open) == ("by-hand", "requested", True)
        await until(lambda: (tmp_path / "arm" / answer.file).exists())
        await until_indexed(tmp_path / "arm" / answer.file)
        path, by_hand = path, tmp_path / "arm" / answer.file
    assert positions(path) == list(range(120))
    assert positions(by_hand) == list(range(200, 210))
    recording = describe_file(path)
    assert recording.cause == "drive 3 failed"
    assert recording.started_by == "flight"
    assert sum(each.lost for each in recording.topics) == 0


async def joints_listed(session):
    """Return the number of joint states in the save that is recording."""
    listed = await session.ask("robomesh/site/-/recordings/list", timeout_s=WITHIN_S)
    assert listed.flight
    rows = [row for recording in listed.recordings for row in recording.topics if row.topic == JOINTS]
    return sum(row.messages for row in rows)


def event(severity, text):
    message = schema.Event(severity=severity, code="test", text=text, source="gateway")
    message.timestamp.GetCurrentTime()
    return message


ABOUT = {"site": "site", "robot": "arm", "name": "flight", "started_by": "flight"}


def segment_in(folder, number, *, end):
    """Write a segment of an earlier process with one message; `end` closes it properly."""
    path = folder / ".flight" / "arm" / f"2026-01-01T00-00-0{number}.000000Z.mcap"
    capture = Capture(path, ABOUT, start_ns=time.time_ns())
    state = JointStates()
    state.joints.add(name="waist", position=number)
    capture.add(
        JOINTS,
        topic("joints"),
        Header(1, number, number),
        state.SerializeToString(),
        received_ns=time.time_ns(),
    )
    if end:
        capture.finish({})
    else:
        capture.hand_over()
        capture.write_out()
        capture.give_up()
    return path


async def test_segments_of_a_killed_flight_recorder_are_saved_at_the_next_start(mesh, tmp_path):
    segment = segment_in(tmp_path, 1, end=False)
    unreadable = segment.with_name("2026-01-01T00-00-00.000000Z.mcap")
    unreadable.write_bytes(bytes(4096))  # like a power loss
    async with recording_site(mesh, tmp_path, flight=Flight()):
        path = await saved(tmp_path)
        await until(lambda: not segment.exists())
    assert "killed" in describe_file(path).cause
    assert positions(path) == [1]
    assert unreadable.with_suffix(".damaged").exists()


async def test_a_save_that_was_done_before_a_kill_is_not_repeated(mesh, tmp_path):
    first, second = (segment_in(tmp_path, number, end=True) for number in (1, 2))
    (tmp_path / "arm").mkdir()
    rewrite([first, second], tmp_path / "arm" / "done.mcap", about={"name": "done"})
    noted = {"about": {"name": "done", "cause": "drive"}, "segments": [first.name, second.name]}
    mark = first.with_name("done.save.json")
    mark.write_text(json.dumps(noted))
    first.unlink()  # the process was killed here
    async with recording_site(mesh, tmp_path, flight=Flight()) as session:
        joints = session.declare_publisher("site", "arm", "joints")
        await until(lambda: joints.watched)
    assert not second.exists()
    assert not mark.exists()
    assert [path.name for path in tmp_path.glob(SAVED)] == ["done.mcap"]


async def test_a_failed_save_is_reported_and_retried(mesh, tmp_path, monkeypatch):
    monkeypatch.setattr(flight, "_SAVE_RETRY_S", 0.1)
    (tmp_path / "arm").write_bytes(b"")  # no folder can be made there
    async with recording_site(mesh, tmp_path, flight=Flight(after_s=0.0)) as session:
        events = session.subscribe("robomesh/site/arm/events/recorder", newest=100)
        joints = session.declare_publisher("site", "arm", "joints")
        await until(lambda: joints.watched)
        await put_states(joints, range(5))
        for name in ("shift/3", "x" * 300):
            with refused(codes.RECORDING_NAME):
                await session.ask(KEY, Ask(action=Ask.SAVE, name=name), timeout_s=WITHIN_S)
        await session.ask(KEY, Ask(action=Ask.SAVE, name="kept"), timeout_s=WITHIN_S)
        failure = await next_event(events, "recorder.not_saved")
        (tmp_path / "arm").unlink()
        path = await saved(tmp_path)
        await next_event(events, "recorder.saved")
        failure, path = failure, path
    assert failure.severity == S.CRITICAL
    assert "kept is not saved" in failure.text
    assert positions(path) == list(range(5))
    assert not list((tmp_path / ".flight" / "arm").glob("*.json"))


def test_only_old_segments_are_removed(mesh, tmp_path, monkeypatch):
    monkeypatch.setattr(flight, "_MIN_SEGMENT_S", 0.2)

    async def main():
        async with recording_site(mesh, tmp_path, flight=Flight(minutes=0.01)) as session:
            joints = session.declare_publisher("site", "arm", "joints")
            await until(lambda: joints.watched)
            folder = tmp_path / ".flight" / "arm"
            first = min(folder.glob("*.mcap"))
            while first.exists():
                await put_states(joints, range(10))
            return len(list(folder.glob("*.mcap")))

    # 0.6 s in segments of 0.2 s; a busy machine removes them late.
    assert 1 <= run(main()) <= 8
    assert not list(tmp_path.glob(SAVED))


async def test_of_too_many_bytes_the_oldest_segments_are_removed(tmp_path):
    settings = SimpleNamespace(folder=tmp_path, split=SimpleNamespace(mib=1.0))
    files = SimpleNamespace(settings=settings, robot="arm")
    recorder = flight.FlightRecorder(files, None, Flight(), on_save=None, report=None)
    folder = tmp_path / ".flight" / "arm"
    folder.mkdir(parents=True)
    for number in range(4):
        with (folder / f"{number}.mcap").open("wb") as file:
            file.truncate(400_000)
    recorder._remove_old()
    assert sorted(each.name for each in folder.iterdir()) == ["2.mcap", "3.mcap"]


async def test_segments_of_a_save_that_is_recording_stay(mesh, tmp_path, monkeypatch):
    ended = threading.Event()
    monkeypatch.setattr(flight, "_MIN_SEGMENT_S", 0.05)
    monkeypatch.setattr(flight.FlightRecorder, "_is_too_long", lambda recorder, now: ended.is_set())
    async with recording_site(mesh, tmp_path, flight=Flight(minutes=0.0005, after_s=600.0)) as session:
        joints = session.declare_publisher("site", "arm", "joints")
        await until(lambda: joints.watched)
        await session.ask(KEY, Ask(action=Ask.SAVE, name="long"), timeout_s=WITHIN_S)
        folder = tmp_path / ".flight" / "arm"
        first, later = min(folder.glob("*.mcap")), set()
        while len(later) < 5:
            await asyncio.sleep(0.02)
            later |= {*folder.glob("*.mcap")} - {first}
        stays = first.exists()
        ended.set()
        await saved(tmp_path)
    assert stays


async def test_without_a_flight_recorder_a_save_is_refused(mesh, tmp_path):
    async with recording_site(mesh, tmp_path) as session:
        with refused(codes.FLIGHT_NONE):
            await session.ask(KEY, Ask(action=Ask.SAVE), timeout_s=WITHIN_S)
