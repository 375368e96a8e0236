"""Rewriting of recorded messages for the replay's robot: frame ids, and the mark of a replay."""

from dataclasses import dataclass
from typing import Any

from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms

from robomesh.schemas import robomesh_pb2 as schema

_VIDEO = "video/"
RECORDED = "recorded-"


@dataclass(frozen=True)
class NameMapping:
    """Mapping from the recorded robot's names to the replay's."""

    of_site: str
    of_robot: str
    site: str
    robot: str

    def frame(self, frame_id: str) -> str:
        """Return the replay's id of a recorded frame."""
        site, slash, rest = frame_id.partition("/")
        if site != self.of_site:
            return frame_id
        robot, further, link = rest.partition("/")
        return self.site + slash + (self.robot if robot == self.of_robot else robot) + further + link

    def topic(self, recorded: str) -> str:
        """Return the replay's topic of a recorded one; other videos of the replay are a renderer's."""
        if recorded.startswith(_VIDEO):
            return f"{_VIDEO}{RECORDED}{recorded.removeprefix(_VIDEO)}"
        return recorded


def renamed(topic: str, payload: bytes, names: NameMapping, replay: schema.Description.Replay) -> bytes:
    """Return a recorded message rewritten for the replay.

    Raises:
        DecodeError: If it does not have its topic's schema.
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
        # Renderer and collision check must not count it among the live robots of the cell.
        message.cell = ""
    elif topic.startswith(_VIDEO):
        message = CompressedVideo.FromString(payload)
        message.frame_id = names.frame(message.frame_id)
    else:
        return payload
    changed: bytes = message.SerializeToString()
    return changed
