"""Questions and answers of SNPX, as the controller reads and writes them."""

from dataclasses import dataclass
from struct import Struct

from controllers.fanuc.srtp import (
    ANSWER,
    CONNECTED,
    HEADER_BYTES,
    INLINE_BYTES,
    LONG,
    LONG_DONE,
    REFUSED,
    SHORT,
    SHORT_DONE,
)

MOST_TEXT = 2048
_HEAD = Struct("<BxHHxxxBxxxxxxxBxxxxxxxxxxxxBBIIBB")
_ADDRESS = Struct("<BBHH")
_CLIENT, _SERVER = 0x3A30, 0x0E10
# Of a controller that runs, as captured from one.
_STATE = bytes.fromhex("0101ff0400007c21")


@dataclass(frozen=True, slots=True)
class Packet:
    """A client's packet.

    Attributes:
        kind: 0: the first of a connection.
        numbers: Bytes 2 to 3, and 30; the answer repeats them.
        service, area, first, count: Zero in the first packet.
        text: Written text or data.
    """

    kind: int
    numbers: tuple[int, int]
    service: int
    area: int
    first: int
    count: int
    text: bytes


class PacketStream:
    """Packets in the bytes of one connection.

    Attributes:
        broken: The bytes are not packets; nothing more can be read.
    """

    def __init__(self) -> None:
        self._rest = b""
        self.broken = False

    def receive(self, data: bytes) -> list[Packet]:
        """Return the packets that are complete now."""
        data = self._rest + data
        found, at = [], 0
        while len(data) - at >= HEADER_BYTES and not self.broken:
            kind, number, size, _, _, second, type_, *_ = _HEAD.unpack_from(data, at)
            if kind not in (0, 2, 8) or size > MOST_TEXT or (kind and type_ not in (SHORT, LONG)):
                self.broken = True
                break
            end = at + HEADER_BYTES + size
            if end > len(data):
                break
            place = at + (50 if type_ == LONG else 42)
            service, area, first, count = _ADDRESS.unpack_from(data, place) if kind else (0, 0, 0, 0)
            # Up to six bytes are written within the header.
            text = data[at + HEADER_BYTES : end] if type_ == LONG else data[at + 48 : at + 54]
            found.append(Packet(kind, (number, second), service, area, first, count, text))
            at = end
        self._rest = b"" if self.broken else data[at:]
        return found


def connected() -> bytes:
    """Return the first answer of a connection, as an R-30iB Plus sends it."""
    return bytes([CONNECTED, *bytes(7), 1, *bytes(HEADER_BYTES - 9)])


def answer(packet: Packet, data: bytes = b"") -> bytes:
    """Return the answer to a packet."""
    if len(data) > INLINE_BYTES:
        return _answer(packet, LONG_DONE, len(data)) + bytes(2) + bytes(4) + _STATE + data
    if data:
        inline = data.ljust(INLINE_BYTES, b"\0")
        return _answer(packet, SHORT_DONE) + bytes(2) + inline + bytes(4) + _STATE[-2:]
    return _answer(packet, SHORT_DONE) + bytes(6) + _STATE


def refusal(packet: Packet, status: int = 0) -> bytes:
    """Return the answer that refuses a packet.

    Args:
        status: Two bytes, the greater part first; 0 as controllers were seen to send.
    """
    return _answer(packet, REFUSED) + status.to_bytes(2, "big") + bytes(4) + _STATE


def _answer(packet: Packet, type_: int, size: int = 0) -> bytes:
    number, second = packet.numbers
    return _HEAD.pack(ANSWER, number, size, 1, 1, second, type_, _SERVER, _CLIENT, 1, 1)
