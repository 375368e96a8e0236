"""`robomesh robot verify` with an arm that another process moves and lets rest."""

import asyncio

import numpy as np
import pytest

from robomesh.schemas import robomesh_pb2 as schema
from robomesh.session import open_session
from robots.description import load
from robots.kinematic_tree import tool_frame
from robots.model import build_model, tool_placement
from robots.poses import rotation_vector
from robots.urdf.write import to_urdf
from services.command_line.robot import verify
from tests.conftest import run
from tests.protocol_gateway.gateway_site import until

ROBOT = load("pt600")
MODEL = build_model(ROBOT)
POSES = np.random.default_rng(3).uniform(-0.6, 0.6, (10, 5))
AXES = ["x", "y", "z", "rx", "ry", "rz"]


def signals(positions):
    """Return the tool's pose as a controller reports it, whose elbow turns the other way by its model."""
    tool = tool_placement(MODEL, positions)
    values = (*tool[:3, 3], *rotation_vector(tool[:3, :3]))
    message = schema.Signals()
    for axis, value in zip(AXES, values, strict=True):
        message.signals.add(name=f"tool.pose.{axis}", unit="m", number=value)
    return message


def description():
    message = schema.Description(name="pt600", urdf=to_urdf(ROBOT))
    link, tool = tool_frame(ROBOT)
    message.frames.add(name="tool", link=link, frame_to_link=tool.ravel())
    message.joints.extend(schema.Description.Joint(name=name) for name in MODEL.joints.names)
    return message


async def moved(session, poses, *, tells_pose=True, signs=1.0):
    """Move an arm from pose to pose, with rests between."""
    from foxglove_schemas_protobuf.JointState_pb2 import JointState
    from foxglove_schemas_protobuf.JointStates_pb2 import JointStates

    joints, values = (session.declare_publisher("hall", "arm", each) for each in ("joints", "signals"))
    session.declare_publisher("hall", "arm", "description").put(description())
    session.declare_presence("hall", "arm", "gateway")
    for pose in (pose for _ in range(100) for pose in poses):
        for _ in range(25):
            rows = zip(MODEL.joints.names, pose, strict=True)
            joints.put(JointStates(joints=[JointState(name=name, position=value) for name, value in rows]))
            if tells_pose:
                values.put(signals(pose * signs))
            await asyncio.sleep(0.02)


async def verified(mesh, **arm):
    async with open_session(mesh) as session, open_session(mesh) as monitor:
        moving = asyncio.create_task(moved(session, POSES, **arm))
        try:
            await until(lambda: True)
            while not await monitor.last("robomesh/hall/arm/description"):
                await asyncio.sleep(0.05)
            return await verify._verify("hall/arm", mesh.connect[0], "", "")
        finally:
            moving.cancel()
            await asyncio.gather(moving, return_exceptions=True)


@pytest.fixture(autouse=True)
def _quick(monkeypatch):
    monkeypatch.setattr(verify, "_REST_S", 0.2)
    monkeypatch.setattr(verify, "_SIGNALS_WITHIN_S", 3.0)


def test_ten_rests_show_that_model_and_controller_agree(mesh):
    result = run(verified(mesh))
    assert result.agrees
    assert len(result.poses) == 10
    assert verify._lines(result)[0].startswith("hall/arm: model and controller agree (at most 0.0")


def test_a_joint_that_turns_the_other_way_is_named(mesh):
    result = run(verified(mesh, signs=np.array([1, 1, -1, 1, 1])))
    assert not result.agrees
    assert any(line == "  all poses agree if: elbow turns the other way" for line in verify._lines(result))


def test_a_controller_without_a_cartesian_position_is_refused_in_words(mesh):
    with pytest.raises(verify.VerificationError, match="reports no Cartesian position"):
        run(verified(mesh, tells_pose=False))
