"""A site's start: from `robomesh up` until a monitor has the first joints, and the processor time until then.

    ./dev run python -m benchmarks start [--runs 5] [--json]

The site has one simulated robot, as the README's first example, and ports of its own. A cold start finds no
bytecode of robomesh and its packages, as after an installation, but that of Python's standard library; all
files may be in the system's memory. A warm start finds all bytecode. Cold and warm starts take turns. The
monitor is this process, connected as soon as the router listens. Processor time is that of the supervisor and
of all its processes, user and system. "Imports" is that of one process for each of them, alone, which imports
its modules and ends; "Python" that of as many empty ones.

Target: warm 2 s on two cores.
"""

import contextlib
import os
import shutil
import signal
import socket
import statistics
import subprocess
import sys
import sysconfig
import tempfile
import time
from collections.abc import Iterator
from importlib.util import cache_from_source
from pathlib import Path
from typing import Annotated, Any

import zenoh
from typer import Option

from benchmarks.harness.program import ROOT
from benchmarks.harness.sites import ROBOMESH
from robomesh.contract.endpoints import client_config
from services.command_line.service_settings.table import SERVICES
from tests.ports import free_port

SITE = """site = "bench"
[router]
listen = ["{router}"]
[console]
listen = "{console}"
[audit]
folder = "{folder}/audit"
[[robot]]
name = "pt600"
model = "pt600"
controller = "simulated"
demo = true
"""
WITHIN_S = 120.0
ENDS_WITHIN_S = 20.0
# Of the processes that the table of services lacks: the supervisor, the simulated controller.
MORE_MODULES = {
    "up": "services.command_line.site.up",
    "router": "services.command_line.site.router",
    "simulate": "controllers.unit.simulated.service",
}
IMPORTING = """
import importlib, sys, time
for name in sys.argv[1:]:
    importlib.import_module(name)
print(time.process_time())
"""


class NotStartedError(SystemExit):
    """The site did not start."""


def measure(runs: Annotated[int, Option(help="of each kind of start", min=1)] = 5) -> dict[str, Any]:
    """Start sites, cold and warm in turns, one after the other."""
    starts: dict[str, list[dict[str, float]]] = {"cold": [], "warm": []}
    with tempfile.TemporaryDirectory() as empty:
        started(Path(empty))  # compiles what a warm start needs
        for _ in range(runs):
            with tempfile.TemporaryDirectory() as bytecode:
                keep_standard_library(Path(bytecode))
                starts["cold"].append(started(Path(bytecode)))
            starts["warm"].append(started(Path(empty)))
        imports = imports_s(Path(empty))
    return {"starts": starts, "imports": imports}


def started(bytecode: Path) -> dict[str, float]:
    """Start a site, wait for its first joints and its page, and end it.

    Args:
        bytecode: Folder in which Python finds and writes bytecode.

    Raises:
        NotStartedError: If the site ends, or publishes no joints within two minutes.
    """
    endpoint, console = f"tcp/127.0.0.1:{free_port()}", f"127.0.0.1:{free_port()}"
    with tempfile.TemporaryDirectory() as name, contextlib.ExitStack() as stack:
        folder = Path(name)
        site, log = folder / "site.toml", folder / "log"
        site.write_text(SITE.format(router=endpoint, console=console, folder=folder))
        begun = time.monotonic()
        up = stack.enter_context(running([*ROBOMESH, "up", str(site)], bytecode, log))
        router_s = until_listening(int(endpoint.rpartition(":")[2]), up, log) - begun
        first: list[float] = []
        with zenoh.open(client_config((endpoint,))) as session:
            subscriber = session.declare_subscriber(
                "robomesh/bench/pt600/joints", lambda _: first.append(time.monotonic())
            )
            poll(lambda: bool(first), up, log)
            cpu, processes = cpu_s(up.pid)
            subscriber.undeclare()
        poll(lambda: "console http" in log.read_text(errors="replace"), up, log)
        return {
            "router_s": router_s,
            "joints_s": first[0] - begun,
            "page_s": time.monotonic() - begun,
            "cpu_s": cpu,
            "processes": processes,
        }


@contextlib.contextmanager
def running(command: list[str], bytecode: Path, log: Path) -> Iterator["subprocess.Popen[bytes]"]:
    """Run a site with all its processes; end them."""
    with log.open("wb") as output:
        up = subprocess.Popen(command, stdout=output, stderr=output, cwd=ROOT, env=environment(bytecode))
    try:
        yield up
    finally:
        up.send_signal(signal.SIGTERM)
        try:
            up.wait(ENDS_WITHIN_S)
        except subprocess.TimeoutExpired:
            up.kill()  # its processes then end by themselves
            up.wait()


def environment(bytecode: Path) -> dict[str, str]:
    rest = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return rest | {"PYTHONPYCACHEPREFIX": str(bytecode)}


def until_listening(port: int, up: "subprocess.Popen[bytes]", log: Path) -> float:
    def listens() -> bool:
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port)):
            return True
        return False

    poll(listens, up, log)
    return time.monotonic()


def poll(condition: Any, up: "subprocess.Popen[bytes]", log: Path) -> None:
    deadline_s = time.monotonic() + WITHIN_S
    while not condition():
        if up.poll() is not None or time.monotonic() > deadline_s:
            ended = (
                f"ended with status {up.poll()}" if up.poll() is not None else f"not within {WITHIN_S:g} s"
            )
            raise NotStartedError(f"robomesh up: {ended}: {log.read_text(errors='replace')[-600:]}")
        time.sleep(0.005)


def cpu_s(ancestor: int) -> tuple[float, int]:
    """Return the processor time of a process and its descendants, ended ones included, and their number."""
    children: dict[int, list[int]] = {}
    ticks: dict[int, int] = {}
    for file in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            fields = file.read_text().rpartition(")")[2].split()
            pid = int(file.parent.name)
            children.setdefault(int(fields[1]), []).append(pid)
            ticks[pid] = sum(map(int, fields[11:15]))
    found = [ancestor]
    for pid in found:
        found += children.get(pid, ())
    return sum(ticks.get(pid, 0) for pid in found) / os.sysconf("SC_CLK_TCK"), len(found)


def keep_standard_library(bytecode: Path) -> None:
    """Copy the present bytecode of Python's standard library into a folder for bytecode."""
    library = Path(sysconfig.get_path("stdlib"))
    for source in library.rglob("*.py"):
        if "site-packages" in source.parts:
            continue
        present = Path(cache_from_source(str(source)))
        if present.is_file():
            copy = bytecode / source.parent.relative_to("/") / present.name
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(present, copy)


def imports_s(bytecode: Path) -> dict[str, float]:
    """Return the processor time of the imports of each process of the site, alone, and of an empty one."""
    modules = {name: row.module for name, row in SERVICES.items()} | MORE_MODULES
    entry = "services.command_line.main"
    seconds = {name: import_s([entry, module], bytecode) for name, module in modules.items()}
    empty_s = import_s([], bytecode)
    return {
        "python_s": empty_s * len(modules),
        "imports_s": sum(seconds.values()) - empty_s * len(modules),
        **{f"{name}_s": value for name, value in seconds.items()},
    }


def import_s(modules: list[str], bytecode: Path) -> float:
    """Return the processor time of a Python that imports the modules, the median of three."""
    command = [sys.executable, "-c", IMPORTING, *modules]
    done = [
        subprocess.run(command, capture_output=True, text=True, cwd=ROOT, env=environment(bytecode))
        for _ in range(3)
    ]
    if failed := [each for each in done if each.returncode]:
        raise NotStartedError(
            f"import {' '.join(modules)}: {failed[0].stderr.strip().rpartition(chr(10))[2]}"
        )
    return statistics.median(float(each.stdout) for each in done)
