"""Ends of subscriptions and processes while threads still read."""

import asyncio
import subprocess
import sys
import threading
from pathlib import Path

from robomesh.publications.subscription import Subscription
from robomesh.wire.session import open_session


async def test_subscription_closed_before_its_first_read_ends_without_error(mesh, monkeypatch):
    read, begin = Subscription._read, threading.Event()

    def late(subscription):
        begin.wait(60.0)
        read(subscription)

    monkeypatch.setattr(Subscription, "_read", late)
    async with open_session(mesh) as monitor:
        subscription = monitor.subscribe("robomesh/site/arm/joints", history=False)
        subscription.close()
        begin.set()
        # An error in the thread would fail this test.
        await asyncio.to_thread(subscription._thread.join)
        assert [sample async for sample in subscription] == []


# On a busy machine a reading thread may wake up late.
_ENDS_WHILE_A_THREAD_READS = """
import asyncio, sys, time
from robomesh.wire.session import SessionSettings, open_session
from robomesh.publications.subscription import Subscription

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


def test_process_exit_waits_for_reading_threads(router):
    ended = subprocess.run(
        [sys.executable, "-c", _ENDS_WHILE_A_THREAD_READS, router],
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        timeout=120.0,
        check=False,
    )
    # Python would abort the process if it ended a thread inside Zenoh's code: "exception not rethrown".
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "has ended\n", "")
