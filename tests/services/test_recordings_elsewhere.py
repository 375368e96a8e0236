"""The recorder's files in other programs: plain MCAP readers, PyAV, Rerun."""

import asyncio
import xml.etree.ElementTree as ET

import av
import numpy as np
import pytest
import zenoh
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from renderer.encoding.encoder import H264Encoder
from robomesh.contract.endpoints import router_config
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import SessionSettings
from services.recorder.attachments import without_secrets
from tests.conftest import run
from tests.ports import free_port
from tests.services.recording import put_states, recording_site, trace_off, trace_on, until, until_indexed

STATES, PICTURES = 100, 60
SITE_FILE = 'site = "site"\n[router]\ntls = { ca = "ca.pem", key = "site.key" }\npassword = "geheim"\n'
URDF = """<robot name="arm"><link name="base"/><link name="column"/>
<joint name="waist" type="revolute"><parent link="base"/><child link="column"/></joint></robot>"""
GLB = b"glTF" + bytes(60)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Record joints, frames and video; return the finished file and each picture's time."""

    endpoint = f"tcp/127.0.0.1:{free_port()}"
    folder = tmp_path_factory.mktemp("recordings")
    with zenoh.open(router_config((endpoint,))):
        mesh = SessionSettings(connect=(endpoint,), wait_s=10.0)
        return run(record(mesh, folder), timeout_s=60.0)


async def record(mesh, folder):
    site_file = without_secrets(SITE_FILE)
    async with recording_site(mesh, folder, site_file=site_file, views=("front",)) as session:
        publishers = {
            name: session.declare_publisher("site", "arm", name)
            for name in ("joints", "frames", "video/front", "video/top", "description", "image/far")
        }

        async def shape_of(_):
            return GLB

        session.answer("site", "arm", "mesh/*", shape_of)
        description = schema.Description(name="arm", urdf=URDF, robot_toml='name = "arm"')
        description.links.add(name="base", mesh="base", mesh_sha256="00")
        description.links.add(name="column")
        publishers["description"].put(description)
        # A key frame before the recording: its video must begin with that frame.
        encoder = H264Encoder((320, 240), 30, codec="libx264")
        put_picture(publishers["video/front"], encoder, 0)
        begun = await trace_on(session)
        await until(lambda: publishers["joints"].watched and publishers["video/front"].watched)
        assert not publishers["video/top"].watched, "a view that is not recorded is rendered"
        await put_states(publishers["joints"], range(STATES), hz=500)
        times = [put_picture(publishers["video/front"], encoder, number) for number in range(1, PICTURES)]
        frames = FrameTransforms()
        frames.transforms.add(parent_frame_id="site/arm/base", child_frame_id="site/arm/column")
        publishers["frames"].put(frames)
        await counted(session, {"joints": STATES, "video/front": PICTURES - 1, "frames": 1})
        done = await trace_off(session)
        assert done.file == begun.file
        path = folder / "arm" / done.file
        await until_indexed(path)
        return path, times


async def counted(session, wanted):
    """Wait until the recorder reports this many messages of each topic."""
    counts = {}
    while any(counts.get(name, 0) < number for name, number in wanted.items()):
        state = await session.last("robomesh/site/arm/recording")
        counts = {each.topic.split("/", 3)[3]: each.messages for each in state.topics} if state else {}
        await asyncio.sleep(0.05)


def put_picture(publisher, encoder, number):
    picture = np.zeros((240, 320, 3), dtype=np.uint8)
    picture[:, : 5 * number] = 255
    packet = encoder.encode(picture, key_frame=number % 20 == 0)
    message = CompressedVideo(frame_id="site/arm/front", data=packet.data, format="h264")
    message.timestamp.GetCurrentTime()
    publisher.put(message, key_frame=packet.key_frame)
    return message.timestamp.ToNanoseconds()


def messages(path, topic):
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        return [(m, decoded) for _, _, m, decoded in reader.iter_decoded_messages(topics=[topic])]


@pytest.mark.slow
def test_plain_readers_find_every_message_once_in_order(recorded):
    path, _ = recorded
    joints = messages(path, "robomesh/site/arm/joints")
    assert [decoded.joints[0].position for _, decoded in joints] == list(range(STATES))
    for message, decoded in joints:
        sent_ns = decoded.timestamp.ToNanoseconds()
        assert abs(message.publish_time - sent_ns) < 1e9
        assert -0.1e9 < message.log_time - sent_ns < 5e9
    times = [message.log_time for message, _ in joints]
    assert times == sorted(times)


def test_video_begins_with_a_key_frame_and_every_picture_decodes(recorded):
    path, times = recorded
    video = messages(path, "robomesh/site/arm/video/front")
    assert len(video) == PICTURES
    assert [decoded.timestamp.ToNanoseconds() for _, decoded in video][1:] == times
    decoder = av.CodecContext.create("h264", "r")
    frames = []
    for _, decoded in video:
        frames += decoder.decode(av.Packet(decoded.data))
    frames += decoder.decode(None)
    assert len(frames) == PICTURES
    white = [(frame.to_ndarray(format="gray") > 128).mean() for frame in frames]
    assert white == pytest.approx([5 * number / 320 for number in range(PICTURES)], abs=0.02)


def test_a_file_is_self_contained(recorded):
    path, _ = recorded
    with path.open("rb") as stream:
        reader = make_reader(stream)
        attached = {each.name: bytes(each.data) for each in reader.iter_attachments()}
        metadata = {each.name: each.metadata for each in reader.iter_metadata()}
        (text,) = [m.data for _, _, m in reader.iter_messages(topics=["/robot_description"])]
        schemas = {
            c.topic: reader.get_summary().schemas[c.schema_id] for c in reader.get_summary().channels.values()
        }
    assert attached["robot.urdf"].decode() == URDF
    assert attached["robot.toml"] == b'name = "arm"'
    assert attached["mesh/base"] == GLB
    assert b'site = "site"' in attached["site.toml"]
    assert b"geheim" not in attached["site.toml"]
    assert b"site.key" not in attached["site.toml"]
    assert metadata[f"robomesh:site/arm/{path.stem}"]["robot"] == "arm"
    assert schemas["/robot_description"].name == "std_msgs/msg/String"
    urdf = ET.fromstring(text[8:-1].decode())
    # Links with a shape; the frames place them.
    assert [link.get("name") for link in urdf.iter("link")] == ["site/arm/base"]
    assert urdf.find("joint") is None
    assert urdf.find("link/visual/geometry/mesh").get("filename").startswith("data:model/gltf-binary;base64,")


@pytest.mark.slow
def test_rerun_opens_it_with_frames_joints_and_video(recorded):
    chunk = pytest.importorskip("rerun.chunk")
    path, _ = recorded
    rows = {}
    pictures = []
    for each in chunk.McapReader(str(path)).stream():
        batch = each.to_record_batch()
        for column in batch.schema.names:
            if column.endswith("VideoStream:sample"):
                pictures += [row for row in batch.column(column).to_pylist() if row]
            if "parent_frame" in column:
                rows["frames"] = batch.column(column).to_pylist()
        if "joints" in str(each.entity_path):
            rows["joints"] = max(rows.get("joints", 0), each.num_rows)
    assert len(pictures) == PICTURES
    assert rows["frames"] == [["site/arm/base"]]
    assert rows["joints"] == STATES
