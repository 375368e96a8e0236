"""The recorder over a real router: what it writes, what a kill leaves, what it refuses."""

import asyncio
import contextlib
import os
import signal
import subprocess
import sys
import time
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from bus.errors import RefusedError
from bus.schemas import robomesh_pb2 as schema
from bus.session import open_session
from services import recorder
from services.recorder.files import RecordingError, describe_file
from tests.conftest import run

_Request = schema.RecorderRequest
KEY = "robomesh/site/arm/recorder/request"


@asynccontextmanager
async def recording_site(mesh, folder):
    """A recorder and a gateway's publishers."""
    async with open_session(mesh) as own, open_session(mesh) as gateway:
        settings = recorder.Settings(site="site", robots=("arm",), folder=folder)
        task = asyncio.create_task(recorder.serve(own, settings))
        publisher = gateway.declare_publisher("site", "arm", "joints")
        gateway.declare_publisher("site", "arm", "description").put(schema.Description(name="pt600"))
        await gateway.ask("robomesh/site/-/recordings/list")
        try:
            yield gateway, publisher
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)


async def put_states(publisher, count, *, hz=200.0):
    for number in range(count):
        message = JointStates()
        message.joints.add(name="waist", position=number)
        publisher.put(message)
        await asyncio.sleep(1 / hz)


def describe_chunks(file):
    with file.open("rb") as stream:
        return make_reader(stream).get_summary().statistics.chunk_count


async def until_watched(publisher):
    while not publisher.watched:
        await asyncio.sleep(0.01)


def test_a_capture_holds_everything_and_opens_with_the_foxglove_schemas(mesh, tmp_path):
    async def main():
        async with recording_site(mesh, tmp_path) as (session, publisher):
            begun = await session.ask(KEY, _Request(action=_Request.TRACE_ON, name="trial"))
            assert (begun.name, begun.open) == ("trial", True)
            await until_watched(publisher)
            await put_states(publisher, 100)
            done = await session.ask(KEY, _Request(action=_Request.TRACE_OFF), timeout_s=10.0)
            listed = await session.ask("robomesh/site/-/recordings/list")
            assert [(row.name, row.open, row.problem) for row in listed.recordings] == [("trial", False, "")]
            file = tmp_path / "arm" / done.file
            while describe_chunks(file) == 0:  # indexed beside what comes next
                await asyncio.sleep(0.02)
            return file

    file = run(main())
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


def test_what_is_lost_on_the_way_is_told_in_the_file(mesh, tmp_path):
    async def main():
        async with recording_site(mesh, tmp_path) as (session, publisher):
            await session.ask(KEY, _Request(action=_Request.TRACE_ON))
            await until_watched(publisher)
            await put_states(publisher, 3)
            publisher._sequence += 7  # what a full link drops, nobody hears of
            await put_states(publisher, 3)
            done = await session.ask(KEY, _Request(action=_Request.TRACE_OFF), timeout_s=10.0)
            return tmp_path / "arm" / done.file

    (joints,) = [row for row in describe_file(run(main())).topics if row.topic.endswith("/joints")]
    assert (joints.messages, joints.lost) == (6, 7)


def test_a_controllers_trace_opens_and_closes_a_capture(mesh, tmp_path):
    async def main():
        async with recording_site(mesh, tmp_path) as (session, _):
            controller = session.declare_publisher("site", "arm", "controller")
            controller.put(schema.ControllerState(trace=schema.ControllerState.YES))

            async def listed(condition):
                while True:
                    answer = await session.ask("robomesh/site/-/recordings/list")
                    if [row for row in answer.recordings if condition(row)]:
                        return
                    await asyncio.sleep(0.02)

            await listed(lambda row: row.open and row.started_by == "trace")
            controller.put(schema.ControllerState(trace=schema.ControllerState.NO))
            await listed(lambda row: not row.open)

    run(main())


def test_wrong_requests_are_refused_in_words(mesh, tmp_path):
    async def main():
        async with recording_site(mesh, tmp_path) as (session, _):
            with pytest.raises(RefusedError, match="not being recorded"):
                await session.ask(KEY, _Request(action=_Request.TRACE_OFF))
            with pytest.raises(RefusedError, match=r"'\.\./etc'"):
                await session.ask(KEY, _Request(action=_Request.TRACE_ON, name="../etc"))
            await session.ask(KEY, _Request(action=_Request.TRACE_ON, name="one"))
            with pytest.raises(RefusedError, match="already, as 'one'"):
                await session.ask(KEY, _Request(action=_Request.TRACE_ON, name="two"))

    run(main())


def test_an_end_of_the_service_closes_the_file(mesh, tmp_path):
    async def main():
        async with recording_site(mesh, tmp_path) as (session, publisher):
            await session.ask(KEY, _Request(action=_Request.TRACE_ON, name="cut"))
            await until_watched(publisher)
            await put_states(publisher, 20)

    run(main())
    (file,) = (tmp_path / "arm").glob("*.mcap")
    recording = describe_file(file)
    assert recording.problem == ""
    assert {row.topic.rsplit("/", 1)[-1]: row.messages for row in recording.topics}["joints"] == 20


def test_a_full_disk_ends_the_capture_and_says_so_and_the_recorder_goes_on(mesh, tmp_path, caplog):
    async def main():
        async with recording_site(mesh, tmp_path) as (session, publisher):
            await session.ask(KEY, _Request(action=_Request.TRACE_ON, name="full"))
            await until_watched(publisher)
            fill_disk_under(tmp_path / "arm")
            await put_states(publisher, 60)
            with pytest.raises(RefusedError, match="not being recorded"):
                await session.ask(KEY, _Request(action=_Request.TRACE_OFF))
            await session.ask(KEY, _Request(action=_Request.TRACE_ON, name="again"))
            listed = await session.ask("robomesh/site/-/recordings/list")
            assert {row.name: row.open for row in listed.recordings}["again"]

    run(main())
    assert "No space left on device" in caplog.text


def fill_disk_under(folder):
    """From now on the one open recording of a folder stands on a full disk."""
    (file,) = folder.glob("*.mcap")
    (descriptor,) = [int(link.name) for link in Path("/proc/self/fd").iterdir() if opens(link) == str(file)]
    with Path("/dev/full").open("wb") as full:
        os.dup2(full.fileno(), descriptor)


def opens(link):
    try:
        return str(link.readlink())
    except OSError:
        return ""


def test_a_file_cut_anywhere_or_with_a_changed_byte_is_told_of_and_breaks_nothing(mesh, tmp_path):
    async def main():
        async with recording_site(mesh, tmp_path) as (session, publisher):
            await session.ask(KEY, _Request(action=_Request.TRACE_ON, name="whole"))
            await until_watched(publisher)
            await put_states(publisher, 5)
            await session.ask(KEY, _Request(action=_Request.TRACE_OFF))

    run(main())
    (file,) = (tmp_path / "arm").glob("*.mcap")
    data = file.read_bytes()
    cut = tmp_path / "cut.mcap"
    for length in range(0, len(data), 97):
        cut.write_bytes(data[:length])
        with contextlib.suppress(RecordingError):
            assert describe_file(cut).problem
    for place in range(0, len(data), 61):
        cut.write_bytes(data[:place] + bytes([data[place] ^ 0xA5]) + data[place + 1 :])
        with contextlib.suppress(RecordingError):
            describe_file(cut)


@pytest.mark.processes
def test_a_kill_loses_at_most_a_quarter_of_a_second(mesh, tmp_path):
    site = tmp_path / "site.toml"
    site.write_text('site = "site"\n[[robot]]\nname = "arm"\nmodel = "pt600"\n')
    process = subprocess.Popen(
        [
            *(sys.executable, "-m", "services.command_line.main", "recorder"),
            *("--site", str(site), "--connect", mesh.connect[0]),
        ],
        stderr=subprocess.DEVNULL,
    )

    async def main():
        async with open_session(mesh) as session:
            publisher = session.declare_publisher("site", "arm", "joints")
            await session.ask(KEY, _Request(action=_Request.TRACE_ON, name="cut"), timeout_s=20.0)
            await until_watched(publisher)
            await put_states(publisher, 300)
            process.send_signal(signal.SIGKILL)
            return time.time_ns()

    try:
        killed_ns = run(main())
    finally:
        process.kill()
        process.wait()
    (file,) = (tmp_path / "recordings" / "arm").glob("*.mcap")
    recording = describe_file(file)
    assert "killed" in recording.problem
    end_ns = recording.start.ToNanoseconds() + recording.duration.ToNanoseconds()
    (joints,) = [row for row in recording.topics if row.topic.endswith("/joints")]
    assert joints.messages > 200
    assert killed_ns - end_ns < 0.25e9
