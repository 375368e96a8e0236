"""A console with accounts over a real router: sign-in, rights, and the end of sessions."""

import asyncio
import json

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus

from robomesh.schemas import robomesh_pb2 as schema
from services.console import app
from services.console.accounts.auth_middleware import SIGNED_OUT
from services.console.accounts.auth_service import change_account
from services.console.accounts.file import AccountRole
from tests.services.http_refusals import read_refusal
from tests.services.signing_in import PASSWORD, Client, guarded
from tests.services.test_console import console, page

__all__ = ["page"]  # a fixture
ACTION = schema.LeaseRequest.Action
LEASE = "robomesh/s/r/lease/request"


def owner(other):
    """Return a gateway's answers, and the requests that it got."""
    asked = []

    async def lease(request):
        asked.append(("lease", request.chunk, request.message))
        return schema.LeaseAnswer(holder=request.chunk, lease="secret")

    async def stop(request):
        asked.append(("stop", "", request.message))
        return schema.StopAnswer(sent=True, stop_id=1)

    other.answer("s", "r", "lease/request/*", lease)
    other.answer("s", "r", "stop", stop)
    return asked


def lease(action=ACTION.ACQUIRE):
    return schema.LeaseRequest(action=action).SerializeToString()


def code_of(answer):
    """Return the code of a refused request."""
    return answer[2]["refusal"]["code"]


async def hello(browser):
    await browser.until(lambda: browser.other)
    return browser.other[0].hello


async def closing(browser, timeout_s=40.0):
    """Return the code and the reason of the close frame."""
    async with asyncio.timeout(timeout_s):
        try:
            while True:
                await browser.socket.recv()
        except ConnectionClosed as closed:
            return closed.rcvd.code, closed.rcvd.reason


async def fetch(client, path):
    """Return all bytes of a GET until the connection ends, complete or not."""
    host, port = client.address.split(":")
    reader, writer = await asyncio.open_connection(host, int(port))
    writer.write(f"GET {path} HTTP/1.1\r\nHost: {client.address}\r\nCookie: {client.cookie}\r\n\r\n".encode())
    try:
        return await reader.read()
    except ConnectionError:
        return b""
    finally:
        writer.close()


async def test_without_a_session_only_the_page_itself_and_the_sign_in_are_open(mesh, page, tmp_path):
    async with guarded(mesh, page, tmp_path) as (client, _, _):
        for path in ("/", "/index.html", "/assets/index-1234.js", "/health", "/account/me"):
            assert (await client.get(path))[0] == 200, path
        for path in (
            "/mesh/s/r/base",
            "/video/s/r/top.mjpeg",
            "/image/s/r/top.jpg",
            "/recordings/s/a.mcap",
            "/define/robots",
            "/account/sessions",
            "/account/accounts",
            "/anything",
        ):
            status, headers, body = await client.get(path)
            assert (status, json.loads(body)["error"]) == (401, "sign_in"), path
            assert read_refusal(headers, body).code == "account.sign_in", path
        with pytest.raises(InvalidStatus, match="403") as refused:
            async with client.browse():
                pass
        answer = refused.value.response
        assert read_refusal(answer.headers, answer.body).code == "account.sign_in"
        assert (await client.post("/define/save"))[0] == 401


async def test_sign_in_gives_the_name_and_the_roles_rights(mesh, page, tmp_path):
    async with guarded(mesh, page, tmp_path) as (client, other, _):
        asked = owner(other)
        status, headers, me = await client.sign_in(" Li ")
        assert (status, me["account"], me["role"], me["operator"]) == (200, "li", "operator", "li.s")
        cookie = headers["set-cookie"]
        assert "HttpOnly" in cookie
        assert "SameSite=strict" in cookie
        async with client.browse() as browser:
            greeting = await hello(browser)
            assert (greeting.account, greeting.operator, greeting.may_command) == ("li", "li.s", True)
            answer = await browser.ask(1, f"{LEASE}/li.s", lease())
            assert answer.ok, answer.error
            assert asked[-1][1] == "li.s"
            # Not even the gateway gets a request under another operator's name.
            answer = await browser.ask(2, f"{LEASE}/wang.s", lease())
            assert (answer.ok, answer.error) == (
                False,
                "li may send requests only as li.s, not as wang.s",
            )
            assert len(asked) == 1


async def test_a_monitor_sees_everything_and_asks_for_nothing_but_a_stop_in_its_own_name(
    mesh, page, tmp_path
):
    async with guarded(mesh, page, tmp_path) as (client, other, _):
        asked = owner(other)
        await client.sign_in("zhao")
        async with client.browse() as browser:
            assert not (await hello(browser)).may_command
            keys = (f"{LEASE}/zhao.s", "robomesh/s/r/command/zhao.s", "robomesh/s/r/recorder/request")
            for number, key in enumerate(keys, 1):
                answer = await browser.ask(number, key, lease())
                assert not answer.ok
                assert "zhao is a monitor" in answer.error
                assert "needs an operator" in answer.error
            answer = await browser.ask(8, "robomesh/s/r/views/li.s", b"")
            assert answer.error == "zhao may send requests only as zhao.s, not as li.s"
            forged = schema.StopRequest(by="li", reason="the page").SerializeToString()
            assert (await browser.ask(9, "robomesh/s/r/stop", forged)).ok
            assert [(what, message.by) for what, _, message in asked] == [("stop", "zhao.s")]
        for path in ("/define/save", "/define/start", "/define/stop"):
            refused = await client.post(path, {"description": {}, "files": {}, "name": "r"})
            assert (refused[0], code_of(refused)) == (403, "page.needs_operator"), path
            what = path.removeprefix("/")
            assert refused[2]["text"] == f"zhao is a monitor: {what} needs an operator"


async def test_a_wrong_password_and_an_unknown_name_get_the_same_refusal(mesh, page, tmp_path):
    async with guarded(mesh, page, tmp_path) as (client, _, _):
        wrong = await client.sign_in("li", "not the password")
        unknown_account = await client.sign_in("nobody", "not the password")
        assert wrong[0] == unknown_account[0] == 401
        assert wrong[2] == unknown_account[2]
        assert client.cookie == ""


async def test_a_session_with_too_many_pages_opens_no_other(mesh, page, tmp_path, monkeypatch):
    monkeypatch.setattr(app, "MOST_PAGES", 1)

    async with guarded(mesh, page, tmp_path) as (client, _, _):
        await client.sign_in("li")
        async with client.browse() as browser:
            await hello(browser)
            with pytest.raises(InvalidStatus, match="403") as refused:
                async with client.browse():
                    pass
        answer = refused.value.response
        reason = read_refusal(answer.headers, answer.body)
        assert (reason.code, reason.values) == ("page.too_many_pages", {"count": "1"})


async def test_a_session_is_over_everywhere_once_it_is_signed_out(mesh, page, tmp_path):
    async with guarded(mesh, page, tmp_path) as (client, _, _):
        await client.sign_in("li")
        async with client.browse() as browser:
            await hello(browser)
            stolen = Client(client.address, client.cookie)
            assert (await client.post("/account/sign-out"))[0] == 200
            assert await closing(browser) == (SIGNED_OUT, "signed_out")
            assert (await stolen.get("/account/sessions"))[0] == 401
            with pytest.raises(InvalidStatus):
                async with stolen.browse():
                    pass


async def test_a_download_ends_with_its_session(mesh, page, tmp_path):
    async with guarded(mesh, page, tmp_path) as (client, other, _):
        begun, go_on = asyncio.Event(), asyncio.Event()

        async def shape_of_link(request):
            begun.set()
            await go_on.wait()
            return b"glTF"

        other.answer("s", "r", "mesh/*", shape_of_link)
        await client.sign_in("li")
        fetched = asyncio.create_task(fetch(client, "/mesh/s/r/base"))
        async with asyncio.timeout(40.0):
            await begun.wait()
        await client.post("/account/sign-out")
        async with asyncio.timeout(40.0):
            assert b"glTF" not in await fetched
        go_on.set()


async def test_signing_out_everywhere_ends_every_session_of_the_account_and_no_other(mesh, page, tmp_path):
    async with guarded(mesh, page, tmp_path) as (client, _, _):
        second, zhao = Client(client.address), Client(client.address)
        for each, name in ((client, "li"), (second, "li"), (zhao, "zhao")):
            await each.sign_in(name)
        async with second.browse() as browser:
            await hello(browser)
            await client.post("/account/sign-out", {"everywhere": True})
            assert await closing(browser) == (SIGNED_OUT, "signed_out")
        assert (await zhao.get("/account/sessions"))[0] == 200


async def test_a_session_is_never_one_that_the_browser_came_with(mesh, page, tmp_path):
    async with guarded(mesh, page, tmp_path) as (client, _, _):
        await client.sign_in("li")
        first = client.cookie
        planted = Client(client.address, first.split("=")[0] + "=planted-by-somebody-else")
        await planted.sign_in("zhao")
        assert "planted" not in planted.cookie
        # A new sign-in in the same browser ends the old session.
        await client.sign_in("li")
        assert client.cookie != first
        assert (await Client(client.address, first).get("/account/sessions"))[0] == 401


@pytest.mark.parametrize(
    ("action", "values", "reason"),
    [
        ("disable", {}, "disabled"),
        ("remove", {}, "removed"),
        ("password", {"hashed": "$argon2id$v=19$m=8,t=1,p=1$c29tZXNhbHQ$AAAA"}, "password"),
    ],
)
async def test_a_change_of_the_accounts_file_ends_sessions_at_once(
    mesh, page, tmp_path, action, values, reason
):
    async with guarded(mesh, page, tmp_path) as (client, _, path):
        await client.sign_in("li")
        async with client.browse() as browser:
            await hello(browser)
            change_account(path, action, "li", **values)
            assert await closing(browser) == (SIGNED_OUT, reason)
        assert (await client.sign_in("li"))[0] == 401


async def test_a_lesser_role_holds_at_once_and_takes_control_away(mesh, page, tmp_path):
    async with guarded(mesh, page, tmp_path) as (client, other, path):
        asked = owner(other)
        await client.sign_in("li")
        async with client.browse() as browser:
            await hello(browser)
            assert (await browser.ask(1, f"{LEASE}/li.s", lease())).ok
            change_account(path, "role", "li", role=AccountRole.MONITOR)
            await browser.until(
                lambda: any(
                    m.WhichOneof("message") == "hello" and not m.hello.may_command for m in browser.other
                ),
            )
            answer = await browser.ask(2, f"{LEASE}/li.s", lease(ACTION.RENEW))
            assert "li is a monitor" in answer.error
            async with asyncio.timeout(40.0):
                while (await other.present_sessions())[0]:
                    await asyncio.sleep(0.01)
            # The gateway learns why, for every page.
            assert released(asked) == [("secret", schema.LeaseRequest.NO_RIGHT)]


async def test_control_of_a_session_that_ends_is_released_with_the_cause(mesh, page, tmp_path):
    async with guarded(mesh, page, tmp_path) as (client, other, path):
        asked = owner(other)
        await client.sign_in("li")
        async with client.browse() as browser:
            await hello(browser)
            assert (await browser.ask(1, f"{LEASE}/li.s", lease())).ok
            change_account(path, "disable", "li")
            assert await closing(browser) == (SIGNED_OUT, "disabled")
            async with asyncio.timeout(40.0):
                while (await other.present_sessions())[0]:
                    await asyncio.sleep(0.01)
        assert released(asked) == [("secret", schema.LeaseRequest.SIGNED_OUT)]


def released(asked):
    """Return the leases that were released, with their causes."""
    leases = [message for what, _, message in asked if what == "lease"]
    return [(each.lease, each.cause) for each in leases if each.action == ACTION.RELEASE]


async def test_an_invalid_accounts_file_is_reported_and_keeps_sessions(mesh, page, tmp_path):
    async with guarded(mesh, page, tmp_path) as (client, other, path):
        events = other.subscribe("robomesh/s/-/events/console", newest=100)
        await client.sign_in("li")
        path.write_text("[[account")
        codes = []
        async with asyncio.timeout(40.0):
            async for sample in events:
                message = sample.message()
                reported = getattr(message, "events", [message])
                codes += [event.code for event in reported]
                if "accounts.unreadable" in codes:
                    break
        assert (await client.get("/account/sessions"))[0] == 200
        events.close()


async def test_signing_in_and_out_and_refusals_are_events_without_secrets(mesh, page, tmp_path):
    async with guarded(mesh, page, tmp_path) as (client, other, _):
        events = other.subscribe("robomesh/s/-/events/console", newest=100)
        await client.sign_in("my-password-in-the-wrong-field", "guess the first one")
        await client.sign_in("li")
        token = client.cookie.partition("=")[2]
        await client.post("/account/sign-out")
        published = {}
        async with asyncio.timeout(40.0):
            async for sample in events:
                message = sample.message()
                for event in getattr(message, "events", [message]):
                    published[event.code] = event
                if len(published) == 3:
                    break
        assert set(published) == {"account.refused", "account.signed_in", "account.signed_out"}
        assert published["account.signed_in"].values["account"] == "li"
        text = " ".join(str(event) for event in published.values())
        for secret in (PASSWORD, token, "guess", "wrong-field"):
            assert secret not in text
        events.close()


async def test_a_new_password_of_ones_own_keeps_this_session_and_ends_the_others(mesh, page, tmp_path):
    async with guarded(mesh, page, tmp_path) as (client, _, _):
        second = Client(client.address)
        await client.sign_in("li")
        await second.sign_in("li")
        new = "four arms in a hall"
        refused = await client.post("/account/password", {"password": "a wrong one", "new": new})
        assert (refused[0], refused[2]["error"]) == (401, "wrong")
        assert code_of(refused) == "account.password_wrong"
        short = await client.post("/account/password", {"password": PASSWORD, "new": "short"})
        assert (short[0], short[2]["error"], code_of(short)) == (422, "short", "account.short")
        assert short[2]["refusal"]["values"] == {"least": "10"}
        done = await client.post("/account/password", {"password": PASSWORD, "new": new})
        assert done[0] == 200, done[2]
        assert (await client.get("/account/sessions"))[0] == 200
        assert (await second.get("/account/sessions"))[0] == 401
        assert (await second.sign_in("li", new))[0] == 200


async def test_only_an_administrator_changes_accounts(mesh, page, tmp_path):
    async with guarded(mesh, page, tmp_path) as (client, _, _):
        li = Client(client.address)
        await li.sign_in("li")
        for asked in (
            {"action": "role", "name": "li", "role": "admin"},
            {"action": "remove", "name": "zhao"},
        ):
            refused = await li.post("/account/accounts", asked)
            assert (refused[0], refused[2]["error"]) == (403, "not_admin")
            assert code_of(refused) == "account.not_admin"
        assert (await li.get("/account/accounts"))[0] == 403
        await client.sign_in("chen")
        add = {"action": "add", "name": "wang", "role": "operator", "password": PASSWORD}
        status, _, answer = await client.post("/account/accounts", add)
        assert status == 200, answer
        assert "wang" in [each["name"] for each in answer["accounts"]]
        assert "argon2" not in json.dumps(answer)
        assert (await Client(client.address).sign_in("wang"))[0] == 200
        for asked, word, code in (
            ({"action": "remove", "name": "chen"}, "last_admin", "account.last_admin"),
            ({"action": "remove", "name": "nobody"}, "no_account", "account.no_account"),
            (add, "taken", "account.taken"),
            ({**add, "name": "Wang!"}, "name", "account.name"),
            ({**add, "role": "king"}, "refused", "account.role"),
            ({"action": "crown", "name": "wang"}, "refused", "account.action"),
        ):
            refused = await client.post("/account/accounts", asked)
            assert (refused[0], refused[2]["error"], code_of(refused)) == (422, word, code)
        gone = await client.post("/account/sessions", {"end": "none"})
        assert (gone[0], gone[2]["error"], code_of(gone)) == (404, "no_session", "account.no_session")
        # The list ends another account's session, too.
        _, _, body = await client.get("/account/sessions")
        of_li = next(each["id"] for each in json.loads(body)["sessions"] if each["account"] == "li")
        assert (await client.post("/account/sessions", {"end": of_li}))[0] == 200
        assert (await li.get("/account/sessions"))[0] == 401


async def test_a_console_without_accounts_needs_no_sign_in(mesh, page):
    async with console(mesh, page) as (address, _):
        client = Client(address)
        _, _, body = await client.get("/account/me")
        me = json.loads(body)
        assert (me["accounts"], me["may_command"], me["site"]) == (False, True, "s")
        assert (await client.post("/account/sign-in", {"name": "li", "password": PASSWORD}))[0] == 405
