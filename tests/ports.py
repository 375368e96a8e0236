"""Ports for processes of tests and benchmarks."""

import contextlib
import fcntl
import os
import random
import socket
import tempfile
from collections.abc import Iterator
from pathlib import Path

_FIRST, _PORTS_A_BLOCK, _BLOCKS = 12_000, 100, 200


def _ports() -> Iterator[int]:
    """Yield ports outside the ephemeral range, in blocks that other test processes do not use."""
    folder = Path(tempfile.gettempdir()) / "robomesh-test-ports"
    folder.mkdir(exist_ok=True)
    while True:
        for block in random.sample(range(_BLOCKS), _BLOCKS):
            # Ours for as long as this process lives.
            file = os.open(folder / str(block), os.O_CREAT | os.O_RDWR, 0o666)
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                os.close(file)
                continue
            break
        else:
            raise AssertionError("all ports for tests are taken by other test processes")
        yield from range(_FIRST + block * _PORTS_A_BLOCK, _FIRST + (block + 1) * _PORTS_A_BLOCK)


_PORTS = _ports()


def free_port() -> int:
    """Return a port that was free a moment ago; Zenoh does not report which port it chose for 0."""
    for port in _PORTS:
        with socket.socket() as probe, contextlib.suppress(OSError):
            probe.bind(("127.0.0.1", port))
            return port
    raise AssertionError("unreachable")
