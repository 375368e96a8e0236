"""`/account/*`: sign-in and sign-out, own sessions and password, and for administrators the accounts.

JSON in both directions. A refusal also has a word (`error`), for programs that do not read its code.
"""

import math
import time
from typing import Any

from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route
from starlette.types import Scope

from robomesh import bounded_json
from robomesh import reason_codes as codes
from robomesh.reasons import Reason
from services.console.accounts.auth_service import AuthService
from services.console.accounts.file import AccountRole, role_of
from services.console.accounts.rights import operator_name
from services.console.accounts.sessions import SignedIn
from services.console.common.error_responses import Handler, as_json, with_error_responses
from services.console.common.errors import AccountsError, RefusedRequest, SignInBusyError, SignInError

Json = dict[str, Any]

MOST_BODY = 16 * 1024
# The words of codes whose last part is not the word.
_WORDS = {
    codes.PASSWORD_AGAIN.name: "resting",
    codes.NOT_JSON_OBJECT.name: "not_json",
    codes.NEEDS_TEXT.name: "missing",
    codes.ACCOUNT_PASSWORD_WRONG.name: "wrong",
    codes.ACCOUNT_ROLE.name: "refused",
    codes.ACCOUNT_ACTION.name: "refused",
    codes.ACCOUNT_FAILED.name: "refused",
}


def refused(status: int, reason: Reason, *, again_s: float | None = None, **more: object) -> RefusedRequest:
    """Return a refusal of `/account`, with the word of its code."""
    word = _WORDS.get(reason.code, reason.code.rpartition(".")[2])
    return RefusedRequest(status, reason, again_s=again_s, error=word, **more)


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
            address=client_address(request.scope),
            agent=request.headers.get("user-agent", ""),
            before=request.scope.get("signed_in"),
        )
        return self._with_token(self._me(signed_in), token)

    async def unlock(self, request: Request) -> Response:
        """Accept the password again, to restore the right to command."""
        asked = await _json(request, "password")
        user = _signed_in(request)
        token = await self.auth.unlock(user, asked["password"], address=client_address(request.scope))
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
        await self.auth.change_password(
            user, asked["password"], asked["new"], address=client_address(request.scope)
        )
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
        raise refused(404, codes.ACCOUNT_NO_SESSION(session=asked["end"][:20]))

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
            raise refused(403, codes.PASSWORD_AGAIN())
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
        raise refused(401, codes.ACCOUNT_SIGN_IN())
    return user


def _admin(request: Request) -> SignedIn:
    user = _signed_in(request)
    if user.account.role is not AccountRole.ADMIN:
        raise refused(403, codes.ACCOUNT_NOT_ADMIN(account=user.account.name))
    return user


def client_address(scope: Scope) -> str:
    """Return the client's IP address."""
    return scope["client"][0] if scope.get("client") else "unknown"


async def _json(request: Request, *texts: str) -> Json:
    """Return a request's JSON object, which must have the given texts.

    Raises:
        RefusedRequest: If the body is invalid or too large, or has another content type: a page of another
            site can send a form without permission, but no JSON.
    """
    if request.headers.get("content-type", "").partition(";")[0].strip().lower() != "application/json":
        raise refused(415, codes.NOT_JSON(detail="its content type is not application/json"))
    body = bytearray()
    async for chunk in request.stream():
        body += chunk
        if len(body) > MOST_BODY:
            raise refused(413, codes.TOO_LARGE(bytes=MOST_BODY))
    try:
        asked = bounded_json.loads(body)
    except (ValueError, RecursionError) as error:
        # Names the place, never the password.
        raise refused(400, codes.NOT_JSON(detail=error)) from None
    if not isinstance(asked, dict):
        raise refused(400, codes.NOT_JSON_OBJECT())
    for name in texts:
        if not isinstance(asked.get(name), str):
            # The refusal must not contain the value.
            raise refused(422, codes.NEEDS_TEXT(field=name))
    return asked


def _answered(handler: Handler) -> Handler:
    return with_error_responses(handler, as_json, _refused)


def _refused(error: Exception) -> RefusedRequest | None:
    match error:
        case SignInBusyError():
            return refused(503, error.reason, again_s=error.wait_s)
        case SignInError() if error.wait_s > 0:
            return refused(429, error.reason, again_s=error.wait_s, seconds=math.ceil(error.wait_s))
        case SignInError():
            return refused(401, error.reason)
        case AccountsError():
            return refused(422, error.reason)
        case _:
            return None
