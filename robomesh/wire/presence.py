"""Presence of services, operators and monitors, as Zenoh liveliness tokens.

Zenoh limits no client's tokens, and a list of 10,000 takes its client seconds. So services are listed apart
from the sessions of operators and monitors, and of these few of one name are reported.
"""

import asyncio
import secrets
import time
from collections import Counter
from collections.abc import AsyncIterator, Iterable

import zenoh

from robomesh import reason_codes as codes
from robomesh.contract import keys
from robomesh.contract.ignored import TOKEN, Ignored
from robomesh.contract.topics import SERVICES
from robomesh.errors import NoAnswerError
from robomesh.requests.replies import Handler, collect
from robomesh.requests.request_queue import RateLimit

_TIMEOUT_S = 2.0
_SESSIONS_WITHIN_S = 1.0
_RETRY_S = 0.05
EVERYTHING = f"{keys.ROOT}/*/*/alive/*/*"
# In place of a service's name: a program or page through which an operator has control of the robot.
OPERATOR = "operator"
# A program that only subscribes.
MONITOR = "monitor"
# Present, but without a topic to publish.
SILENT = (OPERATOR, MONITOR)
_OF_SESSIONS = tuple(f"{keys.ROOT}/*/*/alive/{name}/*" for name in SILENT)
# The bridge to Foxglove has the rights of a monitor.
_OF_SERVICES = tuple(
    f"{keys.ROOT}/*/*/alive/{name}/*" for name in (*(role.value for role in SERVICES), "foxglove")
)
# Most sessions of one name that a watch reports and a listing shows, and rate of new ones [1/s].
MOST_OF_ONE = 64
_NEW_PER_S = 20.0
# Names that a watch remembers.
_MOST_NAMES = 4096


def bounded(alive: Iterable[keys.PresenceKey]) -> list[keys.PresenceKey]:
    """Return the keys without sessions beyond the first of each name."""
    counts = Counter[tuple[str, str]]()
    kept = []
    for key in alive:
        counts[key.service, name_of(key)] += key.service in SILENT
        if counts[key.service, name_of(key)] <= MOST_OF_ONE:
            kept.append(key)
    return kept


def name_of(key: keys.PresenceKey) -> str:
    """Return the name of an operator's or monitor's session, else the id."""
    return key.id.rpartition(".")[0] or key.id


def session_of(name: str) -> str:
    """Return a new id for the presence of a session; with certificates only `name` may declare it.

    Args:
        name: Name in the session's requests.
    """
    return f"{name}.{secrets.token_hex(8)}"


async def present(
    session: zenoh.Session, key_exprs: Iterable[str] = _OF_SERVICES, *, ignored: Ignored | None = None
) -> list[keys.PresenceKey]:
    """Return the presence keys of all services, sorted; while the link to the router is lost, wait for it.

    Args:
        ignored: Counts tokens with invalid keys; None: they are not counted.

    Raises:
        NoAnswerError: If the router did not list all tokens in time; a partial list would hide live services.
    """
    seen = Ignored() if ignored is None else ignored
    deadline = time.monotonic() + _TIMEOUT_S
    was_empty = False
    while (left_s := deadline - time.monotonic()) > 0.0:
        lists = await asyncio.gather(*(_tokens(session, each, seen, left_s) for each in key_exprs))
        found = {key for tokens, _ in lists for key in tokens}
        complete = all(each for _, each in lists)
        if complete and found and session.info.routers_zid():
            return sorted(found)
        # A lost link ends the reply early without an error, and Zenoh reports the loss a moment later.
        # So only a second empty reply counts.
        await asyncio.sleep(min(left_s, _RETRY_S))
        if complete and was_empty and session.info.routers_zid():
            return []
        was_empty = complete
    raise NoAnswerError(codes.PRESENCE_UNKNOWN(seconds=_TIMEOUT_S))


async def present_sessions(session: zenoh.Session, ignored: Ignored) -> tuple[list[keys.PresenceKey], bool]:
    """Return the presence keys of operators and monitors, sorted, and whether there are no others.

    Args:
        session: A separate session: a long list delays everything that follows on it.
    """
    lists = await asyncio.gather(
        *(_tokens(session, each, ignored, _SESSIONS_WITHIN_S) for each in _OF_SESSIONS)
    )
    found = sorted(key for tokens, _ in lists for key in tokens)
    kept = bounded(found)
    return kept, len(kept) == len(found) and all(complete for _, complete in lists)


async def _tokens(
    session: zenoh.Session, key_expr: str, seen: Ignored, timeout_s: float
) -> tuple[set[keys.PresenceKey], bool]:
    """Return the keys of tokens, and whether the router listed all in time."""
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
    return set(found), not late


class _Share:
    """Reported tokens of one name."""

    def __init__(self) -> None:
        self.alive = 0
        self._limit = RateLimit(per_s=_NEW_PER_S, burst=MOST_OF_ONE)

    def admits(self, now_s: float) -> bool:
        """Count one more token; False: the name has too many, or declares them too quickly."""
        if self.alive >= MOST_OF_ONE or not self._limit.take(now_s):
            return False
        self.alive += 1
        return True


class PresenceWatch:
    """Changes of presence as an asynchronous iterator of (key, alive); begins with the tokens alive now.

    An operator's or monitor's name has `MOST_OF_ONE` sessions; those beyond are ignored and counted.
    """

    def __init__(self, session: zenoh.Session, key_expr: str, ignored: Ignored) -> None:
        loop = asyncio.get_running_loop()
        self._closed = False
        self._changes: asyncio.Queue[tuple[keys.PresenceKey, bool] | None] = asyncio.Queue()
        present: set[keys.PresenceKey] = set()
        shares: dict[str, _Share] = {}

        def admits(key: keys.PresenceKey) -> bool:
            if len(shares) >= _MOST_NAMES:
                for name in [name for name, share in shares.items() if not share.alive]:
                    del shares[name]
            share = shares.get(name_of(key)) or (_Share() if len(shares) < _MOST_NAMES else None)
            if share is None or not share.admits(time.monotonic()):
                return False
            shares[name_of(key)] = share
            return True

        def on_change(sample: zenoh.Sample) -> None:
            key = ignored.presence(str(sample.key_expr))
            if key is None:
                return
            alive = sample.kind == zenoh.SampleKind.PUT
            if alive == (key in present):
                return  # a token declared during the subscription is reported twice
            if key.service in SILENT and alive and not admits(key):
                ignored.note(TOKEN, f"too many of {key.service} {name_of(key)}")
                return
            if key.service in SILENT and not alive:
                shares[name_of(key)].alive -= 1
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
