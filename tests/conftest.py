"""What all tests share: a router of their own, sessions, the files that came with the issue."""

import asyncio
import socket
from collections.abc import Coroutine, Iterator
from pathlib import Path
from typing import Any, TypeVar

import pytest
import zenoh

from bus.endpoints import router_config
from bus.session import SessionSettings

T = TypeVar("T")

SHARED = Path(__file__).resolve().parents[2] / "shared"


def free_port() -> int:
    """A port that was free a moment ago; Zenoh does not tell which one it took for 0."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def run(main: Coroutine[Any, Any, T], *, timeout_s: float = 30.0) -> T:
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
