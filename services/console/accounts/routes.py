"""`/account/*`: sign-in and sign-out, own sessions and password, and for administrators the accounts.

JSON in both directions. An error has a word for the page (`error`) and a sentence (`text`).
"""

import json
import math
import time
from collections.abc import Mapping
from typing import Any

from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from services.console.accounts.auth_service import AuthService, SignInError
from services.console.accounts.file import AccountRole, role_of
from services.console.accounts.rights import operator_name
from services.console.accounts.sessions import SignedIn
from services.console.errors import AccountsError, SignInBusyError
from services.console.http.error_responses import Handler, with_error_responses

Json = dict[str, Any]

MOST_BODY = 16 * 1024


class RefusedError(Exception):
    """A refused request of `/account`: HTTP status, a word for the page, a sentence."""

    def __init__(self, status: int, error: str, text: str, **more: object) -> None:
        super().__init__(text)
        self.status, self.answer = status, {"error": error, "text": text, **more}


class AccountRoutes:
    """The routes below `/account`.

    Args:
        auth: The authentication service; None: this console has no accounts.
        cookie: The cookie's name.
        secure: The page is served over TLS.
        insecure: Other machines can reach the page without TLS.
    """

    def __init__(
        self, auth: AuthService | None, *, site: str, cookie: str, secure: bool, insecure: bool
    ) -> None:
        self._auth, self._site, self._cookie = auth, site, cookie
        self._secure, self._insecure = secure, insecure

    def routes(self) -> list[Route]:
        """Return the routes."""
        here = [Route("/account/me", _answered(self.me), methods=["GET"])]
        if self._auth is None:
            return here
        return [
            *here,
            Route("/account/sign-in", _answered(self.sign_in), methods=["POST"]),
            Route("/account/sign-out", _answered(self.sign_out), methods=["POST"]),
            Route("/account/unlock", _answered(self.unlock), methods=["POST"]),
            Route("/account/active", _answered(self.active), methods=["POST"]),
            Route("/account/password", _answered(self.password), methods=["POST"]),
            Route("/account/sessions", _answered(self.sessions), methods=["GET"]),
            Route("/account/sessions", _answered(self.end_session), methods=["POST"]),
            Route("/account/accounts", _answered(self.accounts), methods=["GET"]),
            Route("/account/accounts", _answered(self.change_account), methods=["POST"]),
        ]

    @property
    def auth(self) -> AuthService:
        """The authentication service; there must be accounts."""
        assert self._auth is not None
        return self._auth

    async def me(self, request: Request) -> Response:
        """Return the signed-in user, and how the page is served."""
        return self._me(request.scope.get("signed_in"))

    def _me(self, user: SignedIn | None) -> JSONResponse:
        account = None if user is None else user.account
        return JSONResponse(
            {
                "accounts": self._auth is not None,
                "site": self._site,
                "secure": self._secure,
                "insecure": self._insecure,
                "account": "" if account is None else account.name,
                "role": "" if account is None else account.role.value,
                "operator": "" if account is None else operator_name(account.name, self._site),
                "may_command": self._auth is None or (user is not None and user.may_command),
                "resting": user is not None and user.resting,
                "session": "" if user is None else user.id,
            }
        )

    # ------------------------------------------------------------------------- sessions

    async def sign_in(self, request: Request) -> Response:
        """Sign in with a name and a password; the browser gets a new token in any case."""
        asked = await _json(request, "name", "password")
        token, signed_in = await self.auth.sign_in(
            asked["name"].strip().lower(),
            asked["password"],
            address=_address(request),
            agent=request.headers.get("user-agent", ""),
            before=request.scope.get("signed_in"),
        )
        return self._with_token(self._me(signed_in), token)

    async def unlock(self, request: Request) -> Response:
        """Accept the password again, to restore the right to command."""
        asked = await _json(request, "password")
        user = _signed_in(request)
        token = await self.auth.unlock(user, asked["password"], address=_address(request))
        return self._with_token(self._me(user), token)

    async def sign_out(self, request: Request) -> Response:
        """End this session, or with `everywhere` all sessions of the account."""
        asked = await _json(request)
        self.auth.sign_out(_signed_in(request), everywhere=asked.get("everywhere") is True)
        answer = self._me(None)
        answer.delete_cookie(self._cookie, path="/", secure=self._secure, httponly=True, samesite="strict")
        return answer

    async def active(self, request: Request) -> Response:
        """Record activity of a person, which keeps the right to command."""
        await _json(request)
        user = _signed_in(request)
        self.auth.sessions.touched(user, time.monotonic())
        return self._me(user)

    async def password(self, request: Request) -> Response:
        """Change the user's own password."""
        asked = await _json(request, "password", "new")
        user = _signed_in(request)
        await self.auth.change_password(user, asked["password"], asked["new"], address=_address(request))
        return self._me(user)

    async def sessions(self, request: Request) -> Response:
        """Return the user's own sessions; for administrators all sessions."""
        user = _signed_in(request)
        return JSONResponse(
            {
                "sessions": [
                    {
                        "id": each.id,
                        "account": each.account.name,
                        "role": each.account.role.value,
                        "address": each.address,
                        "agent": each.agent,
                        "began": each.began.isoformat(),
                        "pages": len(each.pages),
                        "resting": each.resting,
                        "this": each is user,
                    }
                    for each in self.auth.sessions
                    if self._may_see(user, each)
                ]
            }
        )

    async def end_session(self, request: Request) -> Response:
        """End a session that the user may see."""
        asked = await _json(request, "end")
        user = _signed_in(request)
        for each in self.auth.sessions:
            if each.id == asked["end"] and self._may_see(user, each):
                self.auth.sessions.end(
                    each, "signed_out" if each.account.name == user.account.name else "ended"
                )
                return JSONResponse({"ended": each.id})
        raise RefusedError(404, "no_session", f"there is no session {asked['end'][:20]!r} any more")

    @staticmethod
    def _may_see(user: SignedIn, other: SignedIn) -> bool:
        return other.account.name == user.account.name or user.account.role is AccountRole.ADMIN

    # ------------------------------------------------------------------------- accounts

    async def accounts(self, request: Request) -> Response:
        """Return every account, without its hash."""
        _admin(request)
        return self._accounts()

    def _accounts(self) -> Response:
        signed_in = [each.account.name for each in self.auth.sessions]
        return JSONResponse(
            {
                "accounts": [
                    {
                        "name": each.name,
                        "role": each.role.value,
                        "created": each.created.isoformat(),
                        "disabled": each.disabled,
                        "sessions": signed_in.count(each.name),
                    }
                    for each in self.auth.sessions.accounts.values()
                ],
                "roles": [role.value for role in AccountRole],
            }
        )

    async def change_account(self, request: Request) -> Response:
        """Change an account: `action` is add, role, password, disable, enable or remove, for `name`."""
        asked = await _json(request, "action", "name")
        by = _admin(request)
        if by.resting:
            raise RefusedError(403, "resting", "give your password again first")
        role = role_of(asked["role"]) if isinstance(asked.get("role"), str) else None
        password = asked.get("password")
        password = password if isinstance(password, str) else ""
        await self.auth.set_account(by, asked["action"], asked["name"], role=role, password=password)
        return self._accounts()

    def _with_token(self, answer: Response, token: str) -> Response:
        answer.set_cookie(
            self._cookie, token, path="/", secure=self._secure, httponly=True, samesite="strict"
        )
        return answer


def _signed_in(request: Request) -> SignedIn:
    user = request.scope.get("signed_in")
    # The middleware has checked this, but the session may have ended while the body arrived.
    if not isinstance(user, SignedIn) or user.ended:
        raise RefusedError(401, "sign_in", "sign in first")
    return user


def _admin(request: Request) -> SignedIn:
    user = _signed_in(request)
    if user.account.role is not AccountRole.ADMIN:
        raise RefusedError(403, "not_admin", f"{user.account.name} is not an administrator")
    return user


def _address(request: Request) -> str:
    return request.client.host if request.client else "unknown"


async def _json(request: Request, *texts: str) -> Json:
    """Return a request's JSON object, which must have the given texts.

    Raises:
        RefusedError: If the body is invalid or too large, or has another content type: a page of another site
            can
            send a form without permission, but no JSON.
    """
    if request.headers.get("content-type", "").partition(";")[0].strip().lower() != "application/json":
        raise RefusedError(415, "not_json", "send application/json")
    body = bytearray()
    async for chunk in request.stream():
        body += chunk
        if len(body) > MOST_BODY:
            raise RefusedError(413, "too_large", f"the request is larger than {MOST_BODY} bytes")
    try:
        asked = json.loads(body)
    except (ValueError, RecursionError):
        raise RefusedError(400, "not_json", "the request is not JSON") from None
    if not isinstance(asked, dict):
        raise RefusedError(400, "not_json", "the request must be a JSON object")
    for name in texts:
        if not isinstance(asked.get(name), str):
            # The text must not contain the value.
            raise RefusedError(422, "missing", f"{name}: must be a text")
    return asked


def _answered(handler: Handler) -> Handler:
    return with_error_responses(handler, _refused)


def _refused(error: Exception) -> Response | None:
    match error:
        case RefusedError():
            return JSONResponse(error.answer, status_code=error.status)
        case SignInError():
            return _refused_sign_in(error)
        case SignInBusyError():
            return _refusal(503, "busy", str(error), {"Retry-After": "1"})
        case AccountsError():
            return _refusal(422, error.word, str(error))
        case _:
            return None


def _refused_sign_in(error: SignInError) -> Response:
    if error.wait_s <= 0:
        return _refusal(401, "wrong", str(error))
    seconds = math.ceil(error.wait_s)
    text = f"{error}: again in {seconds} s"
    return _refusal(429, "wait", text, {"Retry-After": str(seconds)}, seconds=seconds)


def _refusal(
    status: int, error: str, text: str, headers: Mapping[str, str] | None = None, **more: object
) -> Response:
    return JSONResponse({"error": error, "text": text, **more}, status_code=status, headers=headers)
