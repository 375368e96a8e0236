"""A route's handler whose refusals are answered in words, and whose answers no cache keeps."""

from collections.abc import Awaitable, Callable
from functools import wraps

from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response

Handler = Callable[[Request], Awaitable[Response]]


def answered(handler: Handler, refused: Callable[[Exception], Response | None]) -> Handler:
    """The handler, with its errors as answers.

    Args:
        refused: What is answered to an error; None: it is none of those that are answered, and is raised.
    """

    @wraps(handler)
    async def answer(request: Request) -> Response:
        try:
            response = await handler(request)
        except ClientDisconnect:
            response = Response(status_code=499)  # nobody reads it
        except Exception as error:
            told = refused(error)
            if told is None:
                raise
            response = told
        response.headers.setdefault("Cache-Control", "no-store")
        return response

    return answer
