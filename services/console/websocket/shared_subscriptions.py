"""One subscription per key expression, shared by every browser that watches it."""

import asyncio
import logging
from collections.abc import Callable

from robomesh import keys, topics
from robomesh.errors import BusError
from robomesh.session import Session
from robomesh.subscription import Sample
from robomesh.topics import History
from services.console.errors import WatchError
from services.console.websocket.framing import Moment, moments
from services.console.websocket.send_queues import Lane, lane_for, thinned
from services.console.websocket.write_scheduler import Turns

log = logging.getLogger(__name__)

# Samples that may wait for the event loop: one a key of a fleet, or two seconds of video.
_NEWEST = {History.KEY_FRAME: 75, History.LAST_100: 400}
_NEWEST_STATE = 1024
_ASK_AGAIN_S = 3.0

Sink = Callable[[Moment], None]


class Feed:
    """A subscription, what it holds for those still to come, and who takes its samples."""

    def __init__(self, session: Session, expression: str, turns: Turns) -> None:
        self._turns = turns
        self.topic = check_expression(expression)
        newest = _NEWEST.get(self.topic.history, _NEWEST_STATE)
        self._subscription = session.subscribe(expression, newest=newest)
        self._held: dict[str, Lane] = {}
        self._sinks: set[Sink] = set()
        self._tasks = [asyncio.create_task(self._run())]
        if self.topic.history is History.LAST:
            self._tasks.append(asyncio.create_task(self._ask_again()))

    def join(self, sink: Sink) -> None:
        """Gives what is held, then everything new, to a sink that must return at once."""
        for moment in moments(sample for lane in self._held.values() for sample in lane.held()):
            sink(moment)
        self._sinks.add(sink)

    def leave(self, sink: Sink) -> bool:
        """Gives no more to a sink; whether nobody is left."""
        self._sinks.discard(sink)
        return not self._sinks

    def close(self) -> None:
        """Ends the subscription."""
        self._subscription.close()
        for task in self._tasks:
            task.cancel()

    async def _ask_again(self) -> None:
        """Asks until there is a value: on a busy machine an answer can be lost, and what
        changes seldom, as a description does, would not be seen until it did."""
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
            newest = thinned(self.topic, came)
            for moment in moments(newest, len(came) - len(newest)):
                for sink in tuple(self._sinks):
                    self._give(sink, moment)
            await self._turns.over()

    def _hold(self, sample: Sample) -> bool:
        """Keeps a sample for those still to come; whether it can be passed on."""
        try:
            lane = self._held.get(sample.key)
            if lane is None:
                lane = self._held[sample.key] = lane_for(self.topic, hold=True)
            lane.push(sample)
        except Exception:  # one publisher's nonsense must not end the feed of all others
            log.exception("a sample on %s could not be passed on", sample.key)
            return False
        return True

    def _give(self, sink: Sink, moment: Moment) -> None:
        try:
            sink(moment)
        except Exception:  # nor that of one page's
            log.exception("what came on %s could not be passed on", self._subscription.key_expr)


class Feeds:
    """The feeds that somebody watches now.

    Attributes:
        turns: When the pages are served.
    """

    def __init__(self, session: Session) -> None:
        self.turns = Turns()
        self._session = session
        self._feeds: dict[str, Feed] = {}

    def join(self, expression: str, sink: Sink) -> None:
        """Subscribes a sink to a key expression.

        Raises:
            WatchError: If it cannot be watched.
        """
        feed = self._feeds.get(expression)
        if feed is None:
            feed = self._feeds[expression] = Feed(self._session, expression, self.turns)
        feed.join(sink)

    def leave(self, expression: str, sink: Sink) -> None:
        """Unsubscribes it; the last one ends the subscription, so that nobody draws for nobody."""
        feed = self._feeds.get(expression)
        if feed is not None and feed.leave(sink):
            del self._feeds[expression]
            feed.close()

    def close(self) -> None:
        """Ends every subscription."""
        for feed in self._feeds.values():
            feed.close()
        self._feeds.clear()


def check_expression(expression: str) -> topics.Topic:
    """The row of the topic table that a key expression watches.

    Raises:
        WatchError: If it names no topic, or wildcards more than site and robot.
    """
    try:
        key = keys.parse_expression(expression)
        for name, what in ((key.site, "site"), (key.robot, "robot")):
            if name not in ("*", keys.WHOLE_SITE):
                keys.check_name(name, what)
        row = topics.topic(key.topic)
        all_of_it = key.topic == row.name and row.history is History.LAST_100  # events/*: whoever's
        if "*" in key.topic and not all_of_it:
            raise WatchError(
                f"{expression!r} cannot be watched: name the view, '*' stands for site and robot only"
            )
        if row.history is History.KEY_FRAME and "*" in expression:
            raise WatchError(f"{expression!r} cannot be watched: name the site and the robot of a video")
        if row.name.endswith("/*") and not all_of_it:
            keys.check_chunk(key.topic.split("/", 1)[1], "view")
    except BusError as error:
        raise WatchError(f"{expression!r} cannot be watched: {error}") from None
    if topics.Role.CONSOLE not in row.subscribers:
        raise WatchError(f"{expression!r} cannot be watched: the console has no right to {row.name}")
    return row
