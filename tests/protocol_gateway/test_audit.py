"""The audit log: its chain, torn lines, full disks."""

import asyncio
import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from protocol_gateway.audit.log import AuditLog, Entry, Outcome, read_entries, verify
from protocol_gateway.seam.errors import AuditError
from tests.conftest import run
from tests.protocol_gateway.audit_state import state_after

HOUSE = Path(__file__).resolve().parents[2]


def entry(request="HOME", outcome=Outcome.ACCEPTED, **values):
    return Entry(
        time_ns=1, operator="李", source="mesh", request=request, outcome=outcome, values=values, text="ok"
    )


def write(path, *entries):
    async def main():
        log = AuditLog(path)
        written = [await log.append(each) for each in entries]
        await log.close()
        return log, written

    return run(main())


def test_entries_are_numbered_chained_and_read_back_as_they_were(tmp_path):
    path = tmp_path / "hall" / "arm.jsonl"
    _, written = write(path, entry(id="1"), entry("STOP"))
    assert [each.number for each in written] == [1, 2]
    assert written[1].previous == written[0].hash
    assert list(read_entries(path)) == written
    assert verify(path, head=written[1].hash).ok


def test_a_reopened_log_continues_its_chain(tmp_path):
    path = tmp_path / "arm.jsonl"
    write(path, entry())
    log, (second,) = write(path, entry())
    assert log.head == (2, second.hash)
    assert verify(path).entries == 2


async def test_concurrent_entries_keep_the_order_of_the_calls(tmp_path):
    seen = []
    log = AuditLog(tmp_path / "arm.jsonl", on_written=seen.append)
    await asyncio.gather(*(log.append(entry(id=str(number))) for number in range(200)))
    await log.close()
    assert [each.values["id"] for each in seen] == [str(number) for number in range(200)]
    assert verify(log.path).entries == 200


def test_the_hash_covers_the_line_without_the_hash(tmp_path):
    path = tmp_path / "arm.jsonl"
    write(path, entry(id="1"))
    row = json.loads(path.read_text())
    recorded_hash = row.pop("hash")
    text = json.dumps(row, ensure_ascii=False, separators=(",", ":"), sort_keys=True)
    assert hashlib.sha256(text.encode()).hexdigest() == recorded_hash


def three_lines(path):
    write(path, entry(id="1"), entry(id="2"), entry(id="3"))
    return path.read_bytes().splitlines(keepends=True)


@pytest.mark.parametrize(
    ("change", "first_break"),
    [
        (lambda a, b, c: [a, b.replace(b"HOME", b"HOLD"), c], 2),
        (lambda a, b, c: [a, c], 2),
        (lambda a, b, c: [b, a, c], 1),
        (lambda a, b, c: [a, b, b, c], 3),
        (lambda a, b, c: [b, c], 1),
        (lambda a, b, c: [a, b"rubbish\n", c], 2),
        (lambda a, b, c: [a, b, c[:-9]], 3),
        (lambda a, b, c: [a, b.replace(b":", b": ", 1), c], 2),
    ],
)
def test_a_changed_log_reports_the_first_break(tmp_path, change, first_break):
    path = tmp_path / "arm.jsonl"
    path.write_bytes(b"".join(change(*three_lines(path))))
    found = verify(path)
    assert (found.ok, found.first_break, found.entries) == (False, first_break, first_break - 1)


def test_a_truncated_log_is_detected_with_the_head(tmp_path):
    path = tmp_path / "arm.jsonl"
    lines = three_lines(path)
    head = json.loads(lines[2])["hash"]
    path.write_bytes(b"".join(lines[:2]))
    assert verify(path).ok
    found = verify(path, head=head)
    assert (found.ok, found.first_break) == (False, 3)


def test_a_torn_last_line_is_cut_off_and_reported(tmp_path):
    path = tmp_path / "arm.jsonl"
    path.write_bytes(b"".join(three_lines(path))[:-20])
    log, _ = write(path, entry(id="new"))
    assert "torn last line" in log.damage
    assert [each.values["id"] for each in read_entries(path)] == ["1", "2", "new"]
    assert verify(path).ok


def test_a_broken_chain_is_reported_and_not_repaired(tmp_path):
    path = tmp_path / "arm.jsonl"
    first, second, third = three_lines(path)
    path.write_bytes(first + second.replace(b"HOME", b"HOLD") + third)
    log, _ = write(path, entry())
    assert log.damage == "the chain is broken at entry 2"
    assert verify(path).first_break == 2


async def test_two_gateways_do_not_write_one_log(tmp_path):
    log = AuditLog(tmp_path / "arm.jsonl")
    with pytest.raises(AuditError, match="open in another gateway"):
        AuditLog(tmp_path / "arm.jsonl")
    await log.close()


def test_a_folder_that_cannot_be_created_is_an_error(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(AuditError, match=r"arm\.jsonl cannot be written \(File exists\)"):
        AuditLog(tmp_path / "file" / "arm.jsonl")


async def test_a_full_disk_rejects_commands_and_delays_past_events(tmp_path):
    log = AuditLog(tmp_path / "arm.jsonl")
    await log.append(entry(id="1"))
    kept, full = os.dup(log._file), os.open("/dev/full", os.O_RDWR)
    os.dup2(full, log._file)
    with pytest.raises(AuditError, match="No space left on device"):
        await log.append(entry(id="refused"))
    with pytest.raises(AuditError):
        await log.append_later(entry("STOP", id="owed"))
    os.dup2(kept, log._file)
    await log.append(entry(id="2"))
    await log.close()
    os.close(kept)
    os.close(full)
    assert [each.values["id"] for each in read_entries(log.path)] == ["1", "owed", "2"]
    assert verify(log.path).ok


async def test_every_pending_entry_gets_its_error(tmp_path, monkeypatch, caplog):
    def broken(entry):
        raise ZeroDivisionError("nobody listens")

    log = AuditLog(tmp_path / "arm.jsonl", on_written=broken)
    assert (await log.append(entry(id="1"))).number == 1
    assert "entry 1 was not published" in caplog.text
    with monkeypatch.context() as patch:
        patch.setattr(log, "_write", broken)
        with pytest.raises(AuditError, match="nobody listens"):
            await log.append(entry(id="not written"))
    assert (await log.append(entry(id="2"))).number == 2
    await log.close()
    assert verify(log.path).ok


def test_an_invalid_text_is_escaped_and_written(tmp_path):
    write(tmp_path / "arm.jsonl", entry(reason="\ud800"), entry(id="2"))
    assert verify(tmp_path / "arm.jsonl").entries == 2


WRITER = """
import asyncio, sys
from pathlib import Path
from protocol_gateway.audit.log import AuditLog, Entry, Outcome

async def main():
    log = AuditLog(Path(sys.argv[1]))
    for number in range(10**6):
        entry = Entry(time_ns=1, operator="li", source="mesh", request="HOME", outcome=Outcome.ACCEPTED)
        print((await log.append(entry)).number, flush=True)

asyncio.run(main())
"""


@pytest.mark.slow
def test_confirmed_entries_survive_kill_9(tmp_path):
    path = tmp_path / "arm.jsonl"
    writer = subprocess.Popen(
        [sys.executable, "-c", WRITER, str(path)],
        cwd=HOUSE,
        env={**os.environ, "PYTHONPATH": str(HOUSE)},
        stdout=subprocess.PIPE,
    )
    with writer:
        for _ in range(20):
            reported = int(writer.stdout.readline())
        writer.kill()
        rest = writer.stdout.read().split(b"\n")[:-1]
    reported = int(rest[-1]) if rest else reported
    log, _ = write(path, entry())
    assert log.head[0] > reported
    assert verify(path).ok


@pytest.mark.parametrize(
    ("entries", "latched"),
    [
        ([], None),
        ([entry("STOP", stop_id="1")], 1),
        ([entry("STOP", Outcome.FAILED, stop_id="1")], 1),
        ([entry("STOP", stop_id="1"), entry("RESET", stop_id="1")], None),
        ([entry("STOP", stop_id="1"), entry("RESET", Outcome.REFUSED, stop_id="1")], 1),
        (
            [
                entry("STOP", stop_id="1"),
                entry("RESET", stop_id="1"),
                entry("RESET", Outcome.FAILED, stop_id="1"),
            ],
            1,
        ),
        ([entry("STOP", stop_id="1"), entry("STOP", stop_id="2"), entry("RESET", stop_id="1")], 2),
        (
            [
                entry("STOP", stop_id="1"),
                entry("RESET", stop_id="1"),
                entry("RESET"),
                entry("RESET", Outcome.FAILED),
            ],
            None,
        ),
        (
            [
                entry("STOP", stop_id="1"),
                entry("RESET", stop_id="1"),
                entry("STOP", stop_id="2"),
                entry("RESET", Outcome.FAILED, stop_id="1"),
            ],
            2,
        ),
    ],
)
def test_a_stop_without_reset_is_restored_from_the_log(entries, latched):
    stop = state_after(entries).stop
    assert (stop.id if stop else None) == latched
