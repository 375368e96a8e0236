"""Sites on hosts of the tests' network: real services, and probes next to them."""

import json
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.wan.network import Host

ROUTER = "tcp/127.0.0.1:7447"
PORT = 7447
_ROOT = Path(__file__).parents[2]
READY_S = 60.0


@dataclass
class Site:
    """Services of a site, each a process on its host."""

    host: Host
    name: str
    folder: Path
    links: tuple[str, ...] = ()
    more: str = ""
    router: str = ""
    processes: dict[str, subprocess.Popen[str]] = field(default_factory=dict)

    @property
    def file(self) -> Path:
        """Return the site file, written again."""
        self.folder.mkdir(parents=True, exist_ok=True)
        path = self.folder / f"{self.name}.toml"
        path.write_text(
            f'site = "{self.name}"\n[router]\nlisten = ["tcp/0.0.0.0:{PORT}"]\ninsecure = true\n'
            f"connect = {json.dumps(list(self.links))}\n{self.router}\n{self.more}\n"
        )
        return path

    def start(self, service: str, *arguments: str, connect: str = ROUTER) -> subprocess.Popen[str]:
        """Start a service of this site; its log is in the folder."""
        command = [sys.executable, "-m", "services.command_line.main", service, "--site", str(self.file)]
        if service not in ("router", "simulate"):
            command += ["--connect", connect]
        with (self.folder / f"{self.name}-{service}.log").open("a") as log:
            process = self.host.start([*command, *arguments], stdout=log, stderr=log, cwd=_ROOT)
        self.processes[service] = process
        return process

    def with_arm(self, *, moving: bool = False, connect: str = ROUTER, keys: Path | None = None) -> "Probe":
        """Start router, controller and gateway of one arm, and a probe next to them."""
        self.start("router")
        self.processes["controller"] = self.host.start(
            [sys.executable, "-m", "tests.wan.controller", "127.0.0.1", "5400", *["moving"] * moving],
            stdout=subprocess.PIPE,
            cwd=_ROOT,
        )
        self.start("gateway")
        return Probe(self.host, connect, keys)

    def log(self, service: str) -> str:
        """Return a service's log."""
        return (self.folder / f"{self.name}-{service}.log").read_text()


ARM = """
[[robot]]
name = "arm"
model = "pt600"
controller = "tcp://127.0.0.1:5400"
stop_proven = true
thin_at_rest = false  # as if it moved all the time
"""


class Probe:
    """`probe.py` on a host."""

    def __init__(self, host: Host, connect: str = ROUTER, keys: Path | None = None) -> None:
        self.process = host.start(
            [sys.executable, "-m", "tests.wan.probe", connect, *([] if keys is None else [str(keys)])],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            cwd=_ROOT,
        )
        self._ready = False

    def do(self, name: str, *arguments: Any) -> Any:
        """Send a request to the probe, and wait for the answer."""
        self.begin(name, *arguments)
        return self.end()

    def begin(self, name: str, *arguments: Any) -> None:
        """Send a request to the probe; `end` waits for the answer."""
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps([name, *arguments]) + "\n")
        self.process.stdin.flush()

    def end(self) -> Any:
        """Return the answer to the request of `begin`."""
        assert self.process.stdout is not None
        if not self._ready:
            assert self.process.stdout.readline() == "ready\n"
            self._ready = True
        line = self.process.stdout.readline()
        assert line, "the probe has ended"
        return json.loads(line)

    def wait_for(self, name: str, *arguments: Any, timeout_s: float = 30.0) -> Any:
        """Ask until there is something."""
        deadline = time.monotonic() + timeout_s
        while not (answer := self.do(name, *arguments)):
            assert time.monotonic() < deadline, f"{name} {arguments}: nothing within {timeout_s:g} s"
            time.sleep(0.05)
        return answer

    def until(self, key: str, *, stale: bool, within_s: float, stale_s: float = 1.0) -> float:
        """Return when a watched key became stale, or live again [monotonic s]."""
        at = self.do("until", key, key, stale_s, stale, within_s)
        assert at is not None, f"{key} is not {'stale' if stale else 'live'} after {within_s:g} s"
        assert isinstance(at, float)
        return at


def stop(process: subprocess.Popen[str]) -> None:
    """End a service as its supervisor would."""
    process.terminate()
    with suppress(subprocess.TimeoutExpired):
        process.wait(5.0)
