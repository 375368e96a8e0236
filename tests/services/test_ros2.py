"""ROS 2 service, decoded by an independent client of rmw_zenoh's wire format."""

import asyncio
import hashlib
from contextlib import asynccontextmanager

import numpy as np
import pytest
import zenoh
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from rosbags.typesys import Stores, get_typestore
from zenoh_ros2_sdk import ROS2Subscriber, ZenohSession, get_topic_names_and_types
from zenoh_ros2_sdk.qos import QosDurability, QosProfile

from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import open_session
from services.ros2.bridge import JOINT_STATES, ROBOT_DESCRIPTION, TF
from services.ros2.service import serve
from services.ros2.settings import Settings
from services.ros2.wire import Topic
from tests.protocol_gateway.gateway_site import until

GLB = b"glTF" + bytes(60)
URDF = """<robot name="arm"><link name="base"/><link name="column"/>
<joint name="waist" type="revolute"><parent link="base"/><child link="column"/></joint></robot>"""
LATCHED = QosProfile(durability=QosDurability.TRANSIENT_LOCAL, history_depth=1)
DEFINITIONS = get_typestore(Stores.ROS2_JAZZY)


def definition(kind):
    """Return a type's definition with those of its fields' types, in ROS 2's format."""
    return DEFINITIONS.generate_msgdef(kind, ros_version=2)[0]


class Tools:
    """ROS 2 tools of an independent library on the mesh's router."""

    def __init__(self, port):
        self.port = port
        self.session = ZenohSession.get_instance("127.0.0.1", port)

    async def topics(self):
        found = await asyncio.to_thread(
            get_topic_names_and_types, domain_id=0, router_port=self.port, timeout=1.0
        )
        return {name: kind for name, (kind,) in found}

    async def echo(self, topic, kind, qos=None):
        """Subscribe to a topic; return the list that received messages are appended to."""
        got = []
        await asyncio.to_thread(
            ROS2Subscriber,
            topic,
            kind,
            got.append,
            msg_definition=definition(kind),
            domain_id=0,
            router_port=self.port,
            qos=qos,
            type_hash=DEFINITIONS.hash_rihs01(kind),
        )
        return got


@pytest.fixture
def tools(router):
    tools = Tools(int(router.rpartition(":")[2]))
    yield tools
    tools.session.close()


@asynccontextmanager
async def bridge(mesh, folder, **settings):
    async with open_session(mesh) as session:
        task = asyncio.create_task(serve(session, Settings(shapes=folder, **settings)))
        try:
            yield
            assert not task.done()
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)


@asynccontextmanager
async def robot_session(mesh, robot="arm"):
    """Open a session that publishes as a robot's services."""
    async with open_session(mesh) as session:

        async def shape_of(_):
            return GLB

        session.answer("hall", robot, "mesh/*", shape_of)
        yield session


def joints(position):
    states = JointStates()
    states.timestamp.FromNanoseconds(1_700_000_000_250_000_000)
    states.joints.add(name="waist", position=position, velocity=0.25)
    states.joints.add(name="shoulder", position=-1.0, velocity=-0.5)
    return states


def description(sha256):
    message = schema.Description(name="arm", urdf=URDF, base_to_site=np.eye(4).ravel())
    message.links.add(name="base", mesh="foot", mesh_sha256=sha256)
    message.links.add(name="column", mesh="bad", mesh_sha256="../../evil")
    return message


async def test_ros_2_lists_the_topics_with_their_types(mesh, tools, tmp_path):
    wanted = {f"/{topic.name}": topic.kind for topic in (JOINT_STATES, TF, ROBOT_DESCRIPTION)}
    async with bridge(mesh, tmp_path), asyncio.timeout(30):
        while not wanted.items() <= (await tools.topics()).items():
            await asyncio.sleep(0.05)
    async with asyncio.timeout(30):
        while await tools.topics():
            await asyncio.sleep(0.05)


async def test_joint_states_have_prefixed_names_and_the_gateways_time(mesh, tools, tmp_path):
    async with robot_session(mesh) as robot, bridge(mesh, tmp_path):
        states = robot.declare_publisher("hall", "arm", "joints")
        got = await tools.echo("/joint_states", JOINT_STATES.kind)
        await until(lambda: states.watched)
        while not got:
            states.put(joints(0.5))
            await asyncio.sleep(0.05)
        message = got[0]
        assert list(message.name) == ["hall/arm/waist", "hall/arm/shoulder"]
        assert list(message.position) == [0.5, -1.0]
        assert list(message.velocity) == [0.25, -0.5]
        assert len(message.effort) == 0
        assert (message.header.stamp.sec, message.header.stamp.nanosec) == (1_700_000_000, 250_000_000)


async def test_last_values_are_not_published_and_a_single_named_robot_has_plain_joint_names(
    mesh, tools, tmp_path
):
    async with robot_session(mesh) as robot, robot_session(mesh, "arm-2") as other:
        states = robot.declare_publisher("hall", "arm", "joints")
        states.remember(joints(1.0), source_time_ns=5)  # a last value of unknown age
        others = other.declare_publisher("hall", "arm-2", "joints")
        async with bridge(mesh, tmp_path, robots=("hall/arm",)):
            got = await tools.echo("/joint_states", JOINT_STATES.kind)
            await until(lambda: states.watched)
            far = joints(4.0)
            far.timestamp.seconds = 200_000_000_000  # beyond the range of a ROS 2 stamp
            while not got:
                others.put(joints(3.0))
                states.put(far)
                states.put(joints(2.0))
                await asyncio.sleep(0.05)
            assert {message.position[0] for message in got} == {2.0}
            assert list(got[0].name) == ["waist", "shoulder"]


async def test_frames_are_published_as_tf_in_the_sites_frame(mesh, tools, tmp_path):
    async with robot_session(mesh) as robot, bridge(mesh, tmp_path):
        publisher = robot.declare_publisher("hall", "arm", "frames")
        got = await tools.echo("/tf", TF.kind)
        frames = FrameTransforms()
        frame = frames.transforms.add(parent_frame_id="hall", child_frame_id="hall/arm/base")
        frame.timestamp.FromNanoseconds(7_000_000_009)
        frame.translation.x, frame.rotation.w = 1.5, 1.0
        await until(lambda: publisher.watched)
        while not got:
            publisher.put(frames)
            await asyncio.sleep(0.05)
        (stamped,) = got[0].transforms
        assert (stamped.header.frame_id, stamped.child_frame_id) == ("hall", "hall/arm/base")
        assert (stamped.header.stamp.sec, stamped.header.stamp.nanosec) == (7, 9)
        assert (stamped.transform.translation.x, stamped.transform.rotation.w) == (1.5, 1.0)


async def test_late_subscribers_get_the_description_of_all_robots_with_shape_files(mesh, tools, tmp_path):

    sha256 = hashlib.sha256(GLB).hexdigest()
    async with (
        robot_session(mesh) as robot,
        robot_session(mesh, "arm-2") as other,
        bridge(mesh, tmp_path / "meshes"),
    ):
        for session, name in ((robot, "arm"), (other, "arm-2")):
            session.declare_publisher("hall", name, "description").put(description(sha256))
        texts, got = set(), []
        async with asyncio.timeout(30):
            while not any("hall/arm-2/base" in text and "hall/arm/base" in text for text in texts):
                got = await tools.echo("/robot_description", ROBOT_DESCRIPTION.kind, LATCHED)
                texts |= {message.data for message in got}
        urdf = max(texts, key=len)
        assert 'joint name="hall/arm/waist"' in urdf
        file = tmp_path / "meshes" / f"{sha256}.glb"
        assert urdf.count(file.as_uri()) == 2
        assert file.read_bytes() == GLB
        assert "evil" not in urdf
        assert [each.name for each in (tmp_path / "meshes").iterdir()] == [file.name]


async def test_rmw_zenohs_subscription_gets_the_description_early_and_late(mesh, tmp_path):
    key, texts = ROBOT_DESCRIPTION.key(0), []

    def subscribed(session):
        """Subscribe as rmw_zenoh does for reliable and transient local."""
        return zenoh.ext.declare_advanced_subscriber(
            session,
            key,
            lambda sample: texts.append(sample.payload.to_bytes()),
            history=zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=1),
            recovery=zenoh.ext.RecoveryConfig(periodic_queries=None, heartbeat=True),
            subscriber_detection=True,
        )

    async with robot_session(mesh) as robot, open_session(mesh) as early, open_session(mesh) as late:
        robot.declare_publisher("hall", "arm", "description").put(description(""))
        before = subscribed(early.zenoh_session)
        async with bridge(mesh, tmp_path):
            await until(lambda: any(b"hall/arm/base" in text for text in texts))
            texts.clear()
            after = subscribed(late.zenoh_session)
            await until(lambda: any(b"hall/arm/base" in text for text in texts))
        before.undeclare()
        after.undeclare()


@pytest.mark.parametrize(
    ("topic", "hashed"),
    [
        (JOINT_STATES, "a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e"),
        (TF, "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"),
        (ROBOT_DESCRIPTION, "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"),
    ],
    ids=lambda each: each.name if isinstance(each, Topic) else "",
)
def test_types_have_the_hashes_that_ros_2_prints(topic, hashed):
    """Compare type hashes with those of `ros2 topic info --verbose`, Jazzy."""
    assert topic.type_hash == f"RIHS01_{hashed}"


async def test_keys_tokens_and_attachments_are_rmw_zenohs(mesh, tmp_path):
    """Compare with its sources and with other clients."""

    async with robot_session(mesh) as robot, open_session(mesh) as ros:
        taken, tokens = [], []
        found = ros.zenoh_session.declare_subscriber("7/joint_states/**", taken.append)
        alive = ros.zenoh_session.liveliness().declare_subscriber(
            "@ros2_lv/7/**", lambda token: tokens.append(str(token.key_expr)), history=True
        )
        async with bridge(mesh, tmp_path, domain=7, node="bridge"):
            states = robot.declare_publisher("hall", "arm", "joints")
            await until(lambda: states.watched)
            while len(taken) < 2:
                states.put(joints(0.5), source_time_ns=99)
                await asyncio.sleep(0.05)
            await until(lambda: len(tokens) >= 5)
        found.undeclare()
        alive.undeclare()
        first, second = (
            zenoh.ext.z_deserialize(tuple[zenoh.ext.Int64, zenoh.ext.Int64, bytes], each.attachment)
            for each in taken[:2]
        )
        assert (second[0] - first[0], first[1], len(first[2])) == (1, 99, 16)
        assert first[2] == second[2]
        assert taken[0].payload.to_bytes()[:4] == b"\0\1\0\0"
        assert ROBOT_DESCRIPTION.key(7).startswith("7/robot_description/std_msgs::msg::dds_::String_/RIHS01_")
        node = next(token for token in tokens if "/NN/" in token)
        assert node.endswith("/0/0/NN/%/%/bridge")
        publisher = next(token for token in tokens if "%robot_description" in token)
        assert "/MP/%/%/bridge/%robot_description/std_msgs::msg::dds_::String_/RIHS01_" in publisher
        assert publisher.endswith("/:1:,1:,:,:,,")
        assert any("%tf/" in token and token.endswith("/::,100:,:,:,,") for token in tokens)
