"""Fan-out: ten robots at 100 Hz and one 720p video to many monitors, through each of several systems.

    ./dev run python -m benchmarks fanout [--monitors 1,4,16,64] [--seconds 5] [--repeats 3] [--minutes 10]
        [--arms NAMES] [--peers-python PYTHON] [--nats-server FILE] [--json]

Arms: `robomesh` (our publishers, our router, plain Zenoh clients), `zenoh` (a bare router, the same payloads
without our code), `page` (our console, clients that speak the page's protocol), `pyzmq` (no broker), `nats`,
`foxglove` (foxglove-sdk's server). The suffix `-plain` switches TLS off (pyzmq: CURVE).
The peers need a Python with pyzmq, nats-py and foxglove-sdk, and a nats-server. Each arm has the same
publisher and at most four processes of monitors, which record only the age of each message. The arms take
turns, so that other load on the machine affects all of them. The console sends a page the newest state; a
state that a newer one of the same robot replaced counts as overtaken. `--stopped` repeats each measurement
with one more monitor, which is stopped. The program skips a peer that is not installed, reports and skips
an arm that does not start within a minute, and starts no measurement after `--minutes`.

Target: all messages delivered, or overtaken on a page; p99 at 64 monitors at most 1.3 times the bare
router's, and below NATS and foxglove-sdk; a stopped monitor changes the others' p99 by less than a fifth.
"""

import contextlib
import json
import os
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import psutil
from typer import Option

from benchmarks.harness.processes import cpu_s as processor_s
from benchmarks.harness.processes import until_connectable
from benchmarks.harness.program import ROOT, chosen, say
from benchmarks.harness.sites import ROBOMESH
from benchmarks.mesh.fanout_sent import prepared
from tests.ports import free_port

HERE = Path(__file__)
ARMS = ("robomesh", "zenoh", "page", "pyzmq", "nats", "foxglove", "robomesh-plain", "page-plain")
MOST_PROCESSES = 4
OUR_ROLES = ("-m", "benchmarks.mesh.fanout_ours")
PEERS_ROLES = (str(HERE.with_name("fanout_peers.py")),)
PEERS = {"pyzmq": "zmq", "nats": "nats", "foxglove": "foxglove"}
# Limit from the first process's start to the last line of output, plus the seconds that it measures.
MOST_S = 60.0


class NotMeasured(Exception):
    """An arm could not be measured."""


def measure(
    monitors: str = "1,4,16,64",
    seconds: float = 5.0,
    repeats: int = 3,
    minutes: Annotated[float, Option(help="start no measurement after this time")] = 10.0,
    arms: str = ",".join(ARMS),
    stopped: Annotated[bool, Option("--stopped", help="also measure with a stopped monitor")] = False,
    peers_python: Annotated[str, Option(metavar="PYTHON")] = "",
    nats_server: Annotated[str, Option(metavar="FILE")] = "nats-server",
) -> dict[str, Any]:
    wanted = chosen("--arms", arms, [f"{arm}{plain}" for arm in ARMS[:6] for plain in ("", "-plain")])
    for arm in tuple(wanted):
        if missing := missing_peer(arm.removesuffix("-plain"), peers_python, nats_server):
            wanted.remove(arm)
            say(f"{arm} skipped: {missing}")
    rows, left_out = [], 0
    last_s = time.monotonic() + 60 * minutes
    with tempfile.TemporaryDirectory() as name:
        plain, secured = prepared(Path(name))
        for _ in range(repeats):
            for count in (int(each) for each in monitors.split(",")):
                for arm, with_stopped in product(wanted, (False, True) if stopped else (False,)):
                    folder = plain if arm.endswith("-plain") else secured
                    python = peers_python if arm.removesuffix("-plain") in PEERS else sys.executable
                    cell = Cell(arm, count, with_stopped, folder, seconds, python, nats_server)
                    if time.monotonic() > last_s:
                        left_out += 1
                        continue
                    try:
                        rows.append({**cell.row(), **cell.measure()})
                        say(f"{count:3} {arm}: p99 {rows[-1]['p99_ms']:.2f} ms")
                    except NotMeasured as error:
                        say(f"{count:3} {arm}: not measured: {error}")
    if left_out:
        say(f"{left_out} not started within {minutes:g} minutes")
    return {"seconds": seconds, "rows": summed(rows)}


def missing_peer(kind: str, python: str, nats_server: str) -> str:
    """Return which requirement of an arm is missing; "" if it can run."""
    if kind not in PEERS:
        return ""
    if not python:
        return "--peers-python is missing"
    imported = [python, "-c", f"import {PEERS[kind]}"]
    if not shutil.which(python) or subprocess.run(imported, capture_output=True).returncode:
        return f"{python} has no {PEERS[kind]}"
    if kind == "nats" and not shutil.which(nats_server):
        return f"{nats_server} not found"
    return ""


class Cell:
    """A single measurement of one arm with a number of monitors."""

    def __init__(
        self, arm: str, count: int, stopped: bool, folder: Path, seconds: float, python: str, nats_server: str
    ) -> None:
        self.arm, self.count, self.stopped, self.folder = arm, count, stopped, folder
        self.kind = arm.removesuffix("-plain")
        self.tls = (folder / "tls").exists()
        self.seconds, self.python, self.nats_server = seconds, python, nats_server
        self.peers = self.kind in PEERS
        self.address = f"127.0.0.1:{free_port()}"
        self.page = f"127.0.0.1:{free_port()}"
        self.processes: list[subprocess.Popen[str]] = []

    def row(self) -> dict[str, Any]:
        """Return the parameters that identify this measurement."""
        return {"arm": self.arm, "monitors": self.count, "stopped": self.stopped}

    def measure(self) -> dict[str, Any]:
        """Start all processes, run the measurement, and count.

        Raises:
            NotMeasured: If a process does not start, or does not end in time.
        """
        with tempfile.TemporaryDirectory() as out, contextlib.ExitStack() as stack:
            # On a timeout, kill the process: the closed pipe then ends the wait.
            limit = threading.Timer(MOST_S + self.seconds, self.end)
            stack.callback(limit.cancel)
            limit.start()
            stack.callback(self.end)
            folder = Path(out)
            for file in self.folder.iterdir():
                (folder / file.name).symlink_to(file)
            servers = [self.started(each) for each in self.servers(folder)]
            publisher = self.role("publish", folder)
            monitors = [self.role("receive", folder, 1)] if self.stopped else []
            monitors += [self.role("receive", folder, share) for share in shares(self.count)]
            everyone = (publisher, *monitors)
            for each in everyone:
                heard(each, "ready")
            begin = time.time_ns() + 2 * 10**9
            end = begin + round(self.seconds * 1e9)
            for each in everyone:
                tell(each, f"{begin} {end}")
            time.sleep(1.0)
            if self.stopped:
                monitors.pop(0).send_signal(signal.SIGSTOP)
            time.sleep(max(0.0, (begin - time.time_ns()) / 1e9))
            groups = {"servers": servers, "publisher": [publisher], "monitors": monitors}
            used = {name: cpu_s(group) for name, group in groups.items()}
            time.sleep(max(0.0, (end - time.time_ns()) / 1e9))
            cores = {name: (cpu_s(group) - used[name]) / self.seconds for name, group in groups.items()}
            sent = json.loads(heard(publisher))
            for each in monitors:
                each.wait()
            if not limit.is_alive():
                raise NotMeasured(f"did not end within {MOST_S + self.seconds:g} s")
            return {**self.summary(folder, sent), "cores": cores}

    def summary(self, folder: Path, sent: dict[str, int]) -> dict[str, Any]:
        """Return the delivered shares and the ages [ms]."""
        ages = {
            what: np.concatenate([np.fromfile(file, dtype=np.int64) for file in folder.glob(f"{what}.*")])
            for what in ("joints", "pictures")
        }
        percentiles = np.percentile(ages["joints"], (50, 99)) / 1e6 if ages["joints"].size else (np.nan,) * 2
        overtaken = sum(int(file.read_text()) for file in folder.glob("overtaken.*"))
        return {
            "delivered": ages["joints"].size / max(1, sent["joints"] * self.count),
            "overtaken": overtaken / max(1, sent["joints"] * self.count),
            "pictures": ages["pictures"].size / max(1, sent["pictures"] * self.count),
            "p50_ms": float(percentiles[0]),
            "p99_ms": float(percentiles[1]),
        }

    def role(self, role: str, folder: Path, count: int | None = None) -> Any:
        """Start a process that publishes, or that receives for a number of monitors."""
        address = self.page if self.kind == "page" and role == "receive" else self.address
        kind = "robomesh" if self.kind == "page" and role == "publish" else self.kind
        words = [self.python, *(PEERS_ROLES if self.peers else OUR_ROLES), role, kind, address, str(folder)]
        return self.started(words if count is None else [*words, str(count)])

    def started(self, words: list[str]) -> subprocess.Popen[str]:
        """Start a process, which `end` ends."""
        process = subprocess.Popen(
            words,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=None if os.environ.get("FANOUT_DEBUG") else subprocess.DEVNULL,
            text=True,
            cwd=ROOT,
        )
        self.processes.append(process)
        return process

    def end(self) -> None:
        """End all processes."""
        for process in self.processes:
            process.kill()
            process.wait()

    def servers(self, folder: Path) -> Iterator[list[str]]:
        """Start the servers between publisher and monitors, in the order that they need."""
        if self.kind in ("robomesh", "page"):
            scheme = "tls" if self.tls else "tcp"
            site = folder / "site.toml"
            lines = [
                'site = "bench"',
                "[router]",
                f'listen = ["{scheme}/{self.address}"]',
                *([TLS_LINE.format(folder=folder)] if self.tls else []),
            ]
            if self.kind == "page":
                lines += ["[console]", f'listen = "{self.page}"']
                lines += [CONSOLE_TLS_LINE.format(folder=folder)] if self.tls else []
            site.write_text("\n".join(lines) + "\n")
            yield [*ROBOMESH, "router", "--site", str(site)]
            until_listening(self.address)
            if self.kind == "page":
                attach = ("--connect", f"{scheme}/{self.address}")
                yield [*ROBOMESH, "console", "--site", str(site), *attach]
                until_listening(self.page)
        elif self.kind == "zenoh":
            yield [sys.executable, *OUR_ROLES, "route", self.address, str(folder)]
            until_listening(self.address)
        elif self.kind == "nats":
            host, port = self.address.split(":")
            tls = ["--tls", "--tlscert", f"{folder}/tls", "--tlskey", f"{folder}/key"] if self.tls else []
            yield [self.nats_server, "-a", host, "-p", port, *tls]
            until_listening(self.address)


TLS_LINE = 'tls = {{ ca = "{folder}/ca", certificate = "{folder}/tls", key = "{folder}/key" }}'
CONSOLE_TLS_LINE = 'tls = {{ certificate = "{folder}/tls", key = "{folder}/key" }}'


def shares(count: int) -> list[int]:
    """Divide the monitors among at most four processes."""
    processes = min(count, MOST_PROCESSES)
    return [count // processes + (number < count % processes) for number in range(processes)]


def tell(process: Any, line: str) -> None:
    """Send a line to a process; if the process has ended, `heard` reports it."""
    with contextlib.suppress(BrokenPipeError):
        process.stdin.write(f"{line}\n")
        process.stdin.flush()


def heard(process: Any, word: str = "") -> str:
    """Return a process's next line.

    Raises:
        NotMeasured: If the line is missing or begins with another word.
    """
    line = str(process.stdout.readline()).strip()
    if not line or (word and line != word):
        said = f"{' '.join(process.args[1:4])}: said {line!r}, not {word or 'what it counted'!r}"
        raise NotMeasured(f"{said} (FANOUT_DEBUG=1 shows why)")
    return line


def until_listening(address: str) -> None:
    """Wait until a server listens at the address.

    Raises:
        NotMeasured: If no server listens within a minute.
    """
    try:
        until_connectable(address)
    except TimeoutError:
        raise NotMeasured(f"no server listens on {address} (FANOUT_DEBUG=1 shows why)") from None


def cpu_s(processes: list[Any]) -> float:
    """Return the processor time that the processes have used [s].

    Raises:
        NotMeasured: If a process has ended.
    """
    try:
        return sum(processor_s(process.pid) for process in processes)
    except psutil.Error:
        raise NotMeasured(f"did not start within {MOST_S:g} s") from None


def summed(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the medians of the repeats, and the spread of p99."""
    kinds: dict[tuple[Any, ...], list[dict[str, Any]]] = {}
    for row in rows:
        kinds.setdefault((row["monitors"], row["arm"], row["stopped"]), []).append(row)
    found = []
    for (count, arm, stopped), same in sorted(kinds.items(), key=lambda item: item[0][0]):
        values = {
            name: statistics.median(row[name] for row in same)
            for name in ("delivered", "overtaken", "pictures", "p50_ms", "p99_ms")
        }
        cores = {group: statistics.median(row["cores"][group] for row in same) for group in same[0]["cores"]}
        late = [row["p99_ms"] for row in same]
        found.append({"arm": arm, "monitors": count, "stopped": stopped, **values, "cores": cores})
        found[-1]["p99_spread_ms"] = [min(late), max(late)]
    return found
