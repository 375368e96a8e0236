"""The renderer service: video and pictures of a site's robots, drawn only while a subscriber watches."""

import asyncio
import contextlib
import logging
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import ParamSpec, TypeVar

import cv2
from pydantic import Field

from renderer.drawing.studio import Drawn, Studio, open_thread
from renderer.encoding.encoder import best_codec
from renderer.errors import NoRoomError, RendererError, UnknownViewError, ViewError
from renderer.pictures.composition import Composition
from renderer.pictures.post_processing import EncodedPicture, PictureJob, PostProcessor
from renderer.pictures.requested_views import ViewSpec, low_rate_view, requested_view, standard_view
from renderer.pictures.robot_state import Ages, RobotState
from renderer.scene.views import camera_of, view_names
from renderer.service.encoding_threads import EncodingThread, EncodingThreads, thread_count
from renderer.service.frame_scheduler import FrameScheduler, next_view
from renderer.service.robots import Robots
from renderer.service.stream import Stream
from renderer.service.view_budget import ViewBudget
from renderer.settings import Renderer
from renderer.shapes.cache import cache_folder
from robomesh import reason_codes as codes
from robomesh.contract.keys import CLOSE, FAR, FREE, WHOLE_SITE
from robomesh.contract.quotas import DEFAULT_QUOTAS, Quota, Quotas
from robomesh.errors import RefusedError
from robomesh.requests.server import Request, RequestServer
from robomesh.schemas.robomesh_pb2 import Event, KeyFrameAnswer, ViewAnswer, ViewRequest
from robomesh.wire.session import Session

log = logging.getLogger(__name__)

P = ParamSpec("P")
T = TypeVar("T")

_TIDY_EACH_S = 1.0
# A requested view ends if its first subscriber takes longer than this, or a new one after the last left.
_FIRST_WATCHER_WITHIN_S, _NEXT_WATCHER_WITHIN_S = 10.0, 5.0


class Settings(Renderer):
    """A site's renderer.

    Attributes:
        robots: Names of the robots to draw; empty: every robot of the site.
        quotas: Quotas of each operator.
        folder: Cache folder of the shapes.
    """

    site: str
    robots: tuple[str, ...] = ()
    quotas: Quotas = DEFAULT_QUOTAS
    folder: Path = Field(default_factory=cache_folder)


async def serve(session: Session, settings: Settings) -> None:
    """Render until cancelled.

    Raises:
        RendererError: If OpenGL or the encoder is missing.
    """
    # OpenCV's own threads wait actively: on 16 cores they took a third of the processor time, and saved none.
    cv2.setNumThreads(1)
    with contextlib.ExitStack() as threads:
        drawing = threads.enter_context(open_thread("drawing"))
        encoding = [threads.enter_context(open_thread(f"encoding-{n}")) for n in range(thread_count())]
        studio = await _in(
            drawing,
            Studio,
            settings.size,
            samples=settings.anti_aliasing,
            shading=settings.shading,
            device=settings.device,
            folder=settings.folder,
        )
        try:
            codec = await _in(encoding[0], best_codec, settings.size, settings.fps)
            log.info("drawing with %s; encoding with %s", studio.renderer_name, codec)
            encoders = EncodingThreads(EncodingThread(each, PostProcessor(codec)) for each in encoding)
            await _Renderer(session, settings, (drawing, studio), encoders).run()
        finally:
            drawing.submit(studio.close)


def _in(
    thread: ThreadPoolExecutor, function: Callable[P, T], *args: P.args, **kwargs: P.kwargs
) -> asyncio.Future[T]:
    """Run a function in the given thread."""
    return asyncio.get_running_loop().run_in_executor(thread, partial(function, *args, **kwargs))


class _Renderer:
    """The running service: the known robots and their streams."""

    def __init__(
        self,
        session: Session,
        settings: Settings,
        drawing: tuple[ThreadPoolExecutor, Studio],
        encoders: EncodingThreads,
    ) -> None:
        self._session, self._settings = session, settings
        self._drawing, self._studio = drawing
        self._encoders = encoders
        self._robots = Robots(
            session,
            settings.site,
            self,
            wanted=lambda robot: not settings.robots or robot in settings.robots,
            folder=settings.folder,
        )
        # By robot and view.
        self._streams: dict[tuple[str, str], Stream] = {}
        self._servers: dict[str, list[RequestServer]] = {}
        self._active: set[Stream] = set()
        # None: to be found again.
        self._shown: frozenset[str] | None = frozenset()
        self._wake = asyncio.Event()
        self._scheduler = FrameScheduler()
        self._key_frames = Quota("key_frames", a_minute=settings.quotas.key_frames_a_minute)
        self._view_budget = ViewBudget(
            most_views=settings.most_views,
            quota=settings.quotas.views,
            own_pixels_per_s=standard_view("", size=settings.size, fps=settings.fps).pixels_per_s,
            again_s=_NEXT_WATCHER_WITHIN_S,
        )
        self._pictures = 0
        self._events = session.declare_publisher(settings.site, WHOLE_SITE, "events/renderer")
        session.measure("views", "Views that can be watched", lambda: len(self._streams))
        session.measure("pictures_total", "Pictures drawn", lambda: self._pictures)
        session.measure("views_drawn", "Views with subscribers", lambda: len(self._active))

    async def run(self) -> None:
        async with asyncio.TaskGroup() as group:
            group.create_task(self._robots.follow())
            group.create_task(self._paint_forever())
            group.create_task(self._tidy_forever())

    # ---------------------------------------------------------------- robots

    async def has_shape(self, name: str) -> bool:
        return self._studio.has_shape(name)

    async def add_shape(self, name: str, glb: bytes, color: str) -> None:
        await _in(self._drawing, self._studio.add_shape, name, glb, color)

    @property
    def shown(self) -> frozenset[str]:
        if self._shown is None:
            states = [stream.state for stream in self._active]
            others = [other for state in states for other in self._robots.neighbours(state)]
            self._shown = frozenset(state.name for state in (*states, *others))
        return self._shown

    def on_ready(self, state: RobotState) -> None:
        self._shown = None  # its cell may be another
        if state.name in self._servers:
            return  # the description has changed: its streams continue
        appearance, settings = state.appearance, self._settings
        assert appearance is not None
        names = []
        for name in dict.fromkeys((*settings.views, CLOSE)):
            try:
                camera_of(appearance, name)
            except RendererError as error:
                log.error("%s/%s: %s", state.site, state.name, error)
                continue
            names.append(name)
            self._open(state, standard_view(name, size=settings.size, fps=settings.fps))
        self._open(state, low_rate_view(self._first_view(state), size=settings.size, fps=settings.fps))
        self._servers[state.name] = [
            self._session.answer(
                state.site, state.name, "video/*/keyframe/*", partial(self._answer_key_frame, state)
            ),
            self._session.answer(state.site, state.name, "views/*", partial(self._answer_view, state)),
        ]
        log.info("%s/%s: views %s", state.site, state.name, ", ".join((*names, FAR)))

    def on_changed(self, state: RobotState) -> None:
        if state.name in self.shown:
            self._wake.set()

    def on_removed(self, state: RobotState) -> None:
        self._shown = None
        for server in self._servers.pop(state.name, ()):
            server.close()
        for key in [key for key in self._streams if key[0] == state.name]:
            self._close(key)

    # --------------------------------------------------------------- streams

    def ages(self, state: RobotState) -> Ages:
        return self._robots.ages(state)

    def neighbours(self, state: RobotState) -> Sequence[RobotState]:
        return self._robots.neighbours(state)

    async def catch_up(self, state: RobotState) -> None:
        await self._robots.catch_up(state)

    def watchers_changed(self, stream: Stream) -> None:
        (self._active.add if stream.watched else self._active.discard)(stream)
        self._shown = None
        self._reset_if_unwatched()
        self._wake.set()

    @property
    def coarse(self) -> bool:
        return self._scheduler.coarse

    async def draw(self, stream: str, spec: ViewSpec, composition: Composition) -> Drawn:
        return await _in(
            self._drawing,
            self._studio.draw,
            composition.scene,
            composition.camera,
            size=spec.size,
            coarse=self._scheduler.coarse,
            close_up_of=stream if composition.follow else None,
        )

    async def process(self, drawn: Drawn, job: PictureJob) -> EncodedPicture:
        return await self._encoders.of(job.stream).process(drawn.picture, drawn.camera, job)

    def _open(self, state: RobotState, spec: ViewSpec) -> Stream:
        stream = self._streams[state.name, spec.name] = Stream(self._session, state, spec, self)
        return stream

    def _close(self, key: tuple[str, str]) -> None:
        stream = self._streams.pop(key)
        self._active.discard(stream)
        self._shown = None
        self._reset_if_unwatched()
        stream.close()
        self._encoders.end(stream.name)

    def _first_view(self, state: RobotState) -> str:
        """Return the view that provides the camera of the view for slow links."""
        known = () if state.appearance is None else view_names(state.appearance)
        return next((view for view in self._settings.views if view in known), FREE)

    # -------------------------------------------------------------- requests

    async def _answer_key_frame(self, state: RobotState, request: Request) -> KeyFrameAnswer:
        stream = self._streams.get((state.name, request.chunk))
        if stream is None:
            streams = [each for each in self._streams.values() if each.state is state]
            known = [each.spec.name for each in streams if not each.spec.requested]
            raise RefusedError(codes.VIEW_UNKNOWN(view=request.chunk, views=", ".join(sorted(known))))
        self._key_frames.check(request.asker, 1.0)
        forced = stream.request_key_frame()
        if forced:
            self._key_frames.count(request.asker, 1.0)
        return KeyFrameAnswer(forced=forced)

    async def _answer_view(self, state: RobotState, request: Request) -> ViewAnswer:
        wanted, settings = request.message, self._settings
        assert isinstance(wanted, ViewRequest)
        assert state.appearance is not None
        try:
            stream = self._own_stream(state, wanted)
            if stream is None:
                spec = requested_view(
                    wanted,
                    state.appearance,
                    first=self._first_view(state),
                    size=settings.size,
                    fps=settings.fps,
                )
                stream = self._streams.get((state.name, spec.name))
            if stream is None:
                asked_for = [each for each in self._streams.values() if each.spec.requested]
                self._view_budget.check(asked_for, spec, request.asker)
                stream = self._open(state, spec)
        except NoRoomError as error:
            raise RefusedError(codes.VIEW_NO_ROOM(error.reason)) from None
        except UnknownViewError as error:
            raise RefusedError(error.reason) from None
        except ViewError as error:
            raise RefusedError(codes.VIEW_INVALID(error.reason)) from None
        stream.restart_timeout(request.asker)
        spec = stream.spec
        width, height = spec.size
        return ViewAnswer(
            topic=f"video/{spec.name}", image=f"image/{spec.name}", width=width, height=height, fps=spec.fps
        )

    def _own_stream(self, state: RobotState, wanted: ViewRequest) -> Stream | None:
        """Return one of the renderer's own views if the request asks for it unchanged; otherwise None."""
        stream = self._streams.get((state.name, wanted.of))
        own = stream is not None and not stream.spec.requested and wanted == ViewRequest(of=wanted.of)
        return stream if own else None

    # -------------------------------------------------------------- painting

    async def _paint_forever(self) -> None:
        """Draw pictures of the newest state one by one; each is encoded while the next ones are drawn."""
        while True:
            self._wake.clear()
            stream, due_at = next_view(self._active, time.monotonic())
            if stream is None:
                wait_s = None if due_at == float("inf") else max(due_at - time.monotonic(), 0.0)
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(wait_s):
                        await self._wake.wait()
                continue
            began = time.monotonic()
            await self._encoders.of(stream.name).start(await stream.draw(began))
            self._record_picture(began)

    def _record_picture(self, began: float) -> None:
        self._pictures += 1
        now, slow = time.monotonic(), self._scheduler.slow
        self._scheduler.record(now, now - began, wanted_hz=self._wanted_hz)
        self._report_speed(was_slow=slow)

    @property
    def _wanted_hz(self) -> float:
        return sum(stream.wanted_hz for stream in self._active)

    def _reset_if_unwatched(self) -> None:
        if not self._active:
            slow = self._scheduler.slow
            self._scheduler.reset()
            self._report_speed(was_slow=slow)

    def _report_speed(self, *, was_slow: bool) -> None:
        """Publish an event if the machine has become too slow, or is fast enough again."""
        if self._scheduler.slow == was_slow:
            return
        if was_slow:
            severity, code, text = (
                Event.INFO,
                "renderer.keeps_up",
                "the renderer draws all watched views at their full rate again",
            )
        else:
            severity, code = Event.WARNING, "renderer.slow"
            rate_hz = self._scheduler.rate_hz(time.monotonic())
            text = (
                f"the renderer draws {rate_hz:.0f} of {self._wanted_hz:.0f} "
                "watched pictures a second: this machine is too slow"
            )
        log.log(logging.INFO if was_slow else logging.WARNING, "%s", text)
        event = Event(severity=severity, code=code, text=text, source="renderer")
        event.timestamp.GetCurrentTime()
        self._events.put(event)

    async def _tidy_forever(self) -> None:
        while True:
            await asyncio.sleep(_TIDY_EACH_S)
            self._robots.rest()
            now = time.monotonic()
            heard = {stream.name for stream in self._streams.values()}
            for key, stream in list(self._streams.items()):
                # Catches missed notifications of a change of subscribers.
                stream.update_watchers()
                if stream.unwatched_since is None:
                    continue
                unwatched_s = now - stream.unwatched_since
                if unwatched_s > _NEXT_WATCHER_WITHIN_S:
                    heard.discard(stream.name)
                patience_s = _FIRST_WATCHER_WITHIN_S if stream.awaited else _NEXT_WATCHER_WITHIN_S
                if stream.spec.requested and unwatched_s > patience_s:
                    self._close(key)
            self._encoders.keep(heard)
            await _in(
                self._drawing,
                self._studio.tidy,
                shapes=self._robots.shapes,
                streams={stream.name for stream in self._streams.values()},
            )
