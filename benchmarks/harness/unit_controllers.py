"""Controllers of the unit protocol that record times: some send numbered units, others wait for a stop."""

import contextlib
import math
import multiprocessing
import socket
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

from benchmarks.harness.processes import process, until

RATE_HZ = 100
# The counter is in the last joint, in steps that the protocol's text carries exactly.
STEP_DEG = 0.01
# The last joint goes back by 50 degrees then: the gateway shows no step that no drive can make.
STEPS = 5_000
# The units of a period leave in this many groups, a millisecond apart: a sleep costs as much as a unit.
GROUPS = 10


@contextlib.contextmanager
def running_controllers(
    robots: int, written: Any, units: int, go: Any, *, unit_bytes: int = 0
) -> Iterator[list[int]]:
    """Yield the ports of controllers that wait there for the gateway, and then for `go`.

    Args:
        written: When a robot's unit was written [ns], a robot after another.
        unit_bytes: Units are padded with blanks to this length.
    """
    ports = multiprocessing.RawArray("i", robots)
    with process(controllers, ports, written, units, go, unit_bytes):
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


def number_in(joints: Any) -> int:
    """Return the number that joint states carry; 0 until the measurement begins."""
    first, last = (math.degrees(joints[index].position) for index in (0, -1))
    return round(first) * STEPS + round(last / STEP_DEG)


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


def wait(until_s: float) -> None:
    """Sleep until a monotonic time."""
    while (left := until_s - time.monotonic()) > 0:
        time.sleep(left)


class RestingController:
    """A controller at rest, homed and remote; a motion lasts until a stop.

    Args:
        note: Takes the time at which each stop arrived [ns].
    """

    def __init__(self, note: Callable[[int], None], port: int = 0) -> None:
        self._note = note
        self._server = socket.create_server(("127.0.0.1", port))
        self.port = self._server.getsockname()[1]
        self._moving = False
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        while True:
            client, _ = self._server.accept()
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            for work in (self._send, self._receive):
                threading.Thread(target=work, args=(client,), daemon=True).start()

    def _send(self, client: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while True:
                activity = "moving" if self._moving else "idle"
                client.sendall(
                    f"2#ABSOLUTE.DEG*0.00;0.00;0.00;0.00;0.00&STATUS*{activity};remote;homed@".encode()
                )
                time.sleep(0.01)

    def _receive(self, client: socket.socket) -> None:
        rest = b""
        with contextlib.suppress(OSError):
            while data := client.recv(65536):
                at = time.monotonic_ns()
                *units, rest = (rest + data).split(b"@")
                for unit in units:
                    if b"stop" in unit:
                        self._moving = False
                        self._note(at)
                    elif b"ABSOLUTE" in unit:
                        self._moving = True
