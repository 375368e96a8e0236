"""Latch file: stops that survive a kill of the gateway, also on a full disk."""

import asyncio
import json
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from protocol_gateway.audit.log import AuditLog, Entry, Outcome, read_entries
from protocol_gateway.authority.lease_rules import LatchedStop
from protocol_gateway.persistence.latch_file import RESERVED, SLOT_BYTES, LatchFile
from protocol_gateway.persistence.persisted_state import LATCH_UNKNOWN
from protocol_gateway.seam.errors import AuditError
from robomesh import reason_codes as codes
from tests.conftest import run
from tests.protocol_gateway.gateway_site import STATE, A, C, gateway, refusal, simulator, until
from tests.soak import latch_kills

HOUSE = Path(__file__).resolve().parents[2]
NOW_NS = 1_800_000_000_000_000_000


def stop(number, reason="fire"):
    return LatchedStop(id=number, by="wang", reason=reason, since_ns=NOW_NS)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "arm.latch"


def killed(path, *states, begin=(None, 0)):
    """Write a latch file as a killed gateway leaves it."""
    latch = LatchFile(path)
    latch.begin(*begin, given_out=begin[1])
    for state in states:
        latch.keep(*state)
        settle(latch)
    latch._writer.shutdown()
    latch._syncer.shutdown()
    os.close(latch._file)
    return path.read_bytes()


def settle(latch):
    latch._writer.submit(lambda: None).result(timeout=30.0)


def test_the_newest_of_two_slots_counts_and_the_file_never_grows(path):
    for last in range(1, 6):
        data = killed(path, *[(stop(number), number) for number in range(1, last + 1)])
        assert len(data) == 2 * SLOT_BYTES
        found = LatchFile(path).found
        assert (found.stop.id, found.last_stop_id, found.reserved) == (last, last, last + RESERVED)
        path.unlink()


def test_a_reset_stop_is_no_longer_latched(path):
    killed(path, (stop(1), 1), (None, 1))
    assert LatchFile(path).found.stop is None


def test_a_stop_number_is_never_given_out_twice(path):
    killed(path, (stop(1), 1))
    given = RESERVED + 1  # numbers that a killed gateway may have issued and not written
    latch = LatchFile(path)
    latch.begin(latch.found.stop, latch.found.last_stop_id, given_out=latch.found.reserved)
    assert latch.next_number(given, NOW_NS) == given + 1
    latch.close()
    assert LatchFile(path).found.reserved == given  # this one shut down normally, and gave out none


def test_a_number_that_no_disk_reserves_is_the_time(path, monkeypatch):
    latch = LatchFile(path)
    assert latch.next_number(7, NOW_NS) == NOW_NS // 1000
    assert latch.next_number(NOW_NS // 1000, NOW_NS) == NOW_NS // 1000 + 1
    latch.begin(None, 7, given_out=7)
    assert latch.next_number(7, NOW_NS) == 8
    assert latch.next_number(7 + RESERVED, NOW_NS) == NOW_NS // 1000
    latch.close()


@pytest.mark.parametrize("slot", [0, 1])
@pytest.mark.parametrize("offset", [0, 40, 100, 2000, SLOT_BYTES - 1])
def test_a_damaged_slot_may_have_held_a_stop(path, slot, offset):
    data = bytearray(killed(path, (stop(1), 1), (None, 1)))
    data[slot * SLOT_BYTES + offset] ^= 1
    path.write_bytes(data)
    assert LatchFile(path).damage == "its latch file arm.latch is damaged"


EMPTY = b"\0" * SLOT_BYTES


@pytest.mark.parametrize("data", [b"", 2 * EMPTY])
def test_an_unwritten_file_is_damage_except_at_the_first_start(path, data):
    path.write_bytes(data)
    latch = LatchFile(path, first=True)
    assert (latch.found, latch.damage) == (None, "")
    assert LatchFile(path).damage == "its latch file arm.latch is damaged"


def test_an_empty_slot_is_damage_except_after_the_very_first_write(path):
    data = killed(path, (stop(1), 1), (stop(2), 2))  # in slot 0, in slot 1
    for left in (data[:SLOT_BYTES], data[:SLOT_BYTES] + EMPTY, EMPTY + data[SLOT_BYTES:]):
        path.write_bytes(left)
        assert LatchFile(path).damage == "its latch file arm.latch is damaged"
    path.unlink()
    data = killed(path)
    path.write_bytes(data[:SLOT_BYTES] + EMPTY)
    latch = LatchFile(path)
    assert (latch.found.stop, latch.damage) == (None, "")


def test_a_file_of_another_robot_is_damage(path):
    killed(path, (stop(1), 1))
    path.rename(path.with_name("other.latch"))
    latch = LatchFile(path.with_name("other.latch"))
    assert (latch.found, latch.damage) == (None, "its latch file other.latch belongs to another robot")


def test_a_stop_after_closing_the_file_is_reported_as_lost(path, monkeypatch):
    latch = LatchFile(path)
    latch.begin(None, 0, given_out=0)
    goes_on, begun, pwrite = threading.Event(), threading.Event(), os.pwrite

    def slow(*arguments):
        begun.set()
        goes_on.wait()
        return pwrite(*arguments)

    monkeypatch.setattr(os, "pwrite", slow)
    latch.keep(None, 1)
    assert begun.wait(30.0)
    latch.keep(stop(2), 2)
    closing = threading.Thread(target=latch.close)
    closing.start()
    while not latch._closed:
        time.sleep(0.001)
    latch.keep(stop(3), 3)
    said = latch.problem
    goes_on.set()
    closing.join()
    latch.keep(stop(4), 4)
    for each in (said, latch.problem):
        assert each == codes.LATCH_CLOSED(name=path.name)
    assert LatchFile(path).found.stop.id == 2


@pytest.mark.parametrize("data", [b"x", b"{}\n", b"[" * 9000, b"\xff" * 8192, b'{"sha256":1}' + b" " * 4084])
def test_any_file_is_read_or_reported_as_damaged(path, data):
    path.write_bytes(data)
    assert LatchFile(path).damage


def test_the_longest_texts_fit_into_a_slot(path):
    killed(path, (LatchedStop(id=2**62, by="\U0010ffff" * 900, reason='"\\' * 900, since_ns=NOW_NS), 2**62))
    assert LatchFile(path).found.stop.id == 2**62


def test_a_disk_that_hangs_delays_no_stop_and_is_reported(path, monkeypatch):
    latch = LatchFile(path)
    latch.begin(None, 0, given_out=0)
    goes_on, pwrite = threading.Event(), os.pwrite

    def hang(*arguments):
        goes_on.wait()
        return pwrite(*arguments)

    monkeypatch.setattr(os, "pwrite", hang)
    try:
        latch.keep(stop(1), 1)
        latch.keep(stop(2), 2)  # returns while the first is still being written
        monkeypatch.setattr("protocol_gateway.persistence.latch_file.LONGEST_WRITE_S", -1.0)
        assert latch.problem == codes.LATCH_SLOW(name="arm.latch", seconds=-1.0)
    finally:
        goes_on.set()
    settle(latch)
    assert latch.problem is None
    assert LatchFile(path).found.stop.id == 2
    latch.close()


def test_a_sync_that_hangs_does_not_block_newer_stops(path, monkeypatch):
    latch = LatchFile(path)
    latch.begin(None, 0, given_out=0)
    goes_on = threading.Event()
    monkeypatch.setattr(os, "fdatasync", lambda file: goes_on.wait())
    try:
        for number in (1, 2, 3):
            latch.keep(stop(number), number)
            settle(latch)
            assert LatchFile(path).found.stop.id == number
    finally:
        goes_on.set()
    latch.close()


async def test_a_stop_only_in_the_latch_file_is_restored_and_audited(tmp_path):
    log = tmp_path / "arm.jsonl"

    async def life(*, latched=None, kill=False):
        audit = AuditLog(log)
        if latched is not None:
            audit.latch.keep(latched, latched.id)
            settle(audit.latch)
        found = audit.state, audit.damage
        if kill:
            audit.latch.close = lambda: None
        await audit.close()
        return found

    await life(latched=stop(1, "dog"), kill=True)
    memory, mended = await life()
    assert (memory.stop.id, memory.stop.by, memory.stop.reason) == (1, "wang", "dog")
    assert memory.last_stop_id == 1 + RESERVED
    assert mended == ""
    (entry,) = read_entries(log)
    assert (entry.request, entry.operator, entry.values["stop_id"]) == ("STOP", "wang", "1")
    assert entry.text == "the gateway was killed before it wrote the entry of stop 1"
    memory, _ = await life()
    assert memory.stop.id == 1
    assert len(list(read_entries(log))) == 1


async def test_a_stop_with_an_unsent_reset_stays_latched(tmp_path):
    log = tmp_path / "arm.jsonl"

    async def life(*requests, latched=None):
        audit = AuditLog(log)
        for request in requests:
            entry = Entry(
                time_ns=NOW_NS,
                operator="wang",
                source="mesh",
                request=request,
                outcome=Outcome.ACCEPTED,
                text="",
                values={"stop_id": "1"},
            )
            await audit.append(entry)
        if latched is not None:
            audit.latch.keep(latched, latched.id)
            settle(audit.latch)
        found = audit.state
        audit.latch.close = lambda: None  # killed
        await audit.close()
        return found

    await life("STOP", "RESET", latched=stop(1))
    for _ in range(2):
        memory = await life()
        assert (memory.stop.id, memory.stop.by) == (1, "wang")
    *_, entry = read_entries(log)
    assert (entry.request, entry.outcome, entry.number) == ("RESET", Outcome.FAILED, 3)
    assert entry.text.endswith("the stop stays latched")


async def test_a_damaged_file_gets_a_new_stop_number(tmp_path):
    async def life():
        audit = AuditLog(tmp_path / "arm.jsonl")
        found = audit.state
        audit.latch.keep(stop(7), 7)  # in no log
        settle(audit.latch)
        audit.latch.close = lambda: None  # killed
        await audit.close()
        return found

    await life()
    (tmp_path / "arm.latch").write_bytes(b"x" * 2 * SLOT_BYTES)
    assert (await life()).stop.id > 10**15


async def test_a_damaged_latch_file_latches_a_stop_once(tmp_path):
    async def life():
        audit = AuditLog(tmp_path / "arm.jsonl")
        found = audit.state, audit.damage
        await audit.close()
        return found

    await life()
    path = tmp_path / "arm.latch"
    path.write_bytes(path.read_bytes()[:-1])
    memory, mended = await life()
    assert memory.stop.reason == LATCH_UNKNOWN
    assert mended == "its latch file arm.latch is damaged"
    number = memory.stop.id
    memory, mended = await life()
    assert (memory.stop.id, mended) == (number, "")


async def test_without_an_allocated_file_motion_is_refused_and_stop_works(mesh, tmp_path):
    latch = tmp_path / "hall" / "arm.latch"
    latch.parent.mkdir(parents=True)
    latch.symlink_to(tmp_path / "gone" / "arm.latch")  # its disk is missing
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        await site.lease(A.ACQUIRE)
        assert await refusal(site.command(C.HOME)) == (
            "Not sent: the latch file arm.latch cannot be allocated (No such file or directory: "
            "check its disk), so a restart would forget a stop."
        )
        await site.command(C.TRACE_ON)  # moves nothing
        first = await site.stop(by="wang")
        second = await site.stop(by="zhao")
        assert first.sent
        assert second.stop_id > first.stop_id > 10**15  # no disk reserved a small one
        await until(lambda: site.events("audit.failed"))
        await until(lambda: site.controller.activity == STATE.STOPPED)
        latch.unlink()
        await until(lambda: site.events("audit.mended"))
        await site.lease(A.RENEW)
        await site.command(C.RESET, stop_id=second.stop_id)
        await until(lambda: site.controller.activity == STATE.IDLE)
        await site.command(C.HOME)
    # The homing ran during the shutdown: its stop is in the new file.
    assert LatchFile(latch).found.stop.reason == "dead-man: the gateway is shutting down"


async def test_a_locked_log_leaves_the_latch_file_unchanged(tmp_path):
    audit = AuditLog(tmp_path / "arm.jsonl")
    audit.latch.keep(stop(3), 3)
    settle(audit.latch)
    before = (tmp_path / "arm.latch").read_bytes()
    with pytest.raises(AuditError, match="open in another gateway"):
        AuditLog(tmp_path / "arm.jsonl")
    assert (tmp_path / "arm.latch").read_bytes() == before
    await audit.close()


@pytest.mark.slow
def test_a_stop_on_a_full_disk_is_latched_after_kill_9(tmp_path):
    if not latch_kills.may_mount():
        pytest.skip("no small disk can be mounted here: unshare and a tmpfs are not allowed")

    async def main():
        command = (sys.executable, "-m", "tests.soak.latch_kills", "--times", "2", "--json")
        process = await asyncio.create_subprocess_exec(*command, cwd=HOUSE, stdout=subprocess.PIPE)
        try:
            out, _ = await process.communicate()
        finally:
            if process.returncode is None:
                process.terminate()
                await process.wait()
        return json.loads(out)

    report = run(main(), timeout_s=170.0)
    assert report["problems"] == []
    assert report["kills"] == report["latched"] == report["not_in_log"] == 2
