"""Messages as bytes: protobuf, or protobuf's JSON form with the field names of the proto file.

Requests are checked more strictly than by protobuf: NaN, infinities and unspecified enums are refused, and
the error names the field.
"""

import math
from collections.abc import Iterator
from functools import cache
from typing import Any, TypeVar

from google.protobuf import json_format
from google.protobuf.descriptor import Descriptor, FieldDescriptor
from google.protobuf.message import DecodeError, Message
from google.protobuf.timestamp_pb2 import Timestamp

from robomesh import bounded_json
from robomesh import reason_codes as codes
from robomesh.errors import MessageError
from robomesh.reasons import Reason
from robomesh.schemas import robomesh_pb2 as schema

PROTOBUF = "application/protobuf"
JSON = "application/json"
TEXT = "text/plain"

_FLOATS = (FieldDescriptor.TYPE_DOUBLE, FieldDescriptor.TYPE_FLOAT)
_OWN = "robomesh"
# Values in a field of JSON: protobuf's Python code converts 10,000 numbers in 5 ms.
_MOST_ITEMS = 10_000
_TIME = Timestamp.DESCRIPTOR.full_name
# Years 1 to 9999, the range in timestamp.proto; converting another one raises ValueError.
_FIRST_S, _LAST_S = -62_135_596_800, 253_402_300_799

AnyMessage = TypeVar("AnyMessage", bound=Message)


def is_json(encoding: str) -> bool:
    """Return whether a request with this encoding is JSON, which is also the default."""
    return not encoding.startswith(PROTOBUF)


def to_json(message: Message, *, indent: int | None = None) -> str:
    """Return a message as JSON: proto field names, defaults printed, times in RFC 3339."""
    return json_format.MessageToJson(
        message,
        preserving_proto_field_name=True,
        always_print_fields_with_no_presence=True,
        indent=indent,
    )


def encode(message: Message, *, as_json: bool) -> bytes:
    """Return a message as protobuf or JSON bytes."""
    return to_json(message).encode() if as_json else message.SerializeToString()


def reason_message(reason: Reason) -> schema.Reason:
    """Return a reason as the message in answers, audit entries and events."""
    message = schema.Reason(code=reason.code, values=reason.values, text=reason.text)
    message.causes.extend(map(reason_message, reason.causes))
    return message


def received_reason(message: schema.Reason) -> Reason:
    """Return the reason in a received message."""
    causes = tuple(map(received_reason, message.causes))
    return Reason(message.code, dict(message.values), causes, message.text)


def decode(schema: type[AnyMessage], payload: bytes) -> AnyMessage:
    """Decode a message from protobuf bytes.

    Raises:
        MessageError: If the bytes are not that message, or contain an invalid time.
    """
    try:
        message = schema.FromString(payload)
    except DecodeError as error:
        name = schema.DESCRIPTOR.full_name
        raise MessageError(codes.NOT_MESSAGE(count=len(payload), message=name, detail=error)) from None
    _check_times(message, _dated(schema.DESCRIPTOR))
    return message


def decode_request(schema: type[AnyMessage], payload: bytes, encoding: str) -> AnyMessage:
    """Decode and check a request.

    Raises:
        MessageError: If the payload is not that message, or contains a NaN, an infinity or an unspecified
            enum.
    """
    message = decode(schema, payload) if not is_json(encoding) else _from_json(schema, payload)
    for problem in _problems(message):
        raise MessageError(problem)
    return message


def _from_json(schema: type[AnyMessage], payload: bytes) -> AnyMessage:
    name, message = schema.DESCRIPTOR.name, schema()
    try:
        text = payload.decode() or "{}"
        values = bounded_json.loads(text)
        if not isinstance(values, dict):
            raise MessageError(codes.NOT_JSON_OBJECT())
        for key, value in values.items():
            _check_key(schema, key, value)
        json_format.Parse(text, message)
    except (ValueError, RecursionError) as error:  # includes UnicodeDecodeError and JSONDecodeError
        raise MessageError(codes.NOT_JSON(detail=error)) from None
    except json_format.ParseError as error:
        # After " at " protobuf repeats the path in its own names.
        text = str(error).splitlines()[0].partition(" at ")[0]
        raise MessageError(codes.NOT_JSON_MESSAGE(message=name, detail=text)) from None
    return message


def _check_key(schema: type[Message], key: str, value: object) -> None:
    """Check a field's name, number of values and enum value, with a clearer error text than protobuf's."""
    descriptor = schema.DESCRIPTOR
    fields = {name: field for field in descriptor.fields for name in (field.name, field.json_name)}
    field = fields.get(key)
    if isinstance(value, list) and len(value) > _MOST_ITEMS:
        raise MessageError(codes.NOT_JSON(detail=f"{key} has {len(value)} values, at most {_MOST_ITEMS}"))
    if field is None:
        names = ", ".join(field.name for field in descriptor.fields)
        raise MessageError(codes.UNKNOWN_FIELD(request=descriptor.name, field=key, fields=names))
    if field.enum_type is not None and isinstance(value, str) and value not in field.enum_type.values_by_name:
        names = ", ".join(each.name for each in field.enum_type.values if each.number)
        raise MessageError(codes.FIELD_NOT_ONE_OF(field=key, value=value, names=names))


def _problems(message: Message, path: str = "") -> Iterator[Reason]:
    for field in message.DESCRIPTOR.fields:
        name = path + field.name
        enum = field.enum_type
        absent = field.has_presence and not message.HasField(field.name)
        if enum is not None and not field.is_repeated and not absent:
            number = getattr(message, field.name)
            names = [value.name for value in enum.values if value.number]
            if number == 0 or number not in enum.values_by_number:
                yield codes.FIELD_UNSET(field=name, names=", ".join(names))
    for field, value in message.ListFields():
        name = path + field.name
        values = value if field.is_repeated and not _is_map(field) else (value,)
        if field.type in _FLOATS and not all(math.isfinite(number) for number in values):
            shown = list(value) if field.is_repeated else value
            yield codes.FIELD_NOT_FINITE(field=name, value=shown)
        elif field.type == FieldDescriptor.TYPE_MESSAGE and not _is_map(field):
            for child in values:
                yield from _problems(child, f"{name}.")


def _is_map(field: FieldDescriptor) -> bool:
    return field.message_type is not None and field.message_type.GetOptions().map_entry


# The fields that are times or contain times: name, whether it is repeated, and its own such fields; None: the
# field is a time.
_Dated = tuple[tuple[str, bool, "_Dated | None"], ...]


def _check_times(message: Message, dated: _Dated) -> None:
    for name, repeated, within in dated:
        value: Any = getattr(message, name)
        for each in value if repeated else (value,):
            if within is not None:
                _check_times(each, within)
            elif not (_FIRST_S <= each.seconds <= _LAST_S and 0 <= each.nanos < 1_000_000_000):
                raise MessageError(codes.FIELD_TIME(field=name, seconds=each.seconds, nanos=each.nanos))


@cache
def _dated(schema: Descriptor) -> _Dated:
    if schema.file.package != _OWN:  # Foxglove's are frequent, and no code computes with their times
        return ()
    found: list[tuple[str, bool, _Dated | None]] = []
    for field in schema.fields:
        if field.message_type is None or _is_map(field):
            continue
        if field.message_type is schema:
            continue  # of a recursive message only the outermost level is checked
        within = None if field.message_type.full_name == _TIME else _dated(field.message_type)
        if within != ():
            found.append((field.name, bool(field.is_repeated), within))
    return tuple(found)
