"""Authentication middleware: every path needs a session, except those listed here.

A request is cancelled when its session ends, however long it would take.
"""

import asyncio
import time

from starlette.types import ASGIApp, Receive, Scope, Send

from robomesh import reason_codes as codes
from services.console.accounts.rights import PASSWORD_AGAIN, lacks_right
from services.console.accounts.routes import refused
from services.console.accounts.sessions import Sessions, SignedIn
from services.console.errors import RefusedRequest
from services.console.http.error_responses import as_json

# The page's files are public; its data is not.
_OPEN = frozenset({"/", "/index.html", "/icon.svg", "/health", "/account/me", "/account/sign-in"})
# Requests that change the site.
_NEEDS_OPERATOR = frozenset({"/define/save", "/define/start", "/define/stop"})
_OPEN_BELOW = "/assets/"
# Close code for a page without a session; RFC 6455 leaves this range to applications.
SIGNED_OUT = 4401


def is_open(path: str) -> bool:
    """Return whether a path needs no session."""
    return path in _OPEN or path.startswith(_OPEN_BELOW)


def cookie_name(site: str, *, secure: bool) -> str:
    """Return the cookie's name. Browsers accept `__Host-` cookies only from this host over TLS.

    Cookies ignore the port, so the site's name distinguishes two consoles of one machine.
    """
    return f"{'__Host-' if secure else ''}robomesh-{site}"


class AuthMiddleware:
    """ASGI middleware that finds the session (`scope["signed_in"]`) and rejects requests that need one."""

    def __init__(self, app: ASGIApp, sessions: Sessions, cookie: str) -> None:
        self._app, self._sessions, self._cookie = app, sessions, cookie

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward a request that is allowed; reject others."""
        found = self._find(scope)
        scope["signed_in"] = found
        if found is None and not is_open(scope["path"]):
            status = 401 if scope["type"] == "http" else 403
            await as_json(refused(status, codes.ACCOUNT_SIGN_IN()))(scope, receive, send)
        elif found is not None and scope["path"] in _NEEDS_OPERATOR and not found.may_command:
            account = found.account
            what = scope["path"].removeprefix("/")
            reason = PASSWORD_AGAIN if account.may_command else lacks_right(account, what)
            await as_json(RefusedRequest(403, reason))(scope, receive, send)
        elif found is None or scope["type"] == "websocket" or scope["path"].startswith("/account/"):
            await self._app(scope, receive, send)  # these end by themselves, with a reason
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
                # Try all cookies of this name: another domain may have set one, too.
                if key == self._cookie and (found := self._sessions.find(token, now)) is not None:
                    return found
        return None
