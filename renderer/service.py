"""The renderer service: video and pictures of a site's robots, drawn only while watched."""

import asyncio
import logging
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import ParamSpec, TypeVar

from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates

from bus.errors import BusError, MessageError, RefusedError
from bus.keys import ROOT, robot_key
from bus.requests import Request
from bus.schemas.robomesh_pb2 import ControllerState, Description, KeyFrameAnswer
from bus.session import Session
from bus.subscription import Subscription
from renderer.cache import cache_folder, store_glb, stored_glb
from renderer.errors import RendererError, UnknownViewError
from renderer.look import CLOSE, Look, look_of, mesh_name
from renderer.state import Ages, RobotState
from renderer.stream import Stream
from renderer.studio import Studio, open_thread

log = logging.getLogger(__name__)

P = ParamSpec("P")
T = TypeVar("T")

_MESH_TIMEOUT_S = 10.0
_ASK_AGAIN_S = 2.0
# For a site of many robots; each robot's newest counts, and the rest is skipped when read.
_RING = 512


@dataclass(frozen=True, kw_only=True)
class Settings:
    """A site's renderer.

    Attributes:
        robots: Their names; none: every robot of the site.
        views: Of each robot, beside a close-up that follows the arm.
        size: Width and height of the pictures, both even [px].
        fps: Highest rate of a view's video [1/s].
        samples: Of anti-aliasing; 0: none.
        device: Number of the EGL device; None: EGL's own choice.
        folder: Where meshes are kept.
    """

    site: str
    robots: tuple[str, ...] = ()
    views: tuple[str, ...] = ("front", "top", "left", "free")
    size: tuple[int, int] = (1280, 720)
    fps: float = 30.0
    samples: int = 4
    device: int | None = None
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
    with open_thread() as thread:
        studio = await _in(thread, _open_studio, settings)
        log.info("drawing with %s, encoding with %s", studio.renderer_name, studio.encoder_name)
        try:
            await _Renderer(session, settings, thread, studio).run()
        finally:
            thread.submit(studio.close)


def _open_studio(settings: Settings) -> Studio:
    return Studio(
        settings.size,
        settings.fps,
        samples=settings.samples,
        device=settings.device,
        folder=settings.folder,
    )


def _in(
    thread: ThreadPoolExecutor, function: Callable[P, T], *args: P.args, **kwargs: P.kwargs
) -> asyncio.Future[T]:
    """Run something in the studio's thread."""
    return asyncio.get_running_loop().run_in_executor(thread, partial(function, *args, **kwargs))


class _Renderer:
    """One run of the service: the robots that it knows, and their streams."""

    def __init__(
        self, session: Session, settings: Settings, thread: ThreadPoolExecutor, studio: Studio
    ) -> None:
        self._session, self._settings, self._thread, self._studio = session, settings, thread, studio
        self._robots: dict[str, RobotState] = {}
        self._streams: list[Stream] = []
        self._loading: dict[str, asyncio.Task[None]] = {}
        self._subscriptions: dict[str, Subscription] = {}

    async def run(self) -> None:
        async with asyncio.TaskGroup() as group:
            for name in ("description", "frames", "joints", "controller"):
                key_expr = f"{ROOT}/{self._settings.site}/*/{name}"
                subscription = self._session.subscribe(key_expr, newest=_RING)
                self._subscriptions[name] = subscription
                group.create_task(self._follow(subscription, group))
            group.create_task(self._paint_forever())

    async def _follow(self, subscription: Subscription, group: asyncio.TaskGroup) -> None:
        async for sample in subscription:
            robot = sample.parsed.robot
            if self._settings.robots and robot not in self._settings.robots:
                continue
            try:
                message = sample.message()
            except MessageError as error:
                log.warning("%s: %s", sample.key, error)
                continue
            state = self._robots.setdefault(robot, RobotState(self._settings.site, robot))
            if isinstance(message, FrameTransforms):
                state.take_frames(message, sample.header.source_time_ns)
            elif isinstance(message, JointStates):
                state.take_joints(message)
            elif isinstance(message, ControllerState):
                state.take_controller(message)
            elif isinstance(message, Description):
                before = self._loading.get(robot)
                if before is not None:
                    before.cancel()
                self._loading[robot] = group.create_task(self._load(state, message))

    async def _load(self, state: RobotState, description: Description) -> None:
        """Make a robot's pictures possible: its meshes, its cameras, its streams."""
        width, height = self._settings.size
        try:
            look = await _in(self._thread, look_of, description, aspect=width / height)
        except RendererError as error:
            log.error("%s/%s cannot be drawn: %s", state.site, state.name, error)
            return
        for link in description.links:
            if link.mesh:
                await self._load_mesh(state, link)
        first = state.look is None
        state.look = look
        state.version += 1
        if first:
            self._open_streams(state, look)

    async def _load_mesh(self, state: RobotState, link: Description.Link) -> None:
        name = mesh_name(link)
        if await _in(self._thread, self._studio.has_mesh, name):
            return
        folder = self._settings.folder
        glb = await asyncio.to_thread(stored_glb, link.mesh_sha256, folder)
        key = robot_key(state.site, state.name, f"mesh/{link.mesh}")
        told = False
        while glb is None:
            try:
                glb = await self._session.ask_bytes(key, timeout_s=_MESH_TIMEOUT_S)
            except BusError as error:
                if not told:
                    log.warning("mesh of %s: %s; asking until it comes", link.name, error)
                    told = True
                await asyncio.sleep(_ASK_AGAIN_S)
                continue
            await asyncio.to_thread(store_glb, glb, folder)
        try:
            await _in(self._thread, self._studio.take_mesh, name, glb, link.color)
        except RendererError as error:
            log.error("link %s of %s/%s is not drawn: %s", link.name, state.site, state.name, error)

    def _open_streams(self, state: RobotState, look: Look) -> None:
        streams: dict[str, Stream] = {}
        for view in dict.fromkeys((*self._settings.views, CLOSE)):
            try:
                streams[view] = Stream(
                    self._session,
                    state,
                    look,
                    view,
                    fps=self._settings.fps,
                    ages=partial(self._ages, state),
                    paint=lambda job: _in(self._thread, self._studio.paint, job),
                )
            except RendererError as error:
                log.error("%s/%s: %s", state.site, state.name, error)

        async def answer_key_frame(request: Request) -> KeyFrameAnswer:
            if request.chunk not in streams:
                raise RefusedError(str(UnknownViewError(request.chunk, streams)))
            return KeyFrameAnswer(forced=streams[request.chunk].ask_key_frame())

        self._session.answer(state.site, state.name, "video/*/keyframe", answer_key_frame)
        self._streams += streams.values()
        log.info("%s/%s: views %s", state.site, state.name, ", ".join(streams))

    def _ages(self, state: RobotState) -> Ages:
        age = {
            name: subscription.age_s(robot_key(state.site, state.name, name))
            for name, subscription in self._subscriptions.items()
        }
        return Ages(frames=age["frames"], joints=age["joints"], controller=age["controller"])

    async def _paint_forever(self) -> None:
        """One picture after another, each of the newest state; what comes meanwhile is not queued."""
        interval = 1.0 / self._settings.fps
        due = time.monotonic()
        while True:
            for stream in list(self._streams):
                await stream.paint_if_due()
            due = max(due + interval, time.monotonic())
            await asyncio.sleep(due - time.monotonic())
