"""Audit head in recordings: with a recording, a log that was cut after it can be detected."""

import asyncio
import contextlib
import json

from protocol_gateway.audit.log import read_entries
from robomesh.recordings.files import describe_file
from robomesh.wire.session import open_session
from services.recorder.recorder import Settings, serve
from tests.conftest import run
from tests.protocol_gateway.gateway_site import A, C, gateway, simulator, until
from tests.site import robomesh


@contextlib.asynccontextmanager
async def recorder(mesh, folder):
    async with open_session(mesh) as session:
        task = asyncio.create_task(
            serve(
                session,
                Settings(site="hall", robots=("arm",), folder=folder),
            )
        )
        try:
            yield
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)


def test_a_log_that_was_cut_shows_against_a_recording_of_its_time(mesh, tmp_path):
    folder = tmp_path / "recordings"

    async def main():
        async with (
            simulator(demo=True) as port,
            gateway(mesh, tmp_path, port) as plant,
            recorder(mesh, folder),
        ):
            await plant.lease(A.ACQUIRE, ttl_s=5)
            await plant.command(C.TRACE_ON)
            await until(lambda: any(file.stat().st_size for file in folder.glob("arm/*.mcap")))
            await plant.stop(by="wang")
            await until(lambda: plant.controller.audit_head.number >= 3)
            await plant.lease(A.RENEW, ttl_s=5)
            await plant.command(C.TRACE_OFF)
            (file,) = folder.glob("arm/*.mcap")
            await until(
                lambda: describe_file(file).audit_head.number >= 3 and not describe_file(file).problem
            )
        return file, plant.audit

    file, log = run(main())
    described = json.loads(robomesh("recordings", "info", str(file), "--json").stdout)
    number, head_hash = described["audit_head"]["number"], described["audit_head"]["hash"]
    assert number >= 3
    assert head_hash == list(read_entries(log))[number - 1].hash
    assert f"audit log: entry {number}, {head_hash}" in robomesh("recordings", "info", str(file)).stdout

    done = robomesh("audit", "verify", str(log), "--recording", str(file), "--json")
    found = json.loads(done.stdout)
    assert (done.returncode, found["ok"], found["first_break"], found["first_entry"]) == (0, True, None, 1)
    log.write_bytes(b"".join(log.read_bytes().splitlines(keepends=True)[: number - 1]))
    done = robomesh("audit", "verify", str(log), "--recording", str(file))
    assert done.returncode == 1
    assert f"ends after entry {number - 1}, but no entry has the hash {head_hash}" in done.stdout
    # Without the recording the cut is not detected.
    assert robomesh("audit", "verify", str(log)).returncode == 0
