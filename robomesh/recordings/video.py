"""Key frames of recorded video, where decoding can begin."""

from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from google.protobuf.message import DecodeError

from robomesh.recordings.h264 import is_key_frame


def holds_key_frame(payload: bytes) -> bool:
    """Return whether decoding can begin with this foxglove.CompressedVideo; False if it cannot be parsed."""
    try:
        message = CompressedVideo.FromString(payload)
    except DecodeError:
        return False
    return is_key_frame(message.data)
