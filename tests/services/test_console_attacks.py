"""Attacks on a console: each is rejected, and the next valid request is answered."""

import asyncio
import contextlib
import json
import socket
from contextlib import asynccontextmanager

import pytest
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from websockets.exceptions import ConnectionClosed, InvalidHandshake

from robomesh.client.recordings import recorder_file as recorder
from robomesh.schemas.robomesh_pb2 import FromPage
from services.console.http import shapes
from services.console.serving import uvicorn_server
from services.console.serving.listener import Listener
from services.console.serving.request_timeout import Connection
from services.console.websocket import websocket_transport
from tests.services.signing_in import Client, guarded
from tests.services.test_console import console, get, page

__all__ = ["page"]  # a fixture
ENDS_S = 10.0


async def answers(client):
    assert (await client.get("/health"))[0] == 200


@asynccontextmanager
async def connected(address, **where):
    host, port = address.split(":")
    reader, writer = await asyncio.open_connection(host, int(port), **where)
    try:
        yield reader, writer
    finally:
        writer.close()


async def status_of(address, raw):
    """Return the status of the response to raw bytes; 0 if the connection was closed without one."""
    async with connected(address) as (reader, writer), asyncio.timeout(ENDS_S):
        try:
            writer.write(raw)
            head = await reader.readuntil(b"\r\n")
        except (ConnectionError, asyncio.IncompleteReadError):
            return 0
        return int(head.split()[1])


async def ended(reader):
    """Read until the connection ends."""
    async with asyncio.timeout(ENDS_S):
        try:
            return await reader.read()
        except ConnectionError:
            return b""


TOKENS = ["", "A" * 43, "A" * 9000, "%00", "../../etc/passwd", '"; DROP TABLE', "\xff\xfe"]


async def test_a_forged_token_has_no_session(mesh, page, tmp_path):
    async with guarded(mesh, page, tmp_path) as (client, _, _):
        for token in TOKENS:
            forged = Client(client.address, f"robomesh-s={token}")
            assert (await forged.get("/account/sessions"))[0] == 401, token
            with pytest.raises(InvalidHandshake):
                async with forged.browse():
                    pass
        await answers(client)


async def test_other_pages_and_plain_forms_can_ask_nothing_of_a_signed_in_browser(mesh, page, tmp_path):
    async with guarded(mesh, page, tmp_path) as (client, _, _):
        await client.sign_in("li")
        here = f"http://{client.address}"
        for headers, status in (
            ({"Origin": "http://evil.example"}, 403),
            ({"Origin": ""}, 403),
            ({"Origin": "null"}, 403),
            ({"Origin": here + ".evil.example"}, 403),
            ({"Origin": here, "Sec-Fetch-Site": "cross-site"}, 403),
            ({"Origin": here, "Sec-Fetch-Site": "same-site"}, 403),
            ({"Content-Type": "text/plain"}, 415),
            ({"Content-Type": "application/x-www-form-urlencoded"}, 415),
            ({"Host": "evil.example"}, 421),
        ):
            assert (await client.post("/account/sign-out", **headers))[0] == status, headers
        for origin in (None, "http://evil.example", "null"):
            with pytest.raises(InvalidHandshake):
                async with client.browse(origin=origin):
                    pass
        assert (await client.get("/account/sessions"))[0] == 200


TRAVERSALS = [
    "/assets/../../../pyproject.toml",
    "/assets/..%2f..%2f..%2fpyproject.toml",
    "/assets/%2e%2e/%2e%2e/%2e%2e/pyproject.toml",
    "/assets/..%5c..%5cpyproject.toml",
    "/assets/%252e%252e/%252e%252e/pyproject.toml",
    "/..%00/pyproject.toml",
    "//etc/passwd",
    "/mesh/s/r/..%2f..%2fetc%2fpasswd",
    "/mesh/..%2f..%2fs/r/base",
    "/mesh/s/*/base",
    "/mesh/s/r/**",
    "/recordings/s/..%2f..%2f..%2fetc%2fpasswd",
    "/recordings/../s/a.mcap",
    "/recordings/s/%2e%2e",
    "/recordings/s/a.mcap%00.jpg/thumbnail.jpg",
    "/recordings/**/a.mcap",
    "/define/glb/..%2f..%2f..%2fetc%2fpasswd",
    "/define/robots/..%2f..%2f..%2fetc",
]


async def test_no_path_leads_out_of_pages_shapes_and_recordings(mesh, page, tmp_path, monkeypatch):
    # No service of this mesh answers for meshes and recordings.
    monkeypatch.setattr(shapes, "_TIMEOUTS_S", (0.2,))
    monkeypatch.setattr(recorder, "_TIMEOUTS_S", (0.2,))
    (page.parent / "pyproject.toml").write_text("root: secret")

    async with guarded(mesh, page, tmp_path) as (client, _, _):
        await client.sign_in("li")
        outcomes = await asyncio.gather(*(client.get(path) for path in TRAVERSALS))
        for path, (status, _, body) in zip(TRAVERSALS, outcomes, strict=True):
            assert 400 <= status <= 504, path
            assert status != 500, path
            assert b"root:" not in body, path


def http(method, path, address, headers, body=b""):
    lines = "".join(f"{name}: {value}\r\n" for name, value in headers)
    return f"{method} {path} HTTP/1.1\r\nHost: {address}\r\n{lines}\r\n".encode() + body


async def test_requests_that_are_too_large_or_of_two_minds_are_refused(mesh, page, tmp_path):
    async with guarded(mesh, page, tmp_path) as (client, _, _):
        here = client.address
        own = [("Origin", f"http://{here}"), ("Content-Type", "application/json")]
        pieces = (b"8000\r\n" + b"x" * 0x8000 + b"\r\n") * 2 + b"0\r\n\r\n"
        for what, raw, allowed in (
            (
                "a large body",
                http("POST", "/account/sign-in", here, [*own, ("Content-Length", 10**9)]),
                {413},
            ),
            (
                "many pieces",
                http("POST", "/account/sign-in", here, [*own, ("Transfer-Encoding", "chunked")], pieces),
                {413, 0},
            ),
            (
                "a body nowhere",
                http("POST", "/mesh/s/r/base", here, [*own, ("Content-Length", 1)], b"x"),
                {413},
            ),
            (
                "a large file",
                http("POST", "/define/files", here, [*own, ("Content-Length", 10**12)]),
                {413},
            ),
            (
                "a negative length",
                http("POST", "/account/sign-in", here, [*own, ("Content-Length", -1)]),
                {400},
            ),
            ("a GET's body", http("GET", "/", here, [("Content-Length", 5)], b"hello"), {400}),
            (
                "two lengths",
                http("POST", "/account/sign-in", here, [*own, ("Content-Length", 5), ("Content-Length", 6)]),
                {400},
            ),
            (
                "length and pieces",
                http(
                    "POST",
                    "/account/sign-in",
                    here,
                    [*own, ("Content-Length", 5), ("Transfer-Encoding", "chunked")],
                    b"0\r\n\r\n",
                ),
                {400},
            ),
            (
                "a strange coding",
                http("POST", "/account/sign-in", here, [*own, ("Transfer-Encoding", "xchunked")]),
                {400, 501},
            ),
            ("two hosts", http("GET", "/", here, [("Host", "evil.example")]), {400}),
            ("large headers", http("GET", "/", here, [("X-Long", "x" * 200_000)]), {400}),
            ("many headers", http("GET", "/", here, [(f"X-{n}", "x" * 90) for n in range(2000)]), {400}),
            ("a long path", http("GET", "/" + "x" * 200_000, here, []), {400}),
            ("no HTTP at all", b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03 hello\r\n\r\n", {400}),
        ):
            assert await status_of(here, raw) in allowed, what
        await answers(client)


async def test_invalid_json_is_refused_with_a_sentence(mesh, page, tmp_path):
    async with guarded(mesh, page, tmp_path) as (client, _, _):
        for body, status, word, code in (
            (b"", 400, "not_json", "request.not_json"),
            (b"{", 400, "not_json", "request.not_json"),
            (b"[" * 10_000, 400, "not_json", "request.not_json"),
            (b"[]", 400, "not_json", "request.not_json_object"),
            (b"\xff\xfe", 400, "not_json", "request.not_json"),
            (b'{"name": 1, "password": "x"}', 422, "missing", "request.needs_text"),
            (b'{"name": "li"}', 422, "missing", "request.needs_text"),
            (b'{"name": "li", "password": {"$ne": ""}}', 422, "missing", "request.needs_text"),
            (b'{"name": "li", "password": "\\ud800"}', 401, "wrong", "account.wrong"),
            (json.dumps({"name": "li" * 4000, "password": "x"}).encode(), 401, "wrong", "account.wrong"),
        ):
            got, _, answer = await client.post("/account/sign-in", body)
            assert (got, answer["error"], answer["refusal"]["code"]) == (status, word, code), body[:40]
            assert answer["text"] == answer["refusal"]["text"]


async def test_a_request_that_does_not_come_to_its_end_is_cut_off_and_others_are_answered(
    mesh, page, tmp_path, monkeypatch
):
    monkeypatch.setattr(Connection, "request_timeout_s", 0.3)

    async with guarded(mesh, page, tmp_path) as (client, _, _):
        here = client.address
        own = [("Origin", f"http://{here}"), ("Content-Type", "application/json"), ("Content-Length", 90)]
        half = http("GET", "/", here, [])[:-2]
        beginnings = {
            "nothing at all": b"",
            "half a head": half,
            "half a body": http("POST", "/account/sign-in", here, own, b"{"),
        }

        async def slow(beginning):
            async with connected(here) as (reader, writer):
                writer.write(beginning)
                await ended(reader)

        async def slow_then():
            async with connected(here) as (reader, writer):
                writer.write(http("GET", "/health", here, []))
                await reader.readuntil(b"\r\n\r\n")
                writer.write(half)
                await ended(reader)

        async def dripping():
            async with connected(here) as (reader, writer):
                reading = asyncio.create_task(ended(reader))
                writer.write(half)
                while not reading.done():
                    writer.write(b"X-A: b\r\n")
                    await asyncio.sleep(0.05)

        attacks = [slow(each) for each in beginnings.values()] + [slow_then(), dripping()]
        work = [asyncio.create_task(each) for each in attacks]
        await answers(client)
        await asyncio.gather(*work)
        await answers(client)


async def test_one_address_cannot_have_all_connections(mesh, page, tmp_path, monkeypatch):
    monkeypatch.setattr(Listener, "most_of_one", 8)

    async with guarded(mesh, page, tmp_path) as (client, _, _):
        host, port = client.address.split(":")
        held = [await asyncio.open_connection(host, int(port)) for _ in range(8)]
        async with connected(client.address) as (reader, _):
            assert await ended(reader) == b""
        # A client at another address still gets a response.
        async with connected(client.address, local_addr=("127.0.0.2", 0)) as (reader, writer):
            writer.write(http("GET", "/health", client.address, [("Connection", "close")]))
            assert (await ended(reader)).startswith(b"HTTP/1.1 200")
        for _, writer in held:
            writer.close()
        async with asyncio.timeout(ENDS_S):
            while True:
                try:
                    await answers(client)
                    break
                except (ConnectionError, IndexError):
                    await asyncio.sleep(0.02)


@pytest.mark.parametrize(
    ("message", "code"), [("text", 1008), (b"\xff" * 100, 1008), (b"\0" * (2 << 20), 1009)]
)
async def test_a_page_that_sends_nonsense_is_cut_off_and_the_others_are_not(
    mesh, page, tmp_path, message, code
):
    async with guarded(mesh, page, tmp_path) as (client, _, _):
        await client.sign_in("li")
        async with client.browse() as other, client.browse() as browser:
            await browser.socket.send(message)
            async with asyncio.timeout(ENDS_S):
                with contextlib.suppress(ConnectionClosed):
                    while True:
                        await browser.socket.recv()
            assert browser.socket.close_code in (code, 1006)  # 1006: cut off before the close frame
            await other.until(lambda: other.other)
            assert other.other[0].hello.account == "li"


def test_a_connection_in_its_handshake_counts_against_the_limit(monkeypatch):
    monkeypatch.setattr(Listener, "most_of_one", 1)
    with Listener(socket.AF_INET, socket.SOCK_STREAM) as listener:
        listener.bind(("127.0.0.1", 0))
        listener.listen()
        listener.setblocking(False)
        with socket.create_connection(listener.getsockname()):
            first, _ = listener.accept()
            with socket.create_connection(listener.getsockname()) as second:
                with pytest.raises(BlockingIOError):
                    listener.accept()
                second.settimeout(ENDS_S)
                assert second.recv(1) == b""
            first.close()
            with socket.create_connection(listener.getsockname()):
                third, _ = listener.accept()
                third.close()


@asynccontextmanager
async def page_of_bytes(address):
    """Yield a page's WebSocket as raw bytes that are hardly read."""
    host, port = address.split(":")
    connection = socket.socket()
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    connection.setblocking(False)
    await asyncio.get_running_loop().sock_connect(connection, (host, int(port)))
    reader, writer = await asyncio.open_connection(sock=connection, limit=1024)
    upgrade = [("Origin", f"http://{address}"), ("Connection", "Upgrade"), ("Upgrade", "websocket")]
    secret = [("Sec-WebSocket-Version", 13), ("Sec-WebSocket-Key", "x3JJHMbDL1EzLkh9GBhXDw==")]
    try:
        writer.write(http("GET", "/mesh", address, upgrade + secret))
        assert b" 101 " in await reader.readline()
        yield writer
    finally:
        writer.transport.abort()


def masked(first, payload=b""):
    """Return a browser's WebSocket frame: its first byte, and less than 126 bytes."""
    return bytes([first, 0x80 | len(payload), 0, 0, 0, 0]) + payload


async def endlessly(writer, data):
    while True:
        writer.write(data)
        await writer.drain()


@pytest.mark.parametrize(
    ("begin", "again"),
    [(b"", masked(0x89, bytes(125))), (masked(0x02), masked(0x00))],
    ids=["pings", "parts"],
)
async def test_a_page_whose_frames_never_end_is_cut_off_before_it_takes_memory(
    mesh, page, monkeypatch, begin, again
):
    monkeypatch.setattr(websocket_transport, "_MAX_BUFFERED", 1 << 20)
    monkeypatch.setattr(uvicorn_server, "_PING_EACH_S", 300.0)  # missing pongs are not the reason here

    async with console(mesh, page) as (address, _), page_of_bytes(address) as writer:
        writer.write(begin)
        with pytest.raises(ConnectionError):
            await asyncio.wait_for(endlessly(writer, again * 1000), 3 * ENDS_S)
        assert (await get(address, "/health"))[0] == 200


async def test_a_page_that_reads_nothing_any_more_is_gone_once_it_answers_no_ping(mesh, page, monkeypatch):
    monkeypatch.setattr(uvicorn_server, "_PING_EACH_S", 0.2)
    monkeypatch.setattr(uvicorn_server, "_PONG_WITHIN_S", 0.5)
    watch = FromPage(watch=FromPage.Watch(key="robomesh/s/r/joints")).SerializeToString()
    large = JointStates()
    large.joints.add(name="x" * 100_000)

    async with console(mesh, page) as (address, other), page_of_bytes(address) as writer:
        publisher = other.declare_publisher("s", "r", "joints")
        writer.write(masked(0x82, watch))
        async with asyncio.timeout(2 * ENDS_S):
            while not publisher.watched:
                await asyncio.sleep(0.01)
            # Unread data does not keep the connection open.
            while publisher.watched:
                publisher.put(large)
                await asyncio.sleep(0.05)
