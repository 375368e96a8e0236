"""Audit log of several files: rotation, archive, crashes during rotation, verification and search."""

import asyncio
import json
import os
import subprocess
import sys
import tracemalloc
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol_gateway.audit.files import older_parts, part_name
from protocol_gateway.audit.log import AuditLog, Entry, Outcome, read_entries, verify
from protocol_gateway.audit.search import Query, find, matches, query_of
from protocol_gateway.authority.lease_rules import LatchedStop
from robomesh import reason_codes as codes
from robomesh.schemas import robomesh_pb2 as schema
from tests.conftest import run
from tests.protocol_gateway.audit_state import state_after
from tests.refusals import refused

SMALL = 2000
HOUSE = Path(__file__).resolve().parents[2]


def entry(number=0, request="HOME", outcome=Outcome.ACCEPTED, operator="li", **values):
    return Entry(
        time_ns=1_000 + number,
        operator=operator,
        source="mesh",
        request=request,
        outcome=outcome,
        values={name: str(value) for name, value in values.items()},
    )


def write(path, *entries, rotate_bytes=SMALL):
    """Write entries, an fsync each; return the head and the state after a restart."""

    async def main():
        log = AuditLog(path, rotate_bytes=rotate_bytes)
        for each in entries:
            await log.append(each)
        await log.close()
        again = AuditLog(path, rotate_bytes=rotate_bytes)
        head, memory, mended = again.head, again.state, log.damage or again.damage
        await again.close()
        assert head == log.head
        return memory, mended

    return run(main())


def own(live):
    """Return the requests without ROTATE entries."""
    return [each.time_ns - 1_000 for each in read_entries(live) if each.request != "ROTATE"]


def test_a_rotated_log_is_one_chain(tmp_path):
    live = tmp_path / "arm.jsonl"
    _, mended = write(live, *(entry(n) for n in range(40)))
    parts = older_parts(live)
    assert len(parts) >= 3
    assert parts[0].name == "arm.000000001.jsonl"
    assert max(part.stat().st_size for part in parts) < SMALL + 400
    assert own(live) == list(range(40))
    numbers = [each.number for each in read_entries(live)]
    assert numbers == list(range(1, len(numbers) + 1))
    found = verify(live)
    assert (found.ok, found.entries, found.first) == (True, len(numbers), 1)
    assert mended == ""


@pytest.mark.parametrize("harm", ["change", "cut_old_tail", "take_middle_away", "take_live_away"])
def test_a_change_in_an_older_part_is_detected(tmp_path, harm):
    live = tmp_path / "arm.jsonl"
    write(live, *(entry(n) for n in range(40)))
    first, second = older_parts(live)[:2]
    head = list(read_entries(live))[-1].hash
    lines = first.read_bytes().splitlines(keepends=True)
    if harm == "change":
        first.write_bytes(b"".join([lines[0], lines[1].replace(b"HOME", b"HOLD"), *lines[2:]]))
        assert verify(live).first_break == 2
    elif harm == "cut_old_tail":
        first.write_bytes(b"".join(lines[:-1]))
        assert verify(live).first_break == len(lines)
    elif harm == "take_middle_away":
        second.unlink()
        assert verify(live).first_break == len(lines) + 1
    else:
        older_parts(live)[-1].replace(live)
        assert verify(live).ok
        assert "no entry has the hash" in verify(live, head=head).text


def test_every_changed_byte_of_every_file_is_detected(tmp_path):
    live = tmp_path / "arm.jsonl"
    write(live, *(entry(n, reason="李") for n in range(3)), rotate_bytes=1)
    files = [*older_parts(live), live]
    assert len(files) == 3
    for path in files:
        with path.open("r+b") as file:
            for offset, byte in enumerate(path.read_bytes()):
                os.pwrite(file.fileno(), bytes([byte ^ 1]), offset)
                assert not verify(live).ok, (path.name, offset)
                os.pwrite(file.fileno(), bytes([byte]), offset)
    assert verify(live).ok


@given(st.lists(st.binary(max_size=300) | st.sampled_from([b"\n", b"{", b'{"hash":"']), max_size=8))
def test_any_file_can_be_verified_and_searched(tmp_path_factory, pieces):
    live = tmp_path_factory.mktemp("any") / "arm.jsonl"
    live.write_bytes(b"".join(pieces))
    assert verify(live).entries == 0
    assert find(live, Query()) == []


def test_archived_parts_are_no_break_and_are_reported(tmp_path):
    live = tmp_path / "arm.jsonl"
    write(live, *(entry(n) for n in range(40)))
    everything = list(read_entries(live))
    first = older_parts(live)[0]
    gone = len(first.read_bytes().splitlines())
    first.rename(tmp_path / "elsewhere.jsonl")
    found = verify(live, head=everything[-1].hash)
    assert found.ok
    assert (found.first, found.entries) == (gone + 1, len(everything) - gone)
    assert f"entries 1 to {gone} are not here" in found.text
    # The archived part can also be verified alone.
    moved = verify(tmp_path / "elsewhere.jsonl")
    assert (moved.ok, moved.entries, moved.last_hash) == (True, gone, everything[gone].previous)


def test_a_file_that_begins_in_the_middle_without_rotate_is_a_break(tmp_path):
    live = tmp_path / "arm.jsonl"
    write(live, *(entry(n) for n in range(3)))
    live.write_bytes(b"".join(live.read_bytes().splitlines(keepends=True)[1:]))
    assert verify(live).first_break == 1


STOPPED = [entry(1, "STOP", stop_id=7, reason="dog")]
RESET = [*STOPPED, entry(2, "RESET", stop_id=7)]
NOT_SENT = [*RESET, entry(3, "RESET", Outcome.FAILED, stop_id=7)]


@pytest.mark.parametrize(("asked", "latched"), [(STOPPED, 7), (RESET, None), (NOT_SENT, 7)])
@pytest.mark.parametrize("after", range(3))
def test_every_file_holds_the_state_for_a_restart(tmp_path, asked, latched, after):
    live = tmp_path / "arm.jsonl"
    # Rotated after each entry, so that the state crosses files at each step.
    write(live, *asked, *(entry(9) for _ in range(after)), rotate_bytes=1)
    expected = state_after(read_entries(live)).authority
    for part in older_parts(live):
        part.unlink()
    memory, _ = write(live)
    assert memory.authority == expected
    assert memory.last_stop_id == 7
    assert (memory.stop.id if memory.stop else None) == latched
    if latched:
        assert memory.stop == LatchedStop(id=7, by="li", reason="dog", since_ns=1_001)


def test_a_late_count_of_older_stops_does_not_replace_the_newest():
    entries = [entry(1, "STOP", stop_id=9, operator="wang"), entry(2, "STOP", stop_id=8)]
    assert state_after(entries).stop.id == 9


KILLED = """
import asyncio, os, pathlib, sys
from protocol_gateway.audit.log import AuditLog, Entry, Outcome

def killed(*arguments, **named):
    real(*arguments, **named) if sys.argv[3] == "after" else None
    os._exit(9)

async def main():
    global real
    log = AuditLog(pathlib.Path(sys.argv[1]), rotate_bytes=1)
    owner = {"link": os, "fsync": os, "rename": pathlib.Path}[sys.argv[2]]
    real = getattr(owner, sys.argv[2])
    setattr(owner, sys.argv[2], killed)
    await log.append(Entry(time_ns=1, operator="li", source="mesh", request="HOME", outcome=Outcome.ACCEPTED))

asyncio.run(main())
"""


@pytest.mark.parametrize("when", ["before", "after"])
@pytest.mark.parametrize("call", ["fsync", "link", "rename"])
@pytest.mark.slow
def test_a_killed_rotation_leaves_an_intact_log_and_its_stop(tmp_path, call, when):
    live = tmp_path / "arm.jsonl"
    write(live, *STOPPED, rotate_bytes=1 << 20)
    child = [sys.executable, "-c", KILLED, str(live), call, when]
    done = subprocess.run(child, env={**os.environ, "PYTHONPATH": str(HOUSE)}, check=False)
    assert done.returncode == 9
    memory, mended = write(live, entry(5), rotate_bytes=1 << 20)
    assert mended == ""
    assert own(live) == [1, 5]
    assert memory.stop.id == 7
    assert memory.stop.by == "li"
    assert verify(live).ok
    assert not live.with_suffix(".new").exists()


async def test_a_log_that_cannot_be_rotated_continues_in_its_file(tmp_path, caplog):
    live = tmp_path / "arm.jsonl"
    log = AuditLog(live, rotate_bytes=SMALL)
    part_name(live, 1).write_text("somebody's copy\n")
    for number in range(20):
        await log.append(entry(number))
    await log.close()
    assert "was not rotated: " in caplog.text
    assert caplog.text.count("was not rotated") <= live.stat().st_size // SMALL
    assert not live.with_suffix(".new").exists()
    part_name(live, 1).unlink()
    assert own(live) == list(range(20))
    assert verify(live).ok


async def test_the_lock_survives_a_rotation(tmp_path):
    log = AuditLog(tmp_path / "arm.jsonl", rotate_bytes=1)
    for number in range(3):
        await log.append(entry(number))
    with pytest.raises(Exception, match="open in another gateway"):
        AuditLog(tmp_path / "arm.jsonl")
    await log.close()


async def test_a_line_that_the_gateway_is_still_writing_is_no_break(tmp_path):
    log = AuditLog(tmp_path / "arm.jsonl")
    await log.append(entry())
    with log.path.open("ab") as file:
        file.write(b'{"hash":"12')
    assert verify(log.path).ok
    await log.close()
    assert verify(log.path).first_break == 2


def test_a_line_that_is_too_long_does_not_hide_later_ones(tmp_path):
    live = tmp_path / "arm.jsonl"
    write(live, entry(0), entry(1), rotate_bytes=1 << 20)
    first, second = live.read_bytes().splitlines(keepends=True)
    live.write_bytes(first + b"x" * (3 << 20) + b"\n" + second)
    _, mended = write(live, entry(2), rotate_bytes=8 << 20)
    assert mended == "entry 2 cannot be read"
    assert [each for each in own(live) if each < 9] == [0, 1, 2]
    assert verify(live).first_break == 2


def test_a_line_without_end_does_not_fill_the_memory(tmp_path):
    live = tmp_path / "arm.jsonl"
    write(live, entry())
    with live.open("ab") as file:
        file.truncate(64 << 20)
    tracemalloc.start()
    assert verify(live).first_break == 2
    assert len(find(live, Query())) == 1
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 8 << 20


# ------------------------------------------------------------------------- find


@pytest.fixture(scope="module")
def searched(tmp_path_factory):
    """Return a log of several files that the tests do not change."""
    live = tmp_path_factory.mktemp("searched") / "arm.jsonl"
    write(
        live,
        *(
            entry(n, "STOP" if n % 5 == 0 else "HOME", list(Outcome)[n % 3], "li" if n % 2 else "wang", id=n)
            for n in range(60)
        ),
    )
    assert len(older_parts(live)) > 3
    return live


@pytest.mark.parametrize(
    "query",
    [
        Query(),
        Query(operator="li"),
        Query(operator="l"),
        Query(request="STOP"),
        Query(request="STOP", operator="wang", outcome=Outcome.REFUSED),
        Query(since_ns=1_010, until_ns=1_030),
        Query(since_ns=1_059),
        Query(until_ns=0),
        Query(operator="wang", most=7),
        Query(most=1),
    ],
)
def test_a_search_finds_the_same_as_a_full_scan(searched, query):
    expected = [each for each in read_entries(searched) if matches(each, query)][-query.most :]
    assert find(searched, query) == expected


def test_a_text_that_looks_like_a_field_does_not_match(tmp_path):
    live = tmp_path / "arm.jsonl"
    write(live, replace(entry(operator='x","operator":"li'), text='"request":"STOP"'), entry(operator="李"))
    assert find(live, Query(operator="li")) == []
    assert find(live, Query(request="STOP")) == []
    assert len(find(live, Query(operator='x","operator":"li'))) == 1
    assert len(find(live, Query(operator="李"))) == 1
    assert verify(live).entries == 2


def test_invalid_lines_are_left_out_of_a_search(tmp_path):
    live = tmp_path / "arm.jsonl"
    write(live, entry(), rotate_bytes=1 << 20)
    row = json.loads(live.read_text())
    forged = [
        {**row, "time_ns": 10**30},
        {**row, "hash": "no"},
        {**row, "values": [1]},
        {**row, "text": 5},
        7,
    ]
    live.write_text("".join(json.dumps(each, separators=(",", ":")) + "\n" for each in [row, *forged]))
    assert len(find(live, Query())) == 1
    assert verify(live).first_break == 2


def test_a_search_for_too_many_entries_is_refused():
    with refused(codes.AUDIT_TOO_MANY, count="10001"):
        query_of(schema.AuditQuery(most=10_001))


async def test_failed_entries_are_kept_up_to_a_limit_and_the_rest_is_counted(tmp_path):
    log = AuditLog(tmp_path / "arm.jsonl")
    kept, full = os.dup(log._file), os.open("/dev/full", os.O_RDWR)
    os.dup2(full, log._file)
    refused = [log.append_later(entry(n, outcome=Outcome.REFUSED)) for n in range(3000)]
    stops = [log.append_later(entry(n, "STOP")) for n in range(20)]
    done = await asyncio.gather(*refused, *stops, return_exceptions=True)
    assert {type(each).__name__ for each in done} == {"AuditError"}
    os.dup2(kept, log._file)
    log.retry()
    await log.close()
    os.close(kept)
    os.close(full)
    found = list(read_entries(log.path))
    assert [each.request for each in found].count("STOP") == 20
    (lost,) = [each for each in found if each.request == "LOST"]
    assert len(found) - 1 + int(lost.values["requests"]) == 3020
    assert len(found) < 1100
    assert verify(log.path).ok
