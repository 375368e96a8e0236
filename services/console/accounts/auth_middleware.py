"""Authentication middleware: every path needs a session, except those listed here.

A view token (`?token=`) opens the pictures and the page of one view instead of a session; a session precedes
it. A request is cancelled when its session or token ends, however long it would take.
"""

import asyncio
import math
import time
from collections.abc import Sequence
from urllib.parse import parse_qsl, urlencode

from starlette.routing import Match, Route
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from robomesh import reason_codes as codes
from services.console.accounts.auth_service import AuthService
from services.console.accounts.rights import PASSWORD_AGAIN, lacks_right
from services.console.accounts.routes import client_address, refused
from services.console.accounts.sessions import SignedIn
from services.console.accounts.view_access import TokenRequest
from services.console.common.error_responses import as_json
from services.console.common.errors import RefusedRequest, SignInError
from services.console.common.guard import VIEW_PAGE

# The page's files are public; its data is not.
_OPEN = frozenset({"/", "/index.html", "/icon.svg", "/health", "/account/me", "/account/sign-in"})
# Requests that change the site.
_NEEDS_OPERATOR = frozenset({"/define/save", "/define/start", "/define/stop"})
_OPEN_BELOW = "/assets/"
# Close code for a page without a session; RFC 6455 leaves this range to applications.
SIGNED_OUT = 4401


def is_open(path: str) -> bool:
    """Return whether a path needs no session."""
    return path in _OPEN or path.startswith(_OPEN_BELOW) or VIEW_PAGE.fullmatch(path) is not None


def cookie_name(site: str, *, secure: bool) -> str:
    """Return the cookie's name. Browsers accept `__Host-` cookies only from this host over TLS.

    Cookies ignore the port, so the site's name distinguishes two consoles of one machine.
    """
    return f"{'__Host-' if secure else ''}robomesh-{site}"


class AuthMiddleware:
    """ASGI middleware that finds the session (`scope["signed_in"]`) and rejects requests that need one.

    Args:
        viewing: Routes that a view token opens, with the parameters `site`, `robot` and `view`.
    """

    def __init__(self, app: ASGIApp, auth: AuthService, cookie: str, viewing: Sequence[Route]) -> None:
        self._app, self._sessions, self._cookie = app, auth.sessions, cookie
        self._tokens, self._viewing = auth.tokens, viewing

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward a request that is allowed; reject others."""
        asked = self._take_token(scope)
        found = self._find(scope)
        scope["signed_in"] = found
        if found is None and asked is not None:
            try:
                granted = self._tokens.check(*asked, address=client_address(scope))
            except SignInError as error:
                await as_json(_refused_token(error))(scope, receive, send)
            else:
                await self._serve(granted, scope, receive, send)
        elif found is None and not is_open(scope["path"]):
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
            await self._serve(found, scope, receive, send)

    async def _serve(
        self, granted: SignedIn | TokenRequest, scope: Scope, receive: Receive, send: Send
    ) -> None:
        started = False

        async def send_and_note(message: Message) -> None:
            nonlocal started
            started = True
            await send(message)

        try:
            with granted.serving():
                await self._app(scope, receive, send_and_note)
        except asyncio.CancelledError:
            if not granted.ended:
                raise
            if not started:  # otherwise the answer just ends
                await as_json(refused(401, codes.ACCOUNT_SIGN_IN()))(scope, receive, send)

    def _take_token(self, scope: Scope) -> tuple[str, str, str] | None:
        """Remove the token from a request for a view; return it with the robot and the view.

        So that no handler, refusal or log can contain it.
        """
        if scope["type"] != "http" or is_open(scope["path"]) or b"token=" not in scope["query_string"]:
            return None  # the page itself is public, and reads its stream with the token
        for route in self._viewing:
            match, matched = route.matches(scope)
            if match is Match.FULL:
                pairs = parse_qsl(scope["query_string"].decode("latin-1"), keep_blank_values=True)
                token = next((value for name, value in pairs if name == "token"), "")
                scope["query_string"] = urlencode([pair for pair in pairs if pair[0] != "token"]).encode()
                path = matched["path_params"]
                return token, f"{path['site']}/{path['robot']}", path["view"]
        return None

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


def _refused_token(error: SignInError) -> RefusedRequest:
    if error.wait_s > 0:
        return refused(429, error.reason, again_s=error.wait_s, seconds=math.ceil(error.wait_s))
    return refused(403 if error.reason.code == codes.TOKEN_OTHER_VIEW.name else 401, error.reason)
