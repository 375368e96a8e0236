"""Samples as a page gets them: encoded once for all browsers that watch them; only the age differs."""

import functools
import struct
import time

from bus.header import pack
from bus.schemas.robomesh_pb2 import ToPage
from bus.subscription import Sample

# Field 1 of ToPage, a message; field 5 of its Sample, a double: fields of a message may come in any order.
_SAMPLE, _AGE = 0x0A, 0x29
_AGED = struct.Struct("<Bd")
# State of a moment, small: what is passed on to the last browser before so much else came.
_MOST_KEPT = 256


def state_bytes(sample: Sample) -> bytes:
    """A sample of state, its payload and attachment as they were, with its age where it is known."""
    return _aged(_shared(sample), sample)


def video_bytes(sample: Sample, *, key: str, step: int) -> bytes:
    """A picture.

    Args:
        key: As the page watches it.
        step: How far the view is reduced.
    """
    return _aged(_encoded(sample, key, step), sample)


def _aged(encoded: bytes, sample: Sample) -> bytes:
    if not sample.live:
        return encoded
    return encoded + _AGED.pack(_AGE, time.monotonic() - sample.received + sample.late_s)


@functools.lru_cache(_MOST_KEPT)
def _shared(sample: Sample) -> bytes:
    return _encoded(sample, sample.key, 0)


def _encoded(sample: Sample, key: str, step: int) -> bytes:
    """All but the age, whose bytes are counted where they are to follow."""
    body = ToPage.Sample(
        key=key, attachment=pack(sample.header), payload=sample.payload, live=sample.live, step=step
    ).SerializeToString()
    return bytes([_SAMPLE]) + _varint(len(body) + (_AGED.size if sample.live else 0)) + body


def _varint(value: int) -> bytes:
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)
