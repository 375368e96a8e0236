"""The robots known to the renderer: their topics, their shapes, and when they are removed."""

import asyncio
import logging
import math
import time
from collections import defaultdict
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Protocol

from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates

from renderer.errors import RendererError
from renderer.pictures.robot_state import Ages, RobotState
from renderer.scene.appearance import appearance_of, shape_name
from renderer.shapes.cache import store_glb, stored_glb
from robomesh.contract.keys import ROOT, is_replay, robot_key
from robomesh.errors import MessageError, RobomeshError
from robomesh.publications.subscription import Sample, Subscription
from robomesh.schemas.robomesh_pb2 import ControllerState, Description, KinematicState
from robomesh.wire.session import Session

log = logging.getLogger(__name__)

_SHAPE_TIMEOUT_S = 10.0
_ASK_AGAIN_S = 2.0
# Queue length for a site with many robots. Only each robot's newest sample is used.
_RING = 512
_TOPICS = ("description", "controller")
# Topics that robots publish all the time; subscribed while pictures are drawn, and for this time [s] after.
_LIVE = ("frames", "joints", "kinematics")
_REST_AFTER_S = 60.0
# The first picture after a rest waits this long for live samples [s]; one without them looks stale.
_LIVE_WITHIN_S = 0.3
# Samples that arrive within this time are taken together [s], while pictures are watched and otherwise.
_TOGETHER_S, _TOGETHER_UNWATCHED_S = 0.004, 0.05
# Interval of decoding the states of a robot in no watched picture [s]: for the trail of its tool.
_UNWATCHED_EACH_S = 0.2
# The presence of one of these services means that a robot exists. The delay lets them restart without the
# robot being removed.
_PROVIDERS = ("gateway", "kinematics", "player")
_DESCRIBERS = ("kinematics", "player")
_FORGET_AFTER_S, _FORGET_REPLAY_AFTER_S = 15.0, 1.0


class RobotObserver(Protocol):
    """The receiver of shapes and of changes of robots."""

    @property
    def shown(self) -> Collection[str]:
        """Names of the robots in watched pictures."""

    async def has_shape(self, name: str) -> bool:
        """Return whether a shape has been added."""

    async def add_shape(self, name: str, glb: bytes, color: str) -> None:
        """Add a shape."""

    def on_ready(self, state: RobotState) -> None:
        """React to a robot that can be drawn, or to its new description."""

    def on_changed(self, state: RobotState) -> None:
        """React to a change that pictures show."""

    def on_removed(self, state: RobotState) -> None:
        """React to the removal of a robot."""


class Robots:
    """The known robots of a site.

    Attributes:
        states: By name.
    """

    def __init__(
        self,
        session: Session,
        site: str,
        observer: RobotObserver,
        *,
        wanted: Callable[[str], bool],
        folder: Path,
    ) -> None:
        self.states: dict[str, RobotState] = {}
        self._session, self._site, self._observer = session, site, observer
        self._wanted, self._folder = wanted, folder
        self._group = asyncio.TaskGroup()
        self._subscriptions: dict[str, Subscription] = {}
        # When the live topics were subscribed, and when that may end [s].
        self._live_since = self._rests_at = 0.0
        # By key: when a live sample was taken, and the newest one that was not.
        self._taken_at: dict[str, float] = {}
        self._waiting: dict[str, Sample] = {}
        self._shapes: dict[str, set[str]] = {}
        self._loading: dict[str, asyncio.Task[None]] = {}
        self._providers: defaultdict[str, set[tuple[str, str]]] = defaultdict(set)
        self._forgetting: dict[str, asyncio.TimerHandle] = {}
        # Removed robots: if one returns with the same description, the subscription does not report it.
        self._forgotten: set[str] = set()

    async def follow(self) -> None:
        """Follow the site's robots until cancelled."""
        async with self._group:
            self._subscribe(_TOPICS)
            self._group.create_task(self._watch_providers())

    def ages(self, state: RobotState) -> Ages:
        """Return the current ages of a robot's topics."""
        age = dict.fromkeys(_LIVE) | {
            name: subscription.age_s(robot_key(state.site, state.name, name))
            for name, subscription in self._subscriptions.items()
            if name != "description"
        }
        return Ages(**age)

    def neighbours(self, state: RobotState) -> list[RobotState]:
        """Return the other robots of a robot's cell; a replay has none."""
        cell = state.cell
        if not cell:
            return []
        return [other for other in self.states.values() if other is not state and other.cell == cell]

    @property
    def shapes(self) -> set[str]:
        """Names of the shapes of all robots."""
        return set().union(*self._shapes.values())

    async def catch_up(self, state: RobotState) -> None:
        """Take the newest samples of a robot and its cell that were not decoded; end a rest."""
        robots = (state, *self.neighbours(state))
        keys = {name: [robot_key(self._site, each.name, name) for each in robots] for name in _LIVE}
        self._subscribe_live()
        while time.monotonic() < self._live_since + _LIVE_WITHIN_S and any(
            self._subscriptions[name].age_s(key) is None for name in _LIVE for key in keys[name]
        ):
            await asyncio.sleep(0.005)
            self._subscribe_live()
        for name in _LIVE:
            for each, key in zip(robots, keys[name], strict=True):
                if (sample := self._waiting.pop(key, None)) is not None:
                    self._take(each, sample)

    def rest(self) -> None:
        """Unsubscribe from the live topics if no picture has been drawn for some time."""
        if not self._observer.shown and time.monotonic() >= self._rests_at:
            for name in _LIVE:
                if (subscription := self._subscriptions.pop(name, None)) is not None:
                    subscription.close()

    def _subscribe_live(self) -> None:
        now = time.monotonic()
        self._rests_at = now + _REST_AFTER_S
        if _LIVE[0] not in self._subscriptions:
            self._live_since = now
            self._subscribe(_LIVE)

    def _subscribe(self, names: Collection[str]) -> None:
        for name in names:
            subscription = self._session.subscribe(f"{ROOT}/{self._site}/*/{name}", newest=_RING)
            self._subscriptions[name] = subscription
            self._group.create_task(self._take_all(subscription))

    async def _take_all(self, subscription: Subscription) -> None:
        while samples := await subscription.next_batch(pause_s=self._pause_s):
            for sample in {sample.key: sample for sample in samples}.values():
                robot, topic = sample.parsed.robot, sample.parsed.topic
                if not self._wanted(robot):
                    continue
                if (state := self.states.get(robot)) is None:
                    state = self.states[robot] = RobotState(self._site, robot)
                if topic in _LIVE and not self._is_due(robot, sample):
                    self._waiting[sample.key] = sample
                else:
                    self._take(state, sample)

    @property
    def _pause_s(self) -> float:
        return _TOGETHER_S if self._observer.shown else _TOGETHER_UNWATCHED_S

    def _is_due(self, robot: str, sample: Sample) -> bool:
        """Return whether to decode a live sample now, which takes longer than to receive it."""
        before = self._taken_at.get(sample.key, -math.inf)
        if robot not in self._observer.shown and sample.received - before < _UNWATCHED_EACH_S:
            return False
        self._taken_at[sample.key] = sample.received
        self._waiting.pop(sample.key, None)
        return True

    def _take(self, state: RobotState, sample: Sample) -> None:
        before = state.version
        try:
            message = sample.message()
            if isinstance(message, FrameTransforms):
                state.update_frames(message, sample.header.source_time_ns, sample.header.publisher)
            elif isinstance(message, JointStates):
                state.update_joints(message)
            elif isinstance(message, ControllerState):
                state.update_controller(message)
            elif isinstance(message, KinematicState):
                state.update_kinematics(message, self.states)
            elif isinstance(message, Description):
                self._describe(state, message)
        except MessageError as error:
            log.warning("%s: %s", sample.key, error)
        except Exception:
            # A publisher's invalid message must not stop the drawing of other robots.
            log.exception("%s could not be processed", sample.key)
        if state.version != before:
            self._observer.on_changed(state)

    def _describe(self, state: RobotState, description: Description) -> None:
        self._forgotten.discard(state.name)
        before = self._loading.get(state.name)
        if before is not None:
            before.cancel()
        self._loading[state.name] = self._group.create_task(self._load(state, description))

    async def _describe_again(self, robot: str) -> None:
        """Query the description of a robot that has returned: the subscription reports changes only."""
        key = robot_key(self._site, robot, "description")
        while robot in self._forgotten and robot in self._providers:
            try:
                description = await self._session.last(key)
            except RobomeshError as error:
                log.warning("%s: %s", key, error)
                return
            if isinstance(description, Description) and robot in self._forgotten:
                state = self.states.setdefault(robot, RobotState(self._site, robot))
                self._describe(state, description)

    async def _load(self, state: RobotState, description: Description) -> None:
        """Load a robot's shapes and make it ready to draw."""
        where = f"{state.site}/{state.name}"
        try:
            appearance = await asyncio.to_thread(appearance_of, description)
            links: list[Description.Link | Description.Fixture] = [*description.links, *description.fixtures]
            bodies = [body for body in links if body.mesh]
            # The old shapes are drawn until the new ones are loaded.
            names = {shape_name(body) for body in bodies}
            self._shapes[state.name] = self._shapes.get(state.name, set()) | names
            for body in bodies:
                await self._load_shape(state, body)
        except RendererError as error:
            log.error("%s cannot be drawn: %s", where, error)
            return
        except Exception:
            log.exception("%s cannot be drawn", where)
            return
        self._shapes[state.name] = names
        state.appearance = appearance
        state.version += 1
        self._observer.on_ready(state)

    async def _load_shape(self, state: RobotState, body: Description.Link | Description.Fixture) -> None:
        name = shape_name(body)
        if await self._observer.has_shape(name):
            return
        glb = await asyncio.to_thread(stored_glb, body.mesh_sha256, self._folder)
        key = robot_key(state.site, state.name, f"mesh/{body.mesh}")
        warned = False
        while glb is None:
            try:
                glb = await self._session.ask_bytes(key, timeout_s=_SHAPE_TIMEOUT_S)
            except RobomeshError as error:
                if not warned:
                    log.warning("mesh of %s: %s; requests are repeated", body.name, error)
                    warned = True
                await asyncio.sleep(_ASK_AGAIN_S)
                continue
            await asyncio.to_thread(store_glb, glb, self._folder)
        try:
            await self._observer.add_shape(name, glb, body.color)
        except RendererError as error:
            log.error("%s of %s/%s is not drawn: %s", body.name, state.site, state.name, error)

    async def _watch_providers(self) -> None:
        async for who, alive in self._session.watch_presence(f"{ROOT}/{self._site}/*/alive/*/*"):
            if who.service not in _PROVIDERS:
                continue
            providers = self._providers[who.robot]
            (providers.add if alive else providers.discard)((who.service, who.id))
            waiting = self._forgetting.pop(who.robot, None)
            if waiting is not None:
                waiting.cancel()
            if alive and who.robot in self._forgotten and who.service in _DESCRIBERS:
                self._group.create_task(self._describe_again(who.robot))
            if not providers:
                del self._providers[who.robot]
                after_s = _FORGET_REPLAY_AFTER_S if is_replay(who.robot) else _FORGET_AFTER_S
                loop = asyncio.get_running_loop()
                self._forgetting[who.robot] = loop.call_later(after_s, self._forget, who.robot)

    def _forget(self, robot: str) -> None:
        self._forgetting.pop(robot, None)
        loading = self._loading.pop(robot, None)
        if loading is not None:
            loading.cancel()
        self._shapes.pop(robot, None)
        for name in _LIVE:
            key = robot_key(self._site, robot, name)
            self._waiting.pop(key, None)
            self._taken_at.pop(key, None)
        state = self.states.pop(robot, None)
        if state is not None:
            log.info("%s/%s is removed", state.site, state.name)
            self._forgotten.add(robot)
            self._observer.on_removed(state)
