"""`robomesh robot verify` with an arm that another process moves and lets rest."""

import asyncio
import json

import numpy as np
import pytest

from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import open_session
from robots.descriptions.description import load
from robots.descriptions.urdf.write import to_urdf
from robots.kinematics.kinematic_tree import tool_frame
from robots.kinematics.model import build_model, tool_placement
from robots.kinematics.verification_record import VerificationRecord, read_record
from robots.schema.errors import VerificationRecordError
from robots.schema.poses import rotation_vector
from services.command_line.robots import verify
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


async def moved(session, poses, *, tells_pose=True, signs=1.0, silent_s=0.0):
    """Move an arm from pose to pose, with rests between; after the third one it is silent."""
    from foxglove_schemas_protobuf.JointState_pb2 import JointState
    from foxglove_schemas_protobuf.JointStates_pb2 import JointStates

    joints, values = (session.declare_publisher("hall", "arm", each) for each in ("joints", "signals"))
    session.declare_publisher("hall", "arm", "description").put(description())
    session.declare_publisher("hall", "arm", "controller").put(schema.ControllerState(software="1"))
    session.declare_presence("hall", "arm", "gateway")
    for number, pose in enumerate(pose for _ in range(100) for pose in poses):
        await asyncio.sleep(silent_s if number == 3 else 0.0)
        for _ in range(25):
            rows = zip(MODEL.joints.names, pose, strict=True)
            joints.put(JointStates(joints=[JointState(name=name, position=value) for name, value in rows]))
            if tells_pose:
                values.put(signals(pose * signs))
            await asyncio.sleep(0.02)


async def verified(mesh, poses=None, **arm):
    async with open_session(mesh) as session, open_session(mesh) as monitor:
        moving = asyncio.create_task(moved(session, POSES, **arm))
        try:
            await until(lambda: True)
            while not await monitor.last("robomesh/hall/arm/description"):
                await asyncio.sleep(0.05)
            return await verify._verify("hall/arm", mesh.connect[0], "", "", poses)
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


def test_a_silent_arm_is_waited_for(mesh, capsys):
    result = run(verified(mesh, silent_s=2.5))
    assert result.agrees
    said = capsys.readouterr().err
    assert "hall/arm sends no joints: waiting\nhall/arm sends joints again" in said


def test_an_interrupted_comparison_goes_on_with_its_poses(mesh, tmp_path, capsys, monkeypatch):
    poses, keep = tmp_path / "arm.json.unfinished", verify._write

    def interrupt(file, record):
        keep(file, record)
        if len(record.poses) == 4:
            raise KeyboardInterrupt

    monkeypatch.setattr(verify, "_write", interrupt)
    with pytest.raises(KeyboardInterrupt):
        run(verified(mesh, poses))
    monkeypatch.setattr(verify, "_write", keep)
    signs = np.array([1, 1, -1, 1, 1])
    result = run(verified(mesh, poses, signs=signs))
    said = capsys.readouterr().err
    assert f"{poses}: 4 poses are there" in said
    assert said.count("pose 5 of 10 taken") == 1
    assert [each.distance_m < 1e-6 for each in result.poses] == [True] * 4 + [False] * 6
    assert read_record(poses).poses == result.poses


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        ({"robot": "hall/leg"}, "its poses are of another robot: delete it, or give another --out"),
        ({"joints_sha256": "other"}, "its poses are of another model or mapping of the joints: delete it"),
        ({"software": "2"}, "its poses are of another version of the controller's software: delete it"),
        ({"tool_to_base": [1.0]}, "is damaged: delete it"),
        ("{", "make it anew"),
        ({"software": ""}, None),  # a link was down
    ],
)
def test_poses_of_something_else_are_refused_and_stay(tmp_path, damage, words):
    file = tmp_path / "arm.json.unfinished"
    pose = {"positions": [0.0], "distance_m": 0, "angle_rad": 0, "tool_to_base": [0.0] * 16}
    pose["tool_to_flange"] = pose["tool_to_base"]
    values = {"robot": "hall/arm", "time": "2026-11-29T00:00:00+00:00", "agrees": False, "model": "arm"}
    values |= {"joints_sha256": "this", "software": "1", "joints": ["one"], "unmoved": [], "suspects": []}
    now = VerificationRecord.model_validate({**values, "poses": [pose]})
    if damage == "{":
        file.write_text(damage)
    else:
        kept = {**values, "poses": [{key: damage.get(key, value) for key, value in pose.items()}]}
        file.write_text(json.dumps({key: damage.get(key, value) for key, value in kept.items()}))
    before = file.read_bytes()
    if words is None:
        assert len(verify._kept(file, now)) == 1
    else:
        with pytest.raises((verify.VerificationError, VerificationRecordError), match=f"{file}: .*{words}"):
            verify._kept(file, now)
    assert file.read_bytes() == before


def test_a_model_that_changes_meanwhile_ends_the_comparison():
    state = schema.ControllerState
    before, down = state(joints_sha256="this", software="1"), state(joints_sha256="this")
    after = verify._of_same("hall/arm", before, down)
    assert (after.joints_sha256, after.software) == ("this", "1")
    assert verify._of_same("hall/arm", state(), before).software == "1"
    for other in (state(joints_sha256="other"), state(joints_sha256="this", software="2")):
        with pytest.raises(
            verify.VerificationError, match="hall/arm: its model or its controller's software"
        ):
            verify._of_same("hall/arm", before, other)


def test_a_controller_without_a_cartesian_position_is_refused_in_words(mesh):
    with pytest.raises(verify.VerificationError, match="reports no Cartesian position"):
        run(verified(mesh, tells_pose=False))
