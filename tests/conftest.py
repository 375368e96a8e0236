"""What all tests share: a router of their own, sessions, the files that came with the issue."""

import asyncio
import contextlib
import fcntl
import os
import random
import socket
import tempfile
from collections.abc import Coroutine, Iterator
from pathlib import Path
from typing import Any, TypeVar

import pytest
import zenoh

from bus.endpoints import router_config
from bus.session import SessionSettings

T = TypeVar("T")

SHARED = Path(__file__).resolve().parents[2] / "shared"

_FIRST, _PORTS_A_BLOCK, _BLOCKS = 12_000, 100, 200


def _ports() -> Iterator[int]:
    """Ports that no connection gets by itself, in blocks that other test processes leave alone."""
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
    """A port that was free a moment ago; Zenoh does not tell which one it took for 0."""
    for port in _PORTS:
        with socket.socket() as probe, contextlib.suppress(OSError):
            probe.bind(("127.0.0.1", port))
            return port
    raise AssertionError("unreachable")


def run(main: Coroutine[Any, Any, T], *, timeout_s: float = 60.0) -> T:
    """Run a test's coroutine, with a deadline."""

    async def with_deadline() -> T:
        async with asyncio.timeout(timeout_s):
            return await main

    return asyncio.run(with_deadline())


@pytest.fixture
def router() -> Iterator[str]:
    """The endpoint of a running router of this test's own."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with zenoh.open(router_config((endpoint,))):
        yield endpoint


@pytest.fixture
def mesh(router: str) -> SessionSettings:
    """Session settings towards this test's router."""
    return SessionSettings(connect=(router,), wait_s=5.0)


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of reference files that lies beside the checkout here."""
    if not SHARED.is_dir():
        pytest.skip("the reference files (../shared) are not beside this checkout")
    return SHARED
