"""Presence as a watch reports it, without a router."""

import asyncio
import itertools
from types import SimpleNamespace
from unittest.mock import Mock

import zenoh

from robomesh.contract.ignored import Ignored
from robomesh.wire import presence
from robomesh.wire.presence import EVERYTHING, MOST_OF_ONE, PresenceWatch


async def test_sessions_of_one_name_that_end_make_room_for_later_ones(monkeypatch):
    seconds = itertools.count()
    monkeypatch.setattr(presence, "time", SimpleNamespace(monotonic=lambda: float(next(seconds))))
    session = Mock()
    watch = PresenceWatch(session, EVERYTHING, Ignored())
    _, on_change = session.liveliness().declare_subscriber.call_args.args
    for number in range(MOST_OF_ONE + 1):
        key = f"robomesh/site/arm/alive/operator/li.{number}"
        for kind in (zenoh.SampleKind.PUT, zenoh.SampleKind.DELETE):
            on_change(SimpleNamespace(key_expr=key, kind=kind))
            async with asyncio.timeout(10.0):
                reported, alive = await anext(watch)
            assert (reported.id, alive) == (f"li.{number}", kind == zenoh.SampleKind.PUT)
