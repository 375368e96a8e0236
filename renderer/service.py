"""The renderer service: video and pictures of a site's robots, drawn only while watched."""

import asyncio
import contextlib
import logging
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import ParamSpec, TypeVar

from renderer.cache import cache_folder
from renderer.composition import Composition
from renderer.errors import NoRoomError, RendererError
from renderer.frame_scheduler import Pace, next_of
from renderer.post_processing import Finished, Finishing, Order
from renderer.requested_views import FAR, Shot, far, requested, standing
from renderer.robot_state import Ages, RobotState
from renderer.robots import Robots
from renderer.stream import Stream
from renderer.studio import Drawn, Studio, open_thread
from renderer.view_budget import Room
from renderer.views import CLOSE, FREE, camera_of, view_names
from robomesh import reason_codes as codes
from robomesh.errors import RefusedError
from robomesh.keys import WHOLE_SITE
from robomesh.quotas import DEFAULT_QUOTAS, Quota, Quotas
from robomesh.schemas.robomesh_pb2 import Event, KeyFrameAnswer, ViewAnswer, ViewRequest
from robomesh.server import Answerer, Request
from robomesh.session import Session

log = logging.getLogger(__name__)

P = ParamSpec("P")
T = TypeVar("T")

_TIDY_EACH_S = 1.0
# A view of one's own: so long for the first watcher to come, and for another after the last one.
_COMES_WITHIN_S, _COMES_BACK_WITHIN_S = 10.0, 5.0


@dataclass(frozen=True, kw_only=True)
class Settings:
    """A site's renderer.

    Attributes:
        robots: Their names; none: every robot of the site.
        views: Of each robot, beside a close-up that follows the arm and one for slow links.
        size: Width and height of the pictures, both even [px].
        fps: Highest rate of a view's video [1/s].
        samples: Of anti-aliasing; 0: none.
        shading: "fast" or "full".
        device: Number of the EGL device; None: EGL's own choice.
        most_views: That may be asked for beside its own, of all robots together.
        quotas: Of each asker.
        folder: Where meshes are kept.
    """

    site: str
    robots: tuple[str, ...] = ()
    views: tuple[str, ...] = ("front", "top", "left", "free")
    size: tuple[int, int] = (1280, 720)
    fps: float = 30.0
    samples: int = 4
    shading: str = "fast"
    device: int | None = None
    most_views: int = 32
    quotas: Quotas = DEFAULT_QUOTAS
    folder: Path = field(default_factory=cache_folder)


async def serve(session: Session, settings: Settings) -> None:
    """Render until cancelled.

    Raises:
        RendererError: If OpenGL or the encoder is missing, or the size is not possible.
    """
    width, height = settings.size
    if width % 2 or height % 2 or not 64 <= width <= 4096 or not 64 <= height <= 4096:
        raise RendererError(f"renderer size {width} x {height}: even numbers from 64 to 4096 are possible")
    if not 1.0 <= settings.fps <= 120.0:
        raise RendererError(f"renderer fps {settings.fps:g}: 1 to 120 is possible")
    with open_thread("drawing") as drawing, open_thread("encoding") as encoding:
        studio = await _in(
            drawing,
            Studio,
            settings.size,
            samples=settings.samples,
            shading=settings.shading,
            device=settings.device,
            folder=settings.folder,
        )
        try:
            finishing = await _in(encoding, Finishing, settings.size, settings.fps)
            log.info("drawing with %s, encoding with %s", studio.renderer_name, finishing.codec)
            await _Renderer(session, settings, (drawing, studio), (encoding, finishing)).run()
        finally:
            drawing.submit(studio.close)


def _in(
    thread: ThreadPoolExecutor, function: Callable[P, T], *args: P.args, **kwargs: P.kwargs
) -> asyncio.Future[T]:
    """Run something in a thread of its own."""
    return asyncio.get_running_loop().run_in_executor(thread, partial(function, *args, **kwargs))


class _Renderer:
    """One run of the service: the robots that it knows, and their streams."""

    def __init__(
        self,
        session: Session,
        settings: Settings,
        drawing: tuple[ThreadPoolExecutor, Studio],
        encoding: tuple[ThreadPoolExecutor, Finishing],
    ) -> None:
        self._session, self._settings = session, settings
        self._drawing, self._studio = drawing
        self._encoding, self._finishing = encoding
        self._robots = Robots(
            session,
            settings.site,
            self,
            wanted=lambda robot: not settings.robots or robot in settings.robots,
            folder=settings.folder,
        )
        # By robot and view.
        self._streams: dict[tuple[str, str], Stream] = {}
        self._answerers: dict[str, list[Answerer]] = {}
        self._active: set[Stream] = set()
        self._wake = asyncio.Event()
        self._pace = Pace()
        self._key_frames = Quota("key_frames", a_minute=settings.quotas.key_frames_a_minute)
        self._room = Room(
            most_views=settings.most_views,
            quota=settings.quotas.views,
            own_pixels_per_s=standing("", size=settings.size, fps=settings.fps).pixels_per_s,
            again_s=_COMES_BACK_WITHIN_S,
        )
        self._pictures = 0
        self._events = session.declare_publisher(settings.site, WHOLE_SITE, "events/renderer")
        session.measure("views", "Views that can be watched", lambda: len(self._streams))
        session.measure("pictures_total", "Pictures drawn", lambda: self._pictures)
        session.measure("views_drawn", "Views that somebody watches", lambda: len(self._active))

    async def run(self) -> None:
        async with asyncio.TaskGroup() as group:
            group.create_task(self._robots.follow())
            group.create_task(self._paint_forever())
            group.create_task(self._tidy_forever())

    # ---------------------------------------------------------------- robots

    async def has_mesh(self, name: str) -> bool:
        return self._studio.has_mesh(name)

    async def take_mesh(self, name: str, glb: bytes, color: str) -> None:
        await _in(self._drawing, self._studio.take_mesh, name, glb, color)

    def appeared(self, state: RobotState) -> None:
        if state.name in self._answerers:
            return  # described anew: its streams go on
        look, settings = state.look, self._settings
        assert look is not None
        names = []
        for name in dict.fromkeys((*settings.views, CLOSE)):
            try:
                camera_of(look, name)
            except RendererError as error:
                log.error("%s/%s: %s", state.site, state.name, error)
                continue
            names.append(name)
            self._open(state, standing(name, size=settings.size, fps=settings.fps))
        self._open(state, far(self._first(state), size=settings.size, fps=settings.fps))
        self._answerers[state.name] = [
            self._session.answer(
                state.site, state.name, "video/*/keyframe/*", partial(self._answer_key_frame, state)
            ),
            self._session.answer(state.site, state.name, "views/*", partial(self._answer_view, state)),
        ]
        log.info("%s/%s: views %s", state.site, state.name, ", ".join((*names, FAR)))

    def moved(self, state: RobotState) -> None:
        cell = state.cell
        if any(each.state is state or (cell and each.state.cell == cell) for each in self._active):
            self._wake.set()

    def gone(self, state: RobotState) -> None:
        for answerer in self._answerers.pop(state.name, ()):
            answerer.close()
        for key in [key for key in self._streams if key[0] == state.name]:
            self._close(key)

    # --------------------------------------------------------------- streams

    def ages(self, state: RobotState) -> Ages:
        return self._robots.ages(state)

    def neighbours(self, state: RobotState) -> Sequence[RobotState]:
        return self._robots.neighbours(state)

    def watched(self, stream: Stream) -> None:
        (self._active.add if stream.watched else self._active.discard)(stream)
        self._rest_if_unwatched()
        self._wake.set()

    async def draw(self, stream: str, shot: Shot, composition: Composition) -> Drawn:
        return await _in(
            self._drawing,
            self._studio.draw,
            composition.scene,
            composition.camera,
            size=shot.size,
            coarse=self._pace.coarse,
            close_up_of=stream if composition.follow else None,
        )

    async def finish(self, drawn: Drawn, order: Order) -> Finished:
        return await _in(self._encoding, self._finishing.finish, drawn.picture, drawn.camera, order)

    def _open(self, state: RobotState, shot: Shot) -> Stream:
        stream = self._streams[state.name, shot.name] = Stream(self._session, state, shot, self)
        return stream

    def _close(self, key: tuple[str, str]) -> None:
        stream = self._streams.pop(key)
        self._active.discard(stream)
        self._rest_if_unwatched()
        stream.close()
        self._encoding.submit(self._finishing.end, [stream.name])

    def _first(self, state: RobotState) -> str:
        """The view that the one for slow links is of."""
        known = () if state.look is None else view_names(state.look)
        return next((view for view in self._settings.views if view in known), FREE)

    # -------------------------------------------------------------- requests

    async def _answer_key_frame(self, state: RobotState, request: Request) -> KeyFrameAnswer:
        stream = self._streams.get((state.name, request.chunk))
        if stream is None:
            streams = [each for each in self._streams.values() if each.state is state]
            known = [each.shot.name for each in streams if not each.shot.requested]
            raise RefusedError(codes.VIEW_UNKNOWN(view=request.chunk, views=", ".join(sorted(known))))
        self._key_frames.check(request.asker, 1.0)
        forced = stream.ask_key_frame()
        if forced:
            self._key_frames.count(request.asker, 1.0)
        return KeyFrameAnswer(forced=forced)

    async def _answer_view(self, state: RobotState, request: Request) -> ViewAnswer:
        wanted, settings = request.message, self._settings
        assert isinstance(wanted, ViewRequest)
        assert state.look is not None
        try:
            stream = self._standing(state, wanted)
            if stream is None:
                shot = requested(
                    wanted, state.look, first=self._first(state), size=settings.size, fps=settings.fps
                )
                stream = self._streams.get((state.name, shot.name))
            if stream is None:
                asked_for = [each for each in self._streams.values() if each.shot.requested]
                self._room.check(asked_for, shot, request.asker)
                stream = self._open(state, shot)
        except NoRoomError as error:
            raise RefusedError(codes.VIEW_NO_ROOM(detail=error)) from None
        except RendererError as error:
            raise RefusedError(codes.VIEW_INVALID(detail=error)) from None
        stream.stay(request.asker)
        shot = stream.shot
        width, height = shot.size
        return ViewAnswer(
            topic=f"video/{shot.name}", image=f"image/{shot.name}", width=width, height=height, fps=shot.fps
        )

    def _standing(self, state: RobotState, wanted: ViewRequest) -> Stream | None:
        """One of the renderer's own views, where it is asked for as it is: nothing more is drawn for it."""
        stream = self._streams.get((state.name, wanted.of))
        own = stream is not None and not stream.shot.requested and wanted == ViewRequest(of=wanted.of)
        return stream if own else None

    # -------------------------------------------------------------- painting

    async def _paint_forever(self) -> None:
        """One picture after another, each of the newest state; one is encoded while the next is drawn."""
        encoding = asyncio.create_task(asyncio.sleep(0))
        while True:
            self._wake.clear()
            stream, due_at = next_of(self._active, time.monotonic())
            if stream is None:
                wait_s = None if due_at == float("inf") else max(due_at - time.monotonic(), 0.0)
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(wait_s):
                        await self._wake.wait()
                continue
            began = time.monotonic()
            rest = await stream.draw(began)
            try:
                await encoding
            except asyncio.CancelledError:
                rest.close()  # it will not be begun
                raise
            encoding = asyncio.create_task(rest)
            self._drew(began)

    def _drew(self, began: float) -> None:
        self._pictures += 1
        now, slow = time.monotonic(), self._pace.slow
        self._pace.drew(now, now - began, wanted_hz=self._wanted_hz)
        self._tell(was_slow=slow)

    @property
    def _wanted_hz(self) -> float:
        return sum(stream.wanted_hz for stream in self._active)

    def _rest_if_unwatched(self) -> None:
        if not self._active:
            slow = self._pace.slow
            self._pace.rested()
            self._tell(was_slow=slow)

    def _tell(self, *, was_slow: bool) -> None:
        """Say so where the machine has begun to keep up, or ceased to; also as nobody watches any more."""
        if self._pace.slow == was_slow:
            return
        if was_slow:
            severity, code, text = (
                Event.INFO,
                "renderer.keeps_up",
                "the renderer draws all that is watched again",
            )
        else:
            severity, code = Event.WARNING, "renderer.slow"
            text = (
                f"the renderer draws {self._pace.rate_hz(time.monotonic()):.0f} of the {self._wanted_hz:.0f} "
                "pictures a second that are watched: this machine can do no more"
            )
        log.log(logging.INFO if was_slow else logging.WARNING, "%s", text)
        event = Event(severity=severity, code=code, text=text, source="renderer")
        event.timestamp.GetCurrentTime()
        self._events.put(event)

    async def _tidy_forever(self) -> None:
        while True:
            await asyncio.sleep(_TIDY_EACH_S)
            now = time.monotonic()
            silent = []
            for key, stream in list(self._streams.items()):
                # Who was not told of in time is found here.
                stream.look_for_watchers()
                if stream.quiet_since is None:
                    continue
                quiet_s = now - stream.quiet_since
                if quiet_s > _COMES_BACK_WITHIN_S:
                    silent.append(stream.name)
                patience_s = _COMES_WITHIN_S if stream.awaited else _COMES_BACK_WITHIN_S
                if stream.shot.requested and quiet_s > patience_s:
                    self._close(key)
            await _in(self._encoding, self._finishing.end, silent)
            await _in(
                self._drawing,
                self._studio.tidy,
                meshes=self._robots.meshes,
                streams={stream.name for stream in self._streams.values()},
            )
