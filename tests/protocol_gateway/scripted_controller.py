"""Controllers that send the bytes that a test gives them."""

import asyncio
import contextlib
import time

import numpy as np

from robots.kinematics.joints import Joints, JointType
from tests.serving import serving


def endless_joints(count):
    """Return joints without limits of position and speed."""
    zeros, endless = np.zeros(count), np.full(count, np.inf)
    return Joints(
        names=tuple(f"joint_{number}" for number in range(1, count + 1)),
        types=(JointType.ROTARY,) * count,
        lower=-endless,
        upper=endless,
        max_speed=endless,
        max_acceleration=endless,
        max_jerk=endless,
        home=zeros,
        continuous=(True,) * count,
    )


@contextlib.asynccontextmanager
async def scripted_controller():
    """Run a controller that sends a test's text: (port, say, heard)."""
    writers, heard = [], bytearray()

    async def serve(reader, writer):
        writers.append(writer)
        while data := await reader.read(100):
            heard.extend(data)

    def say(text):
        for writer in writers:
            writer.write(text.encode())

    async with serving(serve) as port:
        yield port, say, heard


@contextlib.asynccontextmanager
async def repeated(say, text):
    """Send the result of `text()` 100 times a second."""

    async def send_periodically():
        while True:
            say(text())
            await asyncio.sleep(0.01)

    task = asyncio.create_task(send_periodically())
    try:
        yield
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


@contextlib.asynccontextmanager
async def slow_starter(after_s):
    """Run a controller that begins to move some seconds after a target: (port, heard)."""
    waist, begins = 0.0, None

    def state():
        nonlocal waist, begins
        if begins is None and b"ABSOLUTE" in heard:
            begins = time.monotonic() + after_s
        moves = begins is not None and time.monotonic() >= begins
        waist += 0.1 if moves else 0.0
        return f"2#ABSOLUTE.DEG*{waist:.2f};0;0;0;0&STATUS*{'moving' if moves else 'idle'};remote;homed@"

    async with scripted_controller() as (port, say, heard), repeated(say, state):
        yield port, heard
