"""The age from which a robot's joints are stale: its own, if its description has one."""

import asyncio

import pytest
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates

from robomesh.client.robot.robot import AsyncRobot
from robomesh.client.robot.streams import StaleError
from robomesh.contract.topics import stale_after_s
from robomesh.errors import UnknownTopicError
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import open_session


def test_time_is_that_of_the_description_for_the_arm_and_the_topics_otherwise():
    slow = schema.Description(stale_after_s=3.0)
    assert [stale_after_s(name, slow) for name in ("joints", "joints/slow", "frames", "kinematics")] == [
        3.0
    ] * 4
    assert stale_after_s("joints", None) == stale_after_s("joints", schema.Description()) == 1.0
    assert stale_after_s("controller", slow) == 3.0
    assert stale_after_s("events", slow) is None
    with pytest.raises(UnknownTopicError):
        stale_after_s("joint", slow)


@pytest.mark.slow
@pytest.mark.parametrize(("own", "error"), [(60.0, TimeoutError), (None, StaleError)])
async def test_client_waits_for_a_slow_robot(mesh, own, error):
    async with open_session(mesh) as gateway, open_session(mesh) as client:
        description = gateway.declare_publisher("hall", "arm", "description")
        description.put(schema.Description(stale_after_s=own))
        joints = gateway.declare_publisher("hall", "arm", "joints")
        stream = AsyncRobot(client, "hall", "arm").joints()
        await stream.prepare()
        joints.put(JointStates(joints=[{"name": "waist", "position": 1.0}]))
        assert (await anext(stream))["waist"] == 1.0
        with pytest.raises(error):
            async with asyncio.timeout(3.0):
                await anext(stream)
