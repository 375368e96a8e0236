"""Hosts and origins that the console accepts."""

import pytest
from pydantic import ValidationError
from starlette.datastructures import Headers

from robomesh.errors import RefusedError
from services.console.accounts.rights import parse_request
from services.console.common.errors import WatchError
from services.console.common.guard import Guard, refused_host, refused_origin
from services.console.websocket.shared_subscriptions import check_expression
from services.site_file.tables.console import Console
from tests.conftest import run


@pytest.mark.parametrize(
    "host", ["localhost:8080", "127.0.0.1:8080", "[::1]:8080", "10.0.0.7:8080", "console.plant"]
)
def test_hosts_of_ours_are_answered(host):
    assert refused_host(host, ("console.plant",)) is None


@pytest.mark.parametrize(
    "host", ["", "evil.example", "evil.example:8080", "localhost.evil.example", "a@b:c", "[::1", "[evil]"]
)
def test_a_name_that_could_be_pointed_at_us_is_refused(host):
    reason = refused_host(host, ("console.plant",))
    assert reason is not None
    assert (reason.code, reason.values) == ("http.host", {"host": host})


def test_only_the_pages_own_origin_may_open_the_websocket():
    assert refused_origin("http://127.0.0.1:8080", "127.0.0.1:8080") is None
    assert refused_origin("https://console.plant", "console.plant") is None
    for origin in (
        "",
        "null",
        "http://evil.example",
        "http://127.0.0.1:8081",
        "http://127.0.0.1.evil.example:8080",
        "http://[127.0.0.1:8080",
        "http://[evil]",
    ):
        reason = refused_origin(origin, "127.0.0.1:8080")
        assert reason is not None
        assert (reason.code, reason.values["origin"]) == ("http.origin", origin)


@pytest.mark.parametrize(
    "key",
    ["robomesh/*/*/controller", "robomesh/s/r/video/top", "robomesh/s/*/events", "robomesh/s/r/events/*"],
)
def test_topics_of_the_table_can_be_watched(key):
    check_expression(key)


@pytest.mark.parametrize(
    "key",
    [
        "robomesh/**",
        "**",
        "robomesh/s/r/video/*",
        "robomesh/s/r/events/k*",
        "robomesh/s/r/nonsense",
        "robomesh/s/R$/joints",
        "other/s/r/joints",
        "",
    ],
)
def test_anything_else_is_refused_by_name(key):
    with pytest.raises(WatchError, match="cannot be watched"):
        check_expression(key)


@pytest.mark.parametrize(
    "key",
    [
        "robomesh/s/r/stop",
        "robomesh/s/r/command/li",
        "robomesh/s/r/lease/request/li",
        "robomesh/s/r/mesh/base",
    ],
)
def test_requests_of_the_table_can_be_asked(key):
    parsed, row = parse_request(key)
    assert str(parsed) == key
    assert row.name.split("/")[0] == parsed.topic.split("/")[0]


@pytest.mark.parametrize(
    "key",
    [
        "robomesh/*/*/stop",
        "robomesh/s/r/command/*",
        "robomesh/s/r/joints",
        "robomesh/s/**",
        "robomesh/s/r/command/a/b",
    ],
)
def test_a_page_asks_one_robot_one_request_of_the_table(key):
    with pytest.raises(RefusedError):
        parse_request(key)


LISTED = "https://intranet.plant"


@pytest.mark.parametrize(
    ("path", "headers", "shown"),
    [
        ("/video/s/r/front.mjpeg", {"Origin": LISTED}, True),
        ("/video/s/r/front.mjpeg", {"Referer": f"{LISTED}/wall?of=pt600"}, True),
        ("/image/s/r/front.jpg", {"Referer": f"{LISTED}:444/"}, False),
        ("/image/s/r/front.jpg", {"Origin": "http://intranet.plant"}, False),
        ("/image/s/r/front.jpg", {"Origin": "https://evil.example", "Referer": f"{LISTED}/"}, False),
        ("/image/s/r/front.jpg", {"Referer": "https://[evil"}, False),
        ("/image/s/r/front.jpg", {"Origin": "null"}, False),
        ("/image/s/r/front.jpg", {}, False),
        ("/", {"Origin": LISTED}, False),
        ("/mesh/s/r/base", {"Origin": LISTED}, False),
    ],
)
def test_only_media_are_shown_on_pages_of_listed_origins(path, headers, shown):
    async def app(scope, receive, send):
        await send({"type": "http.response.start", "status": 200, "headers": []})

    async def answer(embed):
        given = [(name.lower().encode(), value.encode()) for name, value in headers.items()]
        scope = {"type": "http", "method": "GET", "path": path}
        scope["headers"] = [(b"host", b"localhost:8080"), *given]
        sent = []

        async def send(message):
            sent.append(message)

        await Guard(app, embed=embed)(scope, None, send)
        return Headers(raw=sent[0]["headers"])

    found = run(answer((LISTED,)))
    assert found["Cross-Origin-Resource-Policy"] == ("cross-origin" if shown else "same-origin")
    assert found.get("Access-Control-Allow-Origin") == (LISTED if shown else None)
    assert found["X-Frame-Options"] == "DENY"
    assert "frame-ancestors 'none'" in found["Content-Security-Policy"]
    assert run(answer(()))["Cross-Origin-Resource-Policy"] == "same-origin"


@pytest.mark.parametrize(
    "origin", ["intranet.plant", "https://a/b", "https://*", "*", "https://A.example", "null"]
)
def test_an_origin_to_embed_in_is_checked(origin):
    with pytest.raises(ValidationError, match="is not an origin"):
        Console(embed=(origin,))
    assert Console(embed=(LISTED, "http://10.0.0.7:3000", "https://[::1]:443")).embed
