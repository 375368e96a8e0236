"""A channel of Foxglove's, and the topic behind it: subscribed to on the mesh only while somebody watches."""

import asyncio
import logging
from collections import deque
from collections.abc import Callable, Coroutine
from typing import Any

import foxglove

from robomesh.errors import BusError
from robomesh.keys import parse_expression
from robomesh.schemas.robomesh_pb2 import KeyFrameRequest
from robomesh.session import Session
from robomesh.subscription import Subscription
from robomesh.topics import History, topic
from services.foxglove.messages import Timed, timed

log = logging.getLogger(__name__)

_NEWEST = {History.LAST_100: 200, History.KEY_FRAME: 75}
_NEWEST_STATES = 100


class Lane:
    """A topic of one robot as a channel.

    Args:
        key_exprs: What it is fed from.
        as_shown: What becomes of each message; none: shown as it is.

    Attributes:
        watchers: The clients that watch it.
    """

    def __init__(
        self,
        session: Session,
        channel: foxglove.Channel,
        key_exprs: tuple[str, ...],
        as_shown: Callable[[bytes], bytes] | None = None,
    ) -> None:
        self.channel = channel
        self.watchers: set[int] = set()
        self._session = session
        self._keys = key_exprs
        self._as_shown = as_shown
        self._row = topic(parse_expression(key_exprs[0]).topic)
        kept = {History.LAST_100: 100, History.KEY_FRAME: 0}.get(self._row.history, 1)
        # What somebody gets who comes while others watch already.
        self._held: deque[Timed] = deque(maxlen=kept)
        self._subscriptions: list[Subscription] = []
        self._nonsense: set[str] = set()
        self._tasks: set[asyncio.Task[None]] = set()

    def join(self, client: int) -> None:
        """A client watches: the first one begins with what the mesh holds, another with what is held here."""
        if self.watchers:
            for payload, time_ns in self._held:
                # The SDK tells no client's sink; while clients are the only sinks, both are numbered alike.
                self.channel.log(payload, log_time=time_ns, sink_id=client)
            if self._row.history is History.KEY_FRAME:
                self._keep(self._ask_for_key_frame())
        self.watchers.add(client)
        if not self._subscriptions:
            newest = _NEWEST.get(self._row.history, _NEWEST_STATES)
            self._subscriptions = [self._session.subscribe(key, newest=newest) for key in self._keys]
            for subscription in self._subscriptions:
                self._keep(self._pass_on(subscription))

    def leave(self, client: int) -> None:
        """A client watches no more; the last one ends the subscription."""
        self.watchers.discard(client)
        if not self.watchers:
            self._end()

    def close(self) -> None:
        """The channel is there no more."""
        self._end()
        self.channel.close()

    def _end(self) -> None:
        for subscription in self._subscriptions:
            subscription.close()
        self._subscriptions = []
        self._held.clear()
        for task in self._tasks:
            task.cancel()

    def _keep(self, work: Coroutine[Any, Any, None]) -> None:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _pass_on(self, subscription: Subscription) -> None:
        async for sample in subscription:
            try:
                for payload, time_ns in timed(self._row, sample):
                    shown = payload if self._as_shown is None else self._as_shown(payload)
                    self._held.append((shown, max(time_ns, 0)))
                    self.channel.log(shown, log_time=max(time_ns, 0))
            except Exception as error:  # one publisher's nonsense must not end the channel
                level = logging.DEBUG if sample.key in self._nonsense else logging.WARNING
                self._nonsense.add(sample.key)
                log.log(level, "%s: a message cannot be shown: %s", sample.key, error)

    async def _ask_for_key_frame(self) -> None:
        try:
            await self._session.ask(f"{self._keys[0]}/keyframe/{self._session.own_name}", KeyFrameRequest())
        except BusError as error:
            log.debug("no key frame on %s: %s", self._keys[0], error)


class Told:
    """A channel that tells one thing, whole, to whoever comes."""

    def __init__(self, channel: foxglove.Channel) -> None:
        self.channel = channel
        self.watchers: set[int] = set()
        self._told: Timed | None = None

    def tell(self, payload: bytes, time_ns: int) -> None:
        """Tell it to all; again only if it is another."""
        if self._told is None or self._told[0] != payload:
            self._told = payload, time_ns
            self.channel.log(payload, log_time=time_ns)

    def join(self, client: int) -> None:
        """A client watches."""
        self.watchers.add(client)
        if self._told is not None:
            payload, time_ns = self._told
            self.channel.log(payload, log_time=time_ns, sink_id=client)

    def leave(self, client: int) -> None:
        """A client watches no more."""
        self.watchers.discard(client)

    def close(self) -> None:
        """The channel is there no more."""
        self.channel.close()
