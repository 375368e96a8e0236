"""Recorded messages as the replay's own robot publishes them: its frames, and marked as a replay."""

from dataclasses import dataclass
from typing import Any

from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms

from robomesh.schemas import robomesh_pb2 as schema

_VIDEO = "video/"
RECORDED = "recorded-"


@dataclass(frozen=True)
class Names:
    """Whose recording is played as which robot."""

    of_site: str
    of_robot: str
    site: str
    robot: str

    def frame(self, frame_id: str) -> str:
        """A recorded frame's id as the replay has it."""
        site, slash, rest = frame_id.partition("/")
        if site != self.of_site:
            return frame_id
        robot, further, link = rest.partition("/")
        return self.site + slash + (self.robot if robot == self.of_robot else robot) + further + link

    def topic(self, recorded: str) -> str:
        """The topic under which a recorded one is published; a renderer draws the replay's other views."""
        if recorded.startswith(_VIDEO):
            return f"{_VIDEO}{RECORDED}{recorded.removeprefix(_VIDEO)}"
        return recorded


def renamed(topic: str, payload: bytes, names: Names, replay: schema.Description.Replay) -> bytes:
    """A recorded message as the replay publishes it.

    Raises:
        DecodeError: If it is not what its topic says.
    """
    message: Any
    if topic == "frames":
        message = FrameTransforms.FromString(payload)
        for transform in message.transforms:
            transform.parent_frame_id = names.frame(transform.parent_frame_id)
            transform.child_frame_id = names.frame(transform.child_frame_id)
    elif topic == "kinematics":
        message = schema.KinematicState.FromString(payload)
        for field in ("clearance", "own_clearance"):
            if message.HasField(field):
                clearance = getattr(message, field)
                clearance.first = names.frame(clearance.first)
                clearance.second = names.frame(clearance.second)
    elif topic == "description":
        message = schema.Description.FromString(payload)
        message.replay.CopyFrom(replay)
        # Nobody draws it among the live robots of a cell, or checks against it.
        message.cell = ""
    elif topic.startswith(_VIDEO):
        message = CompressedVideo.FromString(payload)
        message.frame_id = names.frame(message.frame_id)
    else:
        return payload
    changed: bytes = message.SerializeToString()
    return changed
