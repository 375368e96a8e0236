"""The player over a real router: what a monitor sees of a replay, and what it can ask of it."""

import asyncio
import json
import threading
import time
from contextlib import asynccontextmanager
from datetime import datetime

import pytest
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms

from robomesh.errors import NoAnswerError, RefusedError
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.session import open_session
from services import player, recorder
from services.command_line.live import listing, monitor
from tests.conftest import last_value, run
from tests.recordings import START_NS, Written, joints, write_recording

_Ask, _Record = schema.ReplayRequest, schema.RecorderRequest
OPEN = "robomesh/site/-/player/open"


@asynccontextmanager
async def playing_site(mesh, folder):
    """A player, and somebody who watches."""
    async with open_session(mesh) as own, open_session(mesh) as monitor:
        task = asyncio.create_task(player.serve(own, player.Settings(site="site", folder=folder)))
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
    return await monitor.ask(OPEN, schema.PlayRequest(file="trial.mcap", **values), timeout_s=10.0)


async def ask(monitor, state, action, **values):
    key = f"robomesh/site/{state.robot}/replay/request"
    return await monitor.ask(key, _Ask(action=action, **values))


async def until_state(session, state, condition):
    async for sample in session.subscribe(f"robomesh/site/{state.robot}/replay"):
        if condition(message := sample.message()):
            return message
    raise AssertionError("the replay tells no more")


def waist(sample):
    return {joint.name: joint.position for joint in sample.message().joints}["waist"]


def test_a_monitor_sees_each_recorded_state_once_with_its_recorded_time(mesh, folder):
    async def main():
        async with playing_site(mesh, folder) as session:
            state = await opened(session, paused=True)
            seen = session.subscribe(f"robomesh/site/{state.robot}/joints", newest=1000)
            frames = session.subscribe(f"robomesh/site/{state.robot}/frames", newest=1000)
            await ask(session, state, _Ask.PLAY)
            ended = await until_state(session, state, lambda state: state.position_s == state.duration_s)
            assert not ended.playing
            samples = []
            async with asyncio.timeout(40):
                async for sample in seen:
                    samples.append(sample)
                    if waist(sample) > 3.985:
                        break
            return samples, (await anext(frames)).message()

    samples, frames = run(main())
    # The first stood there before anybody listened, and comes as an answer.
    told = {sample.header.source_time_ns: waist(sample) for sample in samples}
    assert told == {START_NS + number * 10_000_000 - 1000: number / 100 for number in range(400)}
    assert isinstance(frames, FrameTransforms)
    assert frames.transforms[0].child_frame_id.startswith("site/replay-")
    assert frames.transforms[0].parent_frame_id == "site"


def test_what_a_recorder_wrote_is_played_as_it_was(mesh, tmp_path):
    async def main():
        async with playing_site(mesh, tmp_path) as session, open_session(mesh) as own:
            settings = recorder.Settings(site="site", robots=("arm",), folder=tmp_path)
            recording = asyncio.create_task(recorder.serve(own, settings))
            key = "robomesh/site/arm/recorder/request"
            publisher = session.declare_publisher("site", "arm", "joints")
            await session.ask(key, _Record(action=_Record.TRACE_ON, name="real", views=["-"]), timeout_s=15.0)
            while not publisher.watched:
                await asyncio.sleep(0.01)
            put = {}
            for number in range(50):
                header = publisher.put(joints(waist=number / 7))
                put[header.source_time_ns] = number / 7
                await asyncio.sleep(0.01)
            done = await session.ask(key, _Record(action=_Record.TRACE_OFF), timeout_s=15.0)
            # Again and again: a player that is late on a busy machine leaves something out.
            asked = schema.PlayRequest(file=done.file, paused=True, loop=True)
            state = await session.ask(OPEN, asked, timeout_s=10.0)
            seen = session.subscribe(f"robomesh/site/{state.robot}/joints", newest=1000)
            await ask(session, state, _Ask.PLAY)
            played = {}
            # Of what stood there when the recording began the newest is told.
            begin_ns = state.start.ToNanoseconds()
            while {time_ns for time_ns in put if time_ns > begin_ns} - played.keys():
                sample = await anext(seen)
                played[sample.header.source_time_ns] = waist(sample)
            recording.cancel()
            await asyncio.gather(recording, return_exceptions=True)
            return put, played

    put, played = run(main(), timeout_s=60.0)
    assert len(played) > 1
    assert played.items() <= put.items()


def test_a_late_joiner_learns_what_the_replay_is_and_has_its_meshes(mesh, folder):
    async def main():
        async with playing_site(mesh, folder) as session:
            state = await opened(session, paused=True, position_s=2.5)
            robot = f"robomesh/site/{state.robot}"
            description = await last_value(session, f"{robot}/description")
            events = await last_value(session, f"{robot}/events")
            mesh_bytes = await session.ask_bytes(f"{robot}/mesh/base")
            with pytest.raises(RefusedError, match="it has mesh/base"):
                await session.ask_bytes(f"{robot}/mesh/none", timeout_s=8.0)
            alive = {(who.robot, who.service) for who in await session.present()}
            assert (state.robot, "player") in alive
            return state, description, events, mesh_bytes

    state, description, events, mesh_bytes = run(main())
    assert (description.title, description.cell) == ("Pt600", "")
    assert f"replay-{description.replay.id}" == state.robot
    assert (description.replay.robot, description.replay.file) == ("arm", "trial.mcap")
    assert [event.code for event in events.events] == ["second.0", "second.1", "second.2"]
    assert mesh_bytes == b"glTF of the base"
    assert state.duration_s == pytest.approx(3.99)


def test_seeking_shows_what_was_so_then_and_video_from_the_key_frame_before(mesh, folder):
    async def main():
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
            with pytest.raises(RefusedError, match=r"position 99 s: from 0 to 3\.990 s is right"):
                await ask(session, state, _Ask.SEEK, position_s=99)
            return message, video, events

    message, video, events = run(main())
    assert [joint.position for joint in message.joints] == [3.2, -3.2]
    assert len(events.events) == 4
    # Each fiftieth is a key frame, each fifth a picture: 300, 305, 310, 315, 320.
    pictures = [CompressedVideo.FromString(frame.data) for frame in video.frames]
    assert {picture.frame_id.split("/", 2)[2] for picture in pictures} == {"camera/front"}
    assert [picture.data[-3:] for picture in pictures] == [b"300", b"305", b"310", b"315", b"320"]


def test_what_is_paused_stays_and_is_told_again_so_that_nobody_calls_it_stale(mesh, folder):
    async def main():
        async with playing_site(mesh, folder) as session:
            state = await opened(session, paused=True, position_s=1.0)
            seen = session.subscribe(f"robomesh/site/{state.robot}/joints", newest=100, history=False)
            samples = [await anext(seen) for _ in range(3)]
            assert {waist(sample) for sample in samples} == {1.0}
            assert samples[2].received - samples[1].received < 1.0
            return await until_state(session, state, lambda state: True)

    state = run(main())
    assert (state.playing, state.position_s) == (False, 1.0)


def test_a_hundred_times_as_fast_is_thinned_and_ends_a_hundred_times_as_soon(mesh, tmp_path):
    write_recording(tmp_path / "trial.mcap", seconds=60.0, video=False)

    async def main():
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
            return took_s, count

    took_s, count = run(main())
    assert took_s >= 0.59
    assert count < 120  # of 6000; of a machine that cannot keep up it is less, not later


def test_a_loop_begins_again_and_close_ends_it_for_everybody(mesh, folder):
    async def main():
        async with playing_site(mesh, folder) as session:
            state = await opened(session, loop=True, position_s=3.8, speed=1.0)
            await until_state(session, state, lambda state: state.position_s < 1.0)
            await ask(session, state, _Ask.CLOSE)
            async with asyncio.timeout(40):
                while any(who.robot == state.robot for who in await session.present()):
                    await asyncio.sleep(0.02)
            with pytest.raises(NoAnswerError):
                await session.ask(
                    f"robomesh/site/{state.robot}/replay/request", _Ask(action=_Ask.PLAY), timeout_s=0.3
                )

    run(main())


def test_nothing_of_a_replay_can_be_moved_or_recorded(mesh, folder):
    async def main():
        async with playing_site(mesh, folder) as session:
            state = await opened(session)
            robot = f"robomesh/site/{state.robot}"
            asked = {
                "stop": schema.StopRequest(),
                "lease/request/li": schema.LeaseRequest(action=schema.LeaseRequest.ACQUIRE),
                "command/li": schema.CommandRequest(command=schema.CommandRequest.HOME),
                "recorder/request": schema.RecorderRequest(action=schema.RecorderRequest.TRACE_ON),
            }
            words = {}
            for name, message in asked.items():
                with pytest.raises(RefusedError) as refused:
                    await session.ask(f"{robot}/{name}", message)
                words[name] = str(refused.value)
            return words

    words = run(main())
    assert words["stop"] == words["command/li"] == "a replay of trial.mcap: nothing here can move"
    assert words["recorder/request"] == "a replay of trial.mcap: recorded already"


def test_a_replay_ends_when_its_askers_session_goes(mesh, folder, monkeypatch):
    monkeypatch.setattr(player.player, "_SESSION_GOES_S", 0.1)

    async def main():
        async with playing_site(mesh, folder) as session:
            with pytest.raises(RefusedError, match="session 'nobody' is not present"):
                await opened(session, session="nobody")
            token = session.declare_presence_of("site", "-", "operator", "tab")
            state = await opened(session, session="tab", loop=True)
            await until_state(session, state, lambda state: state.position_s > 0.1)
            token.undeclare()
            async with asyncio.timeout(40):
                while any(who.robot == state.robot for who in await session.present()):
                    await asyncio.sleep(0.02)

    run(main())


def test_a_replay_whose_asker_goes_while_it_is_opened_ends_too(mesh, folder, monkeypatch):
    monkeypatch.setattr(player.player, "_SESSION_GOES_S", 0.1)
    opening, go_on, open_replay = threading.Event(), threading.Event(), player.player.open_replay

    def slowly(*args, **values):
        opening.set()
        go_on.wait(30.0)
        return open_replay(*args, **values)

    monkeypatch.setattr(player.player, "open_replay", slowly)

    async def main():
        async with playing_site(mesh, folder) as session:
            token = session.declare_presence_of("site", "-", "operator", "tab")
            asked = asyncio.create_task(opened(session, session="tab", loop=True))
            async with asyncio.timeout(60):
                while not opening.is_set():
                    await asyncio.sleep(0.02)
                token.undeclare()
                await asyncio.sleep(1.0)
                go_on.set()
                state = await asked
                while any(who.robot == state.robot for who in await session.present()):
                    await asyncio.sleep(0.02)

    run(main(), timeout_s=90)


def test_what_cannot_be_played_is_refused_in_words(mesh, folder):
    (folder / "arm" / "text.mcap").write_text("no recording")

    async def refused(session, file, **values):
        with pytest.raises(RefusedError) as error:
            await session.ask(OPEN, schema.PlayRequest(file=file, **values), timeout_s=10.0)
        return str(error.value)

    async def main():
        async with playing_site(mesh, folder) as session:
            assert "no recording 'gone.mcap' here" in await refused(session, "gone.mcap")
            assert "a file's name is right" in await refused(session, "../arm/trial.mcap")
            assert "does not begin as one" in await refused(session, "text.mcap")
            assert "from 0.1 to 100 is right" in await refused(session, "trial.mcap", speed=500.0)
            for _ in range(8):
                await opened(session, paused=True)
            assert "8 recordings are played already" in await refused(session, "trial.mcap")

    run(main())


def test_a_recording_of_one_moment_is_shown_once_however_it_is_to_loop(mesh, tmp_path):
    with Written(tmp_path / "trial.mcap") as file:
        file.put("joints", joints(waist=1.0), 0.0)

    async def main():
        async with playing_site(mesh, tmp_path) as session:
            state = await opened(session, loop=True)
            ended = await until_state(session, state, lambda state: not state.playing)
            return ended.position_s

    assert run(main()) == 0.0


def test_a_monitor_in_the_terminal_never_takes_a_replay_for_a_robot(mesh, router, folder, capsys):
    async def main():
        async with playing_site(mesh, folder) as session:
            state = await opened(session, position_s=1.0, loop=True)
            await asyncio.to_thread(monitor.run, state.robot, router, True, 2)
            line = json.loads(capsys.readouterr().out.splitlines()[-1])
            await monitor._live(state.robot, router, 2)
            screen = capsys.readouterr().out
            await asyncio.to_thread(listing.run, router, False)
            assert f"site/{state.robot}   replay of site/arm, " in capsys.readouterr().out
            return line, screen

    line, screen = run(main())
    assert (line["live"], line["control"]) == (False, None)
    assert line["replay"]["of"] == "site/arm"
    assert line["replay"]["recorded"].startswith(recorded_day())
    assert " ".join(screen.split()).count(f"REPLAY of site/arm recorded {recorded_day()}") >= 1
    for word in ("live", "link", "mode", "control:", "controller:", "homed"):
        assert word not in screen


def recorded_day():
    return f"{datetime.fromtimestamp(START_NS * 1e-9).astimezone():%Y-%m-%d}"
