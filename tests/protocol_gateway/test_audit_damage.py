"""Damaged audit logs: if a stop may be lost, the gateway latches one, once, and reports it."""

import asyncio
import contextlib
import json
import os
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from protocol_gateway.audit.files import older_parts, read_entries, verify
from protocol_gateway.audit.log import AuditLog, Entry, Outcome
from protocol_gateway.audit.search import Query, find
from protocol_gateway.authority.audit_entry import chain_link, entry_message, parse_line
from protocol_gateway.persistence.persisted_state import UNKNOWN
from protocol_gateway.seam.errors import AuditError
from tests.conftest import run
from tests.protocol_gateway.gateway_site import STATE, A, C, gateway, refusal, simulator, until


def entry(request="HOME", outcome=Outcome.ACCEPTED, **values):
    return Entry(time_ns=1, operator="li", source="mesh", request=request, outcome=outcome, values=values)


def write(live, *entries, rotate_bytes=1 << 20):
    """Open a log and write entries; return the damage found and the final state."""

    async def main():
        log = AuditLog(live, rotate_bytes=rotate_bytes)
        for each in entries:
            await log.append(each)
            if each.request == "RESET":  # it was sent
                log.latch.keep(None, int(each.values.get("stop_id", "0")))
        await log.close()
        return log.damage, log.state

    return run(main())


def lines(live):
    return live.read_bytes().splitlines(keepends=True)


def changed(*numbers):
    def damage(live):
        rows = lines(live)
        for number in numbers:
            offset = rows[number].index(b'"request":"') + 12
            rows[number] = rows[number][:offset] + b"~" + rows[number][offset + 1 :]
        live.write_bytes(b"".join(rows))

    return damage


def left_out(number):
    def damage(live):
        rows = lines(live)
        del rows[number]
        live.write_bytes(b"".join(rows))

    return damage


def unreadable(live):
    first, _, *rest = lines(live)
    live.write_bytes(b"".join([first, b"\0" * 300 + b"\n", *rest]))


def restarted_log(live):
    live.unlink()
    write(live.with_name("new.jsonl"), entry(), entry())
    live.with_name("new.jsonl").rename(live)


def put_back(live):
    """Restore an older copy of the live file, from before its rotation."""
    live.write_bytes(older_parts(live)[-1].read_bytes())


STOPPED = [entry(), entry("STOP", stop_id="6", reason="dog"), entry("TRACE_ON")]


@pytest.mark.parametrize(
    "damage", [changed(0), changed(1), changed(0, 2), left_out(0), left_out(1), unreadable]
)
@pytest.mark.parametrize("more", [[], [entry("RESET", stop_id="6")]])
def test_a_damaged_log_latches_a_stop_once(tmp_path, damage, more):
    live = tmp_path / "arm.jsonl"
    write(live, *STOPPED, *more)
    damage(live)
    last = parse_line(lines(live)[-1]).number
    mended, memory = write(live)
    assert mended
    assert (memory.stop.by, memory.stop.reason) == ("gateway", UNKNOWN)
    own = list(read_entries(live))[-1]
    assert (own.request, own.operator, own.text) == ("STOP", "gateway", mended)
    assert own.values == {"stop_id": str(memory.stop.id), "reason": UNKNOWN}
    assert own.number == last + 2
    assert not verify(live).ok
    # It is latched after the next start, too, and then reset.
    again, memory = write(live, entry("RESET", stop_id=str(memory.stop.id)))
    assert again == ""
    assert memory.stop is None
    assert write(live) == ("", memory)


@pytest.mark.parametrize(
    "damage",
    [
        left_out(0),
        changed(0),
        lambda live: live.unlink(),
        lambda live: live.write_bytes(b""),
        lambda live: live.write_bytes(lines(live)[0][:-50]),
        restarted_log,
        put_back,
    ],
)
def test_a_live_file_that_does_not_continue_its_parts_latches_a_stop(tmp_path, damage):
    live = tmp_path / "arm.jsonl"
    write(live, *STOPPED, *(entry() for _ in range(9)), rotate_bytes=1200)
    write(live, entry("RESET", stop_id="6"), rotate_bytes=1200)
    number = max(int(part.name.split(".")[1]) for part in older_parts(live))
    kept = [part.read_bytes() for part in older_parts(live)]
    damage(live)
    mended, memory = write(live)
    assert mended
    assert (memory.stop.reason, memory.stop.id) == (UNKNOWN, 7)
    entries = list(read_entries(live))
    assert entries[-1].request == "STOP"
    assert entries[-1].number > max(number, *(each.number for each in entries[:-1]))
    assert [part.read_bytes() for part in older_parts(live)][: len(kept)] == kept
    assert write(live, entry("RESET", stop_id="7"))[0] == ""
    assert write(live)[1].stop is None


@pytest.mark.parametrize(
    ("request_", "shown", "latched"),
    [
        ("HOME", True, False),
        ("MOVE_ABSOLUTE", True, False),
        ("HOME", False, True),
        ("STOP", True, True),
        ("RESET", True, True),
    ],
)
@pytest.mark.parametrize("before", [0, 2])
def test_a_torn_last_line_latches_a_stop_when_it_may_have_been_one(
    tmp_path, request_, shown, latched, before
):
    live = tmp_path / "arm.jsonl"
    # An operator's name is no request.
    torn = replace(entry(request_), operator='\\","request":"HOME"')
    write(live, *(entry() for _ in range(before)), torn)
    *rows, last = lines(live)
    cut = last.index(b',"request":"') + len(b',"request":"' + request_.encode() + b'"')
    live.write_bytes(b"".join(rows) + last[: cut if shown else cut - 1])
    mended, memory = write(live)
    assert "torn last line" in mended
    assert (memory.stop is not None) == latched
    assert verify(live).ok
    again, memory = write(live)
    assert again == "" or not latched
    assert (memory.stop is not None) == latched


@given(st.data())
def test_changed_bytes_never_lose_a_latched_stop(tmp_path_factory, data):
    live = tmp_path_factory.mktemp("any") / "arm.jsonl"
    write(live, *STOPPED)
    whole = live.read_bytes()
    begin = data.draw(st.integers(0, len(whole)))
    end = data.draw(st.integers(begin, len(whole)))
    live.write_bytes(whole[:begin] + data.draw(st.binary(max_size=40)) + whole[end:])
    left, first = live.read_bytes(), whole[: whole.index(b"\n") + 1]
    # Without the head, a truncation at a line's end or in a HOME line is not detected.
    if left not in (b"", first) and not (b"\n" not in left and b'"request":"HOME"' in left):
        assert write(live)[1].stop is not None


async def test_a_damaged_log_stops_the_robot_until_a_reset(mesh, tmp_path):
    async with simulator() as port:
        async with gateway(mesh, tmp_path, port) as site:
            await site.lease(A.ACQUIRE)
            await site.stop(by="wang", reason="dog")
            await until(lambda: len(site.seen["audit"]) >= 2)
        live = site.audit
        live.write_bytes(live.read_bytes().replace(b'"request":"STOP"', b'"request":"STOQ"'))
        async with gateway(mesh, tmp_path, port) as site:
            stop = site.controller.stop
            assert (stop.by, stop.reason) == ("gateway", UNKNOWN)
            assert "the chain is broken at entry 2" in (await site.event("audit.damaged", 0)).text
            assert await site.event("stop.remembered", 0)
            await until(lambda: "STOP" in [each.request for each in site.seen["audit"]])
            await site.lease(A.ACQUIRE)
            assert UNKNOWN in await refusal(site.command(C.HOME))
            await site.command(C.RESET, stop_id=stop.id)
            await until(lambda: not site.controller.HasField("stop"))
        async with gateway(mesh, tmp_path, port) as site:
            assert not site.controller.HasField("stop")
            assert site.controller.link == STATE.UP


async def test_a_read_only_robot_shows_no_stop_but_its_log_keeps_it(mesh, tmp_path):
    live = tmp_path / "hall" / "arm.jsonl"
    await asyncio.to_thread(write, live, *STOPPED)
    changed(1)(live)
    async with simulator() as port:
        async with gateway(mesh, tmp_path, port, stop_proven=False) as site:
            await until(lambda: site.events("audit.damaged"))
            await until(lambda: site.seen["audit"] and site.seen["audit"][-1].request == "STOP")
            assert not site.controller.HasField("stop")
        async with gateway(mesh, tmp_path, port) as site:
            assert site.controller.stop.reason == UNKNOWN


# ----------------------------------------------------------------------- arbitrary lines

NUMBERS = st.integers() | st.integers(0, 10**5000) | st.just("7" * 5000)


@given(
    st.fixed_dictionaries({"number": NUMBERS, "time_ns": NUMBERS, "repeated": NUMBERS}),
    st.dictionaries(st.sampled_from(["stop_id", "last_stop_id", "stop"]), st.text() | st.just("9" * 5000)),
    st.sampled_from(["STOP", "RESET", "ROTATE", "HOME", "\ud800"]),
)
@example({"number": 1, "time_ns": 1, "repeated": 0}, {}, "\ud800")
@example({"number": "7" * 5000, "time_ns": 1, "repeated": 0}, {"stop": "[" * 100_000}, "ROTATE")
def test_any_line_is_an_entry_or_an_audit_error(tmp_path_factory, numbers, values, request_):
    live = tmp_path_factory.mktemp("line") / "arm.jsonl"
    write(live, entry())
    (line,) = lines(live)
    for name, number in numbers.items():
        # Text, because Python parses 4300 digits at most.
        digits = number if isinstance(number, str) else str(number % 10**4000)
        line = _with(line, name, digits.encode())
    line = line.replace(b'"HOME"', b'"%s"' % request_.encode(errors="backslashreplace"))
    line = line.replace(b'"values":{}', b'"values":%s' % json.dumps(values).encode())
    live.write_bytes(line)
    with contextlib.suppress(AuditError):
        entry_message(parse_line(line))
    chain_link(line)
    find(live, Query(since_ns=0))
    assert not verify(live).ok or verify(live).entries == 1
    write(live, entry())


def _with(line, name, digits):
    begin = line.index(b'"%s":' % name.encode()) + len(name) + 3
    return line[:begin] + digits + line[line.index(b",", begin) :]


# ----------------------------------------------------------------------------- the disk


async def test_the_rest_of_an_incomplete_write_is_removed(tmp_path, monkeypatch):
    log = AuditLog(tmp_path / "arm.jsonl")
    await log.append(entry(id="1"))
    pwrite = os.pwrite
    monkeypatch.setattr(os, "pwrite", lambda file, data, offset: _half(pwrite, file, data, offset))
    with pytest.raises(AuditError, match="No space left"):
        await log.append(entry(text="x" * 2000))
    monkeypatch.undo()
    await log.append(entry(id="2"))
    assert [each.values["id"] for each in read_entries(log.path)] == ["1", "2"]
    await log.close()
    assert verify(log.path).ok


def _half(pwrite, file, data, offset):
    pwrite(file, data[: len(data) // 2], offset)
    raise OSError(28, "No space left on device")


async def test_an_entry_and_its_file_name_are_synced_before_the_confirmation(tmp_path, monkeypatch):
    folder, live = tmp_path / "hall", tmp_path / "hall" / "arm.jsonl"
    synced, fsync = [], os.fsync

    def spy(file):
        synced.append(str(Path(f"/proc/self/fd/{file}").readlink()))
        fsync(file)

    log = AuditLog(live, rotate_bytes=1)
    monkeypatch.setattr(os, "fsync", spy)
    await log.append(entry())
    assert synced == [str(live), str(folder)]
    synced.clear()
    await log.append(entry())
    # The new file's first entry is synced before its rename.
    assert synced == [str(live.with_suffix(".new")), str(live), str(folder)]
    await log.close()
