"""Kinematics service: frames against the D-H product, twist against differences, last values stay old."""

import asyncio
import time
from contextlib import asynccontextmanager

import numpy as np
import pytest
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from google.protobuf.timestamp_pb2 import Timestamp
from hypothesis import given
from hypothesis import strategies as st

from robomesh import reason_codes as codes
from robomesh.errors import NoAnswerError
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import open_session
from robots.descriptions.description import library_names, load
from robots.kinematics.model import build_model, placement_pose, tool_placement
from robots.schema.poses import rpy_rotation
from services import kinematics
from services.kinematics.states import FramesMessage, StateMessage
from tests.cells import single_arm
from tests.conftest import last_value
from tests.refusals import refused

angles = st.floats(-np.pi, np.pi)


def dh_product(description, positions):
    """Return every link's placement as the product of the paper's matrices (section 3.2)."""
    placement = np.eye(4)
    placements = [placement]
    for row, position in zip(description.joints, positions, strict=True):
        rotary = row.type == "rotary"
        theta = np.radians(row.theta) + (position if rotary else 0.0)
        d = row.d / 1000 + (0.0 if rotary else position)
        a, alpha = row.a / 1000, np.radians(row.alpha)
        ct, st_, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
        step = np.array(
            [
                [ct, -st_ * ca, st_ * sa, a * ct],
                [st_, ct * ca, -ct * sa, a * st_],
                [0.0, sa, ca, d],
                [0.0, 0.0, 0.0, 1.0],
            ]
        )
        placement = placement @ step
        placements.append(placement)
    return placements


def turn_of(rotation):
    placement = np.eye(4)
    placement[:3, :3] = rotation
    return placement_pose(placement)[3:]


def rotation_of(quaternion):
    x, y, z, w = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


@given(angles, angles, angles)
def test_a_quaternion_is_the_rotation_of_its_matrix(roll, pitch, yaw):
    rotation = rpy_rotation(roll, pitch, yaw)
    turn = turn_of(rotation)
    assert turn[3] >= 0
    assert rotation_of(turn) == pytest.approx(rotation, abs=1e-12)


@pytest.mark.parametrize("axis", [*np.eye(3).tolist(), [0.6, 0.8, 0.0], [0.6, 0.0, -0.8]])
def test_half_turns_are_exact(axis):
    rotation = 2 * np.outer(axis, axis) - np.eye(3)
    assert rotation_of(turn_of(rotation)) == pytest.approx(rotation, abs=1e-12)


@pytest.mark.parametrize("name", library_names())
def test_frames_equal_the_dh_product_in_the_sites_frame(name):
    description = load(name)
    model = build_model(description)
    base_to_site = np.eye(4)
    base_to_site[:3, :3], base_to_site[:3, 3] = rpy_rotation(0.1, -0.2, 2.0), (1.0, -2.0, 0.5)
    frames_message = FramesMessage(model, prefix="hall/arm", base_to_site=base_to_site)
    random = np.random.default_rng(7)
    for positions in random.uniform(model.joints.lower, model.joints.upper, (100, len(model.joints))):
        message = frames_message.filled(positions, Timestamp(seconds=7))
        frames = {frame.child_frame_id: frame for frame in message.transforms}
        for link, placement in zip(model.link_names, dh_product(description, positions), strict=True):
            frame = frames[f"hall/arm/{link}"]
            assert (frame.parent_frame_id, frame.timestamp.seconds) == ("hall", 7)
            expected = base_to_site @ placement
            translation, q = frame.translation, frame.rotation
            assert (translation.x, translation.y, translation.z) == pytest.approx(expected[:3, 3], abs=1e-9)
            assert rotation_of((q.x, q.y, q.z, q.w)) == pytest.approx(expected[:3, :3], abs=1e-9)
        assert "hall/arm/tool" in frames


@pytest.mark.parametrize("name", library_names())
def test_the_twist_equals_the_tools_numeric_derivative(name):
    model = build_model(load(name))
    random = np.random.default_rng(3)
    positions = random.uniform(model.joints.lower, model.joints.upper)
    velocities = random.uniform(-1, 1, len(model.joints))
    state = StateMessage(model, reach=1.0).filled(positions, velocities, Timestamp())
    dt = 1e-6
    after, before = (tool_placement(model, positions + sign * dt * velocities) for sign in (0.5, -0.5))
    linear = (after[:3, 3] - before[:3, 3]) / dt
    turn = (after[:3, :3] - before[:3, :3]) / dt @ tool_placement(model, positions)[:3, :3].T
    v, w = state.linear_velocity, state.angular_velocity
    assert (v.x, v.y, v.z) == pytest.approx(linear, abs=1e-6)
    assert (w.x, w.y, w.z) == pytest.approx((turn[2, 1], turn[0, 2], turn[1, 0]), abs=1e-6)
    assert {margin.name for margin in state.limit_margins} >= set(model.joints.names)


@asynccontextmanager
async def kinematics_service(mesh):
    """Run the service of one arm; yield a client session."""
    async with open_session(mesh) as service, open_session(mesh) as client:
        settings = kinematics.Settings(site="hall", robots=(single_arm(),))
        service.declare_presence("hall", "arm", "kinematics")
        task = asyncio.create_task(kinematics.serve(service, settings))
        while await client.last("robomesh/hall/arm/description", timeout_s=0.2) is None:
            await asyncio.sleep(0.01)
        try:
            yield client
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)


def states_of(positions) -> JointStates:
    message = JointStates()
    for name, position in zip(("waist", "shoulder", "elbow", "wrist", "roll"), positions, strict=True):
        message.joints.add(name=name, position=position)
    return message


async def test_the_description_names_shapes_that_are_served_as_glb(mesh):
    async with kinematics_service(mesh) as session:
        description = await last_value(session, "robomesh/hall/arm/description")
        assert description.joints[0].name == "waist"
        assert description.provenance.startswith("nominal")
        assert description.provenance_zh.startswith("标称值")
        assert [joint.title_zh for joint in description.joints][:3] == ["腰部", "肩部", "肘部"]
        assert "<robot" in description.urdf
        assert 'name = "pt600"' in description.robot_toml
        for link in description.links:
            glb = await session.ask_bytes(f"robomesh/hall/arm/mesh/{link.mesh}")
            assert glb.startswith(b"glTF")
        with refused(codes.MESH_UNKNOWN, name="nose"):
            await session.ask_bytes("robomesh/hall/arm/mesh/nose")


async def test_frames_keep_their_rate_and_a_last_value_publishes_none(mesh):
    async with open_session(mesh) as gateway:
        joints = gateway.declare_publisher("hall", "arm", "joints")
        joints.put(states_of([0.5, 0.0, 0.0, 0.0, 0.0]))
        async with kinematics_service(mesh) as session:
            # The service joined after the controller's last message.
            frames = session.subscribe("robomesh/hall/arm/frames", newest=1000)
            old = await anext(frames)
            assert not old.live
            for number in range(100):
                joints.put(states_of([number / 100, 0.0, 0.0, 0.0, 0.0]))
                await asyncio.sleep(0.01)
            live = [await anext(frames)]
            while live[-1].header.sequence < 40:
                live.append(await anext(frames))
            assert all(sample.live for sample in live)
            spread_s = (live[-1].header.source_time_ns - live[0].header.source_time_ns) * 1e-9
            assert len(live) / spread_s < 66


async def test_an_arm_whose_encoders_flicker_stays_and_one_that_creeps_is_followed(mesh):
    async with open_session(mesh) as gateway, kinematics_service(mesh) as session:
        joints = gateway.declare_publisher("hall", "arm", "joints")
        frames = session.subscribe("robomesh/hall/arm/frames", newest=100)
        states = session.subscribe("robomesh/hall/arm/kinematics", newest=100)
        while not joints.watched:
            await asyncio.sleep(0.01)
        began_ns = time.time_ns()

        async def shown(number, position):
            """Return the messages without their time, and the position by its margin."""
            message = states_of([position, 0.0, 0.0, 0.0, 0.0])
            time_ns = began_ns + number * 100_000_000
            joints.put(message, source_time_ns=time_ns)

            async def of_it(subscription):
                # The first one may come twice: as the last value, then live.
                while (sample := await anext(subscription)).header.source_time_ns != time_ns:
                    pass
                return sample.message()

            frame, state = await of_it(frames), await of_it(states)
            lower = build_model(load("pt600")).joints.lower[0]
            placed = [(each.translation.x, each.translation.y, each.rotation.z) for each in frame.transforms]
            return placed, state.limit_margins[0].lower + lower, state.linear_velocity.y

        first = await shown(0, 0.5)
        for number in range(1, 6):
            flickered = await shown(number, 0.5 + 1e-5 * (number % 3 - 1))
            assert flickered[:2] == first[:2]
            assert flickered[2] or number == 1, "the velocity is of the joint states"
        for number in range(6, 30):
            placed, position, _ = await shown(number, 0.5 + 1e-5 * (number - 5))
            assert abs(position - (0.5 + 1e-5 * (number - 5))) < 4.5e-5
        assert placed != first[0]


async def test_joint_states_that_do_not_match_the_description_publish_no_frames(mesh):
    async with open_session(mesh) as gateway, kinematics_service(mesh) as session:
        joints = gateway.declare_publisher("hall", "arm", "joints")
        frames = session.subscribe("robomesh/hall/arm/frames", newest=10)
        while not joints.watched:
            await asyncio.sleep(0.01)
        wrong = states_of([1.0] * 5)
        wrong.joints[2].name = "nose"
        joints.put(wrong)
        joints.put(states_of([float("nan"), 0.0, 0.0, 0.0, 0.0]))
        await asyncio.sleep(0.02)
        joints.put(states_of([0.25, 0.0, 0.0, 0.0, 0.0]))
        sample = await anext(frames)
        assert sample.header.sequence == 1
        with refused(codes.JOINT_COUNT_OF_FIELD, count="1", joints="5"):
            await session.ask(
                "robomesh/hall/arm/kinematics/forward", schema.ForwardRequest(joint_positions=[1.0])
            )
        with pytest.raises(NoAnswerError):
            await session.ask(
                "robomesh/hall/other/kinematics/forward", schema.ForwardRequest(), timeout_s=0.2
            )
