"""A console with accounts, and browsers that sign in over real sockets, without a client library."""

import json
from contextlib import asynccontextmanager
from dataclasses import dataclass
from functools import cache
from unittest.mock import patch

from argon2 import PasswordHasher
from websockets.asyncio.client import connect

from services.console.accounts import passwords
from services.console.accounts.auth_service import change_account
from services.console.accounts.file import AccountRole
from tests.services.test_console import Page, console, get

PASSWORD = "three arms in a hall"
ROLES = {"li": AccountRole.OPERATOR, "zhao": AccountRole.MONITOR, "chen": AccountRole.ADMIN}


@cache
def cheap_hasher():
    """Return a cheap hasher for tests, which sign in a hundred times."""
    return PasswordHasher(time_cost=1, memory_cost=64, parallelism=1)


@cache
def hashed():
    """Return a password's hash."""
    return cheap_hasher().hash(PASSWORD)


def accounts_file(folder):
    """Write a file with an operator li, a monitor zhao and an administrator chen."""
    path = folder / "accounts.toml"
    for name, role in ROLES.items():
        change_account(path, "add", name, role=role, hashed=hashed())
    return path


@dataclass
class Client:
    """A browser: its cookie, and requests like those of a page."""

    address: str
    cookie: str = ""

    async def get(self, path, **headers):
        return await get(self.address, path, **self._with_cookie(headers))

    async def post(self, path, body=None, **headers):
        """Return status, headers and JSON of the response."""
        data = body if isinstance(body, bytes) else json.dumps(body or {}).encode()
        own = {"Origin": f"http://{self.address}", "Content-Type": "application/json"}
        given = {**own, "Content-Length": str(len(data)), **headers}
        status, answer, text = await get(
            self.address, path, method="POST", body=data, **self._with_cookie(given)
        )
        told = json.loads(text) if answer.get("content-type") == "application/json" else text.decode()
        return status, answer, told

    async def sign_in(self, name, password=PASSWORD):
        """Sign in, and keep the cookie."""
        answer = await self.post("/account/sign-in", {"name": name, "password": password})
        self.keep(answer[1])
        return answer

    def keep(self, headers):
        if "set-cookie" in headers:
            self.cookie = headers["set-cookie"].split(";")[0]

    @asynccontextmanager
    async def browse(self, path="/mesh", **headers):
        own = {"Cookie": self.cookie} if self.cookie else {}
        origin = headers.pop("origin", f"http://{self.address}")
        async with connect(
            f"ws://{self.address}{path}", origin=origin, additional_headers=own | headers, compression=None
        ) as socket:
            yield Page(socket)

    def _with_cookie(self, headers):
        return {"Cookie": self.cookie, **headers} if self.cookie else headers


@asynccontextmanager
async def guarded(mesh, page, folder, **settings):
    """Yield a running console with accounts: a client that is not signed in, a session, and the file."""
    path = accounts_file(folder)
    with patch.object(passwords, "_hasher", cheap_hasher):
        async with console(mesh, page, accounts=path, **settings) as (address, other):
            yield Client(address), other, path
