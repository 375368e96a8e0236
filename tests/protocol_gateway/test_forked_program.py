"""A program that forked: its control ends when the program dies, also while its children run."""

import asyncio
import contextlib
import os
import signal
import sys

import psutil
import pytest

from tests.conftest import rest_is_long
from tests.patience import be_patient
from tests.protocol_gateway.gateway_site import STATE, gateway, simulator, until
from tests.robomesh.forking_script import WAYS


@pytest.fixture(autouse=True)
def patience(monkeypatch):
    be_patient(monkeypatch.setattr)


@contextlib.asynccontextmanager
async def program(site, mesh, folder, way):
    """Run a program that forks; yield it and its output's reader; kill it and its children afterwards."""
    site.own.declare_presence("hall", "arm", "gateway")  # the service does the same at its start
    output = folder / "output"
    with output.open("w") as file:
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "tests.robomesh.forking_script", way, mesh.connect[0]), stdout=file
        )
    try:
        yield process, lambda: output.read_text().splitlines()
    finally:
        for pid in (process.pid, *children(output.read_text().splitlines())):
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        await process.wait()


def children(lines):
    return [int(line.split()[1]) for line in lines if line.startswith("child ")]


@pytest.mark.slow
@pytest.mark.parametrize("way", rest_is_long(4, (way for way in WAYS if way != "use")))
async def test_a_killed_program_loses_control_at_once_while_its_child_lives(mesh, tmp_path, way):
    async with (
        simulator() as port,
        gateway(mesh, tmp_path, port) as site,
        program(site, mesh, tmp_path, way) as (process, lines),
    ):
        await until(lambda: site.controller.activity == STATE.MOVING, timeout_s=60.0)
        await until(lambda: way == "none" or children(lines()), timeout_s=60.0)
        process.send_signal(signal.SIGKILL)
        await until(lambda: site.controller.HasField("stop"))
        # Its lease did not expire.
        assert site.controller.stop.reason == "dead-man: script's page or program has disconnected"
        # Without a copy of the connection, its end is seen at once. The child still lives.
        for pid in children(lines()):
            ends = [each.raddr.port for each in psutil.Process(pid).net_connections() if each.raddr]
            assert int(mesh.connect[0].rpartition(":")[2]) not in ends


@pytest.mark.slow
async def test_a_forked_process_cannot_use_what_it_inherited_and_its_parent_can(mesh, tmp_path):
    async with (
        simulator() as port,
        gateway(mesh, tmp_path, port) as site,
        program(site, mesh, tmp_path, "use") as (process, lines),
    ):
        assert await process.wait() == 0
        calls = ("stop", "home", "robots", "__next__")
        assert lines() == [*(f"{call} -> ForkedError" for call in calls), "exit status 7", "arrived"]
        assert not site.controller.HasField("stop")
