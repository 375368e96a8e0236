"""Fixtures of the recorder's tests: a recorder and a robot's publishers, over a real router."""

import asyncio
from contextlib import asynccontextmanager

from foxglove_schemas_protobuf.JointStates_pb2 import JointStates

from robomesh.recordings.recovery.recover import State, state_of
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import open_session
from services.recorder import recorder
from services.recorder.settings import Flight, Settings

Ask = schema.RecorderRequest
KEY = "robomesh/site/arm/recorder/request"
# Services start slowly on a busy machine.
WITHIN_S = 20.0


@asynccontextmanager
async def recording_site(mesh, folder, **settings):
    """Run a recorder; yield a session that publishes for robot `arm`."""
    async with open_session(mesh) as service, open_session(mesh) as gateway:
        settings = Settings(
            **{"flight": Flight(minutes=0), "views": ("front",)} | settings,
            site="site",
            robots=("arm",),
            folder=folder,
        )
        task = asyncio.create_task(recorder.serve(service, settings))
        try:
            yield gateway
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)


async def trace_on(session, **fields):
    return await session.ask(KEY, Ask(action=Ask.TRACE_ON, **fields), timeout_s=WITHIN_S)


async def trace_off(session):
    return await session.ask(KEY, Ask(action=Ask.TRACE_OFF), timeout_s=WITHIN_S)


async def put_states(publisher, numbers, *, hz=200.0):
    for number in numbers:
        message = JointStates()
        message.timestamp.GetCurrentTime()
        message.joints.add(name="waist", position=number)
        publisher.put(message)
        await asyncio.sleep(1 / hz)


async def until(condition):
    """Wait until the condition holds; the test's deadline limits the wait."""
    while not condition():
        await asyncio.sleep(0.02)


async def until_indexed(path):
    await until(lambda: path.exists() and state_of(path) is State.INDEXED)


async def next_event(subscription, code):
    """Return a subscription's next event with that code."""
    while True:
        message = (await anext(subscription)).message()
        for each in message.events if isinstance(message, schema.EventList) else [message]:
            if each.code == code:
                return each
