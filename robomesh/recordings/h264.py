"""H.264 byte streams in the Annex B format: units, key frames, sizes (ITU-T H.264, 7.3 and Annex B)."""

from collections.abc import Iterator

from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from google.protobuf.message import DecodeError

_START_CODE = b"\0\0\1"
# Types of NAL units (table 7-1).
SLICE, IDR_SLICE, SEQUENCE_PARAMETERS, PICTURE_PARAMETERS, DELIMITER = 1, 5, 7, 8, 9

# Profiles with colour format and bit depths in the set.
_HIGH = (100, 110, 122, 244, 44, 83, 86, 118, 128, 138, 139, 134, 135)

# More than any level of H.264 allows.
_MOST_PX = 16384


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


def picture_size(sps: bytes) -> tuple[int, int]:
    """Return width and height [px] of a sequence parameter set, given as a NAL unit.

    Raises:
        ValueError: If it is invalid or unsupported: interlaced, or not 4:2:0 in 8 bits.
    """
    # Remove emulation prevention bytes.
    bits = _Bits(sps[1:].replace(b"\0\0\3", b"\0\0"))
    profile = bits.take(8)
    bits.take(16)
    bits.golomb()
    if profile in _HIGH:
        # Colour format, depths, lossless, scaling lists.
        colours = bits.golomb(), bits.golomb(), bits.golomb(), bits.take(1), bits.take(1)
    else:
        colours = 1, 0, 0, 0, 0
    if colours != (1, 0, 0, 0, 0):
        raise ValueError(f"H.264 of profile {profile} is not 4:2:0 in 8 bits, which is not supported")
    bits.golomb()
    order = bits.golomb()
    if order == 0:
        bits.golomb()
    elif order == 1:
        raise ValueError("H.264 with a picture order of type 1 is not supported")
    bits.golomb()
    bits.take(1)
    width, height = 16 * (bits.golomb() + 1), 16 * (bits.golomb() + 1)
    if not bits.take(1):
        raise ValueError("interlaced H.264 is not supported")
    bits.take(1)
    if bits.take(1):
        left, right, top, bottom = (bits.golomb() for _ in range(4))
        width, height = width - 2 * (left + right), height - 2 * (top + bottom)
    if not (0 < width <= _MOST_PX and 0 < height <= _MOST_PX):
        raise ValueError(f"H.264 of {width} x {height} pixels is not supported")
    return width, height


class _Bits:
    def __init__(self, data: bytes) -> None:
        self._bits = "".join(f"{byte:08b}" for byte in data)
        self._at = 0

    def take(self, count: int) -> int:
        bits = self._bits[self._at : self._at + count]
        if len(bits) < count:
            raise ValueError("the sequence parameter set is truncated")
        self._at += count
        return int(bits, 2) if bits else 0

    def golomb(self) -> int:
        """Return an unsigned Exp-Golomb number, ue(v)."""
        zeros = 0
        while not self.take(1):
            zeros += 1
        return (1 << zeros) - 1 + self.take(zeros)
