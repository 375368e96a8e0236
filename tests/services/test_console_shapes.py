"""Errors for a page when a mesh is missing or temporarily unavailable."""

import pytest
from starlette.requests import Request

from robomesh import reason_codes as codes
from robomesh.contract.keys import PresenceKey
from robomesh.errors import BusyError, NoAnswerError, QuotaError, RefusedError
from services.console.http import shapes
from services.console.http.shapes import ShapeCache, shape_response
from tests.conftest import run
from tests.services.http_refusals import read_refusal


class Owner:
    """A session on which the service for meshes gives this answer."""

    def __init__(self, error):
        self._error = error

    async def ask_bytes(self, key, *, timeout_s):
        raise self._error

    async def present(self):
        return [PresenceKey("s", "r", "kinematics", "0")]


@pytest.mark.parametrize(
    ("error", "status", "again"),
    [
        (BusyError("too many requests wait"), 503, "1"),
        (QuotaError("too many meshes a minute", again_s=2.5), 503, "3"),
        (NoAnswerError(codes.NO_ANSWER(key="k", seconds=1)), 504, None),
        (RefusedError("no mesh 'base' here"), 404, None),
    ],
)
def test_a_busy_service_is_retried_and_a_missing_shape_is_not(monkeypatch, error, status, again):
    monkeypatch.setattr(shapes, "_TIMEOUTS_S", (0.1, 0.1))
    path = {"site": "s", "robot": "r", "name": "base"}
    request = Request({"type": "http", "query_string": b"", "headers": [], "path_params": path})
    answer = run(shape_response(request, Owner(error), ShapeCache()))
    assert (answer.status_code, answer.headers.get("retry-after")) == (status, again)
    assert answer.body.decode() == str(error)
    code = "request.no_answer" if status == 504 else "other"
    assert read_refusal(answer.headers, answer.body).code == code
