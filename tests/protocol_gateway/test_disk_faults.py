"""The audit log's disk, full or slow."""

import asyncio
import contextlib
import os
import time
from pathlib import Path

import pytest

from protocol_gateway.audit.log import read_entries, verify
from tests.protocol_gateway.gateway_site import STATE, A, C, gateway, refusal, simulator, until


@contextlib.contextmanager
def full_disk(path):
    """Replace the open audit log's file by a full device for a while, so that writes really fail."""
    (number,) = [int(fd.name) for fd in Path("/proc/self/fd").iterdir() if _target(fd) == path]
    kept, full = os.dup(number), os.open("/dev/full", os.O_RDWR)
    os.dup2(full, number)
    os.close(full)
    try:
        yield
    finally:
        os.dup2(kept, number)
        os.close(kept)


def _target(fd):
    with contextlib.suppress(OSError):
        return fd.readlink()
    return None


async def test_on_a_full_disk_a_stop_works_and_is_written_later(mesh, tmp_path):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        await site.home()
        with full_disk(site.audit):
            text = await refusal(site.command(C.HOME))
            assert "No space left on device" in text
            stop = await site.stop(by="wang")
            assert stop.sent
            await until(lambda: site.controller.activity == STATE.STOPPED)
            await site.lease(A.RENEW)
            await until(lambda: site.events("audit.failed"))
        await until(lambda: [entry.request for entry in read_entries(site.audit)][-1] == "STOP")
        await site.lease(A.RENEW)
        await site.command(C.RESET, stop_id=stop.stop_id)
    assert verify(site.audit).ok
    assert [e.request for e in read_entries(site.audit)] == [
        "ACQUIRE",
        "HOME",
        "HOME",
        "STOP",
        "RESET",
        "REVOKE",
    ]


@pytest.mark.exact_times
async def test_a_command_that_waited_for_a_slow_disk_is_not_sent(mesh, tmp_path, monkeypatch):
    async with simulator(demo=True) as port, gateway(mesh, tmp_path, port) as site:
        await site.lease(A.ACQUIRE)
        fsync = os.fsync

        def slow(file):
            time.sleep(3.0)
            fsync(file)

        monkeypatch.setattr(os, "fsync", slow)
        asked = [site.command(C.TRACE_ON), site.command(C.SPEED, speed_percent=10)]
        first, second = await asyncio.gather(*(refusal(each) for each in asked))
        assert first.startswith("Not sent: the audit log's disk takes longer than 1 s; a command")
        # The refusal depends on the delay after the first command.
        assert second.startswith(("Not sent: it waited ", first[:45]))
        await until(lambda: site.events("audit.failed"))
        monkeypatch.setattr(os, "fsync", fsync)
        await until(lambda: site.seen["audit"][-1].request == "SPEED")
        await site.lease(A.RENEW)
        await site.command(C.TRACE_OFF)
        await until(lambda: site.controller.counters.units_sent == 1)
    outcomes = [(each.request, each.outcome) for each in read_entries(site.audit)]
    assert ("TRACE_ON", "FAILED") in outcomes
    assert dict(outcomes)["SPEED"] in ("REFUSED", "FAILED")
    assert dict(outcomes)["TRACE_OFF"] == "ACCEPTED"
