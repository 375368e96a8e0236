"""Who may attach to the Foxglove bridge: pages, addresses, certificates, and how many at once."""

import asyncio
import contextlib
import ssl
from contextlib import asynccontextmanager

import pytest
import trustme
import websockets

from services.errors import ListenError
from services.foxglove import listener
from services.foxglove.listener import Door, welcome
from services.foxglove.settings import ORIGINS
from tests.conftest import run
from tests.services.foxglove_client import attached
from tests.services.test_foxglove import ARM, bridge, hall

ASKED = b"GET / HTTP/1.1\r\n\r\n"


def test_pages_of_others_are_sent_away_and_programs_are_not(mesh):
    async def main():
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

    run(main())


@pytest.mark.parametrize(
    "origin",
    ["https://app.foxglove.dev.evil.example", "null", "", "https://x", "::", "http://[", "http://[bad]"],
)
def test_what_is_not_allowed_is_not_welcome(origin):
    assert not welcome(origin, ORIGINS)


def test_beyond_loopback_it_needs_tls_or_says_insecure_and_takes_no_commands(mesh):
    async def main():
        with pytest.raises(ListenError, match="without TLS"):
            async with bridge(mesh, listen="0.0.0.0:0"):
                pass
        with pytest.raises(ListenError, match="loopback only"):
            async with bridge(mesh, listen="0.0.0.0:0", insecure=True, operator="li"):
                pass
        async with (
            hall(mesh),
            bridge(mesh, listen="0.0.0.0:0", insecure=True) as address,
            attached(address.replace("0.0.0.0", "127.0.0.1")) as client,
        ):
            await client.until(lambda: f"{ARM}/joints" in client.channels)
            assert "read-only" in client.info["name"]
            assert not client.services

    run(main())


def test_with_a_certificate_it_speaks_tls(mesh, tmp_path):
    async def main():
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

    run(main())


@asynccontextmanager
async def open_door():
    """A way to knock at a door, behind which everybody is greeted."""

    greeted = []

    async def greet(reader, writer):
        greeted.append(asyncio.current_task())
        await reader.readuntil(b"\r\n\r\n")
        writer.write(b"welcome\r\n")
        await reader.read()
        writer.close()

    inside = await asyncio.start_server(greet, "127.0.0.1", 0)
    before = Door("127.0.0.1", inside.sockets[0].getsockname()[1], ())
    knocked = []
    async with before.open("127.0.0.1", 0, None) as port:

        async def knock(says, address="127.0.0.1"):
            reader, writer = await asyncio.open_connection("127.0.0.1", port, local_addr=(address, 0))
            knocked.append((reader, writer))
            writer.write(says)
            return reader, writer

        try:
            yield knock
        finally:
            for reader, writer in knocked:
                with contextlib.suppress(OSError):
                    writer.write_eof()
                    await reader.read()
                writer.close()
            inside.close()
            await asyncio.gather(*greeted)


async def answer(reader):
    async with asyncio.timeout(30):
        return (await reader.readline()).strip()


def test_a_page_that_says_nonsense_of_itself_is_sent_away_like_any_other():
    async def main():
        async with open_door() as knock:
            reader, _ = await knock(b"GET / HTTP/1.1\r\nOrigin: http://[bad\r\n\r\n")
            assert await answer(reader) == b"HTTP/1.1 403 Forbidden"

    run(main())


def test_who_says_nothing_keeps_out_himself_alone_and_for_as_long_as_he_stays(monkeypatch):
    monkeypatch.setattr(listener, "_MOST_CLIENTS", 2)
    monkeypatch.setattr(listener, "_MOST_OF_ONE", 4)

    async def main():
        async with open_door() as knock:
            silent = [await knock(b"") for _ in range(4)]
            reader, _ = await knock(ASKED)
            assert await answer(reader) == b"HTTP/1.1 503 Service Unavailable"
            for address in ("127.0.0.2", "127.0.0.3"):
                reader, _ = await knock(ASKED, address)
                assert await answer(reader) == b"welcome"
            reader, _ = await knock(ASKED, "127.0.0.2")
            assert await answer(reader) == b"HTTP/1.1 503 Service Unavailable"
            assert await answer(reader) == b"Content-Type: text/plain"
            silent[0][1].write(ASKED)
            assert await answer(silent[0][0]) == b"HTTP/1.1 503 Service Unavailable"

    run(main())


def test_places_of_those_who_went_are_free_again(monkeypatch):
    monkeypatch.setattr(listener, "_MOST_CLIENTS", 1)
    monkeypatch.setattr(listener, "_MOST_OF_ONE", 2)

    async def main():
        async with open_door() as knock:
            for _ in range(4):
                async with asyncio.timeout(30):
                    while True:
                        reader, writer = await knock(ASKED)
                        told = await answer(reader)
                        if told == b"welcome":
                            break
                writer.close()

    run(main())


def test_a_door_that_is_closed_ends_its_visits_without_a_word_of_error(caplog):
    async def main():
        before = Door("127.0.0.1", 1, ())
        async with before.open("127.0.0.1", 0, None) as port:
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            while not before._open:
                await asyncio.sleep(0.01)
        assert not before._open
        assert await reader.read() == b""
        writer.close()

    run(main())
    assert not [record for record in caplog.records if record.name == "asyncio"]
