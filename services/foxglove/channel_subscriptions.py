"""Foxglove channels and their subscriptions on the mesh, which last while a client watches."""

import asyncio
import logging
from collections import deque
from collections.abc import Callable, Coroutine
from typing import Any

import foxglove

from robomesh.contract.keys import parse_expression
from robomesh.contract.topics import History, topic
from robomesh.errors import RobomeshError
from robomesh.publications.subscription import Subscription
from robomesh.schemas.robomesh_pb2 import KeyFrameRequest
from robomesh.wire.session import Session
from services.foxglove.messages import Timed, timed

log = logging.getLogger(__name__)

_NEWEST = {History.LAST_100: 200, History.KEY_FRAME: 75}
_NEWEST_STATES = 100


class TopicChannel:
    """A topic of one robot as a channel.

    Args:
        key_exprs: Key expressions to subscribe to.
        convert: Converts each message; None to show messages unchanged.

    Attributes:
        watchers: Ids of the subscribed clients.
    """

    def __init__(
        self,
        session: Session,
        channel: foxglove.Channel,
        key_exprs: tuple[str, ...],
        convert: Callable[[bytes], bytes] | None = None,
    ) -> None:
        self.channel = channel
        self.watchers: set[int] = set()
        self._session = session
        self._keys = key_exprs
        self._convert = convert
        self._row = topic(parse_expression(key_exprs[0]).topic)
        kept = {History.LAST_100: 100, History.KEY_FRAME: 0}.get(self._row.history, 1)
        # Messages for a client that subscribes while others already watch.
        self._history: deque[Timed] = deque(maxlen=kept)
        self._subscriptions: list[Subscription] = []
        self._invalid_keys: set[str] = set()
        self._tasks: set[asyncio.Task[None]] = set()

    def join(self, client: int) -> None:
        """Add a client: the first one starts with the mesh's history, a further one with this channel's."""
        if self.watchers:
            for payload, time_ns in self._history:
                # The SDK does not report sink ids; clients are the only sinks, so the ids are equal.
                self.channel.log(payload, log_time=time_ns, sink_id=client)
            if self._row.history is History.KEY_FRAME:
                self._start_task(self._ask_for_key_frame())
        self.watchers.add(client)
        if not self._subscriptions:
            newest = _NEWEST.get(self._row.history, _NEWEST_STATES)
            self._subscriptions = [self._session.subscribe(key, newest=newest) for key in self._keys]
            for subscription in self._subscriptions:
                self._start_task(self._forward(subscription))

    def leave(self, client: int) -> None:
        """Remove a client; the last one ends the subscription."""
        self.watchers.discard(client)
        if not self.watchers:
            self._end()

    def close(self) -> None:
        """Remove the channel."""
        self._end()
        self.channel.close()

    def _end(self) -> None:
        for subscription in self._subscriptions:
            subscription.close()
        self._subscriptions = []
        self._history.clear()
        for task in self._tasks:
            task.cancel()

    def _start_task(self, work: Coroutine[Any, Any, None]) -> None:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _forward(self, subscription: Subscription) -> None:
        async for sample in subscription:
            try:
                for payload, time_ns in timed(self._row, sample):
                    shown = payload if self._convert is None else self._convert(payload)
                    self._history.append((shown, max(time_ns, 0)))
                    self.channel.log(shown, log_time=max(time_ns, 0))
            except Exception as error:  # an invalid message must not end the channel
                level = logging.DEBUG if sample.key in self._invalid_keys else logging.WARNING
                self._invalid_keys.add(sample.key)
                log.log(level, "%s: a message cannot be shown: %s", sample.key, error)

    async def _ask_for_key_frame(self) -> None:
        try:
            await self._session.ask(f"{self._keys[0]}/keyframe/{self._session.own_name}", KeyFrameRequest())
        except RobomeshError as error:
            log.debug("no key frame on %s: %s", self._keys[0], error)


class LatchedChannel:
    """A channel with one current message, which each new client receives."""

    def __init__(self, channel: foxglove.Channel) -> None:
        self.channel = channel
        self.watchers: set[int] = set()
        self._current: Timed | None = None

    def publish(self, payload: bytes, time_ns: int) -> None:
        """Send a message to all clients if it differs from the current one."""
        if self._current is None or self._current[0] != payload:
            self._current = payload, time_ns
            self.channel.log(payload, log_time=time_ns)

    def join(self, client: int) -> None:
        """Add a client."""
        self.watchers.add(client)
        if self._current is not None:
            payload, time_ns = self._current
            self.channel.log(payload, log_time=time_ns, sink_id=client)

    def leave(self, client: int) -> None:
        """Remove a client."""
        self.watchers.discard(client)

    def close(self) -> None:
        """Remove the channel."""
        self.channel.close()
