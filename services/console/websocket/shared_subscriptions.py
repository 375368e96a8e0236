"""Subscriptions to key expressions, shared by all browsers."""

import asyncio
import logging
from collections.abc import Callable

from robomesh import reason_codes as codes
from robomesh.contract import keys, topics
from robomesh.contract.topics import History
from robomesh.errors import KeyNameError, UnknownTopicError
from robomesh.publications.subscription import Sample
from robomesh.wire.session import Session
from services.console.common.errors import WatchError
from services.console.websocket.framing import SampleBatch, batches
from services.console.websocket.send_queues import SendQueue, drop_outdated, queue_for
from services.console.websocket.write_scheduler import WriteScheduler

log = logging.getLogger(__name__)

# Samples that may wait for the event loop: one for each key of a fleet, or two seconds of video.
_NEWEST = {History.KEY_FRAME: 75, History.LAST_100: 400}
_NEWEST_STATE = 1024
_ASK_AGAIN_S = 3.0
# An unwatched subscription ends within this time: a page that watches and unwatches in turn does not
# subscribe at its own pace, and an unwatched view is drawn for no longer.
_LINGER_S = 2.0

Sink = Callable[[SampleBatch], None]


class SharedSubscription:
    """A subscription, the samples it holds for later browsers, and its sinks."""

    def __init__(self, session: Session, expression: str, scheduler: WriteScheduler) -> None:
        self._scheduler = scheduler
        self.topic = check_expression(expression)
        newest = _NEWEST.get(self.topic.history, _NEWEST_STATE)
        self._subscription = session.subscribe(expression, newest=newest)
        self._held: dict[str, SendQueue] = {}
        self._sinks: set[Sink] = set()
        self._tasks = [asyncio.create_task(self._run())]
        if self.topic.history is History.LAST:
            self._tasks.append(asyncio.create_task(self._ask_again()))

    def join(self, sink: Sink) -> None:
        """Send the held samples, then each new one, to a sink, which must not block."""
        for batch in batches(sample for queue in self._held.values() for sample in queue.held()):
            sink(batch)
        self._sinks.add(sink)

    def leave(self, sink: Sink) -> None:
        """Remove a sink."""
        self._sinks.discard(sink)

    @property
    def unwatched(self) -> bool:
        """True if it has no sink."""
        return not self._sinks

    def close(self) -> None:
        """End the subscription."""
        self._subscription.close()
        for task in self._tasks:
            task.cancel()

    async def _ask_again(self) -> None:
        """Request the value until one arrives: a busy machine may lose an answer, and a value that
        seldom changes, like a description, is not published again soon."""
        key = keys.parse_expression(self._subscription.key_expr)
        while True:
            await asyncio.sleep(_ASK_AGAIN_S)
            one_is_enough = "*" not in (key.site, key.robot)
            if self._held and one_is_enough:
                return
            self._subscription.refresh(key.site, key.robot)
            if self._held:
                return

    async def _run(self) -> None:
        while samples := await self._subscription.next_batch():
            came = [each for each in samples if self._hold(each)]
            newest = drop_outdated(self.topic, came)
            for batch in batches(newest, len(came) - len(newest)):
                for sink in tuple(self._sinks):
                    self._give(sink, batch)
            await self._scheduler.wait_for_round()

    def _hold(self, sample: Sample) -> bool:
        """Hold a sample for later browsers; return whether it can be forwarded."""
        try:
            queue = self._held.get(sample.key)
            if queue is None:
                queue = self._held[sample.key] = queue_for(self.topic, hold=True)
            queue.push(sample)
        except Exception:  # an error in one sample must not end the subscription
            log.exception("a sample on %s could not be passed on", sample.key)
            return False
        return True

    def _give(self, sink: Sink, batch: SampleBatch) -> None:
        try:
            sink(batch)
        except Exception:  # nor an error in one page
            log.exception("what came on %s could not be passed on", self._subscription.key_expr)


class SharedSubscriptions:
    """The subscriptions that browsers use now.

    Attributes:
        scheduler: Schedules the writes to pages.
    """

    def __init__(self, session: Session) -> None:
        self.scheduler = WriteScheduler()
        self._session = session
        self._subscriptions: dict[str, SharedSubscription] = {}
        self._ends: dict[str, asyncio.TimerHandle] = {}

    def __contains__(self, expression: str) -> bool:
        return expression in self._subscriptions

    def join(self, expression: str, sink: Sink) -> None:
        """Subscribe a sink to a key expression.

        Raises:
            WatchError: If it cannot be watched.
        """
        shared = self._subscriptions.get(expression)
        if shared is None:
            shared = self._subscriptions[expression] = SharedSubscription(
                self._session, expression, self.scheduler
            )
        shared.join(sink)

    def leave(self, expression: str, sink: Sink) -> None:
        """Unsubscribe a sink. Without one a subscription soon ends, so that unwatched views are not drawn."""
        shared = self._subscriptions.get(expression)
        if shared is not None:
            shared.leave(sink)
            if shared.unwatched and expression not in self._ends:
                loop = asyncio.get_running_loop()
                self._ends[expression] = loop.call_later(_LINGER_S, self._end, expression)

    def _end(self, expression: str) -> None:
        """End a subscription, or let it last if it is watched again."""
        del self._ends[expression]
        if self._subscriptions[expression].unwatched:
            self._subscriptions.pop(expression).close()

    def close(self) -> None:
        """End all subscriptions."""
        for timer in self._ends.values():
            timer.cancel()
        for shared in self._subscriptions.values():
            shared.close()
        self._ends.clear()
        self._subscriptions.clear()


def check_expression(expression: str) -> topics.Topic:
    """Return the row of the topic table for a key expression.

    Raises:
        WatchError: If it matches no topic, or has a wildcard other than site and robot.
    """
    try:
        key = keys.parse_expression(expression)
        for name, what in ((key.site, "site"), (key.robot, "robot")):
            if name not in ("*", keys.WHOLE_SITE):
                keys.check_name(name, what)
        row = topics.topic(key.topic)
        every_source = key.topic == row.name and row.history is History.LAST_100  # events/* is allowed
        if "*" in key.topic and not every_source:
            raise WatchError(codes.PAGE_WATCH_WILDCARD(key=expression))
        if row.history is History.KEY_FRAME and "*" in expression:
            raise WatchError(codes.PAGE_WATCH_VIDEO(key=expression))
        if row.name.endswith("/*") and not every_source:
            keys.check_chunk(key.topic.split("/", 1)[1], "view")
    except (KeyNameError, UnknownTopicError) as error:
        raise WatchError(codes.PAGE_CANNOT_WATCH(error.reason, key=expression)) from None
    if topics.Role.CONSOLE not in row.subscribers:
        raise WatchError(codes.PAGE_WATCH_NO_RIGHT(key=expression, topic=row.name))
    return row
