"""Messages as bytes: protobuf, or protobuf's JSON form with the proto's own field names.

Requests are checked more strictly than protobuf does: NaN, infinities and unspecified
enums are refused by name.
"""

import math
from collections.abc import Iterator
from typing import TypeVar

from google.protobuf import json_format
from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.message import DecodeError, Message

from bus.errors import MessageError

PROTOBUF = "application/protobuf"
JSON = "application/json"
TEXT = "text/plain"

_FLOATS = (FieldDescriptor.TYPE_DOUBLE, FieldDescriptor.TYPE_FLOAT)

AnyMessage = TypeVar("AnyMessage", bound=Message)


def is_json(encoding: str) -> bool:
    """Whether a request with this encoding is JSON: said so, or nothing said."""
    return not encoding.startswith(PROTOBUF)


def to_json(message: Message, *, indent: int | None = None) -> str:
    """A message as JSON: proto field names, defaults printed, times RFC 3339."""
    return json_format.MessageToJson(
        message,
        preserving_proto_field_name=True,
        always_print_fields_with_no_presence=True,
        indent=indent,
    )


def encode(message: Message, *, as_json: bool) -> bytes:
    """A message as protobuf or JSON bytes."""
    return to_json(message).encode() if as_json else message.SerializeToString()


def decode(schema: type[AnyMessage], payload: bytes) -> AnyMessage:
    """A message from protobuf bytes.

    Raises:
        MessageError: If the bytes are not that message.
    """
    try:
        return schema.FromString(payload)
    except DecodeError as error:
        raise MessageError(f"{len(payload)} bytes are not a {schema.DESCRIPTOR.full_name}: {error}") from None


def decode_request(schema: type[AnyMessage], payload: bytes, encoding: str) -> AnyMessage:
    """A request from its payload, checked.

    Raises:
        MessageError: If it is no such message, or holds a NaN, an infinity or an unspecified enum.
    """
    if not is_json(encoding):
        message = decode(schema, payload)
    else:
        message = schema()
        try:
            json_format.Parse(payload.decode() or "{}", message)
        except (json_format.ParseError, UnicodeDecodeError) as error:
            fields = ", ".join(field.name for field in schema.DESCRIPTOR.fields)
            raise MessageError(f"not a {schema.DESCRIPTOR.name}: {error}; its fields are: {fields}") from None
    for problem in _problems(message):
        raise MessageError(problem)
    return message


def _problems(message: Message, path: str = "") -> Iterator[str]:
    for field in message.DESCRIPTOR.fields:
        name = path + field.name
        enum = field.enum_type
        if enum is not None and not field.is_repeated:
            number = getattr(message, field.name)
            names = [value.name for value in enum.values if value.number]
            if number == 0 or number not in enum.values_by_number:
                yield f"{name}: one of {', '.join(names)} is needed"
    for field, value in message.ListFields():
        name = path + field.name
        values = value if field.is_repeated and not _is_map(field) else (value,)
        if field.type in _FLOATS and not all(math.isfinite(number) for number in values):
            yield f"{name}: {value if not field.is_repeated else list(value)} is not finite"
        elif field.type == FieldDescriptor.TYPE_MESSAGE and not _is_map(field):
            for child in values:
                yield from _problems(child, f"{name}.")


def _is_map(field: FieldDescriptor) -> bool:
    return field.message_type is not None and field.message_type.GetOptions().map_entry
