"""H.264 byte streams in the Annex B format (ITU-T H.264, Annex B)."""

from collections.abc import Iterator

from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from google.protobuf.message import DecodeError

_START_CODE = b"\0\0\1"
# Types of NAL units (table 7-1).
SLICE, IDR_SLICE, SEQUENCE_PARAMETERS, PICTURE_PARAMETERS, DELIMITER = 1, 5, 7, 8, 9


def nal_units(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield the type of each NAL unit, and the unit."""
    at = data.find(_START_CODE)
    while at >= 0:
        start, at = at + 3, data.find(_START_CODE, at + 3)
        # Zeros before a start code belong to it; a unit never ends with a zero.
        unit = (data[start:at] if at >= 0 else data[start:]).rstrip(b"\0")
        if unit:
            yield unit[0] & 0x1F, unit


def is_key_frame(data: bytes) -> bool:
    """Return whether a decoder can begin with this picture: it has parameter sets or an IDR slice."""
    # The parameter sets come before the first slice.
    first = (kind for kind, _ in nal_units(data) if kind in (SLICE, IDR_SLICE, SEQUENCE_PARAMETERS))
    return next(first, SLICE) != SLICE


def holds_key_frame(payload: bytes) -> bool:
    """Return whether decoding can begin with this foxglove.CompressedVideo; False if it cannot be parsed."""
    try:
        return is_key_frame(CompressedVideo.FromString(payload).data)
    except DecodeError:
        return False
