"""Refusals over HTTP: the English sentence, its code and its parameters, in one form for all routes.

Routes that answer JSON refuse with `{"text": sentence, "refusal": {"code", "values", "causes", "text"}}`;
`refusal` is the message `Reason` in JSON. Other routes refuse with the sentence as text, and with the code
and the parameters in the content type, like an error reply on the mesh.
"""

import json
import math
from collections.abc import Awaitable, Callable
from functools import wraps

from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, PlainTextResponse, Response

from robomesh import reason_codes as codes
from robomesh.contract.messages import reason_message, to_json
from robomesh.errors import BusyError, CodedError, NoAnswerError, QuotaError, RefusedError, RobomeshError
from robomesh.reasons import to_parameters
from services.console.common.errors import RefusedRequest

Handler = Callable[[Request], Awaitable[Response]]
Form = Callable[[RefusedRequest], Response]

_BUSY_AGAIN_S = 1.0


def as_json(refused: RefusedRequest) -> Response:
    """Return a refusal as JSON."""
    answer = {
        **refused.more,
        "text": str(refused),
        "refusal": json.loads(to_json(reason_message(refused.reason))),
    }
    return JSONResponse(answer, status_code=refused.status, headers=_headers(refused))


def as_text(refused: RefusedRequest) -> Response:
    """Return a refusal as text, with its code and parameters in the content type."""
    # HTTP permits no "=" in a parameter's value, except in a quoted one.
    parameters = to_parameters(refused.reason).replace('"', "%22")
    headers = _headers(refused) | {"Content-Type": f'text/plain; charset=utf-8; refusal="{parameters}"'}
    return PlainTextResponse(str(refused), status_code=refused.status, headers=headers)


def _headers(refused: RefusedRequest) -> dict[str, str]:
    again = {} if refused.again_s is None else {"Retry-After": str(math.ceil(refused.again_s))}
    return {"Cache-Control": "no-store"} | again


def refused_on_the_mesh(error: RobomeshError) -> RefusedRequest:
    """Return the refusal for a request that failed on the mesh."""
    match error:
        case QuotaError():
            return RefusedRequest(429, error.reason, again_s=error.again_s)
        case BusyError():
            return RefusedRequest(503, error.reason, again_s=_BUSY_AGAIN_S)
        case RefusedError():
            return RefusedRequest(404, error.reason)
        case NoAnswerError():
            return RefusedRequest(504, error.reason)
        case CodedError():
            return RefusedRequest(400, codes.INVALID(error.reason))
        case _:
            return RefusedRequest(400, codes.INVALID(codes.OTHER(detail=error)))


def refused_error(error: Exception) -> RefusedRequest | None:
    """Return the refusal for an error of the mesh; None for another error."""
    return refused_on_the_mesh(error) if isinstance(error, RobomeshError) else None


def with_error_responses(
    handler: Handler, form: Form, refused: Callable[[Exception], RefusedRequest | None] = lambda _: None
) -> Handler:
    """Return the handler with its errors turned into refusals, and without caching by default.

    Args:
        form: Makes the refusal's response.
        refused: Returns the refusal for another error; None if the error is to be raised.
    """

    @wraps(handler)
    async def answer(request: Request) -> Response:
        try:
            response = await handler(request)
        except ClientDisconnect:
            response = Response(status_code=499)  # the client has disconnected
        except RefusedRequest as error:
            response = form(error)
        except Exception as error:
            refusal = refused(error)
            if refusal is None:
                raise
            response = form(refusal)
        response.headers.setdefault("Cache-Control", "no-store")
        return response

    return answer
