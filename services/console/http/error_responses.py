"""Route handlers with errors as responses and without caching."""

from collections.abc import Awaitable, Callable
from functools import wraps

from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response

Handler = Callable[[Request], Awaitable[Response]]


def with_error_responses(handler: Handler, refused: Callable[[Exception], Response | None]) -> Handler:
    """Return the handler with its errors turned into responses.

    Args:
        refused: Returns the response to an error; None if the error is to be raised.
    """

    @wraps(handler)
    async def answer(request: Request) -> Response:
        try:
            response = await handler(request)
        except ClientDisconnect:
            response = Response(status_code=499)  # the client has disconnected
        except Exception as error:
            error_response = refused(error)
            if error_response is None:
                raise
            response = error_response
        response.headers.setdefault("Cache-Control", "no-store")
        return response

    return answer
