"""The test bed of the gateway's benchmarks: a site of real processes, and controllers that record times."""

import contextlib
import multiprocessing
import os
import socket
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from latency import STEP_DEG, STEPS, free_port, process, service, until_connectable, wait

RATE_HZ = 100
# The units of a period leave in this many groups, a millisecond apart: a sleep costs as much as a unit.
GROUPS = 10
START_S = 60.0


@contextlib.contextmanager
def running_site(
    controllers: Sequence[int], *, more: str = ""
) -> Iterator[tuple[str, "subprocess.Popen[bytes]"]]:
    """Run a router, and a gateway with a robot for each controller's port.

    Args:
        more: Lines of the site file's last robot.
    """
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
        site = Path(folder) / "site.toml"
        tables = [
            f'[[robot]]\nname = "arm-{number}"\nmodel = "pt600"\ncontroller = "tcp://127.0.0.1:{port}"\n'
            for number, port in enumerate(controllers)
        ]
        site.write_text(
            f'site = "bench"\n[router]\nlisten = ["{endpoint}"]\n'
            f'[audit]\nfolder = "{folder}/audit"\n' + "".join(tables) + more
        )
        stack.enter_context(service("router", site, endpoint))
        until_connectable(int(endpoint.rpartition(":")[2]))
        yield endpoint, stack.enter_context(service("gateway", site, endpoint))


@contextlib.contextmanager
def running_controllers(
    robots: int, written: Any, units: int, go: Any, *, unit_bytes: int = 0
) -> Iterator[list[int]]:
    """Yield the ports of controllers that wait there for the gateway, and then for `go`.

    Args:
        unit_bytes: Units are padded with blanks to this length.
    """
    ports = multiprocessing.RawArray("i", robots)
    with process(controllers, (ports, written, units, go, unit_bytes)):
        until(lambda: all(ports))
        yield list(ports)


def unit_of(k: int) -> bytes:
    """Return a unit of five joints that carries a number: positions only, as the original controllers do."""
    turns, steps = divmod(k, STEPS)
    return f"1#ABSOLUTE.DEG*{turns}.00;0.00;0.00;0.00;{steps * STEP_DEG:.2f}@".encode()


def number_of(unit: bytes) -> int:
    """Return the number that a unit carries, with or without its "@"."""
    values = unit.partition(b"*")[2].rstrip(b"@").split(b";")
    return round(float(values[0])) * STEPS + round(float(values[-1]) / STEP_DEG)


def controllers(ports: Any, written: Any, units: int, go: Any, unit_bytes: int) -> None:
    """Run the controllers of all robots in one small process; before `go` the number is 0."""
    texts = [unit_of(k).rjust(unit_bytes) for k in range(units + 1)]
    servers = [socket.create_server(("127.0.0.1", 0)) for _ in ports]
    ports[:] = [server.getsockname()[1] for server in servers]
    clients = [server.accept()[0] for server in servers]
    for client in clients:
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    while not go.is_set():
        for client in clients:
            client.sendall(texts[0])
        time.sleep(1 / RATE_HZ)
    with contextlib.suppress(ConnectionError):  # the gateway has ended
        for k, robot in paced(len(clients), units):
            written[robot * units + k - 1] = time.monotonic_ns()
            clients[robot].sendall(texts[k])
        time.sleep(3.0)


def paced(robots: int, units: int) -> Iterator[tuple[int, int]]:
    """Yield (k, robot) when that robot's unit k is due, spread over the period and from unit to unit."""
    begun = time.monotonic() + 0.1
    for k in range(1, units + 1):
        for group in range(GROUPS):
            wait(begun + (k + group / GROUPS) / RATE_HZ)
            yield from ((k, robot) for robot in range(group, robots, GROUPS))


def until(condition: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + START_S
    while not condition():
        assert time.monotonic() < deadline_s, f"not within {START_S:g} s"
        time.sleep(0.2)


def cpu_s(process_id: int) -> float:
    """Return the user and system time of a process, all its threads."""
    fields = Path(f"/proc/{process_id}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def rss_mib(process_id: int) -> float:
    (line,) = [
        line for line in Path(f"/proc/{process_id}/status").read_text().splitlines() if "VmRSS" in line
    ]
    return int(line.split()[1]) / 1024
