"""Who may talk to the console, and what a browser may do with its page.

A page elsewhere must not reach a robot through an operator's browser: the Host must be a name
of ours (else a foreign name could be pointed at us: DNS rebinding), and a WebSocket's Origin
must be the page's own.
"""

import ipaddress
from collections.abc import Collection
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

_OWN_NAMES = frozenset({"localhost"})

SECURITY_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; "
        "connect-src 'self' blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=()",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}


def refused_host(host: str, names: Collection[str]) -> str | None:
    """Why a Host header is refused; None: it is ours.

    An address of numbers is always ours: only a name can be pointed at somebody else.

    Args:
        names: Further names that the console is known by.
    """
    name = (urlsplit(f"//{host}").hostname or "") if host else ""
    if name in _OWN_NAMES or name in {each.lower() for each in names}:
        return None
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return f"host {host!r} is not this console's: use its address, or name it in the console's hosts"
    return None


def refused_origin(origin: str, host: str) -> str | None:
    """Why a WebSocket's Origin is refused; None: it is the page's own."""
    if origin and urlsplit(origin).netloc.lower() == host.lower():
        return None
    return f"origin {origin!r} is not this page's: {host}"


class Guard:
    """ASGI middleware: Host and Origin checked, security headers on every answer."""

    def __init__(self, app: ASGIApp, names: Collection[str] = ()) -> None:
        self._app = app
        self._names = names

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Passes on what is allowed."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        host = headers.get("host", "")
        problem = refused_host(host, self._names)
        if problem is None and scope["type"] == "websocket":
            problem = refused_origin(headers.get("origin", ""), host)

        async def send_guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(SECURITY_HEADERS)
            await send(message)

        if problem is None:
            await self._app(scope, receive, send_guarded)
        elif scope["type"] == "http":
            await PlainTextResponse(problem, status_code=421)(scope, receive, send_guarded)
        else:
            await send({"type": "websocket.close", "code": 1008, "reason": problem})
