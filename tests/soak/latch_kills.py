"""Kill -9 a gateway repeatedly 50 ms after it answered a stop, on a disk that is full.

    .venv/bin/python -m tests.soak.latch_kills --times 20

A real router, a real gateway process, its audit folder on a tmpfs of 512 KiB that is filled to its last byte
(in a mount namespace of this program's own: as root, or where users may have one), a controller that keeps
what it is sent, and a plain Zenoh client that asks in JSON. After each kill, with the disk still full or with
room again:

    the stop is latched under its number, although its entry is not in the audit log
    no motion is sent before the RESET that names it; behind it one is
    no number was given out before
"""

import argparse
import asyncio
import contextlib
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, dataclass, field
from math import radians
from pathlib import Path

import zenoh

from protocol_gateway.audit.log import read_entries, verify
from robomesh.contract.endpoints import router_config
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import Session, SessionSettings, open_session
from tests.ports import free_port
from tests.soak.audit_kills import Controller

STATE = schema.ControllerState
READY_S = 60.0
KILL_AFTER_S = 0.05
SIZE_KIB = 512
SITE = """
site = "full"
[router]
listen = ["{router}"]
[[robot]]
name = "arm"
model = "pt600"
controller = "tcp://127.0.0.1:{port}"
stop_proven = true
"""
BY, REASON = "wang", "somebody is in there"
KEY = "robomesh/full/arm/"


@dataclass
class Report:
    """Results; `problems`: sentences, empty: none."""

    kills: int = 0
    latched: int = 0
    not_in_log: int = 0
    numbers: list[int] = field(default_factory=list)
    slowest_stop_ms: float = 0.0
    problems: list[str] = field(default_factory=list)


@dataclass
class Trial:
    """A router, a controller and a disk, used by one gateway after another."""

    folder: Path
    session: Session
    client: zenoh.Session
    controller: Controller
    router: str
    report: Report
    chance: random.Random = field(default_factory=lambda: random.Random(1))
    secret: str = ""
    id: int = 0

    @property
    def log(self) -> Path:
        return self.folder / "audit" / "full" / "arm.jsonl"

    @property
    def filler(self) -> Path:
        return self.folder / "audit" / "filler"

    async def ask(self, request: str, **fields: object) -> dict[str, object]:
        """Return the reply to a client without robomesh's code; {"refused": words} if it is refused."""

        def get() -> dict[str, object]:
            for reply in self.client.get(KEY + request, payload=json.dumps(fields), timeout=5.0):
                if reply.ok is not None:
                    answer: dict[str, object] = json.loads(reply.ok.payload.to_string())
                    return answer
                return {"refused": reply.err.payload.to_string()}
            return {"refused": "nobody answered"}

        return await asyncio.to_thread(get)

    async def command(self, command: str, **fields: object) -> str:
        """Return the reason why a command was refused; empty: it was not."""
        await self.ask("lease/request/li", action="RENEW", lease=self.secret, ttl_s=5)
        self.id += 1
        answer = await self.ask("command/li", lease=self.secret, id=self.id, command=command, **fields)
        return str(answer.get("refused", ""))

    async def move(self) -> str:
        return await self.command("MOVE_ABSOLUTE", joint_positions=[radians(self.id % 15), 0, 0, 0, 0])

    async def state(self) -> STATE:
        """Return the gateway's state, as soon as its link is up."""
        async with asyncio.timeout(READY_S):
            while True:
                state = await self.session.last(KEY + "controller", timeout_s=0.5)
                if isinstance(state, STATE) and state.link == STATE.UP and state.mode == STATE.REMOTE:
                    return state
                await asyncio.sleep(0.02)

    def fill(self) -> None:
        """Leave no byte."""
        with self.filler.open("ab", buffering=0) as file, contextlib.suppress(OSError):
            while True:
                file.write(b"\0" * 4096)

    def make_room(self) -> None:
        self.filler.unlink(missing_ok=True)


async def _one_life(trial: Trial, number: int, *, die: bool = True) -> None:
    """Start a gateway, check its restored state, stop the robot on a full disk, kill it."""
    report = trial.report
    if number % 2:
        trial.make_room()
    log = (trial.folder / "gateway.log").open("ab")
    arguments = ("gateway", "--site", str(trial.folder / "site.toml"), "--connect", trial.router)
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "services.command_line.main", *arguments, stdout=log, stderr=log
    )
    try:
        await _after_restart(trial, await trial.state())
        if die:
            await _stop_on_a_full_disk(trial)
            await asyncio.sleep(KILL_AFTER_S)
            report.kills += 1
    finally:
        process.kill()
        await process.wait()
        log.close()
    logged = {int(e.values["stop_id"]) for e in read_entries(trial.log) if e.request == "STOP"}
    if die:
        report.not_in_log += report.numbers[-1] not in logged


async def _after_restart(trial: Trial, state: STATE) -> None:
    report, moved = trial.report, len(trial.controller.targets)
    trial.id = 0
    if report.numbers:
        latched = state.stop.id if state.HasField("stop") else 0
        report.latched += latched == report.numbers[-1]
        known = (state.stop.by, state.stop.reason) == (BY, REASON)
        if latched != report.numbers[-1] or not known:
            shown = f"stop {latched} ({state.stop.by}: {state.stop.reason})" if latched else "none"
            report.problems.append(f"stop {report.numbers[-1]} of {BY} was accepted, latched is {shown}")
    # From here on with room: without, nothing is commanded anyway.
    trial.make_room()
    async with asyncio.timeout(READY_S):
        while not (answer := await trial.ask("lease/request/li", action="ACQUIRE", ttl_s=5)).get("lease"):
            await asyncio.sleep(0.05)
    trial.secret = str(answer["lease"])
    # The controller's own word for stopped is no help here: it was started again, too.
    trial.controller.stopped = False
    if report.numbers:
        while "stopped: remove the cause" in (refused := await trial.move()):
            await asyncio.sleep(0.02)
        if f"stop {report.numbers[-1]} is latched" not in refused:
            report.problems.append(f"after the restart a motion without RESET got: {refused or 'accepted'}")
        if len(trial.controller.targets) != moved:
            report.problems.append("after the restart a motion went out without RESET")
        if refused := await trial.command("RESET", stop_id=report.numbers[-1]):
            report.problems.append(f"RESET: {refused}")
    if refused := await trial.move():
        report.problems.append(f"a motion behind the RESET: {refused}")


async def _stop_on_a_full_disk(trial: Trial) -> None:
    trial.fill()
    for _ in range(100):  # fill the rest of the log's last page, by different amounts
        if refused := await trial.command("TRACE_ON", program_name="x" * trial.chance.randrange(200)):
            break
    else:
        trial.report.problems.append("the disk is not full")
    if "No space left on device" not in refused:
        trial.report.problems.append(f"on a full disk a command was refused otherwise: {refused}")
    asked_s = time.monotonic()
    answer = await trial.ask("stop", by=BY, reason=REASON)
    trial.report.slowest_stop_ms = max(trial.report.slowest_stop_ms, (time.monotonic() - asked_s) * 1e3)
    if not answer.get("sent"):
        trial.report.problems.append(f"stop: {answer}")
    number = int(str(answer.get("stop_id", 0)))
    if number in trial.report.numbers:
        trial.report.problems.append(f"stop number {number} was given out twice")
    trial.report.numbers.append(number)


async def kills(times: int, folder: Path) -> Report:
    """Kill a gateway so many times; its folder `audit` is on a small disk."""
    report, controller = Report(), Controller()
    server = await asyncio.start_server(controller.serve, "127.0.0.1", 0)
    router = f"tcp/127.0.0.1:{free_port()}"
    port = server.sockets[0].getsockname()[1]
    (folder / "site.toml").write_text(SITE.format(router=router, port=port))
    plain = zenoh.Config()
    for name, value in (("mode", "client"), ("connect/endpoints", [router])):
        plain.insert_json5(name, json.dumps(value))
    plain.insert_json5("scouting/multicast/enabled", "false")
    with zenoh.open(router_config((router,))), zenoh.open(plain) as client:
        async with open_session(SessionSettings(connect=(router,), wait_s=5.0)) as session:
            trial = Trial(folder, session, client, controller, router, report)
            try:
                for number in range(times):
                    await _one_life(trial, number)
                await _one_life(trial, times, die=False)
                found = verify(trial.log)
                if not found.ok:
                    report.problems.append(f"the audit log's chain: {found.text}")
            finally:
                server.close()
    return report


def in_own_namespace(*arguments: str) -> list[str]:
    """Return this program's command line in a namespace where it may mount a disk."""
    private = ["unshare", "-m"] if os.geteuid() == 0 else ["unshare", "-rm"]
    return [*private, sys.executable, "-m", "tests.soak.latch_kills", "--mount", *arguments]


def may_mount() -> bool:
    """Return whether this machine lets this user mount a tmpfs in a namespace."""
    if shutil.which("unshare") is None:
        return False
    private = in_own_namespace()[: -len([sys.executable, "-m", "tests.soak.latch_kills", "--mount"])]
    tried = [*private, "mount", "-t", "tmpfs", "none", "/tmp"]
    return subprocess.run(tried, capture_output=True, check=False).returncode == 0


def main() -> None:
    """Run the program."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--times", type=int, default=20)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--mount", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if not given.mount:
        os.execvp("unshare", in_own_namespace(*sys.argv[1:]))
    with tempfile.TemporaryDirectory() as name:
        disk = Path(name) / "audit"
        disk.mkdir()
        subprocess.run(
            ["mount", "-t", "tmpfs", "-o", f"size={SIZE_KIB}k", "none", str(disk)], check=True, timeout=10
        )
        try:
            report = asyncio.run(kills(given.times, Path(name)))
        finally:
            subprocess.run(["umount", str(disk)], check=True, timeout=10)
    found = asdict(report)
    print(json.dumps(found) if given.json else "\n".join(f"{k}: {v}" for k, v in found.items()))
    sys.exit(1 if report.problems else 0)


if __name__ == "__main__":
    main()
