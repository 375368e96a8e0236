"""Recordings for tests, written by the plain `mcap` writer, with known content."""

import math
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from google.protobuf.message import Message
from mcap.reader import make_reader
from mcap.writer import Writer
from mcap_protobuf.schema import register_schema

from robomesh.contract.header import Header
from robomesh.contract.topics import topic
from robomesh.recordings.recovery.rewrite import rewrite
from robomesh.recordings.writing.capture import Capture
from robomesh.schemas import robomesh_pb2 as schema
from robots.descriptions.description import load
from robots.descriptions.glb import link_glbs
from robots.descriptions.urdf.write import to_urdf
from services.kinematics.descriptions import describe

START_NS = 1_700_000_000_000_000_000
KEY_PICTURE = b"\x00\x00\x00\x01\x67sps\x00\x00\x00\x01\x68pps\x00\x00\x01\x65"
PICTURE = b"\x00\x00\x00\x01\x41"


@dataclass
class Written:
    """An MCAP file being written."""

    path: Path
    site: str = "site"
    robot: str = "arm"
    chunked: bool = True

    def __enter__(self) -> "Written":
        self._stream = self.path.open("wb")
        self._writer = Writer(self._stream, use_chunking=self.chunked, chunk_size=4096)
        self._writer.start(library="test")
        about = {"site": self.site, "robot": self.robot, "name": self.path.stem, "started_by": "request"}
        self._writer.add_metadata("robomesh", about)
        self._channels: dict[str, int] = {}
        return self

    def __exit__(self, *_: object) -> None:
        self._writer.finish()
        self._stream.close()

    def put(self, topic: str, message: Message, at_s: float, *, repeated: bool = False) -> None:
        """Put a message of the robot, received so long after the start.

        Args:
            repeated: It is published again with the time of the start.
        """
        key = f"robomesh/{self.site}/{self.robot}/{topic}"
        if key not in self._channels:
            number = register_schema(self._writer, type(message))
            self._channels[key] = self._writer.register_channel(key, "protobuf", number)
        time_ns = START_NS + round(at_s * 1e9)
        self._writer.add_message(
            self._channels[key],
            time_ns,
            message.SerializeToString(),
            (START_NS if repeated else time_ns) - 1000,
            int(at_s * 1e3),
        )

    def attach(self, name: str, data: bytes, media_type: str = "application/octet-stream") -> None:
        """Add an attachment."""
        self._writer.add_attachment(0, 0, name, media_type, data)


def joints(**positions: float) -> JointStates:
    """Return joint states."""
    message = JointStates()
    for name, position in positions.items():
        message.joints.add(name=name, position=position)
    return message


def write_recording(
    path: Path, *, seconds: float = 4.0, hz: float = 100.0, chunked: bool = True, video: bool = True
) -> Path:
    """Write an arm whose waist turns by 1 rad a second, and its other topics."""
    with Written(path, chunked=chunked) as file:
        file.put("description", schema.Description(name="pt600", title="Pt600", cell="a"), 0.0)
        file.attach("mesh/base", b"glTF of the base", "model/gltf-binary")
        for number in range(int(seconds * hz)):
            at_s = number / hz
            file.put("joints", joints(waist=at_s, elbow=-at_s), at_s)
            if number % 10 == 0:
                frames = FrameTransforms()
                frames.transforms.add(parent_frame_id="site", child_frame_id="site/arm/base")
                file.put("frames", frames, at_s)
            if number % int(hz) == 0:
                state = schema.ControllerState(link=schema.ControllerState.UP, rate_hz=hz)
                file.put("controller", state, at_s)
                file.put("events", schema.Event(code=f"second.{number // int(hz)}"), at_s)
            if video and number % 5 == 0:
                data = KEY_PICTURE if number % 50 == 0 else PICTURE
                picture = CompressedVideo(
                    format="h264", frame_id="site/arm/camera/front", data=data + b"%d" % number
                )
                file.put("video/front", picture, at_s)
    return path


def write_swinging_arm(path: Path) -> Path:
    """Write a Pt600 that swings its waist for 2 s, as its gateway and kinematics would publish it."""
    description = load("pt600")
    glbs = link_glbs(description)
    message = describe(
        description, urdf=to_urdf(description), shapes=glbs, base_to_site=np.eye(4), cell="", simulated=True
    )
    with Written(path) as file:
        file.put("description", message, 0.0)
        for name, glb in glbs.items():
            file.attach(f"mesh/{name}", glb)
        for number in range(201):
            at_s = number / 100
            home = {joint.name: joint.home for joint in message.joints}
            file.put("joints", joints(**home | {"waist": math.sin(at_s)}), at_s)
            file.put("controller", schema.ControllerState(link=schema.ControllerState.UP), at_s)
        file.put("events", schema.Event(severity=schema.Event.WARNING, code="odd"), 1.0)
    return path


def write_capture(
    path: Path, numbers: range, *, robot: str = "arm", closed: bool = True, missed: int = 0
) -> Path:
    """Write a recording of joint states with these numbers, 0.01 s apart, as the recorder does."""
    key = f"robomesh/site/{robot}/joints"
    about = {"site": "site", "robot": robot, "name": "trial", "started_by": "request"}
    capture = Capture(path, about, start_ns=START_NS + numbers[0] * 10_000_000)
    capture.attach("robot.toml", "application/toml", path.stem.encode(), time_ns=START_NS)
    for number in numbers:
        at_ns = START_NS + number * 10_000_000
        data = joints(waist=number).SerializeToString()
        capture.add(key, topic("joints"), Header(7, number, at_ns), data, received_ns=at_ns)
    if closed:
        capture.finish({key: missed})
        rewrite([path], path)
    else:
        capture.hand_over()
        capture.write_out()
        capture.give_up()
    return path


def merge(paths: list[Path], out: Path) -> Path:
    """Merge files as the `mcap` tools do: by receive time, and only if no two metadata records share a name.

    Raises:
        ValueError: If two share one.
    """
    with out.open("wb") as stream:
        writer = Writer(stream)
        writer.start(library="merge")
        names: set[str] = set()
        channels: dict[tuple[str, str], int] = {}
        messages: list[tuple[Any, int]] = []
        for path in paths:
            reader = make_reader(BytesIO(path.read_bytes()))
            for metadata in reader.iter_metadata():
                if metadata.name in names:
                    raise ValueError(f"metadata name '{metadata.name}' was previously encountered")
                names.add(metadata.name)
                writer.add_metadata(metadata.name, metadata.metadata)
            for each in reader.iter_attachments():
                writer.add_attachment(0, 0, each.name, each.media_type, each.data)
            for found, channel, message in reader.iter_messages():
                key = channel.topic, found.name
                if key not in channels:
                    number = writer.register_schema(found.name, found.encoding, found.data)
                    channels[key] = writer.register_channel(channel.topic, channel.message_encoding, number)
                messages.append((message, channels[key]))
        for message, number in sorted(messages, key=lambda each: each[0].log_time):
            writer.add_message(number, message.log_time, message.data, message.publish_time, message.sequence)
        writer.finish()
    return out
