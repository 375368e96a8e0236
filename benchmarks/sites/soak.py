"""A whole site for hours: lost messages, growth of memory and files, and stops without a request.

    ./dev run python -m benchmarks soak HOURS [--robots 8] [--kills SECONDS] [--json]

`robomesh up` runs simulated robots at 100 Hz and every service. This program runs a monitor of all joints and
a page's WebSocket; half of each minute it records one robot, and then deletes the recording. With `--kills`
it kills a service about that often (never the router, which `wan` kills), and the supervisor restarts it.
Each minute prints a line of JSON on standard error, the end the result: share of joint states delivered,
memory, open files and cores used of each process (of the last with its name; cores of all together), the
slopes of memory and files (a line through the last four fifths), events by code, stops.

Target: 99.995 % delivered without kills, no slope, no stop.
"""

import asyncio
import contextlib
import json
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import psutil
from typer import Argument, Option

from benchmarks.harness.program import ROOT, say
from benchmarks.harness.sites import ROBOMESH
from benchmarks.mesh.fanout_parts import HEADER, WebSocketReader, connected
from robomesh.schemas.robomesh_pb2 import FromPage
from robomesh.wire.session import Session, SessionSettings, open_session
from tests.ports import free_port

SITE = "soak"
LOOK_EACH_S = 60.0
CAPTURE_S = 30.0
ENDED_WITHIN_S = 20.0
KILLED = ("gateway", "kinematics", "console", "recorder", "renderer", "player", "watch")
# The page counts separately: when a machine stalls, a page shows fewer states than were published.
WATCHED = f"robomesh/{SITE}/*/joints"


def measure(
    hours: Annotated[float, Argument()],
    robots: int = 8,
    kills: Annotated[float, Option(metavar="SECONDS", help="kill a service about this often")] = 0.0,
) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        ports = Ports(free_port(), free_port())
        with up(site_file(Path(folder), robots, ports)) as site:
            return asyncio.run(soak(site, Path(folder), ports, hours, robots, kills))


class Ports:
    """The ports of the site's services."""

    def __init__(self, router: int, page: int) -> None:
        self.router, self.page = f"tcp/127.0.0.1:{router}", f"127.0.0.1:{page}"


def site_file(folder: Path, robots: int, ports: Ports) -> Path:
    parts = [
        f'site = "{SITE}"',
        f'[router]\nlisten = ["{ports.router}"]',
        f'[console]\nlisten = "{ports.page}"',
        f'[recorder]\nfolder = "{folder}/recordings"',
        f'[audit]\nfolder = "{folder}/audit"',
        f'[define]\nfolder = "{folder}/robots"',
        *(
            f'[[robot]]\nname = "arm-{number}"\nmodel = "pt600"\ncontroller = "simulated"'
            for number in range(robots)
        ),
    ]
    file = folder / "site.toml"
    file.write_text("\n".join(parts) + "\n")
    return file


@contextlib.contextmanager
def up(file: Path) -> Iterator[subprocess.Popen[str]]:
    """Start the site and wait until its arms are on the page."""
    log = (file.parent / "log").open("w")
    process = subprocess.Popen(
        [*ROBOMESH, "up", str(file)],
        stdout=subprocess.PIPE,
        stderr=log,
        text=True,
        cwd=ROOT,
    )
    try:
        assert process.stdout is not None
        if not process.stdout.readline().startswith("console "):
            sys.exit(f"the site did not come up: {(file.parent / 'log').read_text()[-2000:]}")
        yield process
    finally:
        process.send_signal(signal.SIGINT)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(10)
        process.kill()


class Seen:
    """The messages received of a stream, by publisher: numbers without a gap mean that none is missing."""

    def __init__(self) -> None:
        self._numbers: dict[tuple[str, int], list[int]] = {}

    def note(self, key: str, publisher: int, number: int) -> None:
        first_last_count = self._numbers.setdefault((key, publisher), [number, number, 0])
        first_last_count[1] = max(first_last_count[1], number)
        first_last_count[2] += 1

    @property
    def sent(self) -> int:
        return sum(last - first + 1 for first, last, _ in self._numbers.values())

    @property
    def came(self) -> int:
        return sum(count for _, _, count in self._numbers.values())


class Grown:
    """Memory and open files of every process, over time."""

    def __init__(self, site: int) -> None:
        self._site = psutil.Process(site)
        self._rows: dict[str, list[tuple[float, float, float]]] = {}
        # By process: when it was looked at, and its processor time until then [s].
        self._used: dict[int, tuple[float, float]] = {}

    def look(self) -> dict[str, Any]:
        """Take one sample and return the current resident MiB, open files, and cores used since the last."""
        now: dict[str, dict[str, float]] = {}
        for process in (self._site, *self._site.children(recursive=True)):
            with contextlib.suppress(psutil.Error, OSError):
                name = self._name(process)
                resident = process.memory_info().rss / 2**20
                # The successor of a killed service is another process: its memory series restarts.
                self._rows.setdefault(f"{name} {process.pid}", []).append(
                    (time.monotonic(), resident, process.num_fds())
                )
                cores = self._cores(process) + now.get(name, {}).get("cores", 0.0)
                now[name] = {
                    "mib": round(resident, 1),
                    "files": process.num_fds(),
                    "cores": round(cores, 3),
                }
        return now

    def _cores(self, process: psutil.Process) -> float:
        at, used = time.monotonic(), sum(process.cpu_times()[:2])
        before, used_before = self._used.get(process.pid, (at, used))
        self._used[process.pid] = at, used
        return (used - used_before) / max(at - before, 1e-9)

    def slopes(self) -> dict[str, dict[str, float]]:
        """Return the slopes in MiB and open files an hour."""
        found = {}
        for name, rows in self._rows.items():
            late = np.array(rows[len(rows) // 5 :])
            if len(late) >= 4:
                hours = (late[:, 0] - late[0, 0]) / 3600
                found[name] = {
                    "mib": round(float(late[-1, 1]), 1),
                    "mib_per_h": round(float(np.polyfit(hours, late[:, 1], 1)[0]), 2),
                    "files": int(late[-1, 2]),
                    "files_per_h": round(float(np.polyfit(hours, late[:, 2], 1)[0]), 2),
                }
        return found

    @staticmethod
    def _name(process: psutil.Process) -> str:
        words = process.cmdline()
        if "services.command_line.main" not in words:
            return f"worker of {process.parent().cmdline()[3]}"
        return words[words.index("services.command_line.main") + 1]


async def soak(
    site: subprocess.Popen[str], folder: Path, ports: Ports, hours: float, robots: int, kills_each_s: float
) -> dict[str, Any]:
    begun = time.monotonic()
    joints, pages = Seen(), Seen()
    events: Counter[str] = Counter()
    stops: set[str] = set()
    kills: Counter[str] = Counter()
    unended: list[str] = []
    grown = Grown(site.pid)
    async with open_session(SessionSettings(connect=(ports.router,), wait_s=20.0)) as session:
        tasks = [
            asyncio.create_task(work)
            for work in (
                watch_joints(session, joints),
                watch_stops(session, stops),
                watch_events(session, events),
                record(folder, ports, robots, unended),
                *([kill(site.pid, kills_each_s, kills)] if kills_each_s else []),
            )
        ]
        page = asyncio.create_task(watch_page(ports.page, pages))

        def told() -> dict[str, Any]:
            return {
                "minutes": round((time.monotonic() - begun) / 60, 1),
                "sent": joints.sent,
                "delivered": joints.came / max(1, joints.sent),
                "page": pages.came / max(1, pages.sent),
                "events": dict(events),
                "stops": sorted(stops),
                "kills": dict(kills),
                "captures_not_ended": unended,
                "disk_mib": round(sum(f.stat().st_size for f in folder.rglob("*") if f.is_file()) / 2**20, 1),
            }

        while time.monotonic() < begun + hours * 3600:
            await asyncio.sleep(min(LOOK_EACH_S, max(1.0, hours * 3600 / 20)))
            for task in tasks:
                if task.done():
                    task.result()
            if page.done():
                page = asyncio.create_task(watch_page(ports.page, pages))
            now = {**told(), "processes": grown.look()}
            say(json.dumps(now))
        for task in (*tasks, page):
            task.cancel()
        await asyncio.gather(*tasks, page, return_exceptions=True)
        return {**told(), "slopes": grown.slopes()}


async def watch_joints(session: Session, seen: Seen) -> None:
    async for sample in session.subscribe(WATCHED, newest=50_000, history=False):
        seen.note(sample.key, sample.header.publisher, sample.header.sequence)


async def watch_stops(session: Session, stops: set[str]) -> None:
    async for sample in session.subscribe(f"robomesh/{SITE}/*/controller", newest=1000):
        if sample.message().HasField("stop"):
            stops.add(sample.key)


async def watch_events(session: Session, events: Counter[str]) -> None:
    async def of(expression: str) -> None:
        async for sample in session.subscribe(expression, newest=1000, history=False):
            if sample.live:
                events[sample.message().code] += 1  # type: ignore[attr-defined]

    await asyncio.gather(of(f"robomesh/{SITE}/*/events"), of(f"robomesh/{SITE}/*/events/*"))


async def watch_page(address: str, seen: Seen) -> None:
    """Watch through a page's WebSocket; reconnect when the console is killed."""

    def take(_: WebSocketReader, opcode: int, message: bytes) -> None:
        at = message.find(b"\x12\x18", 0, 120)
        if at > 0:
            publisher, number, _ = HEADER.unpack_from(message, at + 2)
            seen.note(message[:at].decode(errors="replace"), publisher, number)

    reader = await connected(address, "/mesh", False, take)
    reader.send(FromPage(watch=FromPage.Watch(key=WATCHED)).SerializeToString())
    while reader.transport is not None and not reader.transport.is_closing():
        await asyncio.sleep(1.0)


async def record(folder: Path, ports: Ports, robots: int, unended: list[str]) -> None:
    """Record one robot after another, and delete each complete capture; the disk use stays constant."""
    number = 0
    while True:
        process = await asyncio.create_subprocess_exec(
            *(*ROBOMESH, "record", f"arm-{number % robots}", "--name", f"soak-{number}"),
            *("--connect", ports.router),
            cwd=ROOT,
            stdout=asyncio.subprocess.DEVNULL,
            stderr=asyncio.subprocess.DEVNULL,
        )
        try:
            await asyncio.sleep(CAPTURE_S)
            process.send_signal(signal.SIGINT)
            await asyncio.wait_for(process.wait(), ENDED_WITHIN_S)
        except TimeoutError:
            # A late capture is a sign of a slow machine; it is no reason to abort hours of measurement.
            unended.append(f"soak-{number}")
        finally:
            if process.returncode is None:
                process.kill()
        await asyncio.sleep(CAPTURE_S)
        for file in (folder / "recordings").rglob(f"*soak-{number}*"):
            file.unlink(missing_ok=True)
        number += 1


async def kill(site: int, each_s: float, kills: Counter[str]) -> None:
    while True:
        await asyncio.sleep(each_s * random.uniform(0.7, 1.3))
        services = {
            words[3]: child
            for child in psutil.Process(site).children()
            if len(words := child.cmdline()) > 3 and words[3] in KILLED
        }
        if services:
            name = random.choice(sorted(services))
            services[name].kill()
            kills[name] += 1
