"""A host behind a virtual cable that is pulled out; `test_pulled_cable.py` runs these in their own network.

Interfaces that come and go in the machine's own network would end the connections of browsers beside them.
"""

import asyncio
import ctypes
import os
import socket
import subprocess
import sys
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from tests.protocol_gateway.gateway_site import PROMPT, STATE, gateway, until
from tests.protocol_gateway.old_client import Program, legacy, legacy_site

ROOT = Path(__file__).resolve().parents[2]
NEAR, FAR = "10.219.77.1", "10.219.77.2"
_CLONE_NEWNET = 0x40000000
SIMULATOR = f"""
import asyncio
from controllers.unit.simulated.service import Settings, serve
settings = Settings(robot="pt600", listen="{FAR}:5400", insecure=True, demo=True)
asyncio.run(serve(settings, ready=lambda line: print(line, flush=True)))
"""


class Cable:
    """A virtual cable to a network `name`, whose end there is `far`."""

    def __init__(self, name):
        self.name = name

    def set(self, state):
        ip(f"-n {self.name} link set far {state}")

    def connect(self, port):
        """Create a socket in the other network."""
        libc = ctypes.CDLL(None, use_errno=True)
        own, other = Path("/proc/thread-self/ns/net"), Path("/run/netns", self.name)
        with own.open() as own_namespace, other.open() as other_namespace:
            assert libc.setns(other_namespace.fileno(), _CLONE_NEWNET) == 0
            try:
                return socket.create_connection((NEAR, port), timeout=40)
            finally:
                assert libc.setns(own_namespace.fileno(), _CLONE_NEWNET) == 0


def ip(line):
    subprocess.run(["ip", *line.split()], check=True)


@pytest.fixture
def cable():
    name = f"robomesh-{os.getpid()}"
    ip(f"netns add {name}")
    try:
        for line in (
            f"link add near type veth peer name far netns {name}",
            f"addr add {NEAR}/30 dev near",
            "link set near up",
            f"-n {name} addr add {FAR}/30 dev far",
            f"-n {name} link set far up",
        ):
            ip(line)
        yield Cable(name)
    finally:
        # The network exists as long as one of its sockets.
        subprocess.run(["ip", "link", "del", "near"], check=False)
        ip(f"netns del {name}")


async def test_a_pulled_cable_ends_control_in_seconds(mesh, tmp_path, cable):
    settings = legacy(host=NEAR, commanders={FAR: "li"})
    async with legacy_site(mesh, tmp_path, settings) as site:
        far_socket = await asyncio.to_thread(cable.connect, settings.port)
        far_program = Program(*await asyncio.open_connection(sock=far_socket))

        def homed():
            far_program.say(b"1#TIME*1@")
            return "homed" in far_program.words and "idle" in far_program.words

        far_program.say(b"1#COMMAND*home@")
        await until(homed, timeout_s=30)
        far_program.say(b"2#COMMAND*speed=5&ABSOLUTE.DEG*140;0;0;0;0@")
        await until(lambda: site.controller.activity == STATE.MOVING)
        cable.set("down")
        await until(lambda: site.events("stop.latched"))
        assert "was not renewed" in (await site.event("stop.latched", 0)).text
        await until(lambda: site.controller.legacy_clients.attached == 0, timeout_s=30)
        far_program.writer.transport.abort()
        await far_program.close()


@asynccontextmanager
async def simulator_there(cable):
    process = await asyncio.create_subprocess_exec(
        *("ip", "netns", "exec", cable.name, sys.executable, "-c", SIMULATOR),
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=asyncio.subprocess.PIPE,
    )
    try:
        assert await process.stdout.readline()
        yield
    finally:
        process.kill()
        await process.wait()


async def test_a_vanished_host_is_detected_in_seconds_and_reconnected(mesh, tmp_path, cable):
    async with (
        simulator_there(cable),
        gateway(mesh, tmp_path, 5400, host=FAR, **PROMPT) as site,
    ):
        cable.set("down")
        await until(lambda: site.controller.link == STATE.SILENT)
        joints = len(site.seen["joints"])
        await until(lambda: site.controller.link == STATE.DOWN)
        await until(lambda: site.events("link.down"))
        await until(
            lambda: (
                "cannot connect" in site.controller.link_text
                or "does not answer" in site.controller.link_text
            )
        )
        assert len(site.seen["joints"]) == joints
        cable.set("up")
        await until(lambda: site.controller.link == STATE.UP, timeout_s=20.0)
