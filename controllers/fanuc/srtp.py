"""Packets of SNPX: GE's SRTP over TCP, one question and one answer. Numbers are little-endian.

    bytes   question                     question with text           answer
    ------  ---------------------------  ---------------------------  ------------------------------------
    0       2 (0: connect, 8: session)   2                            3 (1: connected)
    2       number of the question       the same                     the same
    4-5     0                            size of the text             size of the text
    9, 17   1                            2
    30      number of the question       the same                     the same
    31      0xC0                         0x80                         0xD4: up to 6 bytes within the header,
                                                                      0x94: text, 0xD1: refused
    36-39   0x0E10: the server           the same
    40-41   1, 1: packet 1 of 1          the same                     the same
    42      service                      size of the text             0xD4: 42-43 status, 44-49 data
    43      area
    44-45   first element, from 0
    46-47   number of elements
    48-49                                1, 1: packet 1 of 1
    50-51                                service, area
    52-55                                first element, number
    56-                                  text                         0x94: data

An answer repeats nothing but the number, and the controller sends nothing unasked.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from struct import Struct
from typing import TypeAlias

from controllers.fanuc.assignments import Assignment

PORT = 60008
"""TCP port of the Robot Interface; the option HMI Device (SNPX) listens on 18245."""
HEADER_BYTES = 56
LONGEST_TEXT = 1024
"""Most bytes of an answer's text; no question asks for more."""
NUMBERS = 255
"""Questions are numbered from 0 to 254; the first packet is 0, later ones have 255 for it."""
INLINE_BYTES = 6

CONNECTED = 0x01
ANSWER = 0x03
SHORT, LONG = 0xC0, 0x80
SHORT_DONE, LONG_DONE, REFUSED = 0xD4, 0x94, 0xD1
_SHORT = Struct("<BxBxHxxxBxxxxxxxBxxxxxxxxxxxxBB4xHxxBBBBHH8x")
_LONG = Struct("<BxBxHxxxBxxxxxxxBxxxxxxxxxxxxBB4xHxxBBH4xBBBBHH")
_SERVER = 0x0E10
_WORD = 2


class Service(IntEnum):
    """Services of the controller that the gateway uses."""

    READ = 0x04
    WRITE = 0x07
    SESSION = 0x4F


class Area(IntEnum):
    """Areas of memory that are read. The robot's outputs are the inputs of the PLC."""

    WORDS = 0x08
    """%R, which assignments fill with values."""
    ROBOT_OUTPUTS = 0x46
    """Bits of %I."""
    ROBOT_INPUTS = 0x48
    """Bits of %Q."""


COMMANDS = 0x38
"""%G: it takes texts, and only `Clear` and `Assign` encode one."""
_SESSION_AREA = 0x01


@dataclass(frozen=True, slots=True)
class Connect:
    """The first packet of a connection."""

    def encode(self, number: int) -> bytes:
        """Return the packet."""
        return bytes(HEADER_BYTES)


@dataclass(frozen=True, slots=True)
class BeginSession:
    """The second packet of a connection."""

    def encode(self, number: int) -> bytes:
        """Return the packet with a number, 0 to 254."""
        return _question(8, number, Service.SESSION, _SESSION_AREA, 0, 0)


@dataclass(frozen=True, slots=True)
class Read:
    """A question for memory.

    Attributes:
        first: First element from 0; bits begin at a multiple of 8.
        count: Number of words, or of bits: a multiple of 8.
    """

    area: Area
    first: int
    count: int

    def __post_init__(self) -> None:
        bits = self.area is not Area.WORDS
        if not 0 <= self.first < 1 << 16 or not 0 < self.size <= LONGEST_TEXT:
            raise ValueError(f"{self.count} elements from {self.first} exceed one answer")
        if bits and (self.first % 8 or self.count % 8):
            raise ValueError("bits are read by whole bytes")

    @property
    def size(self) -> int:
        """Number of bytes of the answer."""
        return self.count * _WORD if self.area is Area.WORDS else self.count // 8

    def encode(self, number: int) -> bytes:
        """Return the packet with a number, 0 to 254."""
        return _question(2, number, Service.READ, self.area, self.first, self.count)


@dataclass(frozen=True, slots=True)
class Clear:
    """Command to begin a table of assignments for this connection.

    A controller without a table for each connection clears the table of all its clients.
    """

    def encode(self, number: int) -> bytes:
        """Return the packet with a number, 0 to 254."""
        return _command(number, b"CLRASG")


@dataclass(frozen=True, slots=True)
class Assign:
    """Command to add an assignment to the table."""

    assignment: Assignment

    def encode(self, number: int) -> bytes:
        """Return the packet with a number, 0 to 254."""
        return _command(number, self.assignment.command.encode("ascii"))


Question: TypeAlias = Connect | BeginSession | Read | Clear | Assign


def _question(kind: int, number: int, service: int, area: int, first: int, count: int) -> bytes:
    number = number or NUMBERS
    return _SHORT.pack(kind, number, 0, 1, 1, number, SHORT, _SERVER, 1, 1, service, area, first, count)


def _command(number: int, text: bytes) -> bytes:
    number, size = number or NUMBERS, len(text)
    head = (2, number, size, 2, 2, number, LONG, _SERVER, 1, 1, size)
    return _LONG.pack(*head, 1, 1, Service.WRITE, COMMANDS, 0, size) + text


@dataclass(frozen=True, slots=True)
class Answer:
    """An answer.

    Attributes:
        number: The question's.
        kind: `SHORT_DONE`, `LONG_DONE` or `REFUSED`.
        status: Code of an error, two bytes; 0: none, also of some that are refused.
        data: Text, or the six bytes within the header.
        connected: It is the first answer of a connection.
    """

    number: int
    kind: int
    status: int
    data: bytes
    connected: bool = False

    @property
    def busy(self) -> bool:
        """True if the controller has no time now for the question."""
        return self.kind == REFUSED and self.status >> 8 == _QUEUE_FULL

    @property
    def refused(self) -> bool:
        """True if the controller does not do what was asked for."""
        return self.kind == REFUSED or self.status != 0

    def answers(self, question: Question) -> bool:
        """Return whether it can be the answer to a question with its number."""
        return self.connected is isinstance(question, Connect)

    def read(self, question: Read) -> bytes:
        """Return what was read.

        Raises:
            ValueError: If it is not as long as asked for.
        """
        size = question.size
        if self.kind == SHORT_DONE and size <= INLINE_BYTES:
            return self.data[:size]
        if self.kind == SHORT_DONE or len(self.data) != size:
            got = 0 if self.kind == SHORT_DONE else len(self.data)
            raise ValueError(f"{got} bytes of text, {size} were asked for")
        return self.data

    @property
    def error(self) -> str:
        """Text of an error."""
        return f"status 0x{self.status:04X}"


_QUEUE_FULL = 0x07
_FIRST = Answer(0, SHORT_DONE, 0, b"", connected=True)


class AnswerStream:
    """Answers in the bytes of one connection.

    After invalid bytes it discards what it has, and goes on with the next read: the controller only
    answers, so the next question's answer begins there.
    """

    def __init__(self) -> None:
        self._rest = b""

    def receive(self, data: bytes) -> Sequence[Answer | ValueError]:
        """Return the answers that are complete now; of invalid bytes, the error."""
        data = self._rest + data
        found: list[Answer | ValueError] = []
        at = 0
        while len(data) - at >= HEADER_BYTES:
            size = int.from_bytes(data[at + 4 : at + 6], "little")
            try:
                _check(data[at : at + HEADER_BYTES], size)
            except ValueError as error:
                self._rest = b""
                return [*found, error]
            end = at + HEADER_BYTES + size
            if end > len(data):
                break
            found.append(_answer(data[at:end]))
            at = end
        self._rest = data[at:]
        return found


def _check(head: bytes, size: int) -> None:
    """Raise ValueError if a header is not of an answer."""
    if head[0] == CONNECTED:
        if size or head[31]:
            raise ValueError("the first answer of a connection has no text and no type")
        return
    if head[0] != ANSWER:
        raise ValueError(f"kind {head[0]} is not that of an answer")
    if head[31] not in (SHORT_DONE, LONG_DONE, REFUSED):
        raise ValueError(f"type 0x{head[31]:02X} is not that of an answer")
    if not head[2] or head[3]:
        raise ValueError(f"number {head[2] + 256 * head[3]} is not that of a question")
    if head[40:42] != b"\x01\x01":
        raise ValueError(f"packet {head[40]} of {head[41]}: answers of several packets are not read")
    if size > LONGEST_TEXT or (size != 0) is not (head[31] == LONG_DONE):
        raise ValueError(f"{size} bytes of text in an answer of type 0x{head[31]:02X}")


def _answer(packet: bytes) -> Answer:
    if packet[0] == CONNECTED:
        return _FIRST
    kind = packet[31]
    data = packet[44:50] if kind == SHORT_DONE else packet[HEADER_BYTES:]
    return Answer(packet[2] % NUMBERS, kind, packet[42] << 8 | packet[43], data)
