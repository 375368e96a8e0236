"""The service: a described robot on a real mesh, watched, joined late, gone stale."""

import asyncio
import contextlib
import math

import av
import cv2
import numpy as np
import pytest
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates

from bus.errors import RefusedError
from bus.schemas.robomesh_pb2 import ControllerState, KeyFrameAnswer, KeyFrameRequest, VideoFrames
from bus.session import open_session
from renderer import service, stream, studio
from renderer.encoder import H264Encoder
from renderer.errors import NoEncoderError, RendererError
from renderer.overlay import AMBER
from renderer.service import Settings
from services import kinematics
from tests.conftest import run
from tests.renderer.bodies import context_or_skip

SIZE = (320, 180)
HOME = (0.0, math.pi / 2, 0.0, 0.0, 0.0)
NAMES = ("waist", "shoulder", "elbow", "wrist", "roll")


@contextlib.asynccontextmanager
async def hall(mesh, tmp_path, **settings):
    """A session, with the kinematics of a pt600 named `arm` and a renderer beside it."""
    context_or_skip().release()
    async with open_session(mesh) as robot, open_session(mesh) as drawing, open_session(mesh) as monitor:
        arm = kinematics.RobotSettings(name="arm", model="pt600", simulated=True)
        wanted = Settings(site="hall", size=SIZE, folder=tmp_path, **settings)
        tasks = [
            asyncio.create_task(kinematics.serve(robot, kinematics.Settings(site="hall", robots=(arm,)))),
            asyncio.create_task(service.serve(drawing, wanted)),
        ]
        try:
            yield robot, monitor
        finally:
            for task in tasks:
                task.cancel()
            for outcome in await asyncio.gather(*tasks, return_exceptions=True):
                assert isinstance(outcome, asyncio.CancelledError), outcome


def joints(positions):
    message = JointStates()
    message.timestamp.GetCurrentTime()
    for name, position in zip(NAMES, positions, strict=True):
        message.joints.add(name=name, position=position)
    return message


async def move(robot):
    """A controller's states at 50 Hz: the waist swings."""
    publisher = robot.declare_publisher("hall", "arm", "joints")
    for tick in range(10_000):
        publisher.put(joints((0.8 * math.sin(tick / 20), *HOME[1:])))
        await asyncio.sleep(0.02)


@contextlib.asynccontextmanager
async def moving(robot):
    task = asyncio.create_task(move(robot))
    try:
        yield
    finally:
        task.cancel()


async def picture(monitor, view="front"):
    """A fresh picture; waits until the renderer knows the robot."""
    while True:
        message = await monitor.last(f"robomesh/hall/arm/image/{view}", timeout_s=2.0)
        if message is not None:
            assert isinstance(message, CompressedImage)
            assert message.format == "jpeg"
            data = np.frombuffer(message.data, np.uint8)
            return cv2.cvtColor(cv2.imdecode(data, cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)


def orange(image):
    """How many pixels below the badge have the pt600's paint."""
    red, green, blue = (image[60:, :, channel].astype(int) for channel in range(3))
    return ((red > 120) & (red > green + 30) & (green > blue + 20)).sum()


def amber(image):
    return (np.abs(image.astype(int) - AMBER).max(axis=2) < 25).sum()


async def frames(subscription, count):
    """The next live messages."""
    messages = []
    async for sample in subscription:
        if sample.live:
            message = sample.message()
            assert isinstance(message, CompressedVideo)
            assert message.format == "h264"
            assert message.frame_id == "hall/arm/camera/front"
            messages.append((sample, message))
            if len(messages) == count:
                return messages
    raise AssertionError("the subscription ended")


def test_a_watched_view_is_video_that_decodes_and_moves(mesh, tmp_path):
    async def main():
        async with hall(mesh, tmp_path) as (robot, monitor), moving(robot):
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
            # Each tells the joint states that it shows, in their order.
            times = [sample.header.source_time_ns for sample, _ in messages]
            assert times == sorted(times)
            assert len(set(times)) > 40
            assert video.lost("robomesh/hall/arm/video/front") == 0

    run(main())


def test_a_joiner_gets_the_frames_since_the_last_key_frame(mesh, tmp_path):
    async def main():
        async with hall(mesh, tmp_path) as (robot, monitor), moving(robot):
            await frames(monitor.subscribe("robomesh/hall/arm/video/front", newest=100, history=False), 10)
            since = await monitor.last("robomesh/hall/arm/video/front")
            assert isinstance(since, VideoFrames)
            decoder = av.CodecContext.create("h264", "r")
            decoder.thread_count = 1
            packets = [CompressedVideo.FromString(frame.data).data for frame in since.frames]
            assert len(packets) >= 10
            pictures = [frame for data in packets for frame in decoder.decode(av.Packet(data))]
            assert len(pictures + decoder.decode(None)) == len(packets)

    run(main())


def test_key_frames_are_forced_at_most_once_a_second(mesh, tmp_path):
    async def main():
        async with hall(mesh, tmp_path) as (robot, monitor), moving(robot):
            await frames(monitor.subscribe("robomesh/hall/arm/video/front", newest=100, history=False), 3)
            key = "robomesh/hall/arm/video/front/keyframe"
            answers = [await monitor.ask(key, KeyFrameRequest()) for _ in range(5)]
            assert answers == [KeyFrameAnswer(forced=False)] * 5
            with pytest.raises(
                RefusedError, match="no view 'behind'; there are close, free, front, left, top"
            ):
                await monitor.ask(key.replace("front", "behind"), KeyFrameRequest())

    run(main())


def test_a_stream_whose_encoder_fails_comes_back(mesh, tmp_path, monkeypatch):
    """The encoder is closed under it, as when a GPU is lost."""

    class Failing(H264Encoder):
        def encode(self, picture, *, key_frame):
            if opened[0] is self and self._number == 5:
                raise NoEncoderError("libx264 failed: the test pulled it out")
            return super().encode(picture, key_frame=key_frame)

    def open_failing(size, fps):
        opened.append(Failing(size, fps, codec="libx264"))
        return opened[-1]

    opened = []
    monkeypatch.setattr(stream, "_TRY_AGAIN_S", 0.2)

    async def main():
        async with hall(mesh, tmp_path) as (robot, monitor), moving(robot):
            await picture(monitor)
            monkeypatch.setattr(studio, "open_encoder", open_failing)
            video = monitor.subscribe("robomesh/hall/arm/video/front", newest=100, history=False)
            messages = await frames(video, 12)
            assert len(opened) == 2
            decoder = av.CodecContext.create("h264", "r")
            decoder.thread_count = 1
            assert sum(len(decoder.decode(av.Packet(m.data))) for _, m in messages[5:]) >= 6

    run(main())


def test_nothing_is_drawn_while_nobody_watches(mesh, tmp_path):
    async def main():
        async with hall(mesh, tmp_path) as (robot, monitor), moving(robot):
            await picture(monitor)
            await asyncio.sleep(0.5)
            assert await monitor.last("robomesh/hall/arm/video/front", timeout_s=0.5) is None

    run(main())


def test_a_still_robot_is_drawn_about_twice_a_second(mesh, tmp_path):
    async def main():
        async with hall(mesh, tmp_path) as (robot, monitor):
            await picture(monitor)
            publisher = robot.declare_publisher("hall", "arm", "joints")

            async def stand_still():
                while True:
                    publisher.put(joints(HOME))
                    await asyncio.sleep(0.02)

            task = asyncio.create_task(stand_still())
            video = monitor.subscribe("robomesh/hall/arm/video/front", newest=100, history=False)
            messages = await frames(video, 6)
            task.cancel()
            took = messages[-1][0].received - messages[2][0].received
            assert 1.2 < took < 2.5

    run(main())


def test_a_robot_whose_states_stop_turns_grey_and_says_how_old_it_is(mesh, tmp_path):
    async def main():
        async with hall(mesh, tmp_path) as (robot, monitor):
            publisher = robot.declare_publisher("hall", "arm", "joints")
            before = await picture(monitor)
            assert orange(before) < 20, "nobody told where it is"
            assert amber(before) > 100
            async with asyncio.timeout(10):
                while not orange(live := await picture(monitor)):
                    publisher.put(joints(HOME))
            assert amber(live) == 0
            async with asyncio.timeout(10):
                while orange(stale := await picture(monitor)):
                    await asyncio.sleep(0.1)
            assert amber(stale) > 100

    run(main())


def test_old_states_under_a_living_gateway_are_stale(mesh, tmp_path):
    async def main():
        async with hall(mesh, tmp_path) as (robot, monitor), moving(robot):
            async with asyncio.timeout(10):
                while not orange(await picture(monitor)):
                    pass
            controller = robot.declare_publisher("hall", "arm", "controller")
            controller.put(ControllerState(link=ControllerState.SILENT, last_unit_age_s=4.0))
            async with asyncio.timeout(10):
                while not amber(await picture(monitor)):
                    pass

    run(main())


def test_a_close_up_follows_the_arm_and_only_says_when_it_is_old(mesh, tmp_path):
    async def main():
        async with hall(mesh, tmp_path) as (robot, monitor), moving(robot):
            while orange(far := await picture(monitor, "free")) < 40:
                pass
            close = await picture(monitor, "close")
            assert orange(close) > 1.3 * orange(far)

    run(main())


def test_a_renderer_that_comes_late_shows_the_last_state_as_stale(mesh, tmp_path):
    async def main():
        # The first renderer is there for another robot only.
        nobody = hall(mesh, tmp_path, robots=("nobody",))
        async with nobody as (robot, monitor), open_session(mesh) as late:
            robot.declare_publisher("hall", "arm", "joints").put(joints((0.0, 0.3, *HOME[2:])))
            while await monitor.last("robomesh/hall/arm/frames") is None:
                pass
            second = Settings(site="hall", size=SIZE, folder=tmp_path, views=("left", "behind"))
            task = asyncio.create_task(service.serve(late, second))
            image = await picture(monitor, "left")
            task.cancel()
            await asyncio.wait([task])
            assert orange(image) < 20
            assert amber(image) > 100
            assert await monitor.last("robomesh/hall/arm/image/behind", timeout_s=0.2) is None

    run(main())


@pytest.mark.parametrize(
    ("settings", "says"),
    [({"size": (321, 180)}, "321 x 180"), ({"size": (32, 32)}, "64 to 4096"), ({"fps": 0.0}, "fps 0")],
)
def test_impossible_settings_are_refused_in_words(mesh, tmp_path, settings, says):
    async def main():
        async with open_session(mesh) as session:
            await service.serve(session, Settings(site="hall", folder=tmp_path, **settings))

    with pytest.raises(RendererError, match=says):
        run(main())
