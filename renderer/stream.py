"""One view of one robot: when it is drawn, and what is published of it."""

import asyncio
import logging
import math
import time
from collections.abc import Coroutine, Sequence
from typing import Any, Protocol

from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo

from renderer.composition import Composition, Known, composed
from renderer.errors import RendererError
from renderer.frame_scheduler import next_due
from renderer.key_frames import KeyFrameClock
from renderer.overlay import inside
from renderer.post_processing import Finished, Order
from renderer.requested_views import IMAGE_HZ, Shot
from renderer.robot_state import Ages, RobotState
from renderer.studio import Drawn
from robomesh.session import Session

log = logging.getLogger(__name__)

# A picture in which nothing moves still tells that it is alive, and its age.
_IDLE_HZ = 2.0
_TRY_AGAIN_S = 5.0
_MOST_ASKERS = 64


class Workshop(Protocol):
    """What a stream needs of the renderer that it is one of."""

    def ages(self, state: RobotState) -> Ages:
        """How old what is known of a robot is, now."""

    def neighbours(self, state: RobotState) -> Sequence[RobotState]:
        """The other robots of its cell."""

    def watched(self, stream: "Stream") -> None:
        """Somebody came to the stream, or went."""

    async def draw(self, stream: str, shot: Shot, composition: Composition) -> Drawn:
        """The picture, before anything is written over it."""

    async def finish(self, drawn: Drawn, order: Order) -> Finished:
        """What becomes of a picture."""


class Stream:
    """A view's video and still pictures, drawn only while somebody watches or asks.

    Attributes:
        name: Of the robot and the view.
        quiet_since: When the last watcher left, or somebody asked for it [s]; None: it is watched.
        awaited: Nobody has watched since it was asked for.
        askers: In whose names it was asked for; it counts for the first one.
    """

    def __init__(self, session: Session, state: RobotState, shot: Shot, workshop: Workshop) -> None:
        """Declare the view's topics."""
        self.state, self.shot = state, shot
        self.askers: list[str] = []
        self.name = f"{state.name}/{shot.name}"
        self.quiet_since: float | None = time.monotonic()
        self.awaited = True
        self._workshop = workshop
        self._closed = False
        self._video = session.declare_publisher(state.site, state.name, f"video/{shot.name}")
        self._image = session.declare_publisher(
            state.site, state.name, f"image/{shot.name}", on_get=self._answer_get
        )
        self._frame_id = f"{state.site}/{state.name}/camera/{shot.name}"
        self._key_frames = KeyFrameClock()
        self._video_watched = self._image_watched = False
        self._drawn_version: tuple[int, ...] = ()
        self._beat_at = self._drawn_at = self._image_at = self._not_before = -math.inf
        self._last_image: CompressedImage | None = None
        self._still: asyncio.Task[None] | None = None
        for publisher in (self._video, self._image):
            publisher.on_watched(self.look_for_watchers)

    @property
    def watched(self) -> bool:
        """Whether anybody watches."""
        return self._video_watched or self._image_watched

    @property
    def due_at(self) -> float:
        """From when on it is to be drawn, as things stand [s]."""
        if self._video_watched and self._key_frames.asked:
            return self._not_before
        if self._changed():
            return max(self._beat_at, self._not_before)
        return max(self._drawn_at + 1.0 / _IDLE_HZ, self._not_before)

    @property
    def wanted_hz(self) -> float:
        """Pictures that are to be drawn a second, as things stand."""
        return self._rate_hz if self._changed() else _IDLE_HZ

    def look_for_watchers(self) -> None:
        """See who watches: called when somebody comes or goes."""
        video, image = self._video.watched, self._image.watched
        if (video, image) == (self._video_watched, self._image_watched):
            return
        now = time.monotonic()
        if video and not self._video_watched:
            # Who comes to a stream that stood still would see where the robot was long ago.
            self._key_frames.ask(now)
        if (video or image) and not self.watched:
            self._beat_at = self._drawn_at = -math.inf
        self._video_watched, self._image_watched = video, image
        self.quiet_since = None if self.watched else now
        self.awaited = False
        self._workshop.watched(self)

    def ask_key_frame(self) -> bool:
        """Make the next picture a key frame; False: the last one is younger than a second."""
        return self._key_frames.ask(time.monotonic())

    def stay(self, asker: str = "") -> None:
        """Somebody asked for it: who is about to watch has as long as who comes first.

        Args:
            asker: In whose name; empty: nobody's, a picture alone was asked for.
        """
        if asker and asker not in self.askers and len(self.askers) < _MOST_ASKERS:
            self.askers.append(asker)
        if self.quiet_since is not None:
            self.quiet_since, self.awaited = time.monotonic(), True

    def close(self) -> None:
        """Publish and answer no more."""
        self._closed = True
        self._video.close()
        self._image.close()

    async def draw(self, now: float) -> Coroutine[Any, Any, None]:
        """Draw the picture that is due; what is then still to be done for it."""
        self._beat_at = next_due(self._beat_at, now, 1.0 / self._rate_hz)
        self._drawn_at = now
        self._drawn_version = self._version()
        video = self._video_watched
        image = self._image_watched and now - self._image_at >= 0.9 / self.shot.image_hz
        return await self._drawn(now, video=video, image=image) if video or image else _nothing()

    @property
    def _rate_hz(self) -> float:
        return self.shot.fps if self._video_watched else self.shot.image_hz

    def _changed(self) -> bool:
        return self._version() != self._drawn_version

    def _version(self) -> tuple[int, ...]:
        return (self.state.version, *(other.version for other in self._workshop.neighbours(self.state)))

    async def _drawn(self, now: float, *, video: bool, image: bool) -> Coroutine[Any, Any, None]:
        """Draw; a fault is this view's alone, which is tried again later."""
        state, look = self.state, self.state.look
        if look is None:
            return _nothing()
        try:
            neighbours = [self._as_known(each) for each in self._workshop.neighbours(state)]
            composition = composed(self.shot, look, self._as_known(state), neighbours)
            source_time_ns, dated_by = state.source_time_ns or time.time_ns(), state.dated_by
            drawn = await self._workshop.draw(self.name, self.shot, composition)
        except Exception as error:
            self._failed(now, error)
            return _nothing()
        key_frame = video and self._key_frames.due(now)
        if key_frame:
            self._key_frames.made(now)
        order = Order(
            stream=self.name,
            shot=self.shot,
            overlay=inside(composition.overlay, drawn.inside),
            span=composition.span,
            # A close-up is too small to be read.
            labelled=not composition.follow,
            video=video,
            key_frame=key_frame,
            image=image,
        )
        return self._publish(now, drawn, order, source_time_ns, dated_by)

    def _as_known(self, state: RobotState) -> Known:
        return Known(state, self._workshop.ages(state))

    async def _publish(
        self, now: float, drawn: Drawn, order: Order, source_time_ns: int, dated_by: int | None
    ) -> None:
        # Of a stream that is closed the encoder is released, and a new one would be nobody's.
        finished = None if self._closed else await self._finished(now, drawn, order)
        if finished is None or self._closed:
            return
        if finished.packet is not None:
            message = CompressedVideo(frame_id=self._frame_id, data=finished.packet.data, format="h264")
            message.timestamp.FromNanoseconds(source_time_ns)
            self._video.put(
                message,
                source_time_ns=source_time_ns,
                dated_by=dated_by,
                key_frame=finished.packet.key_frame,
            )
        if finished.jpeg is not None:
            self._image_at = now
            picture = CompressedImage(frame_id=self._frame_id, data=finished.jpeg, format="jpeg")
            picture.timestamp.FromNanoseconds(source_time_ns)
            self._last_image = picture
            if self._image_watched:
                self._image.put(picture, source_time_ns=source_time_ns, dated_by=dated_by)

    async def _finished(self, now: float, drawn: Drawn, order: Order) -> Finished | None:
        try:
            return await self._workshop.finish(drawn, order)
        except Exception as error:
            self._failed(now, error)
            return None

    def _failed(self, now: float, error: Exception) -> None:
        where = f"{self.state.site}/{self.name}"
        if isinstance(error, RendererError):
            log.error("%s: %s; tried again in %g s", where, error, _TRY_AGAIN_S)
        else:
            log.exception("%s could not be drawn; tried again in %g s", where, _TRY_AGAIN_S)
        # A new encoder begins with a key frame.
        self._key_frames = KeyFrameClock()
        # What was drawn before is not how it is now.
        self._last_image = None
        self._not_before = now + _TRY_AGAIN_S

    async def _answer_get(self) -> CompressedImage | None:
        """A picture of now; many askers share one."""
        self.stay()
        now = time.monotonic()
        if self._last_image is None or now - self._image_at >= 1.0 / IMAGE_HZ:
            if self._still is None or self._still.done():
                self._still = asyncio.create_task(self._draw_still(now))
            await asyncio.shield(self._still)
        return self._last_image

    async def _draw_still(self, now: float) -> None:
        if now >= self._not_before:
            await (await self._drawn(now, video=False, image=True))


async def _nothing() -> None:
    return
