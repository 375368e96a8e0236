"""A whole site as real processes, on ports of its own."""

import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from robomesh.wire.session import SessionSettings
from tests import warm
from tests.ports import free_port

READY_S = 60.0
PROGRAM = (sys.executable, "-m", "services.command_line.main")
LEAN_UP = Path(__file__).with_name("lean_up.py")
# As smooth to the eye as the 100 states a second of a real controller, and cheaper.
RATE_HZ = 25.0
# Besides router, gateway, kinematics and console, which every site has.
EVERY_SERVICE = ("recorder", "player", "watch", "renderer", "store")


@dataclass
class RunningSite:
    """A site that was started by `robomesh up`."""

    folder: Path
    router: str
    console: str
    process: subprocess.Popen[str]
    log: list[str] = field(default_factory=list)

    @property
    def mesh(self) -> SessionSettings:
        """Return session settings for its router."""
        return SessionSettings(connect=(self.router,), wait_s=20.0)

    def children(self) -> dict[str, int]:
        """Return process ids of its services, by name."""
        return {words[0]: pid for pid, words in self.services()}

    def services(self) -> Iterator[tuple[int, list[str]]]:
        """Return each working process and its command's words.

        Exclude a spare, which waits at its standard input, a pipe, and a process that starts or exits.
        """
        for line in _output("ps", "-ww", "-o", "pid=,args=", "--ppid", str(self.process.pid)).splitlines():
            pid, *words = line.split()
            # Of a process that exits, only root may know the files.
            with suppress(FileNotFoundError, PermissionError):
                spare = "pipe:" in str(Path(f"/proc/{pid}/fd/0").readlink())
                if "services.command_line.main" in words and not spare:
                    yield int(pid), words[words.index("services.command_line.main") + 1 :]

    def command(self, *arguments: str, timeout_s: float = 40.0) -> subprocess.CompletedProcess[str]:
        """Run `robomesh` towards its router."""
        return robomesh(*arguments, "--connect", self.router, timeout_s=timeout_s)


def robomesh(*arguments: str, timeout_s: float = 40.0, text: str = "") -> subprocess.CompletedProcess[str]:
    """Run `robomesh` to its end."""
    return warm.run(arguments, timeout_s=timeout_s, text=text)


def site_file(
    folder: Path, *, name: str = "test", robots: str, router: str, console: str, more: str = ""
) -> Path:
    """Write a site file with ports of its own."""
    folder.mkdir(exist_ok=True)
    path = folder / "site.toml"
    path.write_text(
        f"""
site = "{name}"
[router]
listen = ["{router}"]
{more}
[console]
listen = "{console}"
[renderer]
size = [320, 180]
fps = 10
{robots}
""",
        encoding="utf-8",
    )
    return path


ONE_ARM = """
[[robot]]
name = "arm"
model = "pt600"
demo = true
stale_after_s = 5.0  # a busy machine stands still for seconds
"""


@contextmanager
def running_site(
    folder: Path,
    *,
    name: str = "test",
    robots: str = ONE_ARM,
    more: str = "",
    services: Sequence[str] = EVERY_SERVICE,
) -> Iterator[RunningSite]:
    """Yield a running site; it ends, with all its processes, when the block ends.

    Args:
        folder: Of its file and all that it writes.
        name: Name of the site.
        robots: Tables of the site file.
        more: More of the site file.
        services: What the test needs of `EVERY_SERVICE`: each costs about a second of the processor.
    """
    router, console = f"tcp/127.0.0.1:{free_port()}", f"127.0.0.1:{free_port()}"
    path = site_file(folder, name=name, robots=robots, router=router, console=console, more=more)
    with running_file(path, router, console, **lean(services)) as site:
        yield site


def lean(services: Sequence[str] = EVERY_SERVICE) -> dict[str, Any]:
    """Return the options of `running_file` for these services only, and for few states a second."""
    return {
        # A reader of its command line finds `robomesh up`.
        "program": (sys.executable, "-P", str(LEAN_UP), "robomesh"),
        "environment": {"TEST_SERVICES": ",".join(services), "TEST_RATE_HZ": f"{RATE_HZ:g}"},
    }


@contextmanager
def running_file(
    path: Path,
    router: str,
    console: str,
    *,
    program: Sequence[str] = PROGRAM,
    environment: Mapping[str, str] | None = None,
    folder: Path | None = None,
) -> Iterator[RunningSite]:
    """Run `robomesh up` with a site file; end it, with all its processes, when the block ends.

    Args:
        path: The site file.
        router: The address of the site's router, as the file has it.
        console: HOST:PORT of the page, as the file has it.
        program: The words that start `robomesh`.
        environment: Variables in addition to those of the tests.
        folder: Its current folder; None: that of the tests.
    """
    # The kernel interrupts the site when the tests' process dies, however it dies.
    end_with_the_tests = ("setpriv", "--pdeathsig", "INT") if shutil.which("setpriv") else ()
    process = subprocess.Popen(
        [*end_with_the_tests, *program, "up", str(path)],
        cwd=folder,
        env={**os.environ, **(environment or {})},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    site = RunningSite(path.parent, router, f"http://{console}/", process)
    ready = threading.Event()

    def read() -> None:
        assert process.stdout is not None
        for line in process.stdout:
            site.log.append(line.rstrip())
            if line.startswith("console http"):
                ready.set()
        ready.set()

    reader = threading.Thread(target=read, daemon=True)
    reader.start()
    try:
        came = ready.wait(READY_S)
        assert came, "\n".join(site.log)
        assert process.poll() is None, "\n".join(site.log)
        yield site
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
            try:
                process.wait(15.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        reader.join(5.0)
        assert process.stdout is not None
        process.stdout.close()


def alive(pid: int) -> bool:
    """Return whether a process runs (a zombie does not)."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def wait_until(condition, timeout_s: float = 40.0, what: str = "") -> None:
    """Wait for a condition, with as much time between two looks at it as a look takes.

    Raises:
        AssertionError: If it does not come about in time.
    """
    began = time.monotonic()
    deadline = began + timeout_s
    while not condition():
        looked = time.monotonic()
        assert looked < deadline, what or "it did not come about in time"
        time.sleep(max(looked - began, 0.05))
        began = time.monotonic()


def kill(pid: int, number: int = signal.SIGKILL) -> None:
    """Send a signal."""
    os.kill(pid, number)


def _output(*command: str) -> str:
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout
