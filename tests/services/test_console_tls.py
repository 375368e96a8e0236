"""A console's TLS: requirements beyond loopback, cookies, renewed and invalid certificates."""

import asyncio
import gc
import json
import socket
import ssl
import warnings
from asyncio.sslproto import _SSLProtocolTransport
from contextlib import AsyncExitStack

import pytest

from robomesh.errors import ListenError
from services.console.serving import uvicorn_server
from tests.services.certificates import self_signed
from tests.services.signing_in import accounts_file
from tests.services.test_console import console, page
from tests.services.test_console_attacks import ENDS_S, connected, ended, http, status_of

__all__ = ["page"]  # a fixture

CLOSE = b"\x88\x80\x00\x00\x00\x00"  # a client's WebSocket frame


async def test_over_tls_the_cookie_is_for_this_host_alone_and_browsers_come_back_by_tls(mesh, page, tmp_path):
    certificate, key = self_signed(tmp_path)

    path = accounts_file(tmp_path)
    settings = {"accounts": path, "tls": {"certificate": certificate, "key": key}}
    async with console(mesh, page, **settings) as (address, _):
        here = address.removeprefix("https://")
        trusted = ssl.create_default_context(cafile=certificate)
        body = json.dumps({"name": "li", "password": "three arms in a hall"}).encode()
        own = [
            ("Content-Type", "application/json"),
            ("Content-Length", len(body)),
            ("Connection", "close"),
        ]
        for origin, status in ((f"http://{here}", b"403"), (f"https://{here}", b"200")):
            async with connected(here, ssl=trusted) as (reader, writer):
                assert writer.get_extra_info("ssl_object").version() in ("TLSv1.2", "TLSv1.3")
                asked = [("Origin", origin), *own]
                writer.write(http("POST", "/account/sign-in", here, asked, body))
                answer = await ended(reader)
            assert answer.split()[1] == status
        head = answer.partition(b"\r\n\r\n")[0].decode().lower()
        assert "strict-transport-security: max-age=" in head
        assert "set-cookie: __host-robomesh-s=" in head
        assert "; secure" in head
        # Plain HTTP, or an unfinished handshake, affects no other client.
        assert await status_of(here, http("GET", "/", here, [])) == 0


@pytest.mark.parametrize(
    ("has", "lacks"), [((), "accounts and without TLS"), (("accounts",), "TLS"), (("tls",), "accounts")]
)
async def test_beyond_loopback_it_needs_accounts_and_tls(mesh, page, tmp_path, has, lacks):
    certificate, key = self_signed(tmp_path)
    settings = {"listen": "0.0.0.0:0"}
    if "accounts" in has:
        settings["accounts"] = accounts_file(tmp_path)
    if "tls" in has:
        settings |= {"tls": {"certificate": certificate, "key": key}}

    with pytest.raises(ListenError, match=f"without {lacks}: give it accounts"):
        async with console(mesh, page, **settings):
            pass
    # With `insecure` it does, and every page shows that.
    async with console(mesh, page, **settings, insecure=True) as (address, _):
        assert address.endswith(address.rpartition(":")[2])


async def test_a_renewed_certificate_is_taken_up_without_a_restart_and_half_a_one_is_not(
    mesh, page, tmp_path, monkeypatch
):
    monkeypatch.setattr(uvicorn_server, "_CERTIFICATE_CHECK_EVERY_S", 0.02)
    certificate, key = self_signed(tmp_path)
    (tmp_path / "next").mkdir()
    renewed, renewed_key = self_signed(tmp_path / "next")
    anyone = ssl.create_default_context()
    anyone.check_hostname, anyone.verify_mode = False, ssl.CERT_NONE

    async with console(mesh, page, tls={"certificate": certificate, "key": key}) as (address, _):

        async def shown():
            async with connected(address.removeprefix("https://"), ssl=anyone) as (_, writer):
                return writer.get_extra_info("ssl_object").getpeercert(binary_form=True)

        first = await shown()
        renewed.replace(certificate)
        for _ in range(5):
            await asyncio.sleep(0.05)
            assert await shown() == first
        renewed_key.replace(key)
        async with asyncio.timeout(ENDS_S):
            while await shown() == first:
                await asyncio.sleep(0.02)


async def test_a_page_that_closes_and_ends_at_once_leaves_no_socket_open(mesh, page, tmp_path, monkeypatch):
    lost, close = [], _SSLProtocolTransport.close

    def closed(transport):
        lost.append(transport.is_closing())
        close(transport)

    # A second close takes its protocol from a transport, which then can neither read nor end.
    monkeypatch.setattr(_SSLProtocolTransport, "close", closed)
    certificate, key = self_signed(tmp_path)
    trusted = ssl.create_default_context(cafile=certificate)
    async with console(mesh, page, tls={"certificate": certificate, "key": key}) as (address, _):
        here = address.removeprefix("https://")
        headers = [("Origin", address), ("Connection", "Upgrade"), ("Upgrade", "websocket")]
        headers += [("Sec-WebSocket-Version", 13), ("Sec-WebSocket-Key", "AAAAAAAAAAAAAAAAAAAAAA==")]
        async with AsyncExitStack() as stack:
            pages = [await stack.enter_async_context(connected(here, ssl=trusted)) for _ in range(10)]
            for reader, writer in pages:
                writer.write(http("GET", "/mesh", here, headers))
                assert b" 101 " in await reader.readline()
            # The ends come before the console has read all of the close frames.
            for _, writer in pages:
                writer.write(CLOSE)
                writer.get_extra_info("socket").shutdown(socket.SHUT_WR)
    with warnings.catch_warnings(record=True) as unclosed:
        warnings.simplefilter("always", ResourceWarning)
        gc.collect()
    assert not unclosed
    assert lost
    assert not any(lost)


async def test_an_invalid_certificate_is_named(mesh, page, tmp_path):
    (tmp_path / "c.pem").write_text("no certificate")

    for certificate, why in (
        (tmp_path / "c.pem", "not a certificate"),
        (tmp_path / "d.pem", "No such file"),
    ):
        with pytest.raises(ListenError, match=why) as refused:
            async with console(mesh, page, tls={"certificate": certificate, "key": certificate}):
                pass
        assert certificate.name in str(refused.value)
