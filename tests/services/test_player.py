"""Player over a real router: topics of a replay, and requests to it."""

import asyncio
import json
import threading
import time
from contextlib import asynccontextmanager
from datetime import datetime

import pytest
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms

from robomesh import reason_codes as codes
from robomesh.errors import NoAnswerError, RefusedError
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import open_session
from services import player
from services.command_line.watch import listing, monitor
from services.recorder import recorder
from tests.conftest import last_value, run
from tests.recordings import START_NS, Written, joints, write_recording
from tests.refusals import refused

_Ask, _Record = schema.ReplayRequest, schema.RecorderRequest
OPEN = "robomesh/site/-/player/open"


@asynccontextmanager
async def playing_site(mesh, folder):
    """Run a player; yield a monitor's session."""
    async with open_session(mesh) as service, open_session(mesh) as monitor:
        task = asyncio.create_task(player.serve(service, player.Settings(site="site", folder=folder)))
        try:
            yield monitor
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "arm").mkdir()
    write_recording(tmp_path / "arm" / "trial.mcap")
    return tmp_path


async def opened(monitor, **values):
    return await monitor.ask(OPEN, schema.PlayRequest(file="trial.mcap", **values), timeout_s=40.0)


async def ask(monitor, state, action, **values):
    key = f"robomesh/site/{state.robot}/replay/request"
    return await monitor.ask(key, _Ask(action=action, **values))


async def until_state(session, state, condition):
    async for sample in session.subscribe(f"robomesh/site/{state.robot}/replay"):
        if condition(message := sample.message()):
            return message
    raise AssertionError("the subscription ended")


def waist(sample):
    return {joint.name: joint.position for joint in sample.message().joints}["waist"]


async def test_a_monitor_receives_each_recorded_state_once_with_its_recorded_time(mesh, folder):
    async with playing_site(mesh, folder) as session:
        state = await opened(session, paused=True)
        seen = session.subscribe(f"robomesh/site/{state.robot}/joints", newest=1000)
        frames = session.subscribe(f"robomesh/site/{state.robot}/frames", newest=1000)
        await ask(session, state, _Ask.PLAY)
        await until_state(
            session, state, lambda state: state.position_s == state.duration_s and not state.playing
        )
        samples = []
        async with asyncio.timeout(40):
            async for sample in seen:
                samples.append(sample)
                if waist(sample) > 3.985:
                    break
        samples, frames = samples, (await anext(frames)).message()
    # The first state was published before the subscription, and is its history.
    received = {sample.header.source_time_ns: waist(sample) for sample in samples}
    assert received == {START_NS + number * 10_000_000 - 1000: number / 100 for number in range(400)}
    assert isinstance(frames, FrameTransforms)
    assert frames.transforms[0].child_frame_id.startswith("site/replay-")
    assert frames.transforms[0].parent_frame_id == "site"


async def test_a_recorders_file_is_replayed_unchanged(mesh, tmp_path):
    async with playing_site(mesh, tmp_path) as session, open_session(mesh) as service:
        settings = recorder.Settings(site="site", robots=("arm",), folder=tmp_path)
        recording = asyncio.create_task(recorder.serve(service, settings))
        key = "robomesh/site/arm/recorder/request"
        publisher = session.declare_publisher("site", "arm", "joints")
        await session.ask(key, _Record(action=_Record.TRACE_ON, name="real", views=["-"]), timeout_s=40.0)
        while not publisher.watched:
            await asyncio.sleep(0.01)
        put = {}
        for number in range(50):
            header = publisher.put(joints(waist=number / 7))
            put[header.source_time_ns] = number / 7
            await asyncio.sleep(0.01)
        done = await session.ask(key, _Record(action=_Record.TRACE_OFF), timeout_s=40.0)
        # In a loop, because a player that is late on a busy machine skips messages.
        request = schema.PlayRequest(file=done.file, paused=True, loop=True)
        state = await session.ask(OPEN, request, timeout_s=40.0)
        seen = session.subscribe(f"robomesh/site/{state.robot}/joints", newest=1000)
        await ask(session, state, _Ask.PLAY)
        played = {}
        # Of the messages before the recording only the newest is replayed.
        begin_ns = state.start.ToNanoseconds()
        while {time_ns for time_ns in put if time_ns > begin_ns} - played.keys():
            sample = await anext(seen)
            played[sample.header.source_time_ns] = waist(sample)
        recording.cancel()
        await asyncio.gather(recording, return_exceptions=True)
        put, played = put, played
    assert len(played) > 1
    assert played.items() <= put.items()


async def test_a_late_joiner_gets_the_replays_description_events_and_shapes(mesh, folder):
    async with playing_site(mesh, folder) as session:
        state = await opened(session, paused=True, position_s=2.5)
        robot = f"robomesh/site/{state.robot}"
        description = await last_value(session, f"{robot}/description")
        events = await last_value(session, f"{robot}/events")
        shape_bytes = await session.ask_bytes(f"{robot}/mesh/base")
        with refused(codes.RECORDING_NO_ATTACHMENT, name="mesh/none", attachments="mesh/base"):
            await session.ask_bytes(f"{robot}/mesh/none", timeout_s=8.0)
        alive = {(each.robot, each.service) for each in await session.present()}
        assert (state.robot, "player") in alive
        state, description, events, shape_bytes = state, description, events, shape_bytes
    assert (description.title, description.cell) == ("Pt600", "")
    assert f"replay-{description.replay.id}" == state.robot
    assert (description.replay.robot, description.replay.file) == ("arm", "trial.mcap")
    assert [event.code for event in events.events] == ["second.0", "second.1", "second.2"]
    assert shape_bytes == b"glTF of the base"
    assert state.duration_s == pytest.approx(3.99)


async def test_a_seek_publishes_the_state_then_and_video_since_the_key_frame(mesh, folder):
    async with playing_site(mesh, folder) as session:
        state = await opened(session, paused=True)
        robot = f"robomesh/site/{state.robot}"
        await ask(session, state, _Ask.SEEK, position_s=3.204)
        async with asyncio.timeout(40):
            while (message := await last_value(session, f"{robot}/joints")).joints[0].position != 3.2:
                await asyncio.sleep(0.02)
        video = await last_value(session, f"{robot}/video/recorded-front")
        events = await last_value(session, f"{robot}/events")
        await ask(session, state, _Ask.SEEK, position_s=1.0)
        async with asyncio.timeout(40):
            while len((await last_value(session, f"{robot}/events")).events) > 2:
                await asyncio.sleep(0.02)
        with refused(codes.REPLAY_POSITION, seconds="99", most="3.990"):
            await ask(session, state, _Ask.SEEK, position_s=99)
        message, video, events = message, video, events
    assert [joint.position for joint in message.joints] == [3.2, -3.2]
    assert len(events.events) == 4
    # Each fifth state has a frame, each fiftieth a key frame: 300, 305, 310, 315, 320.
    pictures = [CompressedVideo.FromString(frame.data) for frame in video.frames]
    assert {picture.frame_id.split("/", 2)[2] for picture in pictures} == {"camera/front"}
    assert [picture.data[-3:] for picture in pictures] == [b"300", b"305", b"310", b"315", b"320"]


async def test_a_paused_replay_repeats_its_state_so_that_it_does_not_expire(mesh, folder):
    async with playing_site(mesh, folder) as session:
        state = await opened(session, paused=True, position_s=1.0)
        seen = session.subscribe(f"robomesh/site/{state.robot}/joints", newest=100, history=False)
        samples = [await anext(seen) for _ in range(3)]
        assert {waist(sample) for sample in samples} == {1.0}
        assert samples[2].received - samples[1].received < 1.0
        state = await until_state(session, state, lambda state: True)
    assert (state.playing, state.position_s) == (False, 1.0)


async def test_a_replay_at_a_hundred_times_the_speed_is_thinned_and_on_time(mesh, tmp_path):
    write_recording(tmp_path / "trial.mcap", seconds=60.0, video=False)
    async with playing_site(mesh, tmp_path) as session:
        state = await opened(session, paused=True)
        seen = session.subscribe(f"robomesh/site/{state.robot}/joints", newest=10_000, history=False)
        await ask(session, state, _Ask.SPEED, speed=100.0)
        began = time.monotonic()
        await ask(session, state, _Ask.PLAY)
        await until_state(session, state, lambda state: state.position_s == state.duration_s)
        took_s = time.monotonic() - began
        count = 0
        async with asyncio.timeout(40):
            async for sample in seen:
                count += 1
                if waist(sample) > 59:
                    break
        took_s, count = took_s, count
    assert took_s >= 0.59
    assert count < 120  # of 6000; a slow machine skips messages and is not late


async def test_a_loop_restarts_and_close_ends_the_replay(mesh, folder):
    async with playing_site(mesh, folder) as session:
        state = await opened(session, loop=True, position_s=3.8, speed=1.0)
        await until_state(session, state, lambda state: state.position_s < 1.0)
        await ask(session, state, _Ask.CLOSE)
        async with asyncio.timeout(40):
            while any(each.robot == state.robot for each in await session.present()):
                await asyncio.sleep(0.02)
        with pytest.raises(NoAnswerError):
            await session.ask(
                f"robomesh/site/{state.robot}/replay/request", _Ask(action=_Ask.PLAY), timeout_s=0.3
            )


def test_a_replay_can_be_neither_moved_nor_recorded(mesh, folder):
    async def main():
        async with playing_site(mesh, folder) as session:
            state = await opened(session)
            robot = f"robomesh/site/{state.robot}"
            requests = {
                "stop": schema.StopRequest(),
                "lease/request/li": schema.LeaseRequest(action=schema.LeaseRequest.ACQUIRE),
                "command/li": schema.CommandRequest(command=schema.CommandRequest.HOME),
                "recorder/request": schema.RecorderRequest(action=schema.RecorderRequest.TRACE_ON),
            }
            refusals = {}
            for name, message in requests.items():
                with pytest.raises(RefusedError) as caught:
                    await session.ask(f"{robot}/{name}", message)
                refusals[name] = caught.value.reason.code
            return refusals

    refusals = run(main())
    moves = ("stop", "lease/request/li", "command/li")
    assert {refusals[name] for name in moves} == {codes.REPLAY_CANNOT_MOVE.name}
    assert refusals["recorder/request"] == codes.REPLAY_IS_RECORDED.name


async def test_a_replay_ends_with_its_clients_session(mesh, folder, monkeypatch):
    monkeypatch.setattr(player.player, "_SESSION_END_S", 0.1)

    async with playing_site(mesh, folder) as session:
        with refused(codes.REPLAY_SESSION, session="absent"):
            await opened(session, session="absent")
        token = session.declare_presence_of("site", "-", "operator", "tab")
        state = await opened(session, session="tab", loop=True)
        await until_state(session, state, lambda state: state.position_s > 0.1)
        token.undeclare()
        async with asyncio.timeout(40):
            while any(each.robot == state.robot for each in await session.present()):
                await asyncio.sleep(0.02)


async def test_a_replay_ends_when_its_clients_session_ends_during_the_opening(mesh, folder, monkeypatch):
    monkeypatch.setattr(player.player, "_SESSION_END_S", 0.1)
    opening, go_on, open_replay = threading.Event(), threading.Event(), player.player.open_replay

    def open_slowly(*args, **values):
        opening.set()
        go_on.wait(30.0)
        return open_replay(*args, **values)

    monkeypatch.setattr(player.player, "open_replay", open_slowly)

    async with playing_site(mesh, folder) as session:
        token = session.declare_presence_of("site", "-", "operator", "tab")
        task = asyncio.create_task(opened(session, session="tab", loop=True))
        async with asyncio.timeout(60):
            while not opening.is_set():
                await asyncio.sleep(0.02)
            token.undeclare()
            await asyncio.sleep(1.0)
            go_on.set()
            state = await task
            while any(each.robot == state.robot for each in await session.present()):
                await asyncio.sleep(0.02)


async def test_a_file_that_cannot_be_played_is_refused(mesh, folder):
    (folder / "arm" / "text.mcap").write_text("no recording")

    async def play(session, file, **values):
        await session.ask(OPEN, schema.PlayRequest(file=file, **values), timeout_s=40.0)

    async with playing_site(mesh, folder) as session:
        for name in ("gone.mcap", "../arm/trial.mcap"):
            with refused(codes.RECORDING_UNKNOWN, name=name):
                await play(session, name)
        with refused(codes.RECORDING_NOT_MCAP, file="text.mcap"):
            await play(session, "text.mcap")
        with refused(codes.REPLAY_SPEED, speed="500", least="0.1", most="100"):
            await play(session, "trial.mcap", speed=500.0)
        for _ in range(8):
            await opened(session, paused=True)
        with refused(codes.REPLAY_TOO_MANY, count="8"):
            await play(session, "trial.mcap")


def test_a_recording_of_one_moment_is_not_looped(mesh, tmp_path):
    with Written(tmp_path / "trial.mcap") as file:
        file.put("joints", joints(waist=1.0), 0.0)

    async def main():
        async with playing_site(mesh, tmp_path) as session:
            state = await opened(session, loop=True)
            ended = await until_state(session, state, lambda state: not state.playing)
            return ended.position_s

    assert run(main()) == 0.0


async def test_the_terminal_monitor_marks_a_replay(mesh, router, folder, capsys):
    async with playing_site(mesh, folder) as session:
        state = await opened(session, position_s=1.0, loop=True)
        await asyncio.to_thread(monitor.monitor, state.robot, router, True, 2)
        line = json.loads(capsys.readouterr().out.splitlines()[-1])
        await monitor._live(state.robot, router, 2)
        screen = capsys.readouterr().out
        await asyncio.to_thread(listing.list_, router, False)
        assert f"site/{state.robot}   replay of site/arm, " in capsys.readouterr().out
        line, screen = line, screen
    assert (line["live"], line["control"]) == (False, None)
    assert line["replay"]["of"] == "site/arm"
    assert line["replay"]["recorded"].startswith(recorded_day())
    assert " ".join(screen.split()).count(f"REPLAY of site/arm recorded {recorded_day()}") >= 1
    for word in ("live", "link", "mode", "control:", "controller:", "homed"):
        assert word not in screen


def recorded_day():
    return f"{datetime.fromtimestamp(START_NS * 1e-9).astimezone():%Y-%m-%d}"
