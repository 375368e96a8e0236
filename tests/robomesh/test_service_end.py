"""The end of a service: signals, its clean-up, and its exit."""

import signal
import subprocess
import sys

import pytest

pytestmark = pytest.mark.slow

SERVICE = """
import asyncio, sys
from robomesh.service.service import run_until_signalled
async def main():
    print("up", flush=True)
    try:
        await asyncio.Event().wait()
    finally:
        print("cleaning up", flush=True)
        while not done():
            await asyncio.sleep(0.01)
        print("whole", flush=True)
import select
def done():
    return bool(select.select([sys.stdin], [], [], 0)[0])
run_until_signalled(main(), ends_within_s=60.0)
"""


@pytest.fixture
def service():
    process = subprocess.Popen(
        [sys.executable, "-c", SERVICE], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout.readline() == "up\n"
    yield process
    process.kill()
    process.communicate()


def test_second_sigterm_does_not_interrupt_the_clean_up(service):
    service.send_signal(signal.SIGTERM)
    assert service.stdout.readline() == "cleaning up\n"
    service.send_signal(signal.SIGTERM)
    service.stdin.write("go on\n")
    service.stdin.flush()
    assert service.stdout.readline() == "whole\n"
    assert service.wait(20.0) == 0


def test_second_sigint_cancels_the_clean_up(service):
    service.send_signal(signal.SIGINT)
    assert service.stdout.readline() == "cleaning up\n"
    service.send_signal(signal.SIGINT)
    assert service.stdout.readline() == ""
    service.wait(20.0)
