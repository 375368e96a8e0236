"""What ends quietly when it is closed at an awkward moment."""

import asyncio
import subprocess
import sys
import threading
from pathlib import Path

from robomesh.session import open_session
from robomesh.subscription import Subscription
from tests.conftest import run


def test_a_subscription_that_is_closed_before_it_is_read_from_ends_in_silence(mesh, monkeypatch):
    read, begin = Subscription._read, threading.Event()

    def late(subscription):
        begin.wait(10.0)
        read(subscription)

    async def main():
        monkeypatch.setattr(Subscription, "_read", late)
        async with open_session(mesh) as monitor:
            subscription = monitor.subscribe("robomesh/site/arm/joints", history=False)
            subscription.close()
            begin.set()
            # What its thread raised would fail this test.
            await asyncio.to_thread(subscription._thread.join)
            assert [sample async for sample in subscription] == []

    run(main())


# On a busy machine a thread that reads may wake up late.
_ENDS_WHILE_A_THREAD_READS = """
import asyncio, sys, time
from robomesh.session import SessionSettings, open_session
from robomesh.subscription import Subscription

read = Subscription._read

def late(subscription):
    read(subscription)
    time.sleep(0.5)
    print("has ended")

async def main():
    async with open_session(SessionSettings(connect=(sys.argv[1],), wait_s=20.0)) as session:
        session.subscribe("robomesh/site/arm/joints", history=False)

Subscription._read = late
asyncio.run(main())
"""


def test_a_process_waits_at_its_end_for_the_threads_that_read(router):
    ended = subprocess.run(
        [sys.executable, "-c", _ENDS_WHILE_A_THREAD_READS, router],
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        timeout=120.0,
        check=False,
    )
    # A thread that Python ends within Zenoh's code aborts the process: "exception not rethrown".
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "has ended\n", "")
