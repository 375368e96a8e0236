"""Audit log over the mesh, on the command line, and on a full disk: real gateways, real files."""

import asyncio
import contextlib
import json
import math
import os
import resource
import shutil
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from protocol_gateway.audit import search
from protocol_gateway.audit.log import read_entries, verify
from robomesh.errors import RefusedError
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import open_session
from tests.conftest import run
from tests.protocol_gateway.gateway_site import (
    STATE,
    A,
    C,
    GatewaySite,
    gateway,
    refusal,
    simulator,
    until,
    watch,
)
from tests.site import robomesh
from tests.soak.audit_kills import Controller

FIND = "robomesh/hall/arm/audit/find"
POSITIONS, SI = [math.pi, 0.25], "3.14159 0.25"
_JOINT = schema.Description.Joint
JOINTS = schema.Description(joints=[_JOINT(type="ROTARY"), _JOINT(type="PRISMATIC")])


async def robomesh_to(router, *arguments):
    """Run a command against this test's router; return its output."""
    done = await asyncio.to_thread(robomesh, *arguments, "--connect", router)
    assert done.stderr == ""
    assert done.returncode == 0
    return done.stdout.splitlines()


async def test_the_head_is_published_with_the_state_and_after_a_restart(mesh, tmp_path):
    async with simulator() as port:
        async with gateway(mesh, tmp_path, port) as site:
            assert not site.controller.HasField("audit_head")
            await site.lease(A.ACQUIRE)
            await until(lambda: site.controller.audit_head.number == 1)
        number, last = [(e.number, e.hash) for e in read_entries(site.audit)][-1]
        async with gateway(mesh, tmp_path, port, up=False) as site:
            head = site.seen["controller"][0].audit_head
            assert (head.number, head.hash.hex()) == (number, last)
            assert verify(site.audit, head=head.hash.hex()).ok


async def test_a_flood_of_refusals_is_written_as_a_count(mesh, tmp_path):
    flood = 400
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        for _ in range(flood // 20):
            await asyncio.gather(*(refusal(site.command(C.HOME)) for _ in range(20)))
        await site.lease(A.ACQUIRE)
        counted = await until(
            lambda: [e for e in site.seen["audit"] if e.repeated_count and e.request == "HOME"]
        )
    entries = [entry for entry in read_entries(site.audit) if entry.request == "HOME"]
    assert sum(1 + entry.repeated for entry in entries) == flood
    assert len(entries) < 40
    (logged,) = [entry for entry in entries if entry.number == counted[0].number]
    assert (logged.repeated, logged.text) == (counted[0].repeated_count, entries[0].text)
    assert verify(site.audit).ok


async def test_after_a_flood_of_stops_a_restart_restores_the_last(mesh, tmp_path):
    flood = 100

    def by(number):
        return ("wang", "zhao")[number % 2]

    controller = Controller()
    async with await asyncio.start_server(controller.serve, "127.0.0.1", 0) as server:
        port = server.sockets[0].getsockname()[1]
        async with gateway(mesh, tmp_path, port) as site:
            answers = await asyncio.gather(*[site.stop(by=by(number)) for number in range(flood)])
            assert {answer.text for answer in answers if not answer.sent} == set()
            # Stops within 0.1 s share a unit, so they do not break the link.
            await until(lambda: controller.stops)
            assert controller.stops < flood
            last = max(answer.stop_id for answer in answers)
        entries = [entry for entry in read_entries(site.audit) if entry.request == "STOP"]
        assert sum(1 + entry.repeated for entry in entries) == flood
        assert len(entries) < 40
        async with gateway(mesh, tmp_path, port) as site:
            assert site.controller.stop.id == last
            await site.lease(A.ACQUIRE)
            stops = [await site.stop(by=by(number)) for number in range(20)]
            await site.command(C.RESET, stop_id=stops[-1].stop_id)
        async with gateway(mesh, tmp_path, port) as site:
            # The count was written before the RESET that cleared the stop.
            assert not site.controller.HasField("stop")


async def test_entries_are_found_over_the_mesh_by_operator_request_and_time(mesh, tmp_path):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        await refusal(site.command(C.HOME, operator="wang"))
        await site.lease(A.ACQUIRE)
        await site.command(C.TRACE_ON)
        await site.stop(by="wang")
        await until(lambda: len(site.seen["audit"]) >= 4)

        async def numbers(**query):
            answer = await site.session.ask(FIND, schema.AuditQuery(**query))
            return [entry.number for entry in answer.entries]

        assert await numbers() == [1, 2, 3, 4]
        assert await numbers(operator="wang") == [1, 4]
        assert await numbers(operator="wang", outcome="REFUSED") == [1]
        assert await numbers(request="ACQUIRE") == [2]
        assert await numbers(most=2) == [3, 4]
        second = site.seen["audit"][1].timestamp
        assert await numbers(since=second, until=second) == [2]
        (found,) = (await site.session.ask(FIND, schema.AuditQuery(request="TRACE_ON"))).entries
        assert found == site.seen["audit"][2]
        text = await refusal(site.session.ask(FIND, schema.AuditQuery(most=20_000)))
        assert "most = 20000 is too many: at most 10000" in text


def test_a_search_rests_before_the_next_one(tmp_path, monkeypatch):
    times = []

    def slow(*_, **__):
        times.append(time.monotonic())
        time.sleep(0.02)
        times.append(time.monotonic())
        return []

    monkeypatch.setattr(search, "find", slow)

    async def main():
        server = search.SearchServer(tmp_path / "arm.jsonl")
        request = SimpleNamespace(message=schema.AuditQuery())
        await asyncio.gather(*(server.answer(request) for _ in range(3)))

    run(main())
    for begun, ended, next_ in zip(times[::2], times[1::2], times[2::2], strict=False):
        assert next_ - ended >= min(9 * (ended - begun), 1.0)


async def test_the_command_lists_entries_of_robots_and_of_log_files(mesh, router, tmp_path):
    async with simulator() as one, simulator() as two, gateway(mesh, tmp_path, one, two) as site:
        await refusal(site.command(C.HOME))
        await site.session.ask("robomesh/hall/arm-2/stop", schema.StopRequest(by="wang", reason="dog"))
        await site.lease(A.ACQUIRE)
        await until(lambda: len(site.seen["audit"]) >= 2)
        # Clients find robots by the presence of their services.
        for robot in ("arm", "arm-2"):
            site.own.declare_presence("hall", robot, "gateway")
        lines = await robomesh_to(router, "audit", "list", "arm", "--outcome", "refused")
        assert len(lines) == 1
        assert "li            HOME           REFUSED   Not sent: no operator is in control" in lines[0]
        rows = [json.loads(row) for row in await robomesh_to(router, "audit", "list", "--json")]
        assert [(row["robot"], row["request"]) for row in rows[:3]] == [
            ("hall/arm", "HOME"),
            ("hall/arm-2", "STOP"),
            ("hall/arm", "ACQUIRE"),
        ]
        assert rows[1]["values"] == {"stop_id": "1", "reason": "dog"}
        # A robot without a gateway does not hide others.
        site.session.declare_presence("hall", "arm-3", "kinematics")
        done = await asyncio.to_thread(robomesh, "audit", "list", "--connect", router)
        assert "hall/arm-3: no gateway answers" in done.stderr
        assert len(done.stdout.splitlines()) >= 3
    done = await asyncio.to_thread(robomesh, "audit", "list", str(site.audit), "--since", "10m")
    assert [line.split()[4] for line in done.stdout.splitlines()][:2] == ["HOME", "ACQUIRE"]


async def test_the_command_prints_degrees_and_millimetres_and_json_has_si(mesh, router, tmp_path):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        await refusal(site.command(C.MOVE_ABSOLUTE, joint_positions=POSITIONS))
        for _ in range(20):
            await refusal(site.command(C.HOME))
        await until(lambda: [e for e in site.seen["audit"] if e.repeated_count])
        site.own.declare_presence("hall", "arm", "gateway")
        (line,) = await robomesh_to(router, "audit", "list", "arm", "--request", "move_absolute")
        assert f"joint_positions={SI} [rad, m]" in line
        publisher = site.session.declare_publisher("hall", "arm", "description")
        publisher.put(JOINTS)
        (line,) = await robomesh_to(router, "audit", "list", "arm", "--request", "move_absolute")
        assert "joint_positions=180.00° 250.00mm" in line
        arguments = ("audit", "list", "arm", "--request", "move_absolute", "--json")
        (row,) = await robomesh_to(router, *arguments)
        assert json.loads(row)["values"]["joint_positions"] == SI
        lines = await robomesh_to(router, "audit", "list", "arm", "--request", "home")
        counted = next(e for e in site.seen["audit"] if e.repeated_count)
        assert f"REFUSED   x {counted.repeated_count}  {counted.text}" in "\n".join(lines)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--since", "25:99"), "'25:99' is no time: write 2026-11-21T15:04:05Z, 15:04 (today), or 10m"),
        (("--outcome", "maybe"), "--outcome 'maybe': it can be accepted, refused or failed"),
        (("--most", "0"), "--most 0: it can be 1 to 10000"),
        ((), "none.jsonl: cannot be read: No such file or directory"),
    ],
)
@pytest.mark.slow
def test_an_invalid_query_is_refused_in_one_line(tmp_path, arguments, words):
    done = robomesh("audit", "list", str(tmp_path / "none.jsonl"), *arguments)
    assert (done.returncode, done.stdout) == (2, "")
    assert words in done.stderr
    assert len(done.stderr.splitlines()) == 1


# ------------------------------------------------------------------------ disks

SITE = """
site = "hall"
[[robot]]
name = "arm"
model = "pt600"
controller = "tcp://127.0.0.1:{port}"
stop_proven = true
"""

TMPFS = 'mount -t tmpfs -o size=64k tmpfs "$1" && shift && exec "$@"'


@contextlib.asynccontextmanager
async def gateway_process(mesh, folder, port, *, wrapped=()):
    """Run a gateway in a separate process; yield its site and its process id."""
    site = folder / "site.toml"
    site.write_text(SITE.format(port=port))
    command = ("-m", "services.command_line.main", "gateway", "--site", site, "--connect", *mesh.connect)
    process = await asyncio.create_subprocess_exec(*wrapped, sys.executable, *map(str, command))
    async with open_session(mesh) as monitor:
        site = GatewaySite(monitor, folder / "audit" / "hall" / "arm.jsonl")
        topics = ("joints", "controller", "lease", "events")
        watching = [asyncio.create_task(watch(monitor, site, topic)) for topic in topics]
        try:
            await until(lambda: site.seen.get("controller"), timeout_s=30.0)
            await until(lambda: site.controller.link == STATE.UP)
            yield site, process.pid
        finally:
            process.terminate()
            await process.wait()
            for each in watching:
                each.cancel()
            await asyncio.gather(*watching, return_exceptions=True)


@contextlib.contextmanager
def limited(pid, log):
    """Limit the size of the gateway's files: its writes fail in the kernel, after half a line."""
    _, most = resource.prlimit(pid, resource.RLIMIT_FSIZE)
    resource.prlimit(pid, resource.RLIMIT_FSIZE, (log.stat().st_size + 30, most))
    yield
    resource.prlimit(pid, resource.RLIMIT_FSIZE, (most, most))


@contextlib.contextmanager
def filled(pid, log):
    """Fill the gateway's disk to its last byte."""
    filler = log.with_name("filler")
    with filler.open("wb", buffering=0) as file, contextlib.suppress(OSError):
        while True:
            file.write(b"\0" * 4096)
    yield
    filler.unlink()


async def on_a_full_disk(site, log, full, words):
    await site.home()
    with full:
        # The rest of the log's last page can still be written.
        with contextlib.suppress(RefusedError):
            for _ in range(40):
                await site.lease(A.RENEW)
                await site.command(C.TRACE_ON)
        text = await refusal(site.command(C.HOME))
        assert f"{words}: make space on its disk); a command that cannot be recorded is not executed" in text
        stop = await site.stop(by="wang")
        assert stop.sent
        await until(lambda: site.controller.activity == STATE.STOPPED)
        await until(lambda: site.events("audit.failed"))
        assert "STOP" not in [entry.request for entry in read_entries(log)]
    await until(lambda: site.events("audit.mended"))
    assert "STOP" in [entry.request for entry in read_entries(log)]
    await site.lease(A.RENEW)
    await site.command(C.RESET, stop_id=stop.stop_id)
    assert verify(log).ok


def test_when_its_file_cannot_grow_stop_works_and_motion_is_refused(mesh, tmp_path):
    async def main():
        async with (
            simulator() as port,
            gateway_process(mesh, tmp_path, port) as (site, pid),
        ):
            await on_a_full_disk(site, site.audit, limited(pid, site.audit), "File too large")

    run(main(), timeout_s=60.0)


def test_on_a_full_disk_stop_works_and_motion_is_refused(mesh, tmp_path):
    unshare = shutil.which("unshare")
    (tmp_path / "audit").mkdir()
    wrapped = (unshare, "-rm", "sh", "-c", TMPFS, "sh", str(tmp_path / "audit"))
    if unshare is None or subprocess.run([*wrapped, "true"], capture_output=True, check=False).returncode:
        pytest.skip("no small disk can be mounted here: unshare -rm and a tmpfs are not allowed")

    async def main():
        async with (
            simulator() as port,
            gateway_process(mesh, tmp_path, port, wrapped=wrapped) as (site, pid),
        ):
            log = Path(f"/proc/{pid}/root") / site.audit.relative_to("/")
            await on_a_full_disk(site, log, filled(pid, log), "No space left on device")

    run(main(), timeout_s=60.0)


@pytest.mark.exact_times
async def test_a_disk_that_hangs_delays_no_stop(mesh, tmp_path, monkeypatch):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        await site.home()
        answers_again, fsync = threading.Event(), os.fsync

        def hang(file):
            answers_again.wait()
            fsync(file)

        try:
            with monkeypatch.context() as patched:
                patched.setattr(os, "fsync", hang)
                late = "the audit log's disk takes longer than 1 s"
                assert late in await refusal(site.command(C.TRACE_ON))
                assert (await site.stop(by="wang")).sent
                await until(lambda: site.controller.activity == STATE.STOPPED)
                assert late in await refusal(site.command(C.TRACE_OFF))
        finally:
            answers_again.set()
        await until(lambda: site.events("audit.mended"))
    outcomes = [(entry.request, entry.outcome) for entry in read_entries(site.audit)]
    assert outcomes[2:6] == [
        ("TRACE_ON", "ACCEPTED"),
        ("TRACE_ON", "FAILED"),
        ("STOP", "ACCEPTED"),
        ("TRACE_OFF", "REFUSED"),
    ]
    assert verify(site.audit).ok
