"""Rules and keys of a running router; a client without a rule is rejected, with an event."""

import asyncio
import json
from contextlib import asynccontextmanager, suppress
from datetime import timedelta

import pytest
import zenoh

from robomesh import reason_codes as codes
from robomesh.contract.endpoints import bundle, router_config
from robomesh.contract.keys import robot_key
from robomesh.contract.topics import Role
from robomesh.errors import NoAnswerError, NoRightError, SessionError
from robomesh.wire.session import CERTIFICATE, SessionSettings, open_session
from services import router as service
from services.pki import Folder, certificates, renewals, site_keys
from services.router.router import AccessError, read_access
from tests.conftest import run
from tests.ports import free_port

pytestmark = pytest.mark.slow

SITE = "here"


def prepared(path, site=SITE, border="open"):
    folder = Folder(path / site / "keys")
    endpoint = f"tls/127.0.0.1:{free_port()}"
    site_keys.prepare(folder, site, robots=["arm"], border=border, routers=[endpoint])
    return folder, endpoint


def settings_of(folder, endpoint, *links):
    return service.Settings(
        site=site_keys.principals_of(folder).site,
        listen=(endpoint,),
        connect=links,
        tls=folder.tls_of("router"),
        access=folder.access,
    )


@asynccontextmanager
async def routing(*every):
    """Yield routers that run like the service."""
    ready = [asyncio.Event() for _ in every]
    tasks = [
        asyncio.create_task(service.serve(settings, ready=lambda text, there=there: there.set()))
        for settings, there in zip(every, ready, strict=True)
    ]
    try:
        for there in ready:
            await there.wait()
        yield
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


def attached(endpoint, file, wait_s=10.0):
    return open_session(SessionSettings(connect=(endpoint,), tls=bundle(file), wait_s=wait_s))


async def until(condition):
    """Wait until an awaitable returns true; the test's deadline ends it."""
    while True:
        # A router restarts to follow new rules.
        with suppress(NoAnswerError):
            if await condition():
                return
        await asyncio.sleep(0.05)


async def names(session):
    return {(who.site, who.service) for who in await session.present()}


async def test_a_running_router_follows_revoked_and_issued_certificates(tmp_path):
    folder, endpoint = prepared(tmp_path)
    site_keys.issue(folder, "li", Role.OPERATOR)

    async def there(session, who):
        return who in await names(session)

    async def is_empty(session):
        return not await names(session)

    async with routing(settings_of(folder, endpoint)), attached(endpoint, folder.person("li")) as li:
        await until(lambda: there(li, (SITE, "router")))
        async with attached(endpoint, folder.service("watch")) as watch:
            events = watch.subscribe("robomesh/*/-/events/*", newest=100)
            site_keys.revoke(folder, "li")
            async for event in events:
                if "router.without_rights" in str(event.message()):
                    assert "li.here is connected, but has no right here" in str(event.message())
                    break
        await until(lambda: is_empty(li))
        site_keys.issue(folder, "mo", Role.MONITOR)
        async with attached(endpoint, folder.person("mo")) as mo:
            await until(lambda: there(mo, (SITE, "router")))
            assert await is_empty(li)


async def test_broken_rules_are_not_taken_and_the_router_goes_on(tmp_path, caplog):
    folder, endpoint = prepared(tmp_path)
    site_keys.issue(folder, "mo", Role.MONITOR)
    good = folder.access.read_text()

    async def refused():
        return "keeps its current rules and keys" in caplog.text

    async def present(session):
        return (SITE, "router") in await names(session)

    async with routing(settings_of(folder, endpoint)), attached(endpoint, folder.person("mo")) as mo:
        for broken in ("{", good.replace('"deny"', '"allow"')):
            caplog.clear()
            folder.access.write_text(broken)
            await until(refused)
            await until(lambda: present(mo))


KEPT = {"enabled": True, "default_permission": "deny", "subjects": [{"cert_common_names": ["li.here"]}]}


@pytest.mark.parametrize(
    "changed",
    [
        {"default_permission": "allow"},
        {"enabled": False},
        {"enabled": None},
        {"subjects": []},
        {"subjects": None},
        {"subjects": [{"id": "anybody"}]},
        {"subjects": ["li.here"]},
    ],
    ids=str,
)
def test_rules_that_let_everybody_in_are_no_rules(tmp_path, changed):
    path = tmp_path / "access.json5"
    path.write_text(json.dumps({"access_control": KEPT}))
    assert read_access(path)
    path.write_text(json.dumps({"access_control": KEPT | changed}))
    with pytest.raises(AccessError, match="robomesh keys writes a new one"):
        read_access(path)


@pytest.mark.parametrize("text", ["{", "[]", "{}"])
def test_an_invalid_rules_file_is_refused(tmp_path, text):
    path = tmp_path / "access.json5"
    path.write_text(text)
    with pytest.raises(AccessError, match="robomesh keys writes a new one"):
        read_access(path)


def test_an_expired_certificate_is_refused_by_its_holder_in_words_and_by_the_router(tmp_path):
    folder, endpoint = prepared(tmp_path)
    site_keys.issue(folder, "old", Role.MONITOR, lifetime=timedelta(seconds=-60))
    # The file is not in the list, so this side does not know its date.
    text = folder.person("old").read_text()
    unsaid = tmp_path / "unsaid.pem"
    unsaid.write_text(text[text.index("-----BEGIN") :])
    with zenoh.open(router_config((endpoint,), (), folder.tls_of("router"), read_access(folder.access))):

        async def main():
            with pytest.raises(SessionError, match=r"old\.pem: the certificate of old\.here expired on 20"):
                async with attached(endpoint, folder.person("old")):
                    pass
            with pytest.raises(SessionError, match="it has expired: robomesh keys renew"):
                async with attached(endpoint, unsaid, wait_s=0.0):
                    pass

        run(main())


def test_a_link_ends_with_its_certificate_and_comes_back_with_the_renewed_one(tmp_path):
    folder, endpoint = prepared(tmp_path)
    site_keys.issue(folder, "mo", Role.MONITOR, lifetime=timedelta(seconds=3))
    with zenoh.open(router_config((endpoint,), (), folder.tls_of("router"), read_access(folder.access))):

        async def main():
            async with attached(endpoint, folder.person("mo")) as mo:

                async def away():
                    return not mo.connected

                async def back():
                    return mo.connected

                await until(away)
                renewals.renew(folder, ["mo"])
                await until(back)

        run(main(), timeout_s=60.0)


def test_another_authoritys_certificate_and_none_at_all_open_no_session(tmp_path):
    folder, endpoint = prepared(tmp_path)
    stranger, _ = prepared(tmp_path, "elsewhere")
    site_keys.issue(stranger, "mo", Role.MONITOR)
    # It trusts the right router, but shows a certificate that the router does not know.
    forged = stranger.person("mo").read_text().rpartition("-----BEGIN")[0] + folder.authority.read_text()
    (tmp_path / "forged.pem").write_text(forged)
    with zenoh.open(router_config((endpoint,), (), folder.tls_of("router"), read_access(folder.access))):

        async def main():
            for file, why in (
                (stranger.person("mo"), "did not sign"),
                (tmp_path / "forged.pem", "another site's authority signed it"),
            ):
                with pytest.raises(SessionError, match=why):
                    async with attached(endpoint, file, wait_s=0.0):
                        pass
            for address in (endpoint, endpoint.replace("tls/", "tcp/")):
                with pytest.raises(SessionError, match="--keys FILE"):
                    async with open_session(SessionSettings(connect=(address,), wait_s=0.0)):
                        pass

        run(main())


def test_no_certificate_but_a_routers_passes_for_a_router(tmp_path):
    folder, endpoint = prepared(tmp_path)
    site_keys.issue(folder, "li", Role.OPERATOR)
    imposter = router_config((endpoint,), (), bundle(folder.person("li")))
    with zenoh.open(imposter):

        async def main():
            with pytest.raises(SessionError, match="did not sign"):
                async with attached(endpoint, folder.service("gateway"), wait_s=0.0):
                    pass

        run(main())


def test_a_missing_right_is_reported_before_the_request_is_sent(tmp_path):
    folder, endpoint = prepared(tmp_path)
    for name, role in (("li", Role.OPERATOR), ("mo", Role.MONITOR)):
        site_keys.issue(folder, name, role)
    with zenoh.open(router_config((endpoint,), (), folder.tls_of("router"), read_access(folder.access))):

        async def main():
            async with (
                attached(endpoint, folder.person("mo")) as mo,
                attached(endpoint, folder.person("li")) as li,
                attached(endpoint, folder.service("gateway")) as gateway,
            ):
                with pytest.raises(NoRightError) as error:
                    await mo.ask(robot_key(SITE, "arm", "command/mo.here"))
                asked = {"act": "ask", "topic": "command/mo.here", "roles": "console, engineer, operator"}
                assert error.value.reason == codes.NO_RIGHT(
                    codes.RIGHT_ROLE(name="mo.here", role="monitor", **asked)
                )
                with pytest.raises(NoRightError) as error:
                    await li.ask(robot_key(SITE, "arm", "command/wang.here"))
                (cause,) = error.value.reason.causes
                assert (cause.code, cause.values["own"]) == ("right.name", "command/li.here")
                with pytest.raises(NoRightError) as error:
                    li.declare_publisher(SITE, "arm", "joints")
                (cause,) = error.value.reason.causes
                assert (cause.code, cause.values["act"], cause.values["role"]) == (
                    *("right.role", "publish", "operator"),
                )
                with pytest.raises(NoRightError) as error:
                    gateway.declare_publisher(SITE, "other", "joints")
                (cause,) = error.value.reason.causes
                assert (cause.code, cause.values["robots"]) == ("right.robot", "arm")
                gateway.declare_publisher(SITE, "arm", "joints")

        run(main())


def test_zenohd_gets_the_routers_configuration(tmp_path):
    folder, endpoint = prepared(tmp_path)
    out = tmp_path / "zenohd.json5"
    assert "restart it after robomesh keys" in service.write_config(settings_of(folder, endpoint), out)
    config = zenoh.Config.from_file(str(out))
    assert json.loads(config.get_json("listen/endpoints")) == [f"{endpoint}#so_sndbuf=32768"]
    assert json.loads(config.get_json("access_control"))["default_permission"] == "deny"
    with zenoh.open(config):

        async def main():
            async with attached(endpoint, folder.service("gateway")) as session:
                assert session.connected

        run(main())
    assert "PRIVATE" not in out.read_text()


def test_a_certificate_shows_its_name_and_authority(tmp_path):
    folder, _ = prepared(tmp_path)
    entry = site_keys.issue(folder, "li", Role.OPERATOR)
    shown = certificates.read_bundle(folder.person("li").read_bytes())
    assert (shown.name, shown.role, shown.authority) == ("li.here", "operator", "here")
    assert entry.expires == shown.expires


async def test_a_router_outlives_keys_that_are_gone_or_half_copied_and_takes_them_when_they_are_whole(
    tmp_path, caplog
):
    folder, endpoint = prepared(tmp_path)
    site_keys.issue(folder, "mo", Role.MONITOR)
    bundle_of_router = folder.service("router")
    good = bundle_of_router.read_bytes()
    other = site_keys.issued(
        folder, site_keys.principals_of(folder), site_keys.principals_of(folder).find("router")
    )
    assert other.find("router").serial
    other_key = bundle_of_router.read_bytes()
    bundle_of_router.write_bytes(good)

    async def goes_on():
        return "router.pem cannot be used: " in caplog.text

    async def router_of(session):
        while not (routers := session.zenoh_session.info.routers_zid()):
            await asyncio.sleep(0.05)
        return str(routers[0])

    async with routing(settings_of(folder, endpoint)), attached(endpoint, folder.person("mo")) as mo:
        identity = await router_of(mo)
        begin, of_good = other_key.index(b"-----BEGIN CERT"), good.index(b"-----BEGIN CERT")
        for broken in (None, good[: len(good) // 2], good[:of_good] + other_key[begin:]):
            caplog.clear()
            if broken is None:
                bundle_of_router.unlink()
            else:
                bundle_of_router.write_bytes(broken)
            await until(goes_on)
        assert await router_of(mo) == identity, "it was not even opened anew"
        bundle_of_router.write_bytes(other_key)
        while await router_of(mo) == identity:
            await asyncio.sleep(0.05)


async def test_rules_that_zenoh_refuses_are_not_said_to_be_followed(tmp_path, caplog):
    caplog.set_level("INFO")
    folder, endpoint = prepared(tmp_path)
    site_keys.issue(folder, "mo", Role.MONITOR)
    rules = json.loads("\n".join(folder.access.read_text().splitlines()[1:]))
    rules["access_control"]["policies"][0]["rules"] = ["no such rule"]

    async def refused():
        return "Zenoh rejects it; the router keeps its current rules and keys" in caplog.text

    async def present(session):
        return (SITE, "router") in await names(session)

    async with routing(settings_of(folder, endpoint)), attached(endpoint, folder.person("mo")) as mo:
        folder.access.write_text(json.dumps(rules))
        await until(refused)
        assert "the router follows" not in caplog.text
        await until(lambda: present(mo))


def test_a_renewed_certificate_is_reported_without_a_restart(tmp_path):
    folder, endpoint = prepared(tmp_path)
    site_keys.issue(folder, "mo", Role.MONITOR, lifetime=timedelta(hours=1))
    with zenoh.open(router_config((endpoint,), (), folder.tls_of("router"), read_access(folder.access))):

        async def main():
            async with attached(endpoint, folder.person("mo")) as mo:
                (left,) = (each.read for each in mo.measures if each.name == CERTIFICATE)
                assert 3500 < left() <= 3600
                site_keys.issue(folder, "mo", Role.MONITOR, lifetime=timedelta(hours=2))
                assert 7100 < left() <= 7200
                folder.person("mo").unlink()
                assert 3500 < left() <= 3600

        run(main())
