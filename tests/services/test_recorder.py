"""Recorder over a real router: files, recovery after a kill, refused requests."""

import asyncio
import contextlib
import os
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from robomesh import reason_codes as codes
from robomesh.recordings import records
from robomesh.recordings.files import RecordingError, describe_file
from robomesh.recordings.recovery.recover import State, state_of
from robomesh.recordings.writing.capture import Capture
from robomesh.schemas import robomesh_pb2 as schema
from tests.conftest import run
from tests.refusals import refused
from tests.services.recording import (
    WITHIN_S,
    next_event,
    put_states,
    recording_site,
    trace_off,
    trace_on,
    until,
)
from tests.soak import recorder_kills

_Request = schema.RecorderRequest
LIST = "robomesh/site/-/recordings/list"


@asynccontextmanager
async def recording_arm(mesh, folder, **settings):
    """Run a recorder; yield a gateway's session and its joints publisher."""
    async with recording_site(mesh, folder, **settings) as gateway:
        publisher = gateway.declare_publisher("site", "arm", "joints")
        gateway.declare_publisher("site", "arm", "description").put(schema.Description(name="pt600"))
        yield gateway, publisher


def chunk_count(file):
    with file.open("rb") as stream:
        return make_reader(stream).get_summary().statistics.chunk_count


async def until_watched(publisher):
    while not publisher.watched:
        await asyncio.sleep(0.01)


async def test_a_capture_holds_every_message_with_the_foxglove_schemas(mesh, tmp_path):
    async with recording_arm(mesh, tmp_path) as (session, publisher):
        begun = await trace_on(session, name="trial")
        assert (begun.name, begun.open) == ("trial", True)
        await until_watched(publisher)
        await put_states(publisher, range(100))
        done = await trace_off(session)
        listed = await session.ask(LIST, timeout_s=20.0)
        assert [(row.name, row.open, row.problem) for row in listed.recordings] == [("trial", False, "")]
        file = tmp_path / "arm" / done.file
        while chunk_count(file) == 0:  # indexed in the background
            await asyncio.sleep(0.02)
    with file.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        assert reader.get_summary().statistics.chunk_count > 0
        rows = [
            (schema_.name, channel.topic, message)
            for schema_, channel, _, message in reader.iter_decoded_messages()
        ]
    joints = [m.joints[0].position for name, _, m in rows if name == "foxglove.JointStates"]
    assert joints == list(range(100))
    assert [m.name for name, _, m in rows if name == "robomesh.Description"] == ["pt600"]
    assert all(topic.startswith("robomesh/site/arm/") for _, topic, _ in rows)


async def test_events_of_each_service_and_program_progress_are_recorded(mesh, tmp_path):
    async def recorded(session):
        (recording,) = (await session.ask(LIST, timeout_s=20.0)).recordings
        return recording.topics

    async with recording_arm(mesh, tmp_path) as (session, publisher):
        program = session.declare_publisher("site", "arm", "program")
        events = {
            name: session.declare_publisher("site", "arm", name) for name in ("events", "events/kinematics")
        }
        events["events/kinematics"].put(schema.Event(code="before"))
        await trace_on(session)
        for watched in (publisher, program):
            await until_watched(watched)
        program.put(schema.ProgramState(name="weld", line=3))
        for name, each in events.items():
            each.put(schema.Event(code=f"of {name}"))
        keys = {f"robomesh/site/arm/{name}" for name in ("program", *events)}
        async with asyncio.timeout(40):
            while not keys <= {row.topic for row in await recorded(session)}:
                await asyncio.sleep(0.02)
        done = await trace_off(session)
        file = tmp_path / "arm" / done.file
    assert all(row.lost == 0 for row in describe_file(file).topics)
    with file.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        last = {channel.topic: message for _, channel, _, message in reader.iter_decoded_messages()}
    assert last["robomesh/site/arm/program"].line == 3
    assert last["robomesh/site/arm/events/kinematics"].code == "of events/kinematics"
    assert last["robomesh/site/arm/events"].code == "of events"


def test_lost_publications_are_counted_in_the_file(mesh, tmp_path):
    async def main():
        async with recording_arm(mesh, tmp_path) as (session, publisher):
            await trace_on(session)
            await until_watched(publisher)
            await put_states(publisher, range(3))
            publisher._sequence += 7  # simulates a congested link that dropped seven
            await put_states(publisher, range(3))
            done = await trace_off(session)
            return tmp_path / "arm" / done.file

    (joints,) = [row for row in describe_file(run(main())).topics if row.topic.endswith("/joints")]
    assert (joints.messages, joints.lost) == (6, 7)


async def test_a_controllers_trace_opens_and_closes_a_capture(mesh, tmp_path):
    async with recording_arm(mesh, tmp_path) as (session, _):
        controller = session.declare_publisher("site", "arm", "controller")
        controller.put(schema.ControllerState(trace=schema.ControllerState.YES))

        async def listed(condition):
            while True:
                answer = await session.ask(LIST, timeout_s=20.0)
                if [row for row in answer.recordings if condition(row)]:
                    return
                await asyncio.sleep(0.02)

        await listed(lambda row: row.open and row.started_by == "trace")
        controller.put(schema.ControllerState(trace=schema.ControllerState.NO))
        await listed(lambda row: not row.open)


async def test_a_trace_during_a_recording_joins_it_with_an_event(mesh, tmp_path):
    async with recording_arm(mesh, tmp_path) as (session, publisher):
        events = session.subscribe("robomesh/site/arm/events/recorder", newest=100)
        controller = session.declare_publisher("site", "arm", "controller")
        await trace_on(session, name="trial")
        await until_watched(publisher)
        controller.put(schema.ControllerState(trace=schema.ControllerState.YES))
        event = await next_event(events, "recorder.trace_joined")
        assert event.values["recording"] == "trial"


async def test_an_unfinished_file_is_recovered_but_no_open_or_foreign_one(mesh, tmp_path):
    about = {"site": "site", "robot": "arm", "name": "left", "started_by": "request"}
    left, empty = (tmp_path / "arm" / name for name in ("left.mcap", "empty.mcap"))
    killed = Capture(left, about, start_ns=1)
    killed.write_out()
    killed.give_up()
    another = Capture(tmp_path / "arm" / "open.mcap", about, start_ns=1)
    another.write_out()
    other_program = tmp_path / "arm" / "other.mcap"
    other_program.write_bytes(records.start())
    empty.touch()
    async with recording_arm(mesh, tmp_path):
        await until(lambda: state_of(left) is State.INDEXED and not empty.exists())
    assert state_of(another.path) is State.OPEN
    assert other_program.read_bytes() == records.start()
    another.finish({})
    assert state_of(another.path) is State.INDEXED


async def test_invalid_requests_are_refused(mesh, tmp_path):
    async with recording_arm(mesh, tmp_path) as (session, _):
        with refused(codes.RECORDING_NOT_OPEN, robot="arm"):
            await trace_off(session)
        with refused(codes.RECORDING_NAME, name="../etc"):
            await trace_on(session, name="../etc")
        await trace_on(session, name="one")
        with refused(codes.RECORDING_OPEN, robot="arm", name="one"):
            await trace_on(session, name="two")


async def test_the_end_of_the_service_closes_the_file(mesh, tmp_path):
    async with recording_arm(mesh, tmp_path) as (session, publisher):
        await trace_on(session, name="cut")
        await until_watched(publisher)
        await put_states(publisher, range(20))
    (file,) = (tmp_path / "arm").glob("*.mcap")
    recording = describe_file(file)
    assert recording.problem == ""
    assert {row.topic.rsplit("/", 1)[-1]: row.messages for row in recording.topics}["joints"] == 20


async def test_a_full_disk_ends_the_capture_with_an_event_but_not_the_recorder(mesh, tmp_path, caplog):
    async with recording_arm(mesh, tmp_path) as (session, publisher):
        await trace_on(session, name="full")
        await until_watched(publisher)
        (file,) = (tmp_path / "arm").glob("*.mcap")
        await until(lambda: file.stat().st_size)
        fill_disk_under(tmp_path / "arm")
        await put_states(publisher, range(60))
        with refused(codes.RECORDING_NOT_OPEN, robot="arm"):
            await trace_off(session)
        await trace_on(session, name="again")
        listed = await session.ask(LIST, timeout_s=20.0)
        rows = {row.name: row for row in listed.recordings}
        assert rows["again"].open
        assert (rows["full"].open, rows["full"].problem_reason.code) == (False, "recording.disk_full")
    assert "recording full ended: no space left on the disk; what was written is kept" in caplog.text


def fill_disk_under(folder):
    """Redirect the only open recording of a folder to a full disk."""
    (file,) = folder.glob("*.mcap")
    (descriptor,) = [int(link.name) for link in Path("/proc/self/fd").iterdir() if opens(link) == str(file)]
    with Path("/dev/full").open("wb") as full:
        os.dup2(full.fileno(), descriptor)


def opens(link):
    try:
        return str(link.readlink())
    except OSError:
        return ""


async def test_a_file_cut_anywhere_or_with_a_changed_byte_is_described_or_refused(mesh, tmp_path):
    async with recording_arm(mesh, tmp_path) as (session, publisher):
        await trace_on(session, name="whole")
        await until_watched(publisher)
        await put_states(publisher, range(5))
        await trace_off(session)
    (file,) = (tmp_path / "arm").glob("*.mcap")
    data = file.read_bytes()
    cut = tmp_path / "cut.mcap"
    for length in range(0, len(data), 97):
        cut.write_bytes(data[:length])
        with contextlib.suppress(RecordingError):
            assert describe_file(cut).problem
    for position in range(0, len(data), 61):
        cut.write_bytes(data[:position] + bytes([data[position] ^ 0xA5]) + data[position + 1 :])
        with contextlib.suppress(RecordingError):
            describe_file(cut)


@pytest.mark.processes
def test_recordings_of_two_killed_recorders_have_no_gap_and_are_recovered(tmp_path):
    # The amount lost at the end is measured by the program itself, on an idle machine.
    kills = recorder_kills.kills(2, tmp_path, seed=5, longest_s=1.0, most_lost_s=30.0)
    report = run(kills, timeout_s=120.0)
    assert report.problems == []
    assert (report.kills, report.recovered) == (2, 2)


def test_a_robot_that_comes_online_later_can_be_recorded(mesh, tmp_path):
    async def main():
        async with recording_arm(mesh, tmp_path) as (gateway, _):
            publisher = gateway.declare_publisher("site", "late", "joints")
            gateway.declare_presence("site", "late", "gateway")
            key = "robomesh/site/late/recorder/request"
            # Ask once only: a request that timed out may still have been executed.
            with gateway.zenoh_session.declare_querier(key) as querier:
                await until(lambda: querier.matching_status.matching)
            await gateway.ask(key, _Request(action=_Request.TRACE_ON, name="late"), timeout_s=WITHIN_S)
            await until_watched(publisher)
            await put_states(publisher, range(20))
            closed = await gateway.ask(key, _Request(action=_Request.TRACE_OFF), timeout_s=WITHIN_S)
            return {topic.topic: topic.messages for topic in closed.topics}

    assert run(main())["robomesh/site/late/joints"] == 20
