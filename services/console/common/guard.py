"""Request checks of the console, and the security headers of its responses.

A page of another site must not reach a robot through an operator's browser. So the Host header must be one
of the console's names (otherwise another domain could be resolved to the console: DNS rebinding), and the
Origin of a WebSocket and of every changing request must be the page's own.
"""

import contextlib
import ipaddress
import re
from collections.abc import Collection
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from robomesh import reason_codes as codes
from robomesh.reasons import Reason
from services.console.common.error_responses import as_text
from services.console.common.errors import RefusedRequest

_OWN_NAMES = frozenset({"localhost"})

_READING = ("GET", "HEAD", "OPTIONS")

# Largest body [bytes], by the beginning of the path; the body's reader enforces it for chunked bodies.
_MOST_BODY = (("/account/", 16 * 1024), ("/define/", 200 * 1000**2))
_HSTS = "max-age=31536000"

_PAGE_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; "
    "connect-src 'self' blob:; base-uri 'none'; form-action 'none'; "
)
SECURITY_HEADERS = {
    "Content-Security-Policy": f"{_PAGE_POLICY}frame-ancestors 'none'",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=()",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}
# Pictures and video, which pages of other origins may show, and which a browser shows by themselves.
_MEDIA = ("/video/", "/image/")
_MEDIA_POLICY = "default-src 'none'; img-src 'self'; media-src 'self'; base-uri 'none'; form-action 'none'; "
# Exactly what the route of a view's page matches: below another path, as "/view/../index.html", the page with
# controls could be found.
VIEW_PAGE = re.compile("/view/[^/]+/[^/]+/[^/]+")


def refused_host(host: str, names: Collection[str]) -> Reason | None:
    """Return why a Host header is rejected; None if it is one of the console's.

    IP addresses are always accepted, because DNS rebinding needs a name.

    Args:
        names: Additional host names of the console.
    """
    try:
        name = urlsplit(f"//{host}").hostname or ""
    except ValueError:  # brackets around something else than an address
        name = ""
    if name in _OWN_NAMES or name in {each.lower() for each in names}:
        return None
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return codes.HTTP_HOST(host=host)
    return None


def refused_origin(origin: str, host: str, *, secure: bool = False) -> Reason | None:
    """Return why an Origin is rejected; None if it is the page's own.

    Args:
        secure: The page is served over TLS, so an origin of the same name without TLS is another page.
    """
    with contextlib.suppress(ValueError):  # brackets around something else than an address
        parts = urlsplit(origin)
        if origin and parts.netloc.lower() == host.lower() and (parts.scheme == "https" or not secure):
            return None
    return codes.HTTP_ORIGIN(origin=origin, host=host)


def _origin_of(address: str) -> str:
    """Return the origin of an address; empty: it has none."""
    with contextlib.suppress(ValueError):
        parts = urlsplit(address)
        if parts.scheme and parts.netloc:
            return f"{parts.scheme}://{parts.netloc}".lower()
    return ""


def refused_body(scope: Scope, headers: Headers) -> RefusedRequest | None:
    """Return the refusal if a body is declared too large, or is not allowed; otherwise None.

    The body's reader counts a chunked body, which declares no size.
    """
    lengths, pieces = headers.getlist("content-length"), headers.getlist("transfer-encoding")
    if lengths and pieces:
        # A proxy before the console may have seen the end of the request elsewhere (RFC 9112, 6.1).
        return RefusedRequest(400, codes.HTTP_TWO_LENGTHS())
    if scope["method"] in _READING:
        if pieces or lengths not in ([], ["0"]):
            return RefusedRequest(400, codes.HTTP_BODY(method=scope["method"]))
        return None
    most = next((most for path, most in _MOST_BODY if scope["path"].startswith(path)), 0)
    if lengths and (not lengths[0].isdecimal() or int(lengths[0]) > most):
        return RefusedRequest(413, codes.TOO_LARGE(bytes=most))
    return None


class Guard:
    """ASGI middleware that checks Host and Origin, limits bodies, and adds security headers to responses.

    Args:
        secure: The console is served over TLS.
        embed: Origins whose pages may show pictures, video, and the pages of single views in frames.
    """

    def __init__(
        self,
        app: ASGIApp,
        names: Collection[str] = (),
        *,
        secure: bool = False,
        embed: Collection[str] = (),
    ) -> None:
        self._app = app
        self._names, self._embed = names, embed
        self._secure = secure
        self._headers = SECURITY_HEADERS | ({"Strict-Transport-Security": _HSTS} if secure else {})
        policy = f"{_PAGE_POLICY}frame-ancestors {' '.join(embed)}"
        self._framed_headers = self._headers | {"Content-Security-Policy": policy}
        # It knows no origins. Browsers ignore it beside `frame-ancestors`, other programs need not.
        del self._framed_headers["X-Frame-Options"]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward a request that passes the checks; reject others."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        refused = self._refused(scope, headers)
        added = self._headers
        if scope["type"] == "http" and scope["path"].startswith(_MEDIA):
            added = added | self._media_headers(headers)
        elif scope["type"] == "http" and self._embed and VIEW_PAGE.fullmatch(scope["path"]):
            added = self._framed_headers

        async def send_guarded(message: Message) -> None:
            if message["type"].endswith("http.response.start"):  # also of a refused WebSocket
                MutableHeaders(scope=message).update(added)
            await send(message)

        if refused is None:
            await self._app(scope, receive, send_guarded)
        else:
            if scope["type"] == "websocket":
                refused.status = 403
            answer = as_text(refused)
            # Further bytes of this connection may be the rest of the rejected request.
            answer.headers["Connection"] = "close"
            await answer(scope, receive, send_guarded)

    def _media_headers(self, headers: Headers) -> dict[str, str]:
        """Return the headers of pictures and video: a page of a listed origin may show them."""
        origin = headers.get("origin") or _origin_of(headers.get("referer", ""))
        added = {
            "Content-Security-Policy": f"{_MEDIA_POLICY}frame-ancestors 'none'",
            "Vary": "Origin, Referer",
        }
        if origin in self._embed:
            added["Cross-Origin-Resource-Policy"] = "cross-origin"
            added["Access-Control-Allow-Origin"] = origin
        return added

    def _refused(self, scope: Scope, headers: Headers) -> RefusedRequest | None:
        host = headers.get("host", "")
        if (problem := refused_host(host, self._names)) is not None:
            return RefusedRequest(421, problem)
        changing = scope["type"] == "websocket" or scope["method"] not in _READING
        if changing:
            # Browsers send this header (not all for WebSockets); other clients need not.
            site = headers.get("sec-fetch-site", "same-origin")
            if scope["type"] == "http" and site != "same-origin":
                return RefusedRequest(403, codes.HTTP_OTHER_PAGE())
            if problem := refused_origin(headers.get("origin", ""), host, secure=self._secure):
                return RefusedRequest(403, problem)
        return refused_body(scope, headers) if scope["type"] == "http" else None
