"""One view of one robot: scheduling, drawing and publishing of its video and pictures."""

import asyncio
import logging
import math
import time
from collections.abc import Coroutine, Sequence
from dataclasses import replace
from typing import Any, Protocol

from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo

from renderer.drawing.studio import Drawn
from renderer.errors import RendererError
from renderer.pictures.composition import Composition, RobotSnapshot, compose, looks
from renderer.pictures.overlay import inside
from renderer.pictures.post_processing import EncodedPicture, PictureJob
from renderer.pictures.requested_views import IMAGE_HZ, ViewSpec
from renderer.pictures.robot_state import Ages, RobotState
from renderer.service.frame_scheduler import due_with_placements, next_due
from renderer.service.key_frames import KeyFrameClock
from robomesh.wire.session import Session

log = logging.getLogger(__name__)

# Rate of a picture in which nothing moves: subscribers see that the stream is alive, and its age.
_IDLE_HZ = 2.0
# After a requested key frame as many pictures follow at the full rate: ffmpeg, and what is built on it, shows
# nothing before it has measured the rate on 20 pictures, at rest 10 s.
_MEASURED_PICTURES = 22
_TRY_AGAIN_S = 5.0
_MOST_ASKERS = 64


class StreamHost(Protocol):
    """The renderer's functions that a stream uses."""

    @property
    def coarse(self) -> bool:
        """True while pictures are drawn without anti-aliasing."""

    def ages(self, state: RobotState) -> Ages:
        """Return the current ages of a robot's topics."""

    def neighbours(self, state: RobotState) -> Sequence[RobotState]:
        """Return the other robots of the robot's cell."""

    async def catch_up(self, state: RobotState) -> None:
        """Update the state of a robot and its cell, which is older while no stream shows them."""

    def watchers_changed(self, stream: "Stream") -> None:
        """React to a stream that has gained or lost subscribers."""

    async def draw(self, stream: str, spec: ViewSpec, composition: Composition) -> Drawn:
        """Return the picture without its overlay."""

    async def process(self, drawn: Drawn, job: PictureJob) -> EncodedPicture:
        """Write the overlay on a picture and encode it."""


class Stream:
    """A view's video and still pictures, drawn only while they have subscribers or are requested.

    Attributes:
        name: `<robot>/<view>`.
        unwatched_since: When the last subscriber left, or the view was requested [s]; None: it is watched.
        awaited: It has had no subscriber since it was requested.
        askers: The operators who requested it; it counts for the first one.
    """

    def __init__(self, session: Session, state: RobotState, spec: ViewSpec, host: StreamHost) -> None:
        """Declare the view's topics."""
        self.state, self.spec = state, spec
        self.askers: list[str] = []
        self.name = f"{state.name}/{spec.name}"
        self.unwatched_since: float | None = time.monotonic()
        self.awaited = True
        self._host = host
        self._closed = False
        self._video = session.declare_publisher(state.site, state.name, f"video/{spec.name}")
        self._image = session.declare_publisher(
            state.site, state.name, f"image/{spec.name}", on_get=self._answer_get
        )
        self._frame_id = f"{state.site}/{state.name}/camera/{spec.name}"
        self._key_frames = KeyFrameClock()
        self._video_watched = self._image_watched = False
        self._drawn_version: tuple[int, ...] = ()
        self._at_full_rate = 0  # pictures left of `_MEASURED_PICTURES`
        # What the last picture shows; and that picture, kept from the second one on that shows the same.
        self._shown: tuple[object, ...] = ()
        self._repeated: Drawn | None = None
        self._next_frame_at = self._drawn_at = self._image_at = self._not_before = -math.inf
        self._last_image: CompressedImage | None = None
        self._still: asyncio.Task[None] | None = None
        for publisher in (self._video, self._image):
            publisher.on_watched(self.update_watchers)

    @property
    def watched(self) -> bool:
        """True if the video or the pictures have subscribers."""
        return self._video_watched or self._image_watched

    @property
    def due_at(self) -> float:
        """Time at which the next picture is due [s]."""
        if self._video_watched and self._key_frames.asked:
            return self._not_before
        if self._moves():
            moved_at = max(state.moved_at for state in (self.state, *self._host.neighbours(self.state)))
            return max(due_with_placements(self._next_frame_at, moved_at), self._not_before)
        return max(self._drawn_at + 1.0 / _IDLE_HZ, self._not_before)

    @property
    def wanted_hz(self) -> float:
        """Current rate of pictures to draw [1/s]."""
        return self._rate_hz if self._moves() else _IDLE_HZ

    def update_watchers(self) -> None:
        """Check for subscribers; called when their number changes."""
        video, image = self._video.watched, self._image.watched
        if (video, image) == (self._video_watched, self._image_watched):
            return
        now = time.monotonic()
        if video and not self._video_watched:
            # Otherwise a new subscriber's first picture would be one from before the stream paused.
            self._key_frames.ask(now)
        if (video or image) and not self.watched:
            self._next_frame_at = self._drawn_at = -math.inf
        self._video_watched, self._image_watched = video, image
        self.unwatched_since = None if self.watched else now
        self.awaited = False
        self._host.watchers_changed(self)

    def request_key_frame(self) -> bool:
        """Make the next picture a key frame; return False if the last one is younger than a second."""
        return self._key_frames.ask(time.monotonic())

    def restart_timeout(self, asker: str = "") -> None:
        """Restart the time for a subscriber to appear; called for each request of the view.

        Args:
            asker: The operator who requested it; empty for a request of a single picture.
        """
        if asker and asker not in self.askers and len(self.askers) < _MOST_ASKERS:
            self.askers.append(asker)
        if self.unwatched_since is not None:
            self.unwatched_since, self.awaited = time.monotonic(), True

    def close(self) -> None:
        """Stop publishing and answering."""
        self._closed = True
        self._video.close()
        self._image.close()

    async def draw(self, now: float) -> Coroutine[Any, Any, None]:
        """Draw the picture that is due; return a coroutine that encodes and publishes it."""
        await self._host.catch_up(self.state)
        self._next_frame_at = next_due(self._next_frame_at, now, 1.0 / self._rate_hz)
        self._drawn_at = now
        self._drawn_version = self._version()
        video = self._video_watched
        image = self._image_watched and now - self._image_at >= 0.9 / self.spec.image_hz
        return await self._drawn(now, video=video, image=image) if video or image else _nothing()

    @property
    def _rate_hz(self) -> float:
        return self.spec.fps if self._video_watched else self.spec.image_hz

    def _moves(self) -> bool:
        measured = self._video_watched and self._at_full_rate > 0
        return measured or self._version() != self._drawn_version

    def _version(self) -> tuple[int, ...]:
        return (self.state.version, *(other.version for other in self._host.neighbours(self.state)))

    async def _drawn(self, now: float, *, video: bool, image: bool) -> Coroutine[Any, Any, None]:
        """Draw; after an error only this view pauses, and is retried later."""
        state, appearance = self.state, self.state.appearance
        if appearance is None:
            return _nothing()
        try:
            robot, *neighbours = map(self._snapshot, (state, *self._host.neighbours(state)))
            composition = compose(self.spec, appearance, robot, neighbours)
            source_time_ns, dated_by = state.source_time_ns or time.time_ns(), state.dated_by
            drawn = await self._draw(
                composition, (self._version(), self._host.coarse, *map(looks, (robot, *neighbours)))
            )
        except Exception as error:
            self._failed(now, error)
            return _nothing()
        key_frame = video and self._key_frames.due(now)
        self._at_full_rate = max(self._at_full_rate - 1, 0)
        if key_frame:
            if self._key_frames.asked:
                self._at_full_rate = _MEASURED_PICTURES
            self._key_frames.made(now)
        job = PictureJob(
            stream=self.name,
            spec=self.spec,
            overlay=inside(composition.overlay, drawn.inside),
            clearance_line=composition.clearance_line,
            # A close-up is too small for a legible label.
            labelled=not composition.follow,
            video=video,
            key_frame=key_frame,
            image=image,
        )
        return self._publish(now, drawn, job, source_time_ns, dated_by)

    async def _draw(self, composition: Composition, shown: tuple[object, ...]) -> Drawn:
        """Draw, or copy the last picture if this one shows the same, as of an arm at rest.

        Drawing takes most of a picture's time without a GPU; the overlay is written in each picture.
        """
        trail = self.spec.show is not None and self.spec.show.trail
        again = shown == self._shown and not trail
        if not again:
            self._shown, self._repeated = shown, None
        if (drawn := self._repeated) is None:
            drawn = await self._host.draw(self.name, self.spec, composition)
            if again and shown == self._shown:  # not of another picture meanwhile
                self._repeated = drawn
        return replace(drawn, picture=drawn.picture.copy()) if again else drawn

    def _snapshot(self, state: RobotState) -> RobotSnapshot:
        return RobotSnapshot(state, self._host.ages(state))

    async def _publish(
        self, now: float, drawn: Drawn, job: PictureJob, source_time_ns: int, dated_by: int | None
    ) -> None:
        # The encoder of a closed stream has been released; a new one would never be released.
        encoded = None if self._closed else await self._encoded(now, drawn, job)
        if encoded is None or self._closed:
            return
        if encoded.packet is not None:
            message = CompressedVideo(frame_id=self._frame_id, data=encoded.packet.data, format="h264")
            message.timestamp.FromNanoseconds(source_time_ns)
            self._video.put(
                message,
                source_time_ns=source_time_ns,
                dated_by=dated_by,
                key_frame=encoded.packet.key_frame,
            )
        if encoded.jpeg is not None:
            self._image_at = now
            picture = CompressedImage(frame_id=self._frame_id, data=encoded.jpeg, format="jpeg")
            picture.timestamp.FromNanoseconds(source_time_ns)
            self._last_image = picture
            if self._image_watched:
                self._image.put(picture, source_time_ns=source_time_ns, dated_by=dated_by)

    async def _encoded(self, now: float, drawn: Drawn, job: PictureJob) -> EncodedPicture | None:
        try:
            return await self._host.process(drawn, job)
        except Exception as error:
            self._failed(now, error)
            return None

    def _failed(self, now: float, error: Exception) -> None:
        where = f"{self.state.site}/{self.name}"
        if isinstance(error, RendererError):
            log.error("%s: %s; retry in %g s", where, error, _TRY_AGAIN_S)
        else:
            log.exception("%s could not be drawn; retry in %g s", where, _TRY_AGAIN_S)
        # A new encoder begins with a key frame.
        self._key_frames = KeyFrameClock()
        # The last picture is out of date.
        self._last_image = None
        self._not_before = now + _TRY_AGAIN_S

    async def _answer_get(self) -> CompressedImage | None:
        """Return a current picture; concurrent requests share one."""
        self.restart_timeout()
        now = time.monotonic()
        if self._last_image is None or now - self._image_at >= 1.0 / IMAGE_HZ:
            if self._still is None or self._still.done():
                self._still = asyncio.create_task(self._draw_still(now))
            await asyncio.shield(self._still)
        return self._last_image

    async def _draw_still(self, now: float) -> None:
        if now >= self._not_before:
            await self._host.catch_up(self.state)
            await (await self._drawn(now, video=False, image=True))


async def _nothing() -> None:
    return
