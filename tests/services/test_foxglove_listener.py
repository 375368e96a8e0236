"""Listener of the Foxglove service: origins, addresses, certificates and limits."""

import asyncio
import contextlib
import ssl
from contextlib import asynccontextmanager

import pytest
import trustme
import websockets

from robomesh.errors import ListenError
from services.foxglove import listener
from services.foxglove.listener import Listener, is_allowed_origin
from services.foxglove.settings import ORIGINS
from tests.services.foxglove_client import attached
from tests.services.test_foxglove import ARM, bridge, robot_session

REQUEST = b"GET / HTTP/1.1\r\n\r\n"


async def test_foreign_pages_are_refused_and_programs_are_not(mesh):
    async with bridge(mesh, origins=("https://plant.example",)) as address:
        for origin in (None, "http://localhost:8080", ORIGINS[0], "https://plant.example"):
            async with attached(address, origin=origin):
                pass
        for origin in ("https://evil.example", "null", "http://127.0.0.1.evil.example"):
            with pytest.raises(websockets.InvalidStatus) as caught:
                async with attached(address, origin=origin):
                    pass
            assert caught.value.response.status_code == 403
            assert origin.encode() in caught.value.response.body


@pytest.mark.parametrize(
    "origin",
    ["https://app.foxglove.dev.evil.example", "null", "", "https://x", "::", "http://[", "http://[bad]"],
)
def test_other_origins_are_not_allowed(origin):
    assert not is_allowed_origin(origin, ORIGINS)


async def test_beyond_loopback_it_needs_tls_or_insecure_and_offers_no_commands(mesh):
    with pytest.raises(ListenError, match="without TLS"):
        async with bridge(mesh, listen="0.0.0.0:0"):
            pass
    with pytest.raises(ListenError, match="loopback only"):
        async with bridge(mesh, listen="0.0.0.0:0", insecure=True, operator="li"):
            pass
    async with (
        robot_session(mesh),
        bridge(mesh, listen="0.0.0.0:0", insecure=True) as address,
        attached(address.replace("0.0.0.0", "127.0.0.1")) as client,
    ):
        await client.until(lambda: f"{ARM}/joints" in client.channels)
        assert "read-only" in client.info["name"]
        assert not client.services


async def test_with_a_certificate_it_uses_tls(mesh, tmp_path):
    authority = trustme.CA()
    pem = tmp_path / "foxglove.pem"
    authority.issue_cert("127.0.0.1").private_key_and_cert_chain_pem.write_to_path(pem)
    trusting = ssl.create_default_context()
    authority.configure_trust(trusting)
    async with bridge(mesh, certificate=pem) as address, attached(address, ssl=trusting) as client:
        assert address.startswith("wss://")
        assert client.info["capabilities"]
    with pytest.raises(ListenError, match="cannot be used as its certificate"):
        async with bridge(mesh, certificate=tmp_path / "none.pem"):
            pass


@asynccontextmanager
async def open_listener():
    """Run a listener in front of a server that greets; yield a function that connects to it."""

    tasks = []

    async def greet(reader, writer):
        tasks.append(asyncio.current_task())
        await reader.readuntil(b"\r\n\r\n")
        writer.write(b"welcome\r\n")
        await reader.read()
        writer.close()

    server = await asyncio.start_server(greet, "127.0.0.1", 0)
    proxy = Listener("127.0.0.1", server.sockets[0].getsockname()[1], ())
    connections = []
    async with proxy.open("127.0.0.1", 0, None) as port:

        async def connect(data, address="127.0.0.1"):
            reader, writer = await asyncio.open_connection("127.0.0.1", port, local_addr=(address, 0))
            connections.append((reader, writer))
            writer.write(data)
            return reader, writer

        try:
            yield connect
        finally:
            for reader, writer in connections:
                with contextlib.suppress(OSError):
                    writer.write_eof()
                    await reader.read()
                writer.close()
            server.close()
            await asyncio.gather(*tasks)


async def answer(reader):
    async with asyncio.timeout(30):
        return (await reader.readline()).strip()


async def test_a_page_with_an_invalid_origin_is_refused():
    async with open_listener() as connect:
        reader, _ = await connect(b"GET / HTTP/1.1\r\nOrigin: http://[bad\r\n\r\n")
        assert await answer(reader) == b"HTTP/1.1 403 Forbidden"


async def test_silent_connections_block_only_their_own_address(monkeypatch):
    monkeypatch.setattr(listener, "_MAX_CLIENTS", 2)
    monkeypatch.setattr(listener, "_MAX_OF_ADDRESS", 4)

    async with open_listener() as connect:
        silent = [await connect(b"") for _ in range(4)]
        reader, _ = await connect(REQUEST)
        assert await answer(reader) == b"HTTP/1.1 503 Service Unavailable"
        for address in ("127.0.0.2", "127.0.0.3"):
            reader, _ = await connect(REQUEST, address)
            assert await answer(reader) == b"welcome"
        reader, _ = await connect(REQUEST, "127.0.0.2")
        assert await answer(reader) == b"HTTP/1.1 503 Service Unavailable"
        assert await answer(reader) == b"Content-Type: text/plain"
        silent[0][1].write(REQUEST)
        assert await answer(silent[0][0]) == b"HTTP/1.1 503 Service Unavailable"


async def test_a_client_that_disconnects_makes_room_for_another(monkeypatch):
    monkeypatch.setattr(listener, "_MAX_CLIENTS", 1)
    monkeypatch.setattr(listener, "_MAX_OF_ADDRESS", 2)

    async with open_listener() as connect:
        for _ in range(4):
            async with asyncio.timeout(30):
                while True:
                    reader, writer = await connect(REQUEST)
                    if await answer(reader) == b"welcome":
                        break
            writer.close()


async def test_a_closed_listener_ends_its_connections_without_an_error(caplog):
    proxy = Listener("127.0.0.1", 1, ())
    async with proxy.open("127.0.0.1", 0, None) as port:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        while not proxy._per_address:
            await asyncio.sleep(0.01)
    assert not proxy._per_address
    assert await reader.read() == b""
    writer.close()
    assert not [record for record in caplog.records if record.name == "asyncio"]
