"""Packets of HSES: one question in one datagram, one answer in another. Numbers are little-endian.

    bytes   question                      answer
    ------  ----------------------------  -------------------------------------------
    0-3     "YERC"                        "YERC"
    4-5     32, size of the header        32
    6-7     size of the data              size of the data
    8       3                             3
    9       1: robot control              1
    10      0                             1
    11      number of the question        the same
    12-15   0, block number               0x80000000: the last block
    16-23   "99999999"                    "99999999"
    24-25   command                       24: service + 0x80, 25: status, 0: done
    26-27   instance                      26: words of added status
    28      attribute, 0: all             28-31: added status
    29      service
    30-31   0

An answer does not repeat its command, so it belongs to a question by number and service only.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from struct import Struct
from types import MappingProxyType

PORT = 10040
"""UDP port of a controller for everything but files."""
HEADER_BYTES = 32
LONGEST_DATA = 479
IDENTIFIER = b"YERC"
RESERVED = b"99999999"
ROBOT_CONTROL = 1
LAST_BLOCK = 0x8000_0000
ANSWERED = 0x80
"""Added to a service in its answer."""

HEADER = Struct("<4sHHBBBBI8s")
QUESTION = Struct("<HHBBH")
_ANSWER = Struct("<BBBxI")


class Command(IntEnum):
    """Commands that read."""

    ALARM = 0x70
    STATUS = 0x72
    JOB = 0x73
    AXES = 0x74
    POSITION = 0x75
    TORQUE = 0x77
    IO = 0x78
    SYSTEM = 0x89


class Service(IntEnum):
    """Services that read; those that write are not here."""

    ALL = 0x01
    SINGLE = 0x0E


@dataclass(frozen=True, slots=True)
class Read:
    """A question.

    Attributes:
        instance: Which of several, such as the control group.
        attribute: Number of one value, with `Service.SINGLE`; 0: all.
    """

    command: Command
    instance: int
    attribute: int = 0
    service: Service = Service.ALL

    def encode(self, number: int) -> bytes:
        """Return the datagram with a number, 0 to 255."""
        head = HEADER.pack(IDENTIFIER, HEADER_BYTES, 0, 3, ROBOT_CONTROL, 0, number, 0, RESERVED)
        return head + QUESTION.pack(self.command, self.instance, self.attribute, self.service, 0)


@dataclass(frozen=True, slots=True)
class Answer:
    """An answer.

    Attributes:
        number: The question's.
        service: The question's.
        status: 0: done.
        added_status: The controller's code of an error; 0: none.
    """

    number: int
    service: int
    status: int
    added_status: int
    data: bytes

    def answers(self, read: Read) -> bool:
        """Return whether it can be the answer to a question with its number."""
        return self.service == read.service

    @property
    def busy(self) -> bool:
        """True if the controller has no time now for the question."""
        return self.added_status in _BUSY

    @property
    def refused(self) -> bool:
        """True if the controller does not do what was asked for."""
        return self.status != 0

    @property
    def unsupported(self) -> bool:
        """True if the controller does not have what was asked for."""
        return self.status in _STATUS_TEXTS or self.added_status in _UNSUPPORTED

    @property
    def error(self) -> str:
        """Text of an error."""
        text = _STATUS_TEXTS.get(self.status) or _ADDED_TEXTS.get(self.added_status, "")
        code = f"status 0x{self.status:02X}" + (f", 0x{self.added_status:04X}" if self.added_status else "")
        return f"{text} ({code})" if text else code


def decode(datagram: bytes) -> Answer:
    """Return the answer in a datagram.

    Raises:
        ValueError: If the datagram is not an answer; the text gives the reason.
    """
    if len(datagram) < HEADER_BYTES:
        raise ValueError(f"{len(datagram)} bytes, an answer has at least {HEADER_BYTES}")
    identifier, header_bytes, size, _, division, kind, number, block, _ = HEADER.unpack_from(datagram)
    if identifier != IDENTIFIER or header_bytes != HEADER_BYTES:
        raise ValueError('it does not begin with "YERC" and the size of a header')
    if size != len(datagram) - HEADER_BYTES or size > LONGEST_DATA:
        raise ValueError(f"{size} bytes of data are announced, {len(datagram) - HEADER_BYTES} follow")
    if (division, kind) != (ROBOT_CONTROL, 1):
        raise ValueError(f"division {division}, kind {kind}: an answer of robot control has 1 and 1")
    if not block & LAST_BLOCK:
        raise ValueError(f"block {block} is not the last one")
    service, status, words, added = _ANSWER.unpack_from(datagram, HEADER.size)
    if service < ANSWERED or words > 2:
        raise ValueError(f"service 0x{service:02X} with {words} words of status is no answer")
    # Of one word, the other two bytes are padding.
    added = (0, added & 0xFFFF, added)[words]
    return Answer(number, service - ANSWERED, status, added, datagram[HEADER_BYTES:])


_BUSY = frozenset({0xD8F1, 0xD8FA, 0xE444, 0xFFF6})
_UNSUPPORTED = frozenset({0xA000, 0xA001, 0xA002, 0xB006, 0xB007, 0xB008})
_STATUS_TEXTS: Mapping[int, str] = MappingProxyType(
    {0x08: "the command is unknown", 0x09: "the attribute is unknown", 0x28: "there is no such instance"}
)
_ADDED_TEXTS: Mapping[int, str] = MappingProxyType(
    {
        0x1012: "a value is out of its range",
        0x1013: "the data have a wrong length",
        0x2010: "the robot is in operation",
        0x2020: "held at the pendant",
        0x2030: "held at the playback panel",
        0x2040: "held externally",
        0x2050: "held by a command",
        0x2060: "an alarm or error is active",
        0x2070: "the servos are off",
        0x2080: "the mode is wrong",
        0x2100: "remote control by commands is off",
        0x2110: "the data cannot be accessed",
        0x3010: "the servos are off",
        0x3450: "the servos cannot be switched on",
        0xA000: "the command is unknown",
        0xA001: "there is no such instance",
        0xA002: "the attribute is unknown",
        0xB008: "there is no such control group",
        0xB009: "the speed is wrong",
        0xD8F1: "busy with another command",
        0xD8FA: "busy",
        0xE444: "busy with another command",
        0xFFF6: "busy: too many questions",
    }
)
