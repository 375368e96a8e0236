"""The common form of the console's refusals over HTTP."""

import json

import pytest
from starlette.requests import Request
from starlette.responses import Response

from robomesh import reason_codes as codes
from robomesh.errors import BusyError, KeyNameError, NoAnswerError, QuotaError, RefusedError
from services.console.common.error_responses import (
    as_json,
    as_text,
    refused_on_the_mesh,
    with_error_responses,
)
from services.console.common.errors import RefusedRequest
from tests.conftest import run
from tests.services.http_refusals import read_refusal


def test_json_refusal_has_the_sentence_the_reason_and_the_route_s_own_keys():
    reason = codes.LINK_DOWN(codes.LINK_NO_ANSWER(where="10.0.0.7:5400"))
    answer = as_json(RefusedRequest(409, reason, again_s=2.1, error="down"))
    assert (answer.status_code, answer.headers["retry-after"]) == (409, "3")
    assert answer.headers["cache-control"] == "no-store"
    text = "the link to the controller is down (10.0.0.7:5400 does not answer)"
    cause = {
        "code": "link.no_answer",
        "values": {"where": "10.0.0.7:5400"},
        "causes": [],
        "text": "10.0.0.7:5400 does not answer",
    }
    assert json.loads(answer.body) == {
        "error": "down",
        "text": text,
        "refusal": {"code": "link.down", "values": {}, "causes": [cause], "text": text},
    }


@pytest.mark.parametrize("value", ["li", 'a "b" \\ c; d=e&f', "操作员\r\nX: y", "\ud800", "x" * 2000])
def test_text_refusal_has_its_parameters_in_a_valid_content_type(value):
    reason = codes.LEASE_HELD(holder=value)
    answer = as_text(RefusedRequest(403, reason))
    found = read_refusal(answer.headers, answer.body)
    assert (found.code, found.text) == ("lease.held", reason.text)
    assert found.values == ({} if len(value) == 2000 else reason.values)


def test_text_refusal_keeps_its_cause():
    reason = codes.LINK_DOWN(codes.LINK_NO_ANSWER(where="10.0.0.7:5400"))
    answer = as_text(RefusedRequest(409, reason))
    (cause,) = read_refusal(answer.headers, answer.body).causes
    assert (cause.code, cause.values) == ("link.no_answer", {"where": "10.0.0.7:5400"})


@pytest.mark.parametrize(
    ("error", "status", "again_s", "code"),
    [
        (QuotaError(codes.BUSY(), again_s=2.5), 429, 2.5, "request.busy"),
        (BusyError(codes.BUSY()), 503, 1.0, "request.busy"),
        (RefusedError(codes.LEASE_NONE()), 404, None, "lease.none"),
        (NoAnswerError(codes.NO_ANSWER(key="k", seconds=1)), 504, None, "request.no_answer"),
        (KeyNameError("site 'S!' cannot be used"), 400, None, "request.invalid"),
    ],
)
def test_a_request_that_failed_on_the_mesh_keeps_its_reason(error, status, again_s, code):
    refused = refused_on_the_mesh(error)
    assert (refused.status, refused.again_s, refused.reason.code) == (status, again_s, code)
    assert str(refused) == str(error)


def test_another_error_is_raised():
    async def fail(_: Request) -> Response:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        run(with_error_responses(fail, as_text)(Request({"type": "http"})))
