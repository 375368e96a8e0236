"""The attachment of every publication: who published it, its number, its source time.

24 bytes, little-endian: publisher (uint64, new at each start), sequence (uint64, from 1),
source time (int64, ns since the Unix epoch).
"""

import struct
from typing import NamedTuple

from robomesh.errors import MessageError

_LAYOUT = struct.Struct("<QQq")


class Header(NamedTuple):
    """An attachment, decoded."""

    publisher: int
    sequence: int
    source_time_ns: int


def pack(header: Header) -> bytes:
    """The attachment's 24 bytes."""
    return _LAYOUT.pack(*header)


def unpack(attachment: bytes) -> Header:
    """A header from an attachment.

    Raises:
        MessageError: If it does not have 24 bytes.
    """
    if len(attachment) != _LAYOUT.size:
        raise MessageError(f"an attachment of {len(attachment)} bytes: {_LAYOUT.size} are right")
    return Header(*_LAYOUT.unpack(attachment))
