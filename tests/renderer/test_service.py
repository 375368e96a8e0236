"""The renderer service with a robot on a real mesh: subscribers, late joiners, stale states."""

import asyncio
import math
import threading
import time

import av
import numpy as np
import pytest
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from pydantic import ValidationError

from renderer.drawing.studio import Studio
from renderer.encoding.encoder import H264Encoder
from renderer.errors import NoEncoderError
from renderer.pictures import post_processing
from renderer.pictures.composition import compose
from renderer.pictures.robot_state import RobotState
from renderer.service import Settings, frame_scheduler, renderer, robots, stream
from robomesh import reason_codes as codes
from robomesh.errors import NoAnswerError
from robomesh.schemas.robomesh_pb2 import ControllerState, Event, KeyFrameRequest, VideoFrames
from robomesh.wire.session import open_session
from robots.descriptions.cells import Fixture
from services.site_file.tables.fixtures import Fixture as FixtureRow
from services.site_file.tables.fixtures import fixture_shape
from tests.cells import single_arm
from tests.conftest import last_value
from tests.refusals import refused
from tests.renderer.renderer_site import (
    HOME,
    SIZE,
    amber,
    frames,
    joints,
    moving,
    orange,
    picture,
    renderer_site,
)


async def test_a_watched_view_is_video_that_decodes_and_moves(mesh, tmp_path):
    async with renderer_site(mesh, tmp_path) as (robot, monitor), moving(robot):
        video = monitor.subscribe("robomesh/hall/arm/video/front", newest=100, history=False)
        messages = await frames(video, 45)
        decoder = av.CodecContext.create("h264", "r")
        seen = []
        for _, message in messages:
            (frame,) = decoder.decode(av.Packet(message.data)) or [None]
            if frame is not None:
                seen.append(frame.to_ndarray(format="rgb24"))
        assert len(seen) >= 40
        assert seen[0].shape == (180, 320, 3)
        assert orange(seen[-1]) > 40
        assert (np.abs(seen[5].astype(int) - seen[25]) > 40).any()
        # Each picture has the time of the joint states that it shows, in order.
        times = [sample.header.source_time_ns for sample, _ in messages]
        assert times == sorted(times)
        # On a busy machine a picture is drawn again before newer states arrive.
        assert len(set(times)) > 20
        assert video.lost("robomesh/hall/arm/video/front") == 0


async def test_a_joiner_gets_the_frames_since_the_last_key_frame(mesh, tmp_path):
    async with renderer_site(mesh, tmp_path) as (robot, monitor), moving(robot):
        await frames(monitor.subscribe("robomesh/hall/arm/video/front", newest=100, history=False), 10)
        # The last key frame may have been a moment ago.
        while len((since := await last_value(monitor, "robomesh/hall/arm/video/front")).frames) < 5:
            assert isinstance(since, VideoFrames)
        decoder = av.CodecContext.create("h264", "r")
        decoder.thread_count = 1
        packets = [CompressedVideo.FromString(frame.data).data for frame in since.frames]
        pictures = [frame for data in packets for frame in decoder.decode(av.Packet(data))]
        assert len(pictures + decoder.decode(None)) == len(packets)


async def test_key_frames_are_forced_at_most_once_a_second(mesh, tmp_path):
    async with renderer_site(mesh, tmp_path) as (robot, monitor), moving(robot):
        await frames(monitor.subscribe("robomesh/hall/arm/video/front", newest=100, history=False), 3)
        key = "robomesh/hall/arm/video/front/keyframe/li"
        forced = False
        while not forced:
            asked_s = time.monotonic()
            forced = (await monitor.ask(key, KeyFrameRequest())).forced
        while forced:  # the next picture answers all requests until then
            not_before_s, asked_s = asked_s, time.monotonic()
            forced = (await monitor.ask(key, KeyFrameRequest())).forced
        for _ in range(5):
            forced = (await monitor.ask(key, KeyFrameRequest())).forced
            assert not forced or time.monotonic() - not_before_s >= 1.0
        with refused(codes.VIEW_UNKNOWN, view="behind", views="close, far, free, front, left, top"):
            await monitor.ask(key.replace("front", "behind"), KeyFrameRequest())


async def test_a_stream_recovers_from_a_failed_encoder(mesh, tmp_path, monkeypatch):
    """Let the encoder fail during the stream, as after the loss of a GPU."""

    class Failing(H264Encoder):
        def encode(self, picture, *, key_frame):
            if opened[0] is self and self._number == 5:
                raise NoEncoderError("libx264 failed: the test pulled it out")
            return super().encode(picture, key_frame=key_frame)

    def open_failing(size, fps, **options):
        opened.append(Failing(size, fps, codec="libx264"))
        return opened[-1]

    opened = []
    monkeypatch.setattr(stream, "_TRY_AGAIN_S", 0.2)
    async with renderer_site(mesh, tmp_path) as (robot, monitor), moving(robot):
        await picture(monitor)
        monkeypatch.setattr(post_processing, "open_encoder", open_failing)
        video = monitor.subscribe("robomesh/hall/arm/video/front", newest=100, history=False)
        messages = await frames(video, 12)
        assert len(opened) == 2
        decoder = av.CodecContext.create("h264", "r")
        decoder.thread_count = 1
        assert sum(len(decoder.decode(av.Packet(m.data))) for _, m in messages[5:]) >= 6


async def test_nothing_is_drawn_without_subscribers(mesh, tmp_path, monkeypatch):
    drawn, draw = [], Studio.draw

    def count(*arguments, **options):
        drawn.append(arguments)
        return draw(*arguments, **options)

    monkeypatch.setattr(Studio, "draw", count)
    async with renderer_site(mesh, tmp_path) as (robot, monitor), moving(robot):
        await picture(monitor)
        # The one subscriber has gone: drawing ends, although the arm moves.
        async with asyncio.timeout(60.0):
            before = 0
            while before != len(drawn):
                before = len(drawn)
                await asyncio.sleep(1.0)
        assert drawn


async def test_states_of_an_unwatched_robot_are_rarely_decoded(mesh, tmp_path, monkeypatch):
    decoded, update = [], RobotState.update_frames

    def count(state, *arguments):
        decoded.append(state.name)
        update(state, *arguments)

    monkeypatch.setattr(RobotState, "update_frames", count)

    async def decoded_of(published, number):
        decoded.clear()
        for _ in range(number):
            await anext(published)
        return len(decoded)

    async with renderer_site(mesh, tmp_path) as (robot, monitor), moving(robot):
        await picture(monitor)
        published = monitor.subscribe("robomesh/hall/arm/frames", newest=1000, history=False)
        assert 1 <= await decoded_of(published, 60) <= 30
        video = monitor.subscribe("robomesh/hall/arm/video/front", history=False)
        await frames(video, 3)
        assert await decoded_of(published, 60) > 30


async def test_a_picture_of_an_unwatched_robot_shows_its_newest_state(mesh, tmp_path, monkeypatch):
    shown = []

    def composed(spec, appearance, snapshot, neighbours):
        state = snapshot.state
        shown.append((state.positions.get("waist"), state.source_time_ns))
        return compose(spec, appearance, snapshot, neighbours)

    monkeypatch.setattr(stream, "compose", composed)
    async with renderer_site(mesh, tmp_path) as (robot, monitor):
        publisher = robot.declare_publisher("hall", "arm", "joints")
        while not shown:
            publisher.put(joints(HOME))
            await monitor.last("robomesh/hall/arm/image/front", timeout_s=0.5)
        # One after the other, so that the last ones are not decoded when they arrive.
        for waist in (0.1, 0.2, 0.3, 0.4):
            header = publisher.put(joints((waist, *HOME[1:])))
            await asyncio.sleep(0.03)
        while shown[-1] != (0.4, header.source_time_ns):
            await picture(monitor)


async def test_an_unwatched_renderer_unsubscribes_and_its_next_picture_is_live(mesh, tmp_path, monkeypatch):
    monkeypatch.setattr(robots, "_REST_AFTER_S", 0.5)
    monkeypatch.setattr(renderer, "_TIDY_EACH_S", 0.1)
    monkeypatch.setattr(robots, "_LIVE_WITHIN_S", 20.0)  # on a busy machine too
    decoded, ages, update = [], [], RobotState.update_frames

    def count(state, *arguments):
        decoded.append(state.name)
        update(state, *arguments)

    def composed(spec, appearance, snapshot, neighbours):
        ages.append(snapshot.ages)
        return compose(spec, appearance, snapshot, neighbours)

    monkeypatch.setattr(RobotState, "update_frames", count)
    monkeypatch.setattr(stream, "compose", composed)
    async with renderer_site(mesh, tmp_path) as (robot, monitor), moving(robot):
        await picture(monitor)
        published = monitor.subscribe("robomesh/hall/arm/frames", newest=1000, history=False)
        deadline = time.monotonic() + 20.0
        while decoded and time.monotonic() < deadline:
            decoded.clear()
            for _ in range(30):
                await anext(published)
        assert not decoded
        ages.clear()
        video = monitor.subscribe("robomesh/hall/arm/video/front", history=False)
        await frames(video, 20)
        assert all(None not in (each.frames, each.joints, each.kinematics) for each in ages)
        assert len(decoded) > 1


async def test_a_robot_at_rest_is_drawn_about_twice_a_second(mesh, tmp_path):
    async with renderer_site(mesh, tmp_path) as (robot, monitor):
        await picture(monitor)
        publisher = robot.declare_publisher("hall", "arm", "joints")

        async def publish_home():
            while True:
                publisher.put(joints(HOME))
                await asyncio.sleep(0.02)

        task = asyncio.create_task(publish_home())
        video = monitor.subscribe("robomesh/hall/arm/video/front", newest=100, history=False)
        # The first ones follow a requested key frame.
        messages = await frames(video, stream._MEASURED_PICTURES + 6)
        task.cancel()
        first, last = (messages[number][1].timestamp.ToNanoseconds() for number in (-4, -1))
        assert last - first > 1.2e9  # four pictures; a moving arm would have fifty


def counted_pictures(monkeypatch):
    """Return a list that grows with each picture that is drawn."""
    drawn = []
    draw = Studio.draw

    def counted(self, *given, **named):
        drawn.append(given)
        return draw(self, *given, **named)

    monkeypatch.setattr(Studio, "draw", counted)
    return drawn


async def test_pictures_of_a_robot_at_rest_follow_a_requested_key_frame_at_the_full_rate(
    mesh, tmp_path, monkeypatch
):
    """ffmpeg shows nothing before it has 21 pictures, at two a second after 10 s. Most repeat a drawn one."""
    drawn = counted_pictures(monkeypatch)
    async with renderer_site(mesh, tmp_path) as (_, monitor):
        await picture(monitor)
        video = monitor.subscribe("robomesh/hall/arm/video/front", newest=100, history=False)
        await frames(video, stream._MEASURED_PICTURES + 4)  # those of the first key frame, and at rest
        key = "robomesh/hall/arm/video/front/keyframe/li"
        async with asyncio.timeout(40):
            while not (await monitor.ask(key, KeyFrameRequest())).forced:
                await asyncio.sleep(0.1)
        before = len(drawn)
        messages = await frames(video, stream._MEASURED_PICTURES)
        assert messages[-1][0].received - messages[0][0].received < 8.0
        assert len(drawn) - before < stream._MEASURED_PICTURES / 2


async def test_a_picture_of_a_robot_at_rest_is_drawn_once_and_the_next_motion_is_drawn(
    mesh, tmp_path, monkeypatch
):
    drawn = counted_pictures(monkeypatch)
    async with renderer_site(mesh, tmp_path) as (robot, monitor):
        publisher = robot.declare_publisher("hall", "arm", "joints")
        pose = [HOME]

        async def publish():
            while True:
                publisher.put(joints(pose[0]))
                await asyncio.sleep(0.05)

        task = asyncio.create_task(publish())
        video = monitor.subscribe("robomesh/hall/arm/video/front", newest=100, history=False)
        await frames(video, stream._MEASURED_PICTURES + 4)
        at_rest = len(drawn)
        messages = await frames(video, 4)
        assert len(drawn) == at_rest
        stamps = [message.timestamp.ToNanoseconds() for _, message in messages]
        assert stamps == sorted(set(stamps)), "a repeated picture has the time of the newest state"
        pose[0] = [each + 0.3 for each in HOME]
        async with asyncio.timeout(40):
            while len(drawn) == at_rest:
                await frames(video, 1)
        task.cancel()


async def test_a_robot_without_new_states_turns_grey_and_shows_their_age(mesh, tmp_path):
    async with renderer_site(mesh, tmp_path) as (robot, monitor):
        publisher = robot.declare_publisher("hall", "arm", "joints")
        before = await picture(monitor)
        assert orange(before) < 20, "no state was published yet"
        assert amber(before) > 100
        async with asyncio.timeout(40):
            while not orange(live := await picture(monitor)):
                publisher.put(joints(HOME))
        assert amber(live) == 0
        async with asyncio.timeout(40):
            while orange(stale := await picture(monitor)):
                await asyncio.sleep(0.1)
        assert amber(stale) > 100


async def test_fixtures_and_a_current_clearance_line_are_drawn(mesh, tmp_path):
    color = "#00d040"
    box = fixture_shape(FixtureRow(cell="a", name="box", box=(200.0, 200.0, 200.0), color=color))
    box_to_site = np.eye(4)
    box_to_site[:3, 3] = 0.55, -0.2, 0.1
    arm = single_arm(fixtures=(Fixture("box", (box,), box_to_site, box.color),), warning_m=1.0, stop_m=1.0)

    def green(image):
        red, green, blue = (image[60:, :, channel].astype(int) for channel in range(3))
        return ((green > 70) & (green > 1.5 * red) & (green > 1.5 * blue)).sum()

    def red(image):
        red, green, blue = (image[60:, :, channel].astype(int) for channel in range(3))
        return ((red > 130) & (red > 1.8 * green) & (red > 1.8 * blue)).sum()

    async with renderer_site(mesh, tmp_path, arm=arm) as (robot, monitor):
        publisher = robot.declare_publisher("hall", "arm", "joints")
        async with asyncio.timeout(40):
            while not orange(live := await picture(monitor)) or not red(live):
                publisher.put(joints(HOME))
        assert green(live) > 100
        async with asyncio.timeout(40):
            while orange(stale := await picture(monitor)):
                await asyncio.sleep(0.1)
        # The fixture is grey like the arm, and there is no line.
        assert (green(stale), red(stale)) == (0, 0)


async def test_old_states_are_stale_while_the_gateway_is_alive(mesh, tmp_path):
    async with renderer_site(mesh, tmp_path) as (robot, monitor), moving(robot):
        async with asyncio.timeout(40):
            while not orange(await picture(monitor)):
                pass
        controller = robot.declare_publisher("hall", "arm", "controller")
        controller.put(ControllerState(link=ControllerState.SILENT, last_unit_age_s=4.0))
        async with asyncio.timeout(40):
            while not amber(await picture(monitor)):
                pass


async def test_a_close_up_follows_the_arm(mesh, tmp_path):
    async with renderer_site(mesh, tmp_path) as (robot, monitor):
        publisher = robot.declare_publisher("hall", "arm", "joints")
        async with asyncio.timeout(40):
            # Folded, the arm fills little of a picture that shows its whole workspace.
            while orange(far := await picture(monitor, "free")) < 40:
                publisher.put(joints((0.0, math.pi / 2, 1.9, 0.0, 0.0)))
            close = await picture(monitor, "close")
        assert orange(close) > 1.3 * orange(far)


async def test_a_renderer_started_late_shows_the_last_state_as_stale(mesh, tmp_path):
    # The first renderer draws another robot only.
    other = renderer_site(mesh, tmp_path, robots=("other",))
    async with other as (robot, monitor), open_session(mesh) as late:
        robot.declare_publisher("hall", "arm", "joints").put(joints((0.0, 0.3, *HOME[2:])))
        while await monitor.last("robomesh/hall/arm/frames") is None:
            pass
        second = Settings(site="hall", size=SIZE, folder=tmp_path, views=("left", "behind"))
        task = asyncio.create_task(renderer.serve(late, second))
        image = await picture(monitor, "left")
        task.cancel()
        await asyncio.wait([task])
        assert orange(image) < 20
        assert amber(image) > 100
        assert await monitor.last("robomesh/hall/arm/image/behind", timeout_s=0.2) is None


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"size": (321, 180)}, "multiple of 2"),
        ({"size": (32, 32)}, "equal to 64"),
        ({"fps": 0.0}, "equal to 1"),
    ],
)
def test_invalid_settings_are_rejected(tmp_path, settings, says):
    with pytest.raises(ValidationError, match=says):
        Settings(site="hall", folder=tmp_path, **settings)


async def test_a_slow_machine_draws_without_anti_aliasing_and_reports_it_once(mesh, tmp_path, monkeypatch):
    """Slow down drawing, as on a busy machine."""
    sizes = []

    class Slow(renderer.Studio):
        def draw(self, *args, coarse, **options):
            sizes.append(coarse)
            time.sleep(0.1)
            return super().draw(*args, coarse=coarse, **options)

    monkeypatch.setattr(renderer, "Studio", Slow)
    monkeypatch.setattr(frame_scheduler, "_REPORT_AFTER_S", 0.8)
    monkeypatch.setattr(frame_scheduler, "_COARSE_AFTER_S", 0.3)
    async with renderer_site(mesh, tmp_path) as (robot, monitor), moving(robot):
        await picture(monitor)
        events = monitor.subscribe("robomesh/hall/-/events/renderer", newest=10)
        videos = [
            monitor.subscribe(f"robomesh/hall/arm/video/{view}", newest=100, history=False)
            for view in ("front", "top")
        ]
        event = (await anext(events)).message()
        assert isinstance(event, Event)
        assert (event.severity, event.code, event.source) == (Event.WARNING, "renderer.slow", "renderer")
        assert "watched pictures a second: this machine is too slow" in event.text
        assert True in sizes
        # Both views are drawn.
        for video in videos:
            await anext(video)
        # The condition also ends with the last subscriber.
        for video in videos:
            video.close()
        event = (await anext(events)).message()
        assert isinstance(event, Event)
        assert (event.severity, event.code) == (Event.INFO, "renderer.keeps_up")


async def test_no_old_picture_is_sent_after_drawing_has_failed(mesh, tmp_path, monkeypatch):
    broken = threading.Event()

    class Breaking(renderer.Studio):
        def draw(self, *args, **options):
            if broken.is_set():
                raise RuntimeError("the test took the GPU away")
            return super().draw(*args, **options)

    monkeypatch.setattr(renderer, "Studio", Breaking)
    async with renderer_site(mesh, tmp_path) as (robot, monitor):
        publisher = robot.declare_publisher("hall", "arm", "joints")
        await picture(monitor)
        broken.set()
        async with asyncio.timeout(40):
            # One that shows the same is not drawn again.
            publisher.put(joints(HOME))
            while await monitor.last("robomesh/hall/arm/image/front", timeout_s=0.5) is not None:
                pass


async def test_a_robot_that_returns_after_a_long_time_is_drawn_again(mesh, tmp_path, monkeypatch):
    """Let a kinematics service return without a new description, as after an outage of the router."""
    monkeypatch.setattr(robots, "_FORGET_AFTER_S", 0.2)
    async with renderer_site(mesh, tmp_path) as (robot, monitor):
        token = robot.declare_presence_of("hall", "arm", "kinematics", "1")
        await picture(monitor)
        token.undeclare()
        async with asyncio.timeout(40):
            while await monitor.last("robomesh/hall/arm/image/front", timeout_s=0.5) is not None:
                pass
        robot.declare_presence("hall", "arm", "kinematics")
        async with asyncio.timeout(40):
            await picture(monitor)


async def test_a_robot_removed_while_it_is_drawn_leaves_no_encoder(mesh, tmp_path, monkeypatch):
    made, may_draw, draws = [], threading.Event(), threading.Event()
    may_draw.set()

    class Held(renderer.Studio):
        def draw(self, *args, **options):
            draws.set()
            may_draw.wait(40)
            return super().draw(*args, **options)

    class PostProcessor(renderer.PostProcessor):
        def __init__(self, *args):
            super().__init__(*args)
            made.append(self)

    monkeypatch.setattr(renderer, "Studio", Held)
    monkeypatch.setattr(renderer, "PostProcessor", PostProcessor)
    async with renderer_site(mesh, tmp_path) as (_, monitor), open_session(mesh) as player:
        await picture(monitor)
        replayed = await last_value(monitor, "robomesh/hall/arm/description")
        replayed.replay.id = "x"
        token = player.declare_presence_of("hall", "replay-x", "player", "1")
        player.declare_publisher("hall", "replay-x", "description").put(replayed)
        keyframe = "robomesh/hall/replay-x/video/front/keyframe/li"
        async with asyncio.timeout(40):
            while not await asked(monitor, keyframe):
                await asyncio.sleep(0.3)  # within the quota of key frames
        may_draw.clear()
        draws.clear()
        video = monitor.subscribe("robomesh/hall/replay-x/video/front", newest=10, history=False)
        try:
            assert await asyncio.to_thread(draws.wait, 40)
            token.undeclare()
            async with asyncio.timeout(40):
                while await asked(monitor, keyframe):
                    await asyncio.sleep(0.3)  # within the quota of key frames
        finally:
            may_draw.set()
        # This picture is drawn and encoded after the other.
        await picture(monitor)
        video.close()
        streams = [stream for each in made for stream in each._encoders]
        assert not [stream for stream in streams if stream.startswith("replay-x/")]


async def asked(monitor, key):
    """Return whether the request is answered."""
    try:
        await monitor.ask(key, KeyFrameRequest(), timeout_s=1.0)
        return True
    except NoAnswerError:
        return False
