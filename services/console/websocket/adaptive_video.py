"""One view as one browser watches it: as much of it as its line takes, and never later.

Frames that wait for the line are a line that takes less than it is given: the same view is then asked
for in a smaller size, rate and number of bits (`views.Views.reduced`), which all such browsers share.
After a while without waiting it tries the step above; each time that was too much, it waits longer.
"""

import asyncio
import contextlib
import logging
import math
import time
from collections.abc import AsyncIterator, Callable

from robomesh.errors import BusError
from robomesh.subscription import Sample
from services.console.requested_views import LOWEST_STEP, Views
from services.console.websocket.framing import Moment
from services.console.websocket.send_queues import VideoLane, begins_video
from services.console.websocket.shared_subscriptions import Feeds

log = logging.getLogger(__name__)

_LATE_S = 0.25
# Frames since the last key frame come at once, and the system still holds some of what was before.
_SETTLED_AFTER_S = 0.6
_MIND_EACH_S = 1.0
_SILENT_S = 4.0  # a reduced view that ended (its renderer began anew) is left
_KEY_FRAME_WITHIN_S = 3.0
# Where there is no less of it, or nobody answers: frames that are late come 30 times a second.
_ASK_AGAIN_AFTER_S = 5.0
_TRY_MORE_AFTER_S = (10.0, 160.0)
_TOO_MUCH_WITHIN_S = 8.0


class SteppedVideo:
    """A browser's watch of one view.

    Args:
        asker: In whose name less of it is asked for.

    Attributes:
        key: As the browser named it, and as its samples are named whatever is watched for it.
        step: How far it is reduced; 0: not at all.
    """

    def __init__(
        self,
        key: str,
        feeds: Feeds,
        views: Views,
        *,
        asker: str,
        on_frame: Callable[[], None],
        on_starved: Callable[[str], None],
    ) -> None:
        self.key, self.step = key, 0
        self._feeds, self._views, self._asker = feeds, views, asker
        self._on_frame, self._on_starved = on_frame, on_starved
        self._lane = VideoLane()
        self._source: str | None = None
        self._changing: asyncio.Task[None] | None = None
        self._minding: asyncio.Task[None] | None = None
        self._pushed_at = self._late_at = time.monotonic()
        self._joined_at = self._pushed_at
        self._raised_at = self._refused_at = -math.inf
        self._too_much = False
        self._try_more_after_s = _TRY_MORE_AFTER_S[0]
        self._join(key)

    def close(self) -> None:
        """Watches no more."""
        for task in (self._changing, self._minding):
            if task is not None:
                task.cancel()
        self._leave()

    def pop(self) -> Sample | None:
        """The next frame to send, to a line that takes something now."""
        if self._too_much:
            self._step_down()
        return self._lane.pop()

    def _push(self, moment: Moment) -> None:
        self._pushed_at = time.monotonic()
        for sample in moment.samples:
            self._lane.push(sample)
            if self._lane.starved:
                self._on_starved(sample.key)
        if self._lane.waited_s() > _LATE_S:
            self._late()
        self._on_frame()

    def _late(self) -> None:
        now = time.monotonic()
        if now - self._joined_at < _SETTLED_AFTER_S:
            return
        self._late_at = now
        self._lane.skip()
        # Less of it is drawn for who takes some of it, not for who takes nothing.
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
        if self._minding is None:
            self._minding = asyncio.create_task(self._mind())

    async def _mind(self) -> None:
        """While reduced: leaves what fell silent, and tries for more."""
        while True:
            await asyncio.sleep(_MIND_EACH_S)
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
        except BusError as error:
            # There is no less of it: frames are left out, and it goes on at key frames.
            log.debug("%s is not reduced: %s", self.key, error)
            self._refused_at = time.monotonic()
        else:
            async with self._beginning(source) if step < self.step else contextlib.nullcontext():
                self._leave()
                self._lane = VideoLane()
                self._too_much = False
                self.step = step
                self._pushed_at = self._late_at = time.monotonic()
                self._join(source)
        finally:
            self._changing = None

    @contextlib.asynccontextmanager
    async def _beginning(self, source: str) -> AsyncIterator[None]:
        """Waits for a key frame of what is more: all that came since an older one is too much at once."""
        came = asyncio.Event()
        held = True

        def look(moment: Moment) -> None:
            if not held and any(each.live and begins_video(each) for each in moment.samples):
                came.set()

        self._feeds.join(source, look)
        held = False
        try:
            self._on_starved(source)
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(_KEY_FRAME_WITHIN_S):
                    await came.wait()
            yield
        finally:
            self._feeds.leave(source, look)

    def _join(self, source: str) -> None:
        self._source, self._joined_at = source, time.monotonic()
        self._feeds.join(source, self._push)

    def _leave(self) -> None:
        if self._source is not None:
            self._feeds.leave(self._source, self._push)
            self._source = None
