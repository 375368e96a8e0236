"""One view of one robot: when it is drawn, and what is published of it."""

import logging
import math
import time
from collections.abc import Awaitable, Callable

from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo

from bus.session import Session
from renderer.errors import RendererError
from renderer.key_frames import KeyFrameClock
from renderer.look import CLOSE, Look, camera_of, scene_of
from renderer.state import (
    STALE_AFTER_S,
    Ages,
    RobotState,
    age_s,
    overlay_of,
    placements_now,
    warning_of,
)
from renderer.studio import Job, Painted

log = logging.getLogger(__name__)

Paint = Callable[[Job], Awaitable[Painted]]

# A picture in which nothing moves still tells that it is alive, and its age.
_IDLE_HZ = 2.0
_IMAGE_HZ = 5.0
_TRY_AGAIN_S = 5.0


class Stream:
    """A view's video and still pictures, drawn only while somebody watches or asks."""

    def __init__(
        self,
        session: Session,
        state: RobotState,
        look: Look,
        view: str,
        *,
        fps: float,
        ages: Callable[[], Ages],
        paint: Paint,
    ) -> None:
        """Declare the view's topics.

        Args:
            ages: Of the robot's topics, now.
            paint: Makes pictures, one at a time.

        Raises:
            UnknownViewError: If the robot has no such view.
        """
        camera_of(look, view)
        self.state, self.view = state, view
        self._fps, self._ages, self._paint = fps, ages, paint
        self._video = session.declare_publisher(state.site, state.name, f"video/{view}")
        self._image = session.declare_publisher(
            state.site, state.name, f"image/{view}", on_get=self._answer_get
        )
        self._name = state.site, state.name, view
        self._frame_id = f"{state.site}/{state.name}/camera/{view}"
        self._key_frames = KeyFrameClock()
        self._watched = False
        self._drawn_version = -1
        self._drawn_at = self._image_at = -math.inf
        self._last_image: CompressedImage | None = None

    def ask_key_frame(self) -> bool:
        """Make the next picture a key frame; False: the last one is younger than a second."""
        return self._key_frames.ask(time.monotonic())

    async def paint_if_due(self) -> None:
        """Draw and publish, if somebody watches and it is time to."""
        video, image = self._video.watched, self._image.watched
        if not (video or image):
            self._watched = False
            return
        now = time.monotonic()
        if now < self._drawn_at:
            return
        if video and not self._watched:
            # Who comes to a stream that stood still would see where the robot was long ago.
            self._key_frames.ask(now)
            self._drawn_at = -math.inf
        self._watched = video
        changed = self.state.version != self._drawn_version
        rate = _IDLE_HZ if not changed else self._fps if video else _IMAGE_HZ
        # A tick that comes a hair early is taken: the next would be a whole one late.
        if now - self._drawn_at < 0.9 / rate and not (video and self._key_frames.asked):
            return
        image = image and now - self._image_at >= 0.9 / _IMAGE_HZ
        if not (video or image):
            return
        self._drawn_at, self._drawn_version = now, self.state.version
        try:
            await self._draw(now, video=video, image=image)
        except RendererError as error:
            log.error("%s/%s %s: %s; tried again in %g s", *self._name, error, _TRY_AGAIN_S)
            # A new encoder begins with a key frame.
            self._key_frames = KeyFrameClock()
            self._drawn_at = now + _TRY_AGAIN_S

    async def _draw(self, now: float, *, video: bool, image: bool) -> None:
        state, look = self.state, self.state.look
        if look is None or self.view not in look.cameras:
            return  # a newer description has no such view: silence, and the age tells
        age = age_s(state, self._ages())
        source_time_ns = state.source_time_ns or time.time_ns()
        key_frame = video and self._key_frames.due(now)
        close = self.view == CLOSE
        painted = await self._paint(
            Job(
                stream=f"{state.name}/{self.view}",
                scene=scene_of(look, placements_now(state, look), stale=age > STALE_AFTER_S),
                camera=camera_of(look, self.view),
                follow=close,
                overlay=warning_of(state, age=age) if close else overlay_of(state, look, self.view, age=age),
                video=video,
                key_frame=key_frame,
                image=image,
            )
        )
        if painted.packet is not None:
            if painted.packet.key_frame:
                self._key_frames.made(now)
            message = CompressedVideo(frame_id=self._frame_id, data=painted.packet.data, format="h264")
            message.timestamp.FromNanoseconds(source_time_ns)
            self._video.put(message, source_time_ns=source_time_ns, key_frame=painted.packet.key_frame)
        if painted.jpeg is not None:
            self._image_at = now
            picture = CompressedImage(frame_id=self._frame_id, data=painted.jpeg, format="jpeg")
            picture.timestamp.FromNanoseconds(source_time_ns)
            self._last_image = picture
            if self._image.watched:
                self._image.put(picture, source_time_ns=source_time_ns)

    async def _answer_get(self) -> CompressedImage | None:
        """A picture of now; many askers share one."""
        now = time.monotonic()
        if self._last_image is None or now - self._image_at >= 1.0 / _IMAGE_HZ:
            await self._draw(now, video=False, image=True)
        return self._last_image
