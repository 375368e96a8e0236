"""Presence of services, operators and monitors, as Zenoh liveliness tokens."""

import asyncio
import secrets
import time
from collections.abc import AsyncIterator

import zenoh

from robomesh import keys
from robomesh import reason_codes as codes
from robomesh.errors import NoAnswerError
from robomesh.ignored import Ignored
from robomesh.replies import Handler, collect

_TIMEOUT_S = 2.0
_RETRY_S = 0.05
EVERYTHING = f"{keys.ROOT}/*/*/alive/*/*"
# In place of a service's name: a program or page through which an operator has control of the robot.
OPERATOR = "operator"
# A program that only subscribes.
MONITOR = "monitor"
# Present, but without a topic to publish.
SILENT = (OPERATOR, MONITOR)


def session_of(name: str) -> str:
    """Return a new id for the presence of a session; with certificates only `name` may declare it.

    Args:
        name: Name in the session's requests.
    """
    return f"{name}.{secrets.token_hex(8)}"


async def present(
    session: zenoh.Session, key_expr: str = EVERYTHING, *, ignored: Ignored | None = None
) -> list[keys.PresenceKey]:
    """Return all presence keys alive now, sorted; while the link to the router is lost, wait for it.

    Args:
        ignored: Counts tokens with invalid keys; None: they are not counted.

    Raises:
        NoAnswerError: If the router did not list all tokens in time; a partial list would hide live services.
    """
    seen = Ignored() if ignored is None else ignored
    deadline = time.monotonic() + _TIMEOUT_S
    was_empty = False
    while (left_s := deadline - time.monotonic()) > 0.0:
        found = await _tokens(session, key_expr, seen, left_s)
        if found and session.info.routers_zid():
            return sorted(found)
        # A lost link ends the reply early without an error, and Zenoh reports the loss a moment later.
        # So only a second empty reply counts.
        await asyncio.sleep(min(left_s, _RETRY_S))
        if found is not None and was_empty and session.info.routers_zid():
            return []
        was_empty = found is not None
    raise NoAnswerError(codes.PRESENCE_UNKNOWN(seconds=_TIMEOUT_S))


async def _tokens(
    session: zenoh.Session, key_expr: str, seen: Ignored, timeout_s: float
) -> set[keys.PresenceKey] | None:
    """Return the keys of all tokens; None: the router did not list all in time."""
    late = False

    def read(reply: zenoh.Reply) -> keys.PresenceKey | None:
        nonlocal late
        if reply.ok is None:
            late = True
            return None
        return seen.presence(str(reply.ok.key_expr))

    def send(handler: Handler) -> None:
        session.liveliness().get(key_expr, handler, timeout=timeout_s)

    found = await collect(send, read)
    return None if late else set(found)


class PresenceWatch:
    """Changes of presence as an asynchronous iterator of (key, alive); begins with the tokens alive now."""

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
                return  # a token declared during the subscription is reported twice
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
        """True after `close`."""
        return self._closed

    def close(self) -> None:
        """Stop watching; the iterator ends."""
        if not self._closed:
            self._closed = True
            self._subscriber.undeclare()
            self._changes.put_nowait(None)
