"""One view as one browser watches it: reduced to what its line can carry, without added delay.

If frames have to wait, the view is replaced by one of a smaller size, rate and bit rate (`Views.reduced`),
which all slow browsers share. After some time without waiting, the next larger step is tried; after each
failure the time is doubled.
"""

import asyncio
import contextlib
import logging
import math
import time
from collections.abc import AsyncIterator, Callable

from robomesh.errors import RobomeshError
from robomesh.publications.subscription import Sample
from services.console.common.requested_views import LOWEST_STEP, Views
from services.console.websocket.framing import SampleBatch
from services.console.websocket.send_queues import VideoQueue, begins_video
from services.console.websocket.shared_subscriptions import SharedSubscriptions

log = logging.getLogger(__name__)

_LATE_S = 0.25
# Frames since the last key frame arrive in one burst, and the system still buffers some of the old ones.
_SETTLED_AFTER_S = 0.6
_ADAPT_EVERY_S = 1.0
_SILENT_S = 4.0  # a reduced view that has ended (its renderer restarted) is left
_KEY_FRAME_WITHIN_S = 3.0
# Interval of requests for a reduced view that is not available; late frames come 30 times a second.
_ASK_AGAIN_AFTER_S = 5.0
_TRY_MORE_AFTER_S = (10.0, 160.0)
_TOO_MUCH_WITHIN_S = 8.0


class AdaptiveVideo:
    """A browser's subscription to one view.

    Args:
        asker: Name for requests of reduced views.

    Attributes:
        key: Key that the browser watches; its samples keep it at every step.
        step: Reduction; 0: none.
    """

    def __init__(
        self,
        key: str,
        subscriptions: SharedSubscriptions,
        views: Views,
        *,
        asker: str,
        on_frame: Callable[[], None],
        on_starved: Callable[[str], None],
    ) -> None:
        self.key, self.step = key, 0
        self._subscriptions, self._views, self._asker = subscriptions, views, asker
        self._on_frame, self._on_starved = on_frame, on_starved
        self._queue = VideoQueue()
        self._source: str | None = None
        self._changing: asyncio.Task[None] | None = None
        self._adapting: asyncio.Task[None] | None = None
        self._pushed_at = self._late_at = time.monotonic()
        self._joined_at = self._pushed_at
        self._raised_at = self._refused_at = -math.inf
        self._too_much = False
        self._try_more_after_s = _TRY_MORE_AFTER_S[0]
        self._join(key)

    def close(self) -> None:
        """Unsubscribe."""
        for task in (self._changing, self._adapting):
            if task is not None:
                task.cancel()
        self._leave()

    def pop(self) -> Sample | None:
        """Return the next frame; called when the line accepts data."""
        if self._too_much:
            self._step_down()
        return self._queue.pop()

    def _push(self, batch: SampleBatch) -> None:
        self._pushed_at = time.monotonic()
        for sample in batch.samples:
            self._queue.push(sample)
            if self._queue.starved:
                self._on_starved(sample.key)
        if self._queue.waited_s() > _LATE_S:
            self._late()
        self._on_frame()

    def _late(self) -> None:
        now = time.monotonic()
        if now - self._joined_at < _SETTLED_AFTER_S:
            return
        self._late_at = now
        self._queue.skip()
        # Reduce it in `pop` only: a browser that accepts nothing needs no reduced view.
        self._too_much = True

    def _step_down(self) -> None:
        now = time.monotonic()
        self._too_much = False
        if self._changing is not None or self.step == LOWEST_STEP:
            return
        if now - self._refused_at < _ASK_AGAIN_AFTER_S:
            return
        if now - self._raised_at < _TOO_MUCH_WITHIN_S:
            self._try_more_after_s = min(2 * self._try_more_after_s, _TRY_MORE_AFTER_S[1])
        self._changing = asyncio.create_task(self._change(self.step + 1))
        if self._adapting is None:
            self._adapting = asyncio.create_task(self._adapt())

    async def _adapt(self) -> None:
        """While reduced: leave a silent view, and try the next larger step."""
        while True:
            await asyncio.sleep(_ADAPT_EVERY_S)
            now = time.monotonic()
            if self._changing is not None or self.step == 0:
                continue
            if now - self._pushed_at > _SILENT_S:
                self._changing = asyncio.create_task(self._change(0))
            elif now - self._late_at > self._try_more_after_s:
                self._raised_at = self._late_at = now
                self._changing = asyncio.create_task(self._change(self.step - 1))

    async def _change(self, step: int) -> None:
        try:
            source = await self._views.reduced(self.key, step, self._asker)
        except RobomeshError as error:
            # Not available: frames are dropped instead, and the video continues at key frames.
            log.debug("%s is not reduced: %s", self.key, error)
            self._refused_at = time.monotonic()
        else:
            async with self._beginning(source) if step < self.step else contextlib.nullcontext():
                self._leave()
                self._queue = VideoQueue()
                self._too_much = False
                self.step = step
                self._pushed_at = self._late_at = time.monotonic()
                self._join(source)
        finally:
            self._changing = None

    @contextlib.asynccontextmanager
    async def _beginning(self, source: str) -> AsyncIterator[None]:
        """Wait for a key frame of the larger view: all frames since an older one would be too much."""
        came = asyncio.Event()
        held = True

        def look(batch: SampleBatch) -> None:
            if not held and any(each.live and begins_video(each) for each in batch.samples):
                came.set()

        self._subscriptions.join(source, look)
        held = False
        try:
            self._on_starved(source)
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(_KEY_FRAME_WITHIN_S):
                    await came.wait()
            yield
        finally:
            self._subscriptions.leave(source, look)

    def _join(self, source: str) -> None:
        self._source, self._joined_at = source, time.monotonic()
        self._subscriptions.join(source, self._push)

    def _leave(self) -> None:
        if self._source is not None:
            self._subscriptions.leave(self._source, self._push)
            self._source = None
