"""Presence: who is alive, told by Zenoh's liveliness."""

import asyncio
import secrets
import time
from collections.abc import AsyncIterator

import zenoh

from robomesh import keys
from robomesh.errors import NoAnswerError
from robomesh.ignored import Ignored

_TIMEOUT_S = 2.0
_RETRY_S = 0.05
EVERYBODY = f"{keys.ROOT}/*/*/alive/*/*"
# In the service's place: a program or page through which somebody has control of the robot.
OPERATOR = "operator"
# A program that only watches.
MONITOR = "monitor"
# Who publishes nothing.
SILENT = (OPERATOR, MONITOR)


def session_of(name: str) -> str:
    """Return a new id for the presence of a session; with certificates its owner alone may declare it.

    Args:
        name: In whose name the session asks.
    """
    return f"{name}.{secrets.token_hex(8)}"


async def present(
    session: zenoh.Session, key_expr: str = EVERYBODY, *, ignored: Ignored | None = None
) -> list[keys.PresenceKey]:
    """Return who is alive now, sorted; while the link to the router is lost, wait for it.

    Args:
        ignored: Counts tokens that fit no presence key; None: they are left out uncounted.

    Raises:
        NoAnswerError: If the router did not tell all in time: a part of it would say that others are gone.
    """
    seen = Ignored() if ignored is None else ignored
    deadline = time.monotonic() + _TIMEOUT_S
    while (left_s := deadline - time.monotonic()) > 0.0:
        found = await _told(session, key_expr, seen, left_s)
        if not found:
            # A lost link ends the answer early, as if it were whole; Zenoh tells of it a moment later.
            await asyncio.sleep(min(left_s, _RETRY_S))
        if found is not None and session.info.routers_zid():
            return sorted(found)
    raise NoAnswerError(f"the router did not say within {_TIMEOUT_S:g} s who is alive: ask again")


async def _told(
    session: zenoh.Session, key_expr: str, seen: Ignored, timeout_s: float
) -> set[keys.PresenceKey] | None:
    """Return who is alive as the router tells it; None: it did not tell all in time."""
    loop = asyncio.get_running_loop()
    done = asyncio.Event()
    found: set[keys.PresenceKey] = set()
    late = False

    def on_reply(reply: zenoh.Reply) -> None:
        nonlocal late
        if reply.ok is None:
            late = True
        elif (key := seen.presence(str(reply.ok.key_expr))) is not None:
            found.add(key)

    def on_end() -> None:
        if not loop.is_closed():
            loop.call_soon_threadsafe(done.set)

    session.liveliness().get(key_expr, zenoh.handlers.Callback(on_reply, on_end), timeout=timeout_s)
    await done.wait()
    return None if late else found


class PresenceWatch:
    """Who comes alive and who goes, as an asynchronous iterator; who is there already comes first."""

    def __init__(self, session: zenoh.Session, key_expr: str, ignored: Ignored) -> None:
        loop = asyncio.get_running_loop()
        self._closed = False
        self._changes: asyncio.Queue[tuple[keys.PresenceKey, bool] | None] = asyncio.Queue()
        present: set[keys.PresenceKey] = set()

        def on_change(sample: zenoh.Sample) -> None:
            key = ignored.presence(str(sample.key_expr))
            if key is None:
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
