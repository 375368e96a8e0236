"""What is said of a request that is none."""

import pytest

from bus.errors import MessageError
from bus.messages import JSON, decode_request
from bus.schemas.robomesh_pb2 import CheckRequest, InverseRequest


@pytest.mark.parametrize(
    ("schema", "payload", "words"),
    [
        (InverseRequest, b'{"posse": []}', "not an InverseRequest: it has no field 'posse'"),
        (InverseRequest, b"[]", "not an InverseRequest: a JSON object is right"),
        (CheckRequest, b'{"program": 1}', "not a CheckRequest: "),
    ],
)
def test_a_request_that_is_none_is_named_as_it_is_spoken(schema, payload, words):
    with pytest.raises(MessageError, match=words):
        decode_request(schema, payload, JSON)
