"""Questions and answers of HSES, as the controller reads and writes them."""

import struct
from collections.abc import Sequence
from dataclasses import dataclass

from controllers.yaskawa.data import Alarm, Job, Position, Status, System
from controllers.yaskawa.hses import (
    ANSWERED,
    HEADER,
    HEADER_BYTES,
    IDENTIFIER,
    LAST_BLOCK,
    QUESTION,
    RESERVED,
    ROBOT_CONTROL,
)

ALARM_HISTORY = 0x71
"""A further command that reads; the gateway does not use it."""


@dataclass(frozen=True, slots=True)
class Question:
    """A client's question or command."""

    number: int
    command: int
    instance: int
    attribute: int
    service: int
    data: bytes


def decode(datagram: bytes) -> Question | None:
    """Return the question in a datagram; None: a controller does not answer this datagram."""
    if len(datagram) < HEADER_BYTES:
        return None
    identifier, header_bytes, size, _, division, kind, number, *_ = HEADER.unpack_from(datagram)
    right = (IDENTIFIER, HEADER_BYTES, len(datagram) - HEADER_BYTES, ROBOT_CONTROL, 0)
    if (identifier, header_bytes, size, division, kind) != right:
        return None
    command, instance, attribute, service, _ = QUESTION.unpack_from(datagram, HEADER.size)
    return Question(number, command, instance, attribute, service, datagram[HEADER_BYTES:])


def answer(question: Question, data: bytes = b"", *, status: int = 0, added_status: int = 0) -> bytes:
    """Return the datagram that answers a question."""
    head = HEADER.pack(
        IDENTIFIER, HEADER_BYTES, len(data), 3, ROBOT_CONTROL, 1, question.number, LAST_BLOCK, RESERVED
    )
    words = 1 if added_status else 0
    service = (question.service + ANSWERED) & 0xFF
    return head + struct.pack("<BBBxHH", service, status, words, added_status, 0) + data


def fields_of(value: Position | Status | Alarm | Job | System, *, sub_codes: bool = False) -> list[bytes]:
    """Return a value's attributes, the first to the last, as bytes.

    Args:
        sub_codes: Alarms have the texts of their sub-codes, as on DX200 and later.
    """
    match value:
        case Position(data_type, form, tool, user_frame, extended_form, axes):
            head = [_unsigned(each) for each in (data_type, form, tool, user_frame, extended_form)]
            return head + words(axes)
        case Status(first, second):
            return [_unsigned(first), _unsigned(second)]
        case Alarm(code, sub_code, kind, time, name):
            more = [_text("", size) for size in (16, 96, 96)] if sub_codes else []
            return [*map(_unsigned, (code, sub_code, kind)), _text(time, 16), _text(name, 32), *more]
        case Job(name, line, step, speed_override):
            return [_text(name, 32), *map(_unsigned, (line, step, speed_override))]
        case System(software, model, parameters):
            return [_text(software, 24), _text(model, 16), _text(parameters, 8)]


def words(values: Sequence[int]) -> list[bytes]:
    """Return signed numbers of 32 bits."""
    return [struct.pack("<i", value) for value in values]


def names(values: Sequence[str]) -> list[bytes]:
    """Return the names of axes."""
    return [_text(value, 4) for value in values]


def _unsigned(value: int) -> bytes:
    return struct.pack("<I", value)


def _text(value: str, size: int) -> bytes:
    return value.encode()[:size].ljust(size, b"\0")
