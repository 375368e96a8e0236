"""TCP proxies of the benchmark of jogs: one that stops forwarding, and one that logs a controller's units."""

import contextlib
import re
import socket
import threading
import time

import numpy as np

# As the unit protocol has it; independent of the gateway's parser.
_POSITIONS = re.compile(rb"ABSOLUTE\.DEG\*([-0-9.; ]+)")


class Proxy:
    """A TCP proxy to the console, which can stop forwarding."""

    def __init__(self, console: str) -> None:
        host, _, port = console.removeprefix("http://").rstrip("/").partition(":")
        self._to = host, int(port)
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.address = f"http://127.0.0.1:{self._listener.getsockname()[1]}/"
        self.cut = False
        self._sockets: list[socket.socket] = []

    def __enter__(self) -> "Proxy":
        threading.Thread(target=self._accept, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._listener.close()
        for each in self._sockets:
            each.close()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                near, _ = self._listener.accept()
                far = socket.create_connection(self._to)
                for each in (near, far):
                    each.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._sockets += [near, far]
                for one, other in ((near, far), (far, near)):
                    threading.Thread(target=self._forward, args=(one, other, one is far), daemon=True).start()

    def _forward(self, one: socket.socket, other: socket.socket, is_answer: bool) -> None:
        with contextlib.suppress(OSError):
            while data := one.recv(65536):
                self._passes(data, is_answer)
                if not self.cut:
                    other.sendall(data)
            other.shutdown(socket.SHUT_WR)

    def _passes(self, data: bytes, is_answer: bool) -> None:
        """Notice what passes."""


class UnitLog(Proxy):
    """A log of the units between gateway and controller, with the time at which each passed."""

    def __init__(self) -> None:
        super().__init__("127.0.0.1:0")
        self.address = self.address.removeprefix("http://").rstrip("/")
        self._rest = {True: b"", False: b""}
        # Time, whether the controller sent it, and the unit.
        self._units: list[tuple[float, bool, bytes]] = []

    def forward_to(self, host: str, port: int) -> None:
        self._to = host, port

    def _passes(self, data: bytes, is_answer: bool) -> None:
        now_s = time.time()
        *units, self._rest[is_answer] = (self._rest[is_answer] + data).split(b"@")
        self._units += [(now_s, is_answer, unit) for unit in units]

    def positions_since(self, since_s: float) -> tuple[np.ndarray, np.ndarray]:
        """Return times (m,) and joint positions (m, n) [rad] that the controller sent since a time."""
        found = [
            (at, [float(each) for each in match[1].split(b";")])
            for at, is_answer, unit in self._units[:]
            if is_answer and at >= since_s and (match := _POSITIONS.search(unit))
        ]
        return np.array([at for at, _ in found]), np.radians([degrees for _, degrees in found])

    def count(self, record: bytes, *, since_s: float) -> int:
        """Return how many units with a record the gateway sent since a time."""
        return sum(
            not is_answer and at >= since_s and record in unit for at, is_answer, unit in self._units[:]
        )


def rest_ms(times: np.ndarray, moving: np.ndarray, ended_s: float) -> float:
    """Return how long after the end the last motion was [ms]; 0: none."""
    last = times[1:][moving & (times[1:] > ended_s)]
    return 1000 * float(last[-1] - ended_s) if len(last) else 0.0


def until_rest(log: UnitLog) -> None:
    """Wait until the arm has not moved for a second."""
    while True:
        time.sleep(0.2)
        _, positions = log.positions_since(time.time() - 1.0)
        if len(positions) and np.ptp(positions, axis=0).max() < 1e-5:
            return
