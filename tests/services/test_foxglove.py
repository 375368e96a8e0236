"""Foxglove service, tested with an independent client of Foxglove's protocol."""

import asyncio
import xml.etree.ElementTree as ET
from contextlib import asynccontextmanager

import av
import numpy as np
import zenoh
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from foxglove_schemas_protobuf.Log_pb2 import Log

from renderer.encoding.encoder import H264Encoder
from robomesh.contract.endpoints import router_config
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import SessionSettings, open_session
from services.foxglove.server import serve
from services.foxglove.settings import Settings
from tests.ports import free_port
from tests.protocol_gateway.gateway_site import STATE, gateway, simulator
from tests.services.foxglove_client import attached

ARM = "robomesh/hall/arm"
GLB = b"glTF" + bytes(60)
URDF = """<robot name="arm"><link name="base"/><link name="column"/>
<joint name="waist" type="revolute"><parent link="base"/><child link="column"/></joint></robot>"""


@asynccontextmanager
async def bridge(mesh, **settings):
    """Run the service; yield its address."""
    ready = asyncio.get_running_loop().create_future()
    async with open_session(mesh) as session:
        settings = Settings(**{"listen": "127.0.0.1:0", **settings})
        task = asyncio.create_task(serve(session, settings, on_ready=ready.set_result))
        await asyncio.wait([ready, task], return_when=asyncio.FIRST_COMPLETED)
        if task.done():
            await task
        try:
            yield await ready
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)


@asynccontextmanager
async def robot_session(mesh, robot="arm"):
    """Open a session that acts as a robot's services, with presence and meshes."""
    async with open_session(mesh) as session:

        async def shape_of(_):
            return GLB

        session.answer("hall", robot, "mesh/*", shape_of)
        session.declare_presence("hall", robot, "gateway")
        yield session


def description():
    message = schema.Description(name="arm", urdf=URDF, base_to_site=np.eye(4).ravel())
    message.links.add(name="base", mesh="foot")
    message.links.add(name="column")
    message.views.add(name="front")
    message.fixtures.add(name="table", mesh="fixture.table", fixture_to_site=np.eye(4).ravel())
    return message


def joints(position):
    states = JointStates()
    states.joints.add(name="waist", position=position)
    return states


async def test_a_client_gets_states_with_their_own_times_and_events_as_logs(mesh):
    async with robot_session(mesh) as robot, bridge(mesh) as address, attached(address) as client:
        publishers = {name: robot.declare_publisher("hall", "arm", name) for name in ("joints", "frames")}
        events = robot.declare_publisher("hall", "arm", "events")
        events.put(schema.Event(severity=schema.Event.ERROR, code="a.b", text="so", source="gateway"))
        for name in ("joints", "frames", "log"):
            await client.subscribe(f"{ARM}/{name}")
        await client.until(lambda: all(each.watched for each in publishers.values()))
        publishers["joints"].put(joints(0.5), source_time_ns=1_700_000_000_123_456_789)
        frames = FrameTransforms()
        frames.transforms.add(parent_frame_id="hall", child_frame_id="hall/arm/base")
        publishers["frames"].put(frames)

        states = await client.first(f"{ARM}/joints", JointStates)
        assert states.joints[0].position == 0.5
        assert client.got[f"{ARM}/joints"][0][0] == 1_700_000_000_123_456_789
        frames = await client.first(f"{ARM}/frames", FrameTransforms)
        assert frames.transforms[0].child_frame_id == "hall/arm/base"
        log = await client.first(f"{ARM}/log", Log)
        assert (log.level, log.message, log.name) == (Log.ERROR, "so [a.b]", "hall/arm gateway")
        assert client.channels[f"{ARM}/joints"]["schemaName"] == "foxglove.JointStates"


async def test_last_joints_are_not_shown_and_a_last_controller_state_keeps_its_time(mesh):
    async with robot_session(mesh) as robot, bridge(mesh) as address, attached(address) as client:
        states = robot.declare_publisher("hall", "arm", "joints")
        states.remember(joints(1.0), source_time_ns=5)  # a last value of unknown age
        controller = robot.declare_publisher("hall", "arm", "controller")
        controller.put(schema.ControllerState(fault="f1"), source_time_ns=5)
        for name in ("joints", "controller"):
            await client.subscribe(f"{ARM}/{name}")
        assert (await client.first(f"{ARM}/controller", schema.ControllerState)).fault == "f1"
        assert client.got[f"{ARM}/controller"][0][0] == 5
        await client.until(lambda: states.watched)
        states.put(joints(2.0))
        assert (await client.first(f"{ARM}/joints", JointStates)).joints[0].position == 2.0


async def test_the_description_of_all_robots_names_shapes_that_can_be_fetched(mesh):
    async with (
        robot_session(mesh) as robot,
        robot_session(mesh, "arm-2") as other,
        bridge(mesh) as address,
    ):
        publishers = [
            robot.declare_publisher("hall", "arm", "description"),
            other.declare_publisher("hall", "arm-2", "description"),
        ]
        for publisher in publishers:
            publisher.put(description())
        async with attached(address) as client:
            await client.subscribe("/robot_description")
            texts = client.got["/robot_description"]
            await client.until(lambda: texts and b"hall/arm-2/base" in texts[-1][1])
            urdf = ET.fromstring(texts[-1][1][8:-1])
            # The frames place the links: joints would place them at zero.
            joints = {joint.get("name") for joint in urdf.iter("joint")}
            assert "hall/table_in_hall" in joints
            assert not [name for name in joints if name.endswith("waist")]
            uris = [each.get("filename") for each in urdf.iter("mesh")]
            # The table of the cell is in both robots' descriptions and shown once.
            assert len(uris) == 3
            assert {f"package://robomesh/hall/{name}/foot.glb" for name in ("arm", "arm-2")} < set(uris)
            assert "hall/table" in {link.get("name") for link in urdf.iter("link")}
            for uri in uris:
                assert await client.asset(uri) == GLB
            for wrong in ("package://robomesh/hall/arm/../../x.glb", "file:///etc/passwd"):
                assert "not found" in str(await client.asset(wrong))


async def test_video_decodes_and_is_subscribed_only_while_a_client_watches(mesh):
    encoder, requests = H264Encoder((320, 240), 30, codec="libx264"), []

    def frame(number, *, key_frame):
        picture = np.full((240, 320, 3), 10 * number, dtype=np.uint8)
        packet = encoder.encode(picture, key_frame=key_frame)
        video.put(CompressedVideo(data=packet.data, format="h264"), key_frame=packet.key_frame)

    async def key_frame(request):
        requests.append(request)
        return schema.KeyFrameAnswer()

    async with robot_session(mesh) as robot, bridge(mesh) as address, attached(address) as client:
        robot.declare_publisher("hall", "arm", "description").put(description())
        robot.answer("hall", "arm", "video/*/keyframe/*", key_frame)
        video = robot.declare_publisher("hall", "arm", "video/front")
        for number in range(3):
            frame(number, key_frame=number == 0)
        await client.until(lambda: f"{ARM}/video/front" in client.channels)
        assert not video.watched
        watching = await client.subscribe(f"{ARM}/video/front")
        await client.until(lambda: video.watched)
        got = client.got[f"{ARM}/video/front"]
        await client.until(lambda: len(got) >= 3)  # since the earlier key frame
        frame(3, key_frame=False)
        await client.until(lambda: len(got) >= 4)
        decoder = av.CodecContext.create("h264", "r")
        pictures = [
            picture
            for _, payload in got
            for picture in decoder.decode(av.Packet(CompressedVideo.FromString(payload).data))
        ] + decoder.decode(None)
        assert len(pictures) == 4
        async with attached(address) as second:
            await second.subscribe(f"{ARM}/video/front")
            await client.until(lambda: requests)
        await client.unsubscribe(watching)
        await client.until(lambda: not video.watched)


async def test_a_client_that_never_reads_does_not_delay_another(mesh):
    async with robot_session(mesh) as robot, bridge(mesh) as address, attached(address) as client:
        robot.declare_publisher("hall", "arm", "description").put(description())
        video = robot.declare_publisher("hall", "arm", "video/front")
        states = robot.declare_publisher("hall", "arm", "joints")
        async with attached(address) as stalled:
            await stalled.subscribe(f"{ARM}/video/front")
            await client.until(lambda: video.watched)
            stalled.stop_reading()
            for _ in range(200):
                video.put(CompressedVideo(data=bytes(100_000)), key_frame=True)
                await asyncio.sleep(0)
            await client.subscribe(f"{ARM}/joints")
            await client.until(lambda: states.watched)
            for number in range(50):
                states.put(joints(number))
                await client.until(lambda number=number: len(client.got[f"{ARM}/joints"]) > number)


async def test_a_later_client_gets_the_earlier_events_and_no_client_gets_them_twice(mesh):
    async with robot_session(mesh) as robot, bridge(mesh) as address, attached(address) as first:
        events = robot.declare_publisher("hall", "arm", "events")
        events.put(schema.Event(code="one"))
        await first.subscribe(f"{ARM}/log")
        await first.first(f"{ARM}/log")
        async with attached(address) as second:
            await second.subscribe(f"{ARM}/log")
            await second.first(f"{ARM}/log")
            events.put(schema.Event(code="two"))
            for client in (first, second):
                got = client.got[f"{ARM}/log"]
                await client.until(lambda got=got: len(got) >= 2)
                codes = [Log.FromString(payload).message for _, payload in got]
                assert codes == [" [one]", " [two]"]


async def called(client, name, **values):
    """Call a command; retry if a busy machine did not renew the bridge's control in time."""
    while not (answer := await client.call(f"{ARM}/{name}", **values))["accepted"]:
        assert "take control first" in answer["text"], answer


async def test_commands_are_one_operators_and_control_ends_with_their_client(mesh, tmp_path):
    async with (
        simulator(rate_hz=50) as port,
        gateway(mesh, tmp_path, port) as plant,
        bridge(mesh, operator="li") as address,
    ):
        plant.own.declare_presence("hall", "arm", "gateway")
        async with attached(address) as client, attached(address) as other:
            answer = await client.call(f"{ARM}/home")
            assert not answer["accepted"]
            assert "is not subscribed to hall/arm" in answer["text"]
            await client.subscribe(f"{ARM}/joints")
            await client.first(f"{ARM}/joints")
            answer = await client.call(f"{ARM}/move_absolute", joint_positions=[1.0, float("nan")])
            assert "not finite" in answer["text"]
            answer = await client.call(f"{ARM}/home", at="once")
            assert answer["text"] == "home has no field 'at'; it takes nothing: {}"
            await called(client, "home")
            await client.until(lambda: plant.controller.homed == STATE.YES)
            await client.until(lambda: not plant.seen["lease"][-1].holder)
            await called(client, "speed", speed_percent=5.0)  # a busy machine sees it move
            await called(client, "move_absolute", joint_positions=[2.0, 0.5, 0.5, 0.5, 0.5])
            await client.until(lambda: plant.controller.activity == STATE.MOVING)
            assert plant.seen["lease"][-1].holder == "li"
            # Another client is refused; the first one keeps control.
            answer = await other.call(f"{ARM}/hold")
            assert "li is in control with another lease" in answer["text"]
            # The client keeps control while the arm moves.
            assert (await client.call(f"{ARM}/hold"))["accepted"]
            await client.until(lambda: plant.controller.activity == STATE.HOLDING)
            assert (await client.call(f"{ARM}/resume"))["accepted"]
            await client.until(lambda: plant.controller.activity == STATE.MOVING)
        # The client disconnected during the motion.
        await client.until(lambda: not plant.seen["lease"][-1].holder)
        await client.until(lambda: plant.controller.HasField("stop"))


async def test_without_an_operator_only_stop_is_offered(mesh, tmp_path):
    async with (
        simulator(rate_hz=50) as port,
        gateway(mesh, tmp_path, port) as plant,
        bridge(mesh) as address,
        attached(address) as client,
    ):
        plant.own.declare_presence("hall", "arm", "gateway")
        answer = await client.call(f"{ARM}/stop", reason="smoke")
        assert answer["accepted"], answer
        assert list(client.services) == [f"{ARM}/stop"]
        await client.until(lambda: plant.controller.HasField("stop"))
        assert plant.controller.stop.reason == "smoke"


async def test_only_named_robots_are_shown(mesh):
    async with robot_session(mesh) as robot, robot_session(mesh, "arm-2") as other:
        publishers = [
            robot.declare_publisher("hall", "arm", "description"),
            other.declare_publisher("hall", "arm-2", "description"),
        ]
        for publisher in publishers:
            publisher.put(description())
        async with bridge(mesh, robots=("hall/arm",)) as address, attached(address) as client:
            await client.subscribe("/robot_description")
            got = client.got["/robot_description"]
            await client.until(lambda: got and b"hall/arm/base" in got[-1][1])
            await client.until(lambda: f"{ARM}/video/front" in client.channels)
            assert not [name for name in client.channels if "arm-2" in name]


async def test_a_robots_channels_are_removed_when_it_goes_offline_and_added_on_return(mesh):
    async with open_session(mesh) as kinematics, bridge(mesh, gone_after_s=0.1) as address:
        kinematics.declare_publisher("hall", "arm", "description").put(description())
        async with attached(address) as client:
            view = f"{ARM}/video/front"
            for _ in range(2):
                async with robot_session(mesh):
                    await client.until(lambda: view in client.channels)
                    before = client.channels.pop(view)["id"]
                await client.until(lambda before=before: before in client.gone)


async def test_names_that_are_invalid_in_keys_are_ignored(mesh):
    async with robot_session(mesh) as robot, bridge(mesh) as address, attached(address) as client:
        message = description()
        message.views.add(name="../../x y")
        robot.declare_publisher("hall", "arm", "description").put(message)
        token = robot.zenoh_session.liveliness().declare_token("robomesh/HALL/a b/alive/gateway/0")
        await client.until(lambda: f"{ARM}/joints" in client.channels)
        states = robot.declare_publisher("hall", "arm", "joints")
        await client.subscribe(f"{ARM}/joints")
        await client.until(lambda: states.watched)
        states.put(joints(1.0))
        await client.first(f"{ARM}/joints")
        token.undeclare()


async def test_states_arrive_again_after_a_routers_restart():
    mesh = SessionSettings(connect=(f"tcp/127.0.0.1:{free_port()}",), wait_s=5.0)
    endpoint = mesh.connect[0]
    router = zenoh.open(router_config((endpoint,)))
    try:
        async with robot_session(mesh) as robot, bridge(mesh) as address, attached(address) as client:
            states = robot.declare_publisher("hall", "arm", "joints")
            await client.subscribe(f"{ARM}/joints")
            await client.until(lambda: states.watched)
            states.put(joints(1.0))
            await client.first(f"{ARM}/joints")
            await asyncio.to_thread(router.close)
            await client.until(lambda: not robot.connected)
            router = zenoh.open(router_config((endpoint,)))
            got, before = client.got[f"{ARM}/joints"], len(client.got[f"{ARM}/joints"])
            async with asyncio.timeout(60):
                while len(got) == before:
                    states.put(joints(2.0))
                    await asyncio.sleep(0.05)
    finally:
        await asyncio.to_thread(router.close)
