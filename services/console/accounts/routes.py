"""`/account/*`: signing in and out, one's own sessions and password, and, for administrators, the accounts.

JSON both ways. What is refused says so in one word for the page (`error`) and in words (`text`).
"""

import json
import math
import time
from collections.abc import Mapping
from typing import Any

from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from services.console.accounts.auth_service import Desk, SignInError
from services.console.accounts.file import AccountRole, role_of
from services.console.accounts.rights import operator_name
from services.console.accounts.sessions import SignedIn
from services.console.errors import AccountsError, SignInBusyError
from services.console.http.error_responses import Handler, answered

Json = dict[str, Any]

MOST_BODY = 16 * 1024


class RefusedError(Exception):
    """A request of `/account` that is refused: HTTP's status, a word for the page, a sentence."""

    def __init__(self, status: int, error: str, text: str, **more: object) -> None:
        super().__init__(text)
        self.status, self.answer = status, {"error": error, "text": text, **more}


class AccountRoutes:
    """The routes.

    Args:
        desk: None: this console has no accounts.
        cookie: The cookie's name.
        secure: Whether the page is served over TLS.
        insecure: Whether others can reach it without.
    """

    def __init__(self, desk: Desk | None, *, site: str, cookie: str, secure: bool, insecure: bool) -> None:
        self._desk, self._site, self._cookie = desk, site, cookie
        self._secure, self._insecure = secure, insecure

    def routes(self) -> list[Route]:
        """Everything below /account."""
        here = [Route("/account/me", _answered(self.me), methods=["GET"])]
        if self._desk is None:
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
    def desk(self) -> Desk:
        """The desk, where there are accounts."""
        assert self._desk is not None
        return self._desk

    async def me(self, request: Request) -> Response:
        """Who is signed in here, if anybody, and how the page is reached."""
        return self._me(request.scope.get("signed_in"))

    def _me(self, who: SignedIn | None) -> JSONResponse:
        account = None if who is None else who.account
        return JSONResponse(
            {
                "accounts": self._desk is not None,
                "site": self._site,
                "secure": self._secure,
                "insecure": self._insecure,
                "account": "" if account is None else account.name,
                "role": "" if account is None else account.role.value,
                "operator": "" if account is None else operator_name(account.name, self._site),
                "may_command": self._desk is None or (who is not None and who.may_command),
                "resting": who is not None and who.resting,
                "session": "" if who is None else who.id,
            }
        )

    # ------------------------------------------------------------------------- sessions

    async def sign_in(self, request: Request) -> Response:
        """A name and a password for a session; never the one that the browser came with."""
        asked = await _json(request, "name", "password")
        token, signed_in = await self.desk.sign_in(
            asked["name"].strip().lower(),
            asked["password"],
            address=_address(request),
            agent=request.headers.get("user-agent", ""),
            before=request.scope.get("signed_in"),
        )
        return self._with_token(self._me(signed_in), token)

    async def unlock(self, request: Request) -> Response:
        """The password again, for the right to command."""
        asked = await _json(request, "password")
        who = _who(request)
        token = await self.desk.unlock(who, asked["password"], address=_address(request))
        return self._with_token(self._me(who), token)

    async def sign_out(self, request: Request) -> Response:
        """Ends this session, or with `everywhere` all of the account."""
        asked = await _json(request)
        self.desk.sign_out(_who(request), everywhere=asked.get("everywhere") is True)
        answer = self._me(None)
        answer.delete_cookie(self._cookie, path="/", secure=self._secure, httponly=True, samesite="strict")
        return answer

    async def active(self, request: Request) -> Response:
        """A person touched the page: the right to command does not rest yet."""
        await _json(request)
        who = _who(request)
        self.desk.sessions.touched(who, time.monotonic())
        return self._me(who)

    async def password(self, request: Request) -> Response:
        """A new password of one's own."""
        asked = await _json(request, "password", "new")
        who = _who(request)
        await self.desk.change_password(who, asked["password"], asked["new"], address=_address(request))
        return self._me(who)

    async def sessions(self, request: Request) -> Response:
        """One's own sessions; for administrators everybody's."""
        who = _who(request)
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
                        "this": each is who,
                    }
                    for each in self.desk.sessions
                    if self._may_see(who, each)
                ]
            }
        )

    async def end_session(self, request: Request) -> Response:
        """Ends one of the sessions that one sees."""
        asked = await _json(request, "end")
        who = _who(request)
        for each in self.desk.sessions:
            if each.id == asked["end"] and self._may_see(who, each):
                self.desk.sessions.end(
                    each, "signed_out" if each.account.name == who.account.name else "ended"
                )
                return JSONResponse({"ended": each.id})
        raise RefusedError(404, "no_session", f"there is no session {asked['end'][:20]!r} any more")

    @staticmethod
    def _may_see(who: SignedIn, other: SignedIn) -> bool:
        return other.account.name == who.account.name or who.account.role is AccountRole.ADMIN

    # ------------------------------------------------------------------------- accounts

    async def accounts(self, request: Request) -> Response:
        """Every account, never a hash."""
        _admin(request)
        return self._accounts()

    def _accounts(self) -> Response:
        signed_in = [each.account.name for each in self.desk.sessions]
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
                    for each in self.desk.sessions.accounts.values()
                ],
                "roles": [role.value for role in AccountRole],
            }
        )

    async def change_account(self, request: Request) -> Response:
        """`action`: add, role, password, disable, enable, remove; `name`; `role`, `password` where needed."""
        asked = await _json(request, "action", "name")
        by = _admin(request)
        if by.resting:
            raise RefusedError(403, "resting", "give your password again first")
        role = role_of(asked["role"]) if isinstance(asked.get("role"), str) else None
        password = asked.get("password")
        password = password if isinstance(password, str) else ""
        await self.desk.set_account(by, asked["action"], asked["name"], role=role, password=password)
        return self._accounts()

    def _with_token(self, answer: Response, token: str) -> Response:
        answer.set_cookie(
            self._cookie, token, path="/", secure=self._secure, httponly=True, samesite="strict"
        )
        return answer


def _who(request: Request) -> SignedIn:
    who = request.scope.get("signed_in")
    # The gate has seen to it, but the session may have ended while the body came.
    if not isinstance(who, SignedIn) or who.ended:
        raise RefusedError(401, "sign_in", "sign in first")
    return who


def _admin(request: Request) -> SignedIn:
    who = _who(request)
    if who.account.role is not AccountRole.ADMIN:
        raise RefusedError(403, "not_admin", f"{who.account.name} is no administrator")
    return who


def _address(request: Request) -> str:
    return request.client.host if request.client else "unknown"


async def _json(request: Request, *texts: str) -> Json:
    """A request's JSON object with these texts in it.

    Raises:
        RefusedError: If it is none, or too large. Of another content type too: a page elsewhere can send
            a form, but no JSON, without asking first.
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
            # Never with the value in it.
            raise RefusedError(422, "missing", f"{name}: must be a text")
    return asked


def _answered(handler: Handler) -> Handler:
    return answered(handler, _refused)


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
