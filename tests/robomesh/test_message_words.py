"""Error texts for invalid requests and messages."""

import pytest

from robomesh.errors import MessageError
from robomesh.messages import JSON, decode, decode_request
from robomesh.schemas.robomesh_pb2 import CheckRequest, Event, EventList, InverseRequest


@pytest.mark.parametrize(
    ("schema", "payload", "words"),
    [
        (InverseRequest, b'{"posse": []}', "not an InverseRequest: it has no field 'posse'"),
        (InverseRequest, b"[]", "not an InverseRequest: send a JSON object"),
        (CheckRequest, b'{"program": 1}', "not a CheckRequest: "),
    ],
)
def test_error_of_an_invalid_request_has_the_right_article(schema, payload, words):
    with pytest.raises(MessageError, match=words):
        decode_request(schema, payload, JSON)


def dated(seconds=0, nanos=0):
    event = Event(code="a")
    event.timestamp.seconds, event.timestamp.nanos = seconds, nanos
    return event


@pytest.mark.parametrize(("seconds", "nanos"), [(1 << 40, 0), (-(1 << 40), 0), (0, -1), (0, 1_000_000_000)])
def test_message_with_an_invalid_time_is_an_error(seconds, nanos):
    event = dated(seconds, nanos)
    for message in (event, EventList(events=[dated(), event])):
        with pytest.raises(MessageError, match=f"timestamp: {seconds} s and {nanos} ns is not a valid time"):
            decode(type(message), message.SerializeToString())


@pytest.mark.parametrize("second", [-62_135_596_800, 0, 253_402_300_799])
def test_every_time_from_year_1_to_9999_is_valid(second):
    message = EventList(events=[dated(second, 999_999_999)])
    assert decode(EventList, message.SerializeToString()) == message
    assert message.events[0].timestamp.ToNanoseconds() == second * 1_000_000_000 + 999_999_999
