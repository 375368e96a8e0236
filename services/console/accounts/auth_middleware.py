"""The gate: what is open to everybody, and that everything else needs a session.

Closed unless named here. A request of a session ends with it, however long it would take.
"""

import asyncio
import time

from starlette.responses import JSONResponse, PlainTextResponse
from starlette.types import ASGIApp, Receive, Scope, Send

from services.console.accounts.rights import PASSWORD_AGAIN, lacks_right
from services.console.accounts.sessions import Sessions, SignedIn

# The page itself is no secret; what it shows is.
_OPEN = frozenset({"/", "/index.html", "/icon.svg", "/health", "/account/me", "/account/sign-in"})
# What changes the site for everybody.
_NEEDS_OPERATOR = frozenset({"/define/save", "/define/start", "/define/stop"})
_OPEN_BELOW = "/assets/"
# Of a page that is told that it is signed out; RFC 6455 leaves these to us.
SIGNED_OUT = 4401


def is_open(path: str) -> bool:
    """Whether a path needs no session."""
    return path in _OPEN or path.startswith(_OPEN_BELOW)


def cookie_name(site: str, *, secure: bool) -> str:
    """The cookie's name. A browser takes `__Host-` from this host over TLS alone, so nobody plants it.

    Cookies know no ports: the site keeps two consoles of one machine apart.
    """
    return f"{'__Host-' if secure else ''}robomesh-{site}"


class Gate:
    """ASGI middleware: finds the session (`scope["signed_in"]`), and refuses where there must be one."""

    def __init__(self, app: ASGIApp, sessions: Sessions, cookie: str) -> None:
        self._app, self._sessions, self._cookie = app, sessions, cookie

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Passes on what is allowed."""
        found = self._find(scope)
        scope["signed_in"] = found
        if found is None and not is_open(scope["path"]):
            if scope["type"] == "websocket":
                await send({"type": "websocket.close", "code": SIGNED_OUT})
            else:
                refusal = {"error": "sign_in", "text": "sign in first"}
                headers = {"Cache-Control": "no-store"}
                await JSONResponse(refusal, status_code=401, headers=headers)(scope, receive, send)
        elif found is not None and scope["path"] in _NEEDS_OPERATOR and not found.may_command:
            account = found.account
            reason = PASSWORD_AGAIN if account.may_command else lacks_right(account, "this")
            await PlainTextResponse(reason.text, status_code=403)(scope, receive, send)
        elif found is None or scope["type"] == "websocket" or scope["path"].startswith("/account/"):
            await self._app(scope, receive, send)  # a page is told why its connection ends
        else:
            try:
                with found.serving():
                    await self._app(scope, receive, send)
            except asyncio.CancelledError:
                if not found.ended:
                    raise

    def _find(self, scope: Scope) -> SignedIn | None:
        now = time.monotonic()
        for name, value in scope["headers"]:
            if name != b"cookie":
                continue
            for part in value.decode("latin-1").split(";"):
                key, _, token = part.strip().partition("=")
                # A cookie of ours planted beside the right one hides it from nobody.
                if key == self._cookie and (found := self._sessions.of(token, now)) is not None:
                    return found
        return None
