"""Ports in use: the error names the program, and `up` is ready only when its own console answers."""

import asyncio
import os
import re
import subprocess
import sys
import threading
from http.server import HTTPServer, SimpleHTTPRequestHandler

import pytest

from robomesh.errors import ListenError
from robomesh.listen_address import own_addresses
from robomesh.wire.session import SessionSettings, open_session
from services.command_line.site import up
from services.router.router import Settings, check_ports_free, serve
from services.site_file.site import Site
from services.site_file.tables.console import Console
from services.used_ports import check_free
from tests.ports import free_port


@pytest.fixture
def foreign():
    """Serve HTTP in this process, which is no child of a site."""
    with HTTPServer(("127.0.0.1", 0), SimpleHTTPRequestHandler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield server.server_address[1]
        server.shutdown()


def site_of(port: int) -> Site:
    return Site(site="hall", console=Console(listen=f"127.0.0.1:{port}"))


def test_another_programs_answer_does_not_make_a_site_ready(foreign):
    site = site_of(foreign)
    assert up._answers(site.console.url)
    assert not up._own_console_answers(site)


@pytest.mark.slow
def test_a_childs_answer_makes_a_site_ready():
    program = (
        "import http.server; http.server.test(http.server.SimpleHTTPRequestHandler, port=0, bind='127.0.0.1')"
    )
    with subprocess.Popen(
        [sys.executable, "-u", "-c", program], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as child:
        try:
            port = re.search(r"port (\d+)", child.stdout.readline())[1]
            assert up._own_console_answers(site_of(int(port)))
        finally:
            child.kill()


def test_the_error_for_a_used_port_names_its_program_and_the_remedy(foreign):
    with pytest.raises(ListenError) as caught:
        check_ports_free([f"tcp/127.0.0.1:{foreign}"])
    assert re.fullmatch(
        rf"the router cannot listen on 127.0.0.1:{foreign}: process {os.getpid()} \(.+\) uses the port. "
        r"End it, or choose another address with \[router\] listen",
        str(caught.value),
    )


def test_a_site_does_not_start_when_a_port_of_it_is_used(foreign, monkeypatch):
    monkeypatch.setattr(up, "check_ports_free", lambda _: None)
    with pytest.raises(ListenError, match="the console cannot listen"):
        up._check_ports_free(site_of(foreign))


def test_a_free_port_is_free():
    check_free("the console", "127.0.0.1", 0, "")


@pytest.mark.slow
async def test_a_router_serves_its_other_addresses_while_one_is_not_there_yet(monkeypatch):
    # RFC 5737: no machine has this address.
    late, there = f"tcp/192.0.2.1:{free_port()}", f"tcp/127.0.0.1:{free_port()}"

    settings = Settings(site="hall", listen=(late, there), insecure=True)
    task = asyncio.create_task(serve(settings))
    async with open_session(SessionSettings(connect=own_addresses(settings.listen), wait_s=20.0)) as session:
        health = session.subscribe("robomesh/hall/-/health/*")
        assert f"the router does not listen on {late} yet" in (await anext(health)).message().problems[0].text
        monkeypatch.setattr("services.router.router.is_absent", lambda _: False)  # its network is up
        while (await anext(health)).message().problems:
            pass
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
