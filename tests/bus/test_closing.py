"""What ends quietly when it is closed at an awkward moment."""

import asyncio
import threading

from bus.session import open_session
from bus.subscription import Subscription
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
