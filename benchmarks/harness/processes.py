"""Processes of a measurement: their start, their end, and their use of processor time and memory."""

import contextlib
import multiprocessing
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any

import psutil

START_S = 240.0  # on a busy machine a process takes a minute to start
ENDS_WITHIN_S = 10.0


@contextlib.contextmanager
def process(target: Callable[..., Any], *arguments: Any) -> Iterator[BaseProcess]:
    """Run a function in another process while the block runs."""
    running = multiprocessing.Process(target=target, args=arguments, daemon=True)
    running.start()
    try:
        yield running
    finally:
        running.terminate()
        running.join(ENDS_WITHIN_S)
        if running.is_alive():
            running.kill()
            running.join()


@contextlib.contextmanager
def piped(target: Callable[..., Any], *arguments: Any) -> Iterator[Connection]:
    """Run a function in another process; its last argument is the other end of the pipe."""
    ours, theirs = multiprocessing.Pipe()
    with process(target, *arguments, theirs):
        theirs.close()
        yield ours


@contextlib.contextmanager
def program(*words: str, **options: Any) -> Iterator[subprocess.Popen[Any]]:
    """Run a program without its output while the block runs."""
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    running = subprocess.Popen(words, **(quiet | options))
    try:
        yield running
    finally:
        running.terminate()
        try:
            running.wait(ENDS_WITHIN_S)
        except subprocess.TimeoutExpired:  # a backlog, which the figures show
            running.kill()
            running.wait()


def until(condition: Callable[[], Any], *, within_s: float = START_S, each_s: float = 0.05) -> None:
    """Wait for a condition.

    Raises:
        TimeoutError: If it does not come about in time.
    """
    deadline_s = time.monotonic() + within_s
    while not condition():
        if time.monotonic() > deadline_s:
            raise TimeoutError(f"not within {within_s:g} s")
        time.sleep(each_s)


def until_connectable(address: int | str) -> None:
    """Wait until a server listens at a port of this machine, or at an address that ends with one."""
    port = int(str(address).rpartition(":")[2])

    def connects() -> bool:
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port)):
            return True
        return False

    until(connects)


def cpu_s(pid: int | None, *, children: bool = False) -> float:
    """Return the user and system time of a process, all its threads, and of its children if asked."""
    parent = psutil.Process(pid)
    found = 0.0
    for each in (parent, *(parent.children(recursive=True) if children else ())):
        with contextlib.suppress(psutil.NoSuchProcess):
            found += sum(each.cpu_times()[:2])
    return found


def rss_mib(pid: int | None) -> float:
    """Return the resident memory of a process."""
    return float(psutil.Process(pid).memory_info().rss / 2**20)
