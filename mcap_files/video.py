"""What must be known of recorded video to begin in its middle."""

from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from google.protobuf.message import DecodeError

_START = b"\x00\x00\x01"
_SLICE, _KEY_SLICE, _PARAMETERS = 1, 5, 7


def is_key_frame(payload: bytes) -> bool:
    """Whether decoding can begin with this foxglove.CompressedVideo (H.264, Annex B)."""
    try:
        data = CompressedVideo.FromString(payload).data
    except DecodeError:
        return False
    at = data.find(_START)
    while 0 <= at < len(data) - 3:
        kind = data[at + 3] & 0x1F
        if kind in (_KEY_SLICE, _PARAMETERS):
            return True
        if kind == _SLICE:
            return False
        at = data.find(_START, at + 3)
    return False
