"""`robomesh record`: its end by Ctrl-C, by another client and by a full disk."""

import asyncio
import os
import signal
from contextlib import asynccontextmanager

import pytest
import zenoh

from robomesh.contract.endpoints import router_config
from robomesh.errors import RefusedError
from robomesh.wire.session import SessionSettings
from services.command_line.control.send import joined
from services.command_line.record.record import _interrupted, _record, _stop
from services.command_line.terminal.discovery import RobotAddress
from tests.conftest import run
from tests.ports import free_port
from tests.services.recording import put_states, recording_site, trace_off
from tests.services.test_recorder import fill_disk_under


@asynccontextmanager
async def arm_recorded(mesh, folder):
    """Run a recorder, with a present arm."""
    async with recording_site(mesh, folder) as other:
        other.declare_presence("site", "arm", "gateway")
        while await other.last("robomesh/site/arm/recording") is None:
            pass
        yield other


async def until_printed(capsys, text):
    printed = ""
    while text not in printed:
        printed += capsys.readouterr().err
        await asyncio.sleep(0.02)


async def test_ctrl_c_ends_a_recording_and_prints_a_summary(mesh, router, tmp_path, capsys):
    async with arm_recorded(mesh, tmp_path) as other:
        recording = asyncio.create_task(_record("arm", "trial", ["-"], router))
        await until_printed(capsys, "recording site/arm as trial; Ctrl-C ends it")
        while not await joined(other, RobotAddress("site", "arm")):
            pass
        os.kill(os.getpid(), signal.SIGINT)
        done = await recording
    assert (done.recording.name, done.problem) == ("trial", "")
    assert (tmp_path / "arm" / done.recording.file).is_file()


def test_a_recording_of_another_client_is_ended_from_the_command_line(mesh, router, tmp_path, capsys):
    async def main():
        async with arm_recorded(mesh, tmp_path):
            recording = asyncio.create_task(_record("arm", "trial", ["-"], router))
            await until_printed(capsys, "Ctrl-C ends it")
            ended = await _stop("arm", router)
            assert (ended.name, ended.open) == ("trial", False)
            with pytest.raises(RefusedError, match="is not being recorded"):
                await _stop("arm", router)
            return await recording

    assert run(main()).problem == "recording trial was ended by another"


async def test_a_second_ctrl_c_does_not_end_the_program_before_the_recording():
    async with _interrupted() as pressed:
        os.kill(os.getpid(), signal.SIGINT)
        await pressed.wait()
        os.kill(os.getpid(), signal.SIGINT)  # `timeout --signal INT` sends both
        await asyncio.sleep(0.05)


def test_a_recording_ended_by_another_client_is_reported(mesh, router, tmp_path, capsys):
    async def main():
        async with arm_recorded(mesh, tmp_path) as other:
            recording = asyncio.create_task(_record("arm", "trial", ["-"], router))
            await until_printed(capsys, "Ctrl-C ends it")
            await trace_off(other)
            return await recording

    assert run(main()).problem == "recording trial was ended by another"


@pytest.mark.slow
def test_a_recording_whose_site_has_gone_ends_after_a_while_and_says_where_to_look(
    tmp_path, capsys, monkeypatch
):
    monkeypatch.setattr("services.command_line.record.record._SILENCE_S", 2.0)
    monkeypatch.setattr("services.command_line.record.record._SITE_GONE_S", 2.0)
    endpoint = f"tcp/127.0.0.1:{free_port()}"

    async def main():
        router = zenoh.open(router_config((endpoint,)))
        async with arm_recorded(SessionSettings(connect=(endpoint,), wait_s=5.0), tmp_path):
            recording = asyncio.create_task(_record("arm", "trial", ["-"], endpoint))
            await until_printed(capsys, "Ctrl-C ends it")
            await asyncio.to_thread(router.close)
            return await recording

    problem = run(main()).problem
    assert problem.startswith("no router answers any more: trial of site/arm was seen until ")


def test_a_full_disk_ends_a_recording_with_its_error(mesh, router, tmp_path, capsys):
    async def main():
        async with arm_recorded(mesh, tmp_path) as other:
            recording = asyncio.create_task(_record("arm", "full", ["-"], router))
            await until_printed(capsys, "Ctrl-C ends it")
            fill_disk_under(tmp_path / "arm")
            await put_states(other.declare_publisher("site", "arm", "joints"), range(20))
            return await recording

    problem = run(main()).problem
    # The other is what a sync of /dev/full says.
    ends = tuple(f"recording full ended: {why}" for why in ("no space left", "invalid argument"))
    assert problem.lower().startswith(ends)
    assert problem.endswith("; what was written is kept")
