"""Hosts and links for tests: network namespaces of this process's own, joined by `link.py`.

A namespace lives as long as its file descriptor and the processes in it: nothing is left behind.
"""

import ctypes
import json
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from tests.wan.link import SETTINGS

T = TypeVar("T")

_CLONE_NEWNET = 0x40000000
_C = ctypes.CDLL(None, use_errno=True)


def missing() -> str | None:
    """Return what this kernel or container does not allow, in words; None: all is available."""
    if not Path("/dev/net/tun").exists():
        return "no /dev/net/tun here"
    try:
        with Network() as network:
            network.link(network.host("near"), network.host("far"))
    except (OSError, subprocess.CalledProcessError, AssertionError) as error:
        return f"no network namespaces with TUN devices here: {error}"
    return None


@dataclass(frozen=True)
class Host:
    """A machine with its own network."""

    name: str
    namespace: int
    processes: list[subprocess.Popen[str]] = field(default_factory=list)

    def start(self, command: Sequence[str], **options: Any) -> subprocess.Popen[str]:
        """Start a process there; it ends with the network."""
        entered = ["nsenter", f"--net=/proc/self/fd/{self.namespace}", *command]
        process = subprocess.Popen(entered, pass_fds=(self.namespace,), text=True, **options)
        self.processes.append(process)
        return process

    def run(self, command: Sequence[str], timeout_s: float = 60.0) -> str:
        """Return the output of a process there, after its end."""
        process = self.start(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        text, _ = process.communicate(timeout=timeout_s)
        return text


@dataclass(frozen=True)
class Link:
    """A link between two hosts, `near` and `far`: `forth` goes from near to far."""

    process: subprocess.Popen[str]
    near: str
    far: str

    def change(self, *, direction: str = "both", **values: Any) -> dict[str, dict[str, Any]]:
        """Change the link's settings (see `link.py`); return the counters so far."""
        assert not set(values) - SETTINGS, values
        names = ("forth", "back") if direction == "both" else (direction,)
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write(json.dumps(dict.fromkeys(names, values)) + "\n")
        self.process.stdin.flush()
        answer: dict[str, dict[str, Any]] = json.loads(self.process.stdout.readline())
        return answer

    def counters(self) -> dict[str, dict[str, Any]]:
        """Return each direction's counters."""
        return self.change()


class Network:
    """Hosts and links; the end of the block removes them."""

    def __init__(self) -> None:
        self._stack = ExitStack()
        self._links = 0

    def __enter__(self) -> "Network":
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def host(self, name: str) -> Host:
        """Return a new machine, with only its loopback device."""

        def make() -> int:
            if _C.unshare(_CLONE_NEWNET):
                raise OSError(ctypes.get_errno(), "cannot make a network namespace (CAP_SYS_ADMIN)")
            subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
            with suppress(OSError):
                # Available in any namespace; the machine's default may be one that ignores loss.
                Path("/proc/sys/net/ipv4/tcp_congestion_control").write_text("reno")
            return os.open("/proc/thread-self/ns/net", os.O_RDONLY)

        host = Host(name, _in_a_thread(make))
        self._stack.callback(_end, host)
        return host

    def link(self, near: Host, far: Host, **values: Any) -> Link:
        """Join two hosts; they reach each other at `Link.near` and `Link.far`."""
        self._links += 1
        number = self._links
        addresses = [f"10.77.{number}.{end}" for end in (1, 2)]
        ends = [
            {"netns": host.namespace, "name": f"wan{number}", "address": f"{address}/30"}
            for host, address in zip((near, far), addresses, strict=True)
        ]
        process = subprocess.Popen(
            [sys.executable, "-m", "tests.wan.link", json.dumps(ends)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            pass_fds=(near.namespace, far.namespace),
            cwd=Path(__file__).parents[2],
        )
        self._stack.callback(_end_link, process)
        assert process.stdout is not None
        if process.stdout.readline() != "ready\n":
            raise AssertionError(_last_words(process))
        link = Link(process, *addresses)
        if values:
            link.change(**values)
        return link


def _in_a_thread(make: Callable[[], T]) -> T:
    """Run a function in a new thread, so that no other thread changes its namespace."""
    done: list[T] = []
    failed: list[BaseException] = []

    def work() -> None:
        try:
            done.append(make())
        except BaseException as error:
            failed.append(error)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    if failed:
        raise failed[0]
    return done[0]


def _end(host: Host) -> None:
    for process in host.processes:
        if process.poll() is None:
            process.kill()
        process.wait()
        for stream in (process.stdin, process.stdout, process.stderr):
            if stream is not None:
                with suppress(OSError):
                    stream.close()
    os.close(host.namespace)


def _end_link(process: subprocess.Popen[str]) -> None:
    assert process.stdin is not None
    with suppress(OSError):
        process.stdin.close()
    try:
        process.wait(5.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    for stream in (process.stdout, process.stderr):
        if stream is not None:
            stream.close()


def _last_words(process: subprocess.Popen[str]) -> str:
    assert process.stderr is not None
    return (process.stderr.read().strip().splitlines() or ["the link's program ended"])[-1]
