"""Presence: who is alive, told by Zenoh's liveliness."""

import asyncio
import contextlib
from collections.abc import AsyncIterator

import zenoh

from bus import keys
from bus.errors import KeyNameError

_TIMEOUT_S = 2.0
EVERYBODY = f"{keys.ROOT}/*/*/alive/*/*"
# In the service's place: a program or page through which somebody has control of the robot.
OPERATOR = "operator"
# A program that only watches.
MONITOR = "monitor"
# Who publishes nothing.
SILENT = (OPERATOR, MONITOR)


async def present(session: zenoh.Session, key_expr: str = EVERYBODY) -> list[keys.PresenceKey]:
    """Who is alive now, sorted."""
    loop = asyncio.get_running_loop()
    done = asyncio.Event()
    found: set[keys.PresenceKey] = set()

    def on_reply(reply: zenoh.Reply) -> None:
        if reply.ok is not None:
            with contextlib.suppress(KeyNameError):
                found.add(keys.parse_presence_key(str(reply.ok.key_expr)))

    def on_end() -> None:
        if not loop.is_closed():
            loop.call_soon_threadsafe(done.set)

    session.liveliness().get(key_expr, zenoh.handlers.Callback(on_reply, on_end), timeout=_TIMEOUT_S)
    await done.wait()
    return sorted(found)


class PresenceWatch:
    """Who comes alive and who goes, as an asynchronous iterator; who is there already comes first."""

    def __init__(self, session: zenoh.Session, key_expr: str = EVERYBODY) -> None:
        loop = asyncio.get_running_loop()
        self._closed = False
        self._changes: asyncio.Queue[tuple[keys.PresenceKey, bool] | None] = asyncio.Queue()
        present: set[keys.PresenceKey] = set()

        def on_change(sample: zenoh.Sample) -> None:
            try:
                key = keys.parse_presence_key(str(sample.key_expr))
            except KeyNameError:
                return
            alive = sample.kind == zenoh.SampleKind.PUT
            if alive == (key in present):
                return  # who comes in the moment of asking is told twice: as there already, and as coming
            (present.add if alive else present.discard)(key)
            if not loop.is_closed():
                loop.call_soon_threadsafe(self._changes.put_nowait, (key, alive))

        self._subscriber = session.liveliness().declare_subscriber(key_expr, on_change, history=True)

    def __aiter__(self) -> AsyncIterator[tuple[keys.PresenceKey, bool]]:
        return self

    async def __anext__(self) -> tuple[keys.PresenceKey, bool]:
        change = await self._changes.get()
        if change is None:
            raise StopAsyncIteration
        return change

    @property
    def closed(self) -> bool:
        """Whether it was closed."""
        return self._closed

    def close(self) -> None:
        """Watch no more; the iterator ends."""
        if not self._closed:
            self._closed = True
            self._subscriber.undeclare()
            self._changes.put_nowait(None)
