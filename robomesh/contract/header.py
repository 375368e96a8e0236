"""The attachment of every publication: publisher id, sequence number, source time.

24 bytes, little-endian: publisher (uint64, new at each start), sequence (uint64, from 1),
source time (int64, ns since the Unix epoch).
"""

import struct
from typing import NamedTuple

from robomesh.errors import MessageError

_LAYOUT = struct.Struct("<QQq")


class Header(NamedTuple):
    """A decoded attachment."""

    publisher: int
    sequence: int
    source_time_ns: int


def pack(header: Header) -> bytes:
    """Return the 24 bytes of an attachment."""
    return _LAYOUT.pack(*header)


def unpack(attachment: bytes) -> Header:
    """Decode an attachment.

    Raises:
        MessageError: If it does not have 24 bytes.
    """
    if len(attachment) != _LAYOUT.size:
        raise MessageError(f"the attachment has {len(attachment)} bytes instead of {_LAYOUT.size}")
    return Header(*_LAYOUT.unpack(attachment))
