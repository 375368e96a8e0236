"""A site with one arm: kinematics and renderer on a real mesh, and helpers for subscribers."""

import asyncio
import contextlib
import math

import cv2
import numpy as np
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates

from renderer import service
from renderer.pictures.overlay import AMBER
from renderer.service import Settings
from robomesh.wire.session import open_session
from services import kinematics
from tests.cells import single_arm
from tests.renderer.bodies import context_or_skip

SIZE = (320, 180)
HOME = (0.0, math.pi / 2, 0.0, 0.0, 0.0)
NAMES = ("waist", "shoulder", "elbow", "wrist", "roll")


def shared_shapes(tmp_path):
    """Return the folder of prepared shapes that all tests share: an arm's cost 0.5 s of processor time."""
    return tmp_path.parent / "prepared"


@contextlib.asynccontextmanager
async def renderer_site(mesh, tmp_path, *, arm=None, **settings):
    """Run the kinematics of a pt600 named `arm` and a renderer; yield the robot's and a monitor's session."""
    context_or_skip().release()
    async with open_session(mesh) as robot, open_session(mesh) as drawing, open_session(mesh) as monitor:
        arm = arm or single_arm(simulated=True)
        wanted = Settings(site="hall", size=SIZE, folder=shared_shapes(tmp_path), **settings)
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
    """Publish a controller's joint states at 50 Hz; the waist swings."""
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
    """Return a current picture; wait until the renderer knows the robot."""
    while True:
        message = await monitor.last(f"robomesh/hall/arm/image/{view}", timeout_s=2.0)
        if message is not None:
            assert isinstance(message, CompressedImage)
            assert message.format == "jpeg"
            data = np.frombuffer(message.data, np.uint8)
            return cv2.cvtColor(cv2.imdecode(data, cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)


def orange(image):
    """Return the number of pixels below the badge that have the pt600's colour."""
    red, green, blue = (image[60:, :, channel].astype(int) for channel in range(3))
    return ((red > 120) & (red > green + 30) & (green > blue + 20)).sum()


def amber(image):
    return (np.abs(image.astype(int) - AMBER).max(axis=2) < 25).sum()


async def frames(subscription, count):
    """Return the next `count` live messages."""
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
