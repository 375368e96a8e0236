"""Kill -9 a commanding gateway repeatedly at random, and compare its audit log with its controller.

    .venv/bin/python -m tests.soak.audit_kills --times 50

A real router, a real gateway process, a controller that keeps every unit it receives, an operator that
sends each command after the previous answer, and a client that stops the robot at intervals. The log is
rotated every 10 KiB, so that kills meet rotations too. After each kill:

    every command that reached the controller is in the log as accepted, exactly one time
    the chain holds, and the newest head that was seen on the mesh is in it
    the stop that the log leaves latched is latched after the restart
    a stop whose entry was lost shows as the controller's own: stopped, and motion is refused
"""

import argparse
import asyncio
import contextlib
import json
import random
import sys
import tempfile
import time
from dataclasses import asdict, dataclass, field
from math import degrees, radians
from pathlib import Path

import zenoh

from protocol_gateway.audit.log import read_entries, verify
from robomesh.contract.endpoints import router_config
from robomesh.errors import NoAnswerError, RefusedError
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import Session, SessionSettings, open_session
from tests.ports import free_port
from tests.protocol_gateway.audit_state import state_after

C = schema.CommandRequest.Command
A = schema.LeaseRequest.Action
STATE = schema.ControllerState
STATES_HZ = 50
READY_S = 60.0
# A command in 0.1 degree steps of two joints: every one is another.
STEPS = 100

SITE = """
site = "kills"
[router]
listen = ["{router}"]
[audit]
rotate_mib = 0.01
[[robot]]
name = "arm"
model = "pt600"
controller = "tcp://127.0.0.1:{port}"
stop_proven = true
"""


@dataclass
class Report:
    """Results; `problems`: sentences, empty: none."""

    kills: int = 0
    commands: int = 0
    entries: int = 0
    parts: int = 0
    torn: int = 0
    stops: int = 0
    stops_lost: int = 0
    stops_remembered: int = 0
    problems: list[str] = field(default_factory=list)


class Controller:
    """Controller that reaches each target immediately, and records the units that it receives."""

    def __init__(self) -> None:
        self.targets: list[tuple[int, int]] = []
        self.stops = 0
        self.stopped = False
        self._where = "0;0;0;0;0"

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Send the state periodically, and read units until the gateway is gone."""
        telling = asyncio.create_task(self._tell(writer))
        try:
            with contextlib.suppress(OSError, asyncio.IncompleteReadError):
                while True:
                    self._take((await reader.readuntil(b"@")).decode())
        finally:
            telling.cancel()
            writer.transport.abort()

    async def _tell(self, writer: asyncio.StreamWriter) -> None:
        while True:
            activity = "stopped" if self.stopped else "idle"
            writer.write(f"2#ABSOLUTE.DEG*{self._where}&STATUS*{activity};remote;homed@".encode())
            await asyncio.sleep(1 / STATES_HZ)

    def _take(self, unit: str) -> None:
        kind, _, data = unit.partition("#")[2].rstrip("@").partition("*")
        if kind == "ABSOLUTE.DEG":
            self._where = data
            waist, shoulder, *_ = map(float, data.split(";"))
            self.targets.append((round(waist * 10), round(shoulder * 10)))
        elif data == "stop":
            self.stopped = True
            self.stops += 1
        elif data == "reset":
            self.stopped = False


@dataclass
class Trial:
    """A router, a controller and the folder of a site, used by one gateway after another."""

    folder: Path
    session: Session
    controller: Controller
    router: str
    chance: random.Random
    report: Report
    secret: str = ""
    id: int = 0
    number: int = 0
    head: str = ""

    @property
    def log(self) -> Path:
        return self.folder / "audit" / "kills" / "arm.jsonl"

    def key(self, request: str) -> str:
        return f"robomesh/kills/arm/{request}"

    async def command(self, command: C, **fields: object) -> None:
        self.id += 1
        request = schema.CommandRequest(command=command, lease=self.secret, id=self.id, **fields)
        await self.session.ask(self.key("command/li"), request)

    async def begin(self) -> None:
        """Acquire control of a gateway that has just started."""
        async with asyncio.timeout(READY_S):
            while True:
                with contextlib.suppress(NoAnswerError, RefusedError):
                    state = await self.session.last(self.key("controller"))
                    if state is not None and state.link == STATE.UP and state.mode == STATE.REMOTE:
                        break
                await asyncio.sleep(0.02)
        await self.check_stop(state)
        request = schema.LeaseRequest(action=A.ACQUIRE, ttl_s=5)
        self.secret = (await self.session.ask(self.key("lease/request/li"), request)).lease
        self.id = 0
        if self.controller.stopped:
            try:
                await self.move()
                self.report.problems.append("a motion was accepted although the controller is stopped")
            except RefusedError:
                pass
        await self.command(C.RESET, stop_id=state.stop.id)

    async def check_stop(self, state: STATE) -> None:
        """Check after a restart that the logged stop is latched, or else that the controller reports it."""
        shown = state.stop.id if state.HasField("stop") else 0
        begun_s = time.monotonic()
        while True:
            logged = state_after(read_entries(self.log)).stop
            # One that the gateway latched for a torn line is written in its first second.
            if shown == (logged.id if logged else 0) or time.monotonic() - begun_s > READY_S:
                break
            await asyncio.sleep(0.02)
        if shown != (logged.id if logged else 0):
            self.report.problems.append(f"stop {logged} is in the log, but stop {shown} is latched")
        self.report.stops_remembered += bool(shown)
        if self.controller.stopped and not shown:
            self.report.stops_lost += 1
            if state.activity != STATE.STOPPED:
                self.report.problems.append("a stop whose entry was lost does not show at the controller")

    async def move(self) -> None:
        self.number += 1
        waist, shoulder = self.number % STEPS / 10, self.number // STEPS / 10
        target = [radians(waist), radians(shoulder), 0.0, 0.0, 0.0]
        await self.command(C.MOVE_ABSOLUTE, joint_positions=target)

    async def work(self) -> None:
        """Command until the gateway is gone; stop, reset and renew at intervals."""
        renewed_s = time.monotonic()
        while True:
            try:
                await self.move()
                if self.chance.random() < 0.03:
                    stop = await self.session.ask(self.key("stop"), schema.StopRequest(by="wang"))
                    await self.command(C.RESET, stop_id=stop.stop_id)
                if time.monotonic() - renewed_s > 1.0:
                    request = schema.LeaseRequest(action=A.RENEW, lease=self.secret, ttl_s=5)
                    await self.session.ask(self.key("lease/request/li"), request)
                    renewed_s = time.monotonic()
            except RefusedError:
                pass  # the last stop of this gateway's; it stays latched

    async def watch(self) -> None:
        """Record the newest head that is known outside the gateway."""
        async for sample in self.session.subscribe(self.key("audit"), history=False):
            message = sample.message()
            if isinstance(message, schema.AuditEntry):
                self.head = message.hash.hex()

    def check(self, when: str) -> None:
        """Compare the log with the controller."""
        told = [entry for entry in read_entries(self.log) if entry.request == "MOVE_ABSOLUTE"]
        accepted = [_target(entry.values) for entry in told if entry.outcome == "ACCEPTED"]
        if len(accepted) != len(set(accepted)):
            self.report.problems.append(f"{when}: a command stands twice in the log as accepted")
        missing = set(self.controller.targets) - set(accepted)
        if missing:
            self.report.problems.append(f"{when}: {len(missing)} commands reached the controller unlogged")


def _target(values: dict[str, str]) -> tuple[int, int]:
    waist, shoulder, *_ = map(float, values["joint_positions"].split())
    return round(degrees(waist) * 10), round(degrees(shoulder) * 10)


async def kills(times: int, folder: Path, *, seed: int = 1) -> Report:
    """Kill a gateway so many times; return the results."""
    report, controller = Report(), Controller()
    server = await asyncio.start_server(controller.serve, "127.0.0.1", 0)
    router = f"tcp/127.0.0.1:{free_port()}"
    port = server.sockets[0].getsockname()[1]
    (folder / "site.toml").write_text(SITE.format(router=router, port=port))
    with zenoh.open(router_config((router,))):
        async with open_session(SessionSettings(connect=(router,), wait_s=5.0)) as session:
            trial = Trial(folder, session, controller, router, random.Random(seed), report)
            watching = asyncio.create_task(trial.watch())
            try:
                for _ in range(times):
                    await _one_life(trial)
                await _one_life(trial, die=False)
            finally:
                watching.cancel()
                server.close()
                await asyncio.gather(watching, return_exceptions=True)
    report.commands, report.stops = len(controller.targets), controller.stops
    report.parts = len(list(trial.log.parent.glob("*.jsonl")))
    return report


async def _one_life(trial: Trial, *, die: bool = True) -> None:
    """Start a gateway, command, kill it, compare; `die`: else it is only started, compared and ended."""
    torn = trial.log.exists() and not trial.log.read_bytes().endswith(b"\n")
    trial.report.torn += torn and trial.log.stat().st_size > 0
    log = (trial.folder / "gateway.log").open("ab")
    arguments = ("gateway", "--site", str(trial.folder / "site.toml"), "--connect", trial.router)
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "services.command_line.main", *arguments, stdout=log, stderr=log
    )
    asked: list[asyncio.Task[object]] = []
    try:
        await trial.begin()
        found = verify(trial.log, head=trial.head or None)
        trial.report.entries = found.entries
        if not found.ok:
            trial.report.problems.append(f"after kill {trial.report.kills}: {found.text}")
        trial.check(f"after restart {trial.report.kills}")
        if die:
            asked.append(asyncio.create_task(trial.work()))
            await asyncio.sleep(trial.chance.uniform(0.05, 1.0))
            if trial.chance.random() < 0.4:
                # Between wire and disk is where a stop's entry can be lost.
                count = trial.controller.stops
                asking = asyncio.create_task(trial.session.ask(trial.key("stop"), schema.StopRequest()))
                asked.append(asking)
                while trial.controller.stops == count and not asking.done():
                    await asyncio.sleep(0)
            trial.report.kills += 1
    finally:
        process.kill()
        await process.wait()
        log.close()
        # The next gateway would receive an unanswered request.
        for task in asked:
            task.cancel()
        await asyncio.gather(*asked, return_exceptions=True)
    # Read the bytes that the socket still holds, too.
    await asyncio.sleep(0.1)
    trial.check(f"after kill {trial.report.kills}")


def main() -> None:
    """Run the program."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--times", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        report = asyncio.run(kills(given.times, Path(folder), seed=given.seed))
    print(
        json.dumps(asdict(report))
        if given.json
        else "\n".join(f"{k}: {v}" for k, v in asdict(report).items())
    )
    sys.exit(1 if report.problems else 0)


if __name__ == "__main__":
    main()
