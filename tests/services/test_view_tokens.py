"""View tokens: what they open, what they do not, and their end, over real sockets."""

import asyncio
import json
import logging
import re
import stat
import time
from contextlib import asynccontextmanager
from datetime import UTC, datetime, timedelta
from unittest.mock import create_autospec

import pytest
from starlette.routing import Mount, WebSocketRoute
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus

from services.command_line.main import run as command
from services.console.accounts import view_access
from services.console.accounts.auth_middleware import AuthMiddleware
from services.console.accounts.auth_service import AuthService, change_account
from services.console.accounts.file import AccountRole, read_accounts
from services.console.accounts.view_access import add_token, revoke_token
from services.console.accounts.view_token import ViewToken
from services.console.app import Hub, Settings, application
from services.console.common.errors import AccountsError
from services.console.define.settings import DefineSettings
from services.site_file.site import Define, Site
from tests.services.http_refusals import read_refusal
from tests.services.signing_in import accounts_file, guarded, hashed
from tests.services.test_console import console, get, page
from tests.services.test_console_pictures import rendering, stream, unwatched
from tests.services.test_console_view_page import live_view

__all__ = ["page"]  # a fixture
OPENED = (
    "/video/s/r/front.mjpeg",
    "/video/s/r/front.mp4",
    "/image/s/r/front.jpg",
    "/image/s/r/front.png",
    "/view/s/r/front",
    "/view/s/r/front/live",
)
LISTED = "https://intranet.plant"


def allow(path, *, name="wall", robot="s/r", view="front", lasts=None):
    return add_token(path, name, robot, view, lasts=lasts)


@asynccontextmanager
async def shown(mesh, page, folder, **settings):
    """Yield a console with accounts and a renderer: a client, the renderer, another session, and the file."""
    async with (
        guarded(mesh, page, folder, **settings) as (client, other, path),
        rendering(other) as renderer,
    ):
        yield client, renderer, other, path


async def opens(client, path, *, method="GET", **headers):
    """Return the status of a request, also of one whose answer does not end."""
    lines = {"Host": client.address, **headers}
    host, port = client.address.split(":")
    reader, writer = await asyncio.open_connection(host, int(port))
    text = f"{method} {path} HTTP/1.1\r\n" + "".join(f"{k}: {v}\r\n" for k, v in lines.items())
    writer.write(f"{text}\r\n".encode())
    async with asyncio.timeout(40.0):
        head = (await reader.readuntil(b"\r\n\r\n")).decode()
    writer.close()
    assert "set-cookie" not in head.lower()
    assert "referrer-policy: no-referrer" in head.lower()
    return int(head.split()[1])


async def until_known(client, path, status=200):
    """Wait until the console has read the changed file."""
    async with asyncio.timeout(40.0):
        while await opens(client, path) != status:
            await asyncio.sleep(0.1)


async def test_a_token_opens_the_media_and_the_page_of_its_view(mesh, page, tmp_path):
    async with shown(mesh, page, tmp_path) as (client, renderer, _, path):
        token = allow(path)
        await until_known(client, f"/image/s/r/front.jpg?token={token}")
        for opened in OPENED:
            assert await opens(client, f"{opened}?token={token}") == 200, opened
            # The page itself is public, its stream is not.
            assert await opens(client, opened) == (200 if opened == "/view/s/r/front" else 401), opened
            assert await opens(client, f"{opened}?token={token}", method="HEAD") == 200, opened
        # It says itself what the token does not open.
        assert await opens(client, f"/view/s/r/top?token={token}") == 200
        assert await opens(client, f"/image/s/r/front.jpg?width=100&token={token}&height=80") == 200
        assert await opens(client, f"/image/s/r/front.jpg?token={token}", Range="bytes=0-9") == 200
        await client.sign_in("zhao")  # a session precedes a token
        assert (await client.get("/image/s/r/front.jpg?token=whatever"))[0] == 200
        await unwatched(renderer.images)


def paths_of(routes, before=""):
    """Yield path and methods of every route, with the parameters' values as in the token."""
    values = {"site": "s", "robot": "r", "view": "front", "name": "front", "sha": "0" * 64}
    for route in routes:
        here = before + route.path
        if isinstance(route, Mount):
            yield from paths_of(route.routes or [], here)
            yield f"{here}/index.html", {"GET"}
        else:
            names = {name: values.get(name, "front") for name in route.param_convertors}
            path = re.sub(r"\{(\w+)(:\w+)?\}", lambda match: names[match[1]], here)  # noqa: B023
            yield path, {"GET"} if isinstance(route, WebSocketRoute) else set(route.methods or {"GET"})


async def test_a_token_changes_nothing_on_any_other_route_of_the_app(mesh, page, tmp_path):
    site = Site(site="s", define=Define(folder=tmp_path / "robots"))
    define = DefineSettings(site=site, store=tmp_path / "store")

    async with shown(mesh, page, tmp_path, define=define) as (client, _, other, path):
        token = allow(path)
        await until_known(client, f"/image/s/r/front.jpg?token={token}")
        settings = Settings(site="s", page=page, accounts=path, define=define)
        app = application(Hub(other, settings, exposed=False))
        routes = list(paths_of(app._app.routes))
        assert {"/account/accounts", "/define/save", "/mesh", "/mesh/s/r/front"} <= {p for p, _ in routes}
        assert set(OPENED) <= {path for path, _ in routes}
        for at, methods in routes:
            if at in OPENED:
                methods = {"POST", "PUT", "DELETE"}
            for method in methods:
                headers = {} if method in ("GET", "HEAD") else {"Content-Length": "0"}
                own = {"Origin": f"http://{client.address}", "Content-Type": "application/json"}
                bare = await opens(client, at, method=method, **headers, **own)
                asked = f"{at}?token={token}"
                assert await opens(client, asked, method=method, **headers, **own) == bare, at
                bearer = {"Authorization": f"Bearer {token}", "Cookie": f"robomesh-s={token}"}
                assert await opens(client, at, method=method, **headers, **own, **bearer) == bare, at
                if at not in OPENED and bare == 200:
                    assert at in ("/health", "/account/me") or "index" in at, at
        for at in ("/mesh", "/view/s/r/front", "/view/s/r/front/live", "/video/s/r/front.mp4"):
            with pytest.raises(InvalidStatus) as refused:
                async with connect(
                    f"ws://{client.address}{at}?token={token}", origin=f"http://{client.address}"
                ):
                    pass
            assert refused.value.response.status_code == 403


# Addresses, and their answer to a token of `OPENED`.
ADDRESSES = {
    "/image/s/q/front.jpg": 403,
    "/image/t/r/front.jpg": 403,
    "/video/s/r/top.mjpeg": 403,
    "/view/s/r/top/live": 403,
    "/video/s/r/front.mp4.mp4": 403,
    "/image/s/r/Front.jpg": 403,
    "/image/S/r/front.jpg": 403,
    "/image/s/r/%66ront.jpg": 200,  # the same address
    "/image/s/r/front%00.jpg": 403,
    "/image/s/%72/front.jpg": 200,
    "/image/s/r%2Ftop.jpg": 403,
    "/image/s/r/front/../top.jpg": 401,
    "/image/s/r/front%2F%2e%2e%2Ftop.jpg": 401,
    "/image/s/x/..%2Fr/front.jpg": 401,
    "/image/%2e%2e/r/front.jpg": 403,
    "/IMAGE/s/r/front.jpg": 401,
    "//image/s/r/front.jpg": 401,
    "/image/s/r/front.jpg/": 401,
    "/image/s/r/front.jpg;.jpg": 403,
    "/image/s/r/front.jpg/../../../../recordings": 401,
    "/view/s/r/front/live/../../../../../account/accounts": 401,
    "/recordings": 401,
    "/layout/s/r.json": 401,
}


async def test_a_token_opens_no_other_address(mesh, page, tmp_path):
    async with shown(mesh, page, tmp_path) as (client, _, _, file):
        token = allow(file)
        await until_known(client, f"/image/s/r/front.jpg?token={token}")
        for headers in (
            {},
            {"X-Forwarded-Host": client.address, "X-Forwarded-For": "127.0.0.1"},
            {"X-Original-URL": "/image/s/r/front.jpg", "X-Rewrite-URL": "/image/s/r/front.jpg"},
            {"X-HTTP-Method-Override": "GET", "Referer": f"http://{client.address}/"},
        ):
            found = {path: await opens(client, f"{path}?token={token}", **headers) for path in ADDRESSES}
            assert found == ADDRESSES


def set_clock(monkeypatch, by):
    real = time.time
    monkeypatch.setattr("robomesh.publications.wall_clock.time.time", lambda: real() + by.total_seconds())


STREAMS = ("/video/s/r/front.mjpeg", "/video/s/r/front.mp4", "/view/s/r/front/live")


async def streams(client, token):
    """Return a connection to each stream, which has begun."""
    begun = [await stream(client.address, f"{path}?token={token}", until_bytes=500) for path in STREAMS]
    assert all(" 200 " in head for head, _, _ in begun)
    return [connection for _, _, connection in begun]


@pytest.mark.parametrize("how", ["revoked", "added again", "clock", "no file"])
async def test_what_a_token_shows_ends_with_it(mesh, page, tmp_path, monkeypatch, how):
    async with shown(mesh, page, tmp_path) as (client, renderer, _, file):
        token = allow(file, lasts=timedelta(days=1))
        other = allow(file, name="other")
        await until_known(client, f"/image/s/r/front.jpg?token={other}")
        ending, kept = await streams(client, token), await streams(client, other)
        match how:
            case "revoked":
                revoke_token(file, "wall")
            case "added again":
                revoke_token(file, "wall")
                allow(file)
            case "clock":
                set_clock(monkeypatch, timedelta(days=2))
            case "no file":
                file.unlink()
        async with asyncio.timeout(40.0):
            for reader, writer in ending:
                while await reader.read(65536):
                    pass
                writer.close()
        if how != "no file":
            for reader, _ in kept:
                assert await reader.read(1)  # it goes on
        if how == "clock":
            set_clock(monkeypatch, timedelta(days=-2))  # it stays expired
        for path in STREAMS:
            assert await opens(client, f"{path}?token={token}") == 401
        for _, writer in kept:
            writer.close()
        await unwatched([*renderer.images, *renderer.videos])


async def test_refusals_say_why_and_guesses_wait_but_known_tokens_do_not(mesh, page, tmp_path):
    async with shown(mesh, page, tmp_path) as (client, _, _, file):
        token, old = allow(file), allow(file, name="old", lasts=timedelta(seconds=-1))
        gone = allow(file, name="gone")
        revoke_token(file, "gone")
        await until_known(client, f"/image/s/r/front.jpg?token={token}")

        async def refusal(text, at="/image/s/r/front.jpg"):
            status, headers, body = await client.get(f"{at}?token={text}")
            return status, read_refusal(headers, body).code, headers.get("retry-after")

        for _ in range(20):  # neither waits: they are known
            assert await refusal(gone) == (401, "token.revoked", None)
            assert await refusal(old) == (401, "token.expired", None)
            assert await refusal(token, "/image/s/r/top.jpg") == (403, "token.other_view", None)
        answers = []
        for wrong in (
            "",
            "x",
            token[:-1],
            token.upper(),
            "%00",
            "x" * 5000,
            *(token[i:] for i in range(1, 9)),
        ):
            answers.append(await refusal(wrong))
        # Some were counted before the console had read the file.
        assert answers[0] == (401, "token.unknown", None)
        assert {answer[:2] for answer in answers} == {(401, "token.unknown"), (429, "account.wait")}
        assert int(answers[-1][2]) >= 1
        assert await opens(client, f"/image/s/r/front.jpg?token={token}") == 200
        assert (await client.sign_in("li"))[0] == 200  # other failures do not count here


async def test_uses_changes_and_refusals_are_events_and_no_token_is_in_an_event_or_log(
    mesh, page, tmp_path, caplog
):
    caplog.set_level(logging.DEBUG)

    async with shown(mesh, page, tmp_path) as (client, _, other, file):
        events = other.subscribe("robomesh/s/-/events/console", newest=100)
        token = allow(file)
        path = f"/image/s/r/front.jpg?token={token}"
        await until_known(client, path)
        await client.get(f"/image/s/r/front.jpg?token={token[:-1]}")
        await client.get(f"/recordings?token={token}")
        await client.get(f"/image/s/r/front.jpg?token={token}&quality={token[:3]}")
        revoke_token(file, "wall")
        await until_known(client, path, 401)
        published = {}
        async with asyncio.timeout(40.0):
            async for sample in events:
                message = sample.message()
                for event in getattr(message, "events", [message]):
                    published[event.code] = event
                if {"token.added", "token.used", "token.refused", "token.revoked"} <= set(published):
                    break
        events.close()
        used = published["token.used"].values
        assert (used["token"], used["robot"], used["view"]) == ("wall", "s/r", "front")
        assert used["address"] == "127.0.0.1"
        said = " ".join(str(event) for event in published.values())
        logged = " ".join(record.getMessage() for record in caplog.records if record.name != "asyncio")
        assert token not in said
        assert token not in logged
        assert token not in file.read_text()
        assert stat.S_IMODE(file.stat().st_mode) == 0o600


async def test_a_request_that_is_revoked_before_its_answer_is_refused():
    """A cancelled handler without an answer would be the server's error 500."""
    token = ViewToken(name="wall", robot="s/r", view="front", hash="", created=datetime.now(UTC))

    working, sent = asyncio.Event(), []

    async def handle(scope, receive, send):
        working.set()
        await asyncio.Event().wait()

    async def send(message):
        sent.append(message)

    middleware = AuthMiddleware(
        handle, create_autospec(AuthService, sessions=None, tokens=None), "cookie", ()
    )
    granted = view_access.TokenRequest(token, set())
    serving = asyncio.create_task(middleware._serve(granted, {"type": "http"}, None, send))
    await working.wait()
    granted.end()
    await serving
    assert sent[0]["status"] == 401


@pytest.mark.parametrize("origin", [None, LISTED, "https://evil.example"])
async def test_a_token_works_without_an_origin_and_browsers_show_it_on_listed_origins_only(
    mesh, page, tmp_path, origin
):
    async with shown(mesh, page, tmp_path, embed=(LISTED,)) as (client, _, _, file):
        token = allow(file)
        path = f"/image/s/r/front.jpg?token={token}"
        await until_known(client, path)
        status, headers, _ = await client.get(path, **({"Origin": origin} if origin else {}))
        assert status == 200
        allowed = origin == LISTED
        assert headers["cross-origin-resource-policy"] == ("cross-origin" if allowed else "same-origin")
        assert headers.get("access-control-allow-origin") == (LISTED if allowed else None)
        assert "access-control-allow-credentials" not in headers


async def test_without_accounts_addresses_with_a_token_work_too(mesh, page, tmp_path):
    async with console(mesh, page) as (address, other), rendering(other):
        assert (await get(address, "/image/s/r/front.jpg?token=x"))[0] == 200
        status, view = await live_view(address, "/view/s/r/front/live?token=x")
        assert status == 200
        view.close()


def test_the_command_adds_lists_and_revokes_and_prints_a_token_once(tmp_path, capsys):
    accounts_file(tmp_path)
    site = tmp_path / "site.toml"
    site.write_text('site = "s"\n[console]\naccounts = "accounts.toml"\n')

    def do(*words):
        status = command(["accounts", "tokens", *map(str, words)])
        printed = capsys.readouterr()
        return status, printed.out + printed.err

    status, text = do("add", site, "wall", "r", "front", "--days", "30", "--json")
    added = json.loads(text)
    assert status == 0
    assert added["addresses"]["page"] == "/view/s/r/front"
    kept = read_accounts(tmp_path / "accounts.toml")
    assert kept.tokens["wall"].expires - kept.tokens["wall"].created == timedelta(days=30)
    assert set(kept.accounts) == {"li", "zhao", "chen"}
    status, text = do("add", tmp_path / "accounts.toml", "nvr", "t/q", "top")
    token = re.search(r"/video/t/q/top\.mp4\?token=(\S{43})\n", text)[1]
    assert status == 0
    assert token not in (tmp_path / "accounts.toml").read_text()
    status, text = do("list", site)
    assert [line.split()[0] for line in text.splitlines()] == ["wall", "nvr"]
    assert token not in text
    assert do("revoke", site, "wall")[0] == 0
    assert "revoked" in do("list", site)[1]
    assert json.loads(do("list", site, "--json")[1].splitlines()[0])["revoked"]
    assert do("add", site, "wall", "r", "front")[0] == 0  # the name is free again
    for words, says in (
        (("add", site, "wall", "r", "front"), "already"),
        (("add", site, "Wall", "r", "front"), "Wall"),
        (("add", site, "x", "../r", "front"), "site"),
        (("add", site, "x", "r", "fr/ont"), "view"),
        (("add", tmp_path / "accounts.toml", "x", "r", "front"), "SITE/r"),
        (("add", tmp_path / "nowhere.toml", "x", "s/r", "front"), "no such file"),
        (("revoke", site, "nobody"), "tokens: "),
    ):
        status, text = do(*words)
        assert (status, says in text, text.count("\n")) == (2, True, 1), (words, text)


TOKEN = f'name = "wall"\nrobot = "s/r"\nview = "front"\nhash = "sha256:{"0" * 64}"\n'
CREATED = "created = 2026-11-21T08:00:00Z\n"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[token]\n" + TOKEN + CREATED, r"\[\[token\]\] tables"),
        ("[[token]]\n" + TOKEN, "created"),
        ("[[token]]\n" + TOKEN.replace("sha256:0", "secret in clear") + CREATED, "should be sha256"),
        ("[[token]]\n" + TOKEN.replace('"s/r"', '"r"') + CREATED, "robot"),
        ("[[token]]\n" + TOKEN + CREATED + 'expires = "soon"\n', "a time with its zone"),
        ("[[token]]\n" + TOKEN + CREATED + "admin = true\n", "admin is not a key"),
        (f"[[token]]\n{TOKEN}{CREATED}[[token]]\n{TOKEN}{CREATED}", "two tokens are named 'wall'"),
    ],
)
def test_a_wrong_token_in_the_file_is_refused_with_its_place_and_never_with_its_hash(tmp_path, text, says):
    path = tmp_path / "accounts.toml"
    path.write_text(text)
    with pytest.raises(AccountsError, match=says) as refused:
        read_accounts(path)
    assert str(path) in str(refused.value)
    assert "secret in clear" not in str(refused.value)


def test_changes_of_accounts_keep_tokens_and_the_other_way_round(tmp_path):
    path = accounts_file(tmp_path)
    allow(path, lasts=timedelta(days=1))
    before = read_accounts(path)
    change_account(path, "add", "wang", role=AccountRole.MONITOR, hashed=hashed())
    assert read_accounts(path).tokens == before.tokens
    assert before.tokens["wall"].created <= datetime.now(UTC)
    revoke_token(path, "wall")
    assert set(read_accounts(path).accounts) == {*before.accounts, "wang"}
