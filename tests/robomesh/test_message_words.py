"""Error texts for invalid requests and messages."""

import pytest

from robomesh import reason_codes as codes
from robomesh.contract.messages import JSON, PROTOBUF, decode, decode_request
from robomesh.errors import MessageError
from robomesh.schemas.robomesh_pb2 import CheckRequest, Event, EventList, InverseRequest


@pytest.mark.parametrize(
    ("schema", "payload", "code", "values"),
    [
        (
            InverseRequest,
            b'{"posse": []}',
            codes.UNKNOWN_FIELD,
            {"request": "InverseRequest", "field": "posse"},
        ),
        (InverseRequest, b"[]", codes.NOT_JSON_OBJECT, {}),
        (InverseRequest, b"[", codes.NOT_JSON, {}),
        (CheckRequest, b'{"program": 1}', codes.NOT_JSON_MESSAGE, {"message": "CheckRequest"}),
        (InverseRequest, b'{"task": "3D"}', codes.FIELD_NOT_ONE_OF, {"field": "task", "value": "3D"}),
        (InverseRequest, b"{}", codes.FIELD_UNSET, {"names": "POSE_6D, POSITION_AND_AXIS_5D"}),
        (InverseRequest, b'{"task": 1, "pose": ["NaN"]}', codes.FIELD_NOT_FINITE, {"field": "pose"}),
    ],
)
def test_an_invalid_request_has_a_code_with_its_field(schema, payload, code, values):
    with pytest.raises(MessageError) as caught:
        decode_request(schema, payload, JSON)
    assert caught.value.reason.code == code.name
    assert values.items() <= caught.value.reason.values.items()


def test_bytes_of_another_message_have_a_code():
    with pytest.raises(MessageError) as caught:
        decode_request(InverseRequest, b"\xff", PROTOBUF)
    assert (caught.value.reason.code, caught.value.reason.values["count"]) == ("request.not_message", "1")


def dated(seconds=0, nanos=0):
    event = Event(code="a")
    event.timestamp.seconds, event.timestamp.nanos = seconds, nanos
    return event


@pytest.mark.parametrize(("seconds", "nanos"), [(1 << 40, 0), (-(1 << 40), 0), (0, -1), (0, 1_000_000_000)])
def test_message_with_an_invalid_time_is_an_error(seconds, nanos):
    event = dated(seconds, nanos)
    for message in (event, EventList(events=[dated(), event])):
        with pytest.raises(MessageError) as caught:
            decode(type(message), message.SerializeToString())
        assert caught.value.reason == codes.FIELD_TIME(field="timestamp", seconds=seconds, nanos=nanos)


@pytest.mark.parametrize("second", [-62_135_596_800, 0, 253_402_300_799])
def test_every_time_from_year_1_to_9999_is_valid(second):
    message = EventList(events=[dated(second, 999_999_999)])
    assert decode(EventList, message.SerializeToString()) == message
    assert message.events[0].timestamp.ToNanoseconds() == second * 1_000_000_000 + 999_999_999
