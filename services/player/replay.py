"""One replay: a recording published as a separate robot, with requests to pause, seek and change speed."""

import asyncio
import contextlib
import logging
import time
from collections import deque
from dataclasses import dataclass

from robomesh import reason_codes as codes
from robomesh.contract import topics
from robomesh.contract.keys import replay_name, robot_key
from robomesh.contract.messages import reason_message
from robomesh.contract.topics import History
from robomesh.errors import RefusedError, RobomeshError
from robomesh.publications.publisher import Publisher
from robomesh.reasons import Reason
from robomesh.recordings.errors import RecordingError
from robomesh.requests.server import Handler, Request, RequestServer
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import Session
from services.player.clock import Clock
from services.player.errors import ReplayError
from services.player.recording_source import RecordingSource, ReplayMessage, Snapshot

log = logging.getLogger(__name__)


SERVICE = "player"
_Request = schema.ReplayRequest
# Time to read ahead, at normal speed.
_AHEAD_S = 0.3
_STATE_EACH_S = 0.2
# Messages that are due within this time are published together.
_BATCH_S = 0.002
_MAX_SLEEP_S = 0.05
# A replay that is further behind skips to its position: on a slow machine it shows less, not later.
_MAX_BEHIND_S = 1.0
_SLOW_HZ = 10.0
# A shorter recording is not looped, and no loop restarts more often.
_MIN_LOOP_S, _LOOP_EACH_S = 0.1, 0.5
_SHAPE_TIMEOUT_S = 5.0


@dataclass
class _LastPut:
    """The last message of a topic, and the time at which it was published [s]."""

    played: ReplayMessage
    put_s: float


class Replay:
    """A recording published on the mesh.

    Args:
        identity: Suffix of the robot's name `replay-<identity>`.
    """

    def __init__(
        self, session: Session, site: str, identity: str, source: RecordingSource, clock: Clock
    ) -> None:
        self.robot = replay_name(identity)
        self._session, self._site, self._source, self._clock = session, site, source, clock
        self._problem: Reason | None = None
        self._seek_due = asyncio.Event()
        self._closed = asyncio.Event()
        self._wake = asyncio.Event()
        self._queue: deque[ReplayMessage] = deque()
        self._horizon_ns = 0
        self._last_put: dict[str, _LastPut] = {}
        self._slow_s = 0.0
        self._restarted_s = -_LOOP_EACH_S
        source.names = type(source.names)(source.of_site, source.of_robot, site, self.robot)
        source.replay = schema.Description.Replay(
            id=identity, site=source.of_site, robot=source.of_robot, file=source.file.path.name
        )
        source.replay.start.FromNanoseconds(source.start_ns)
        self._publishers: dict[str, Publisher] = {}
        self._servers: list[RequestServer] = []

    def describe(self) -> schema.ReplayState:
        """Return the state of the replay."""
        now, source = time.monotonic(), self._source
        state = schema.ReplayState(
            robot=self.robot,
            file=source.file.path.name,
            of_site=source.of_site,
            of_robot=source.of_robot,
            duration_s=self._clock.duration_s,
            position_s=self._clock.position_s(now),
            speed=self._clock.speed,
            playing=self._clock.playing,
            loop=self._clock.loop,
            text="" if self._problem is None else self._problem.text,
            reason=None if self._problem is None else reason_message(self._problem),
        )
        state.timestamp.GetCurrentTime()
        state.start.FromNanoseconds(source.start_ns)
        return state

    def close(self) -> None:
        """End the replay; `run` returns."""
        self._closed.set()
        self._wake.set()

    async def run(self) -> None:
        """Play until `close` is called."""
        self._declare()
        token = self._session.declare_presence_of(self._site, self.robot, SERVICE, self._session.identity)
        state_task = asyncio.create_task(self._publish_state())
        try:
            self._seek_due.set()
            while not self._closed.is_set():
                try:
                    await self._step()
                except RecordingError as error:
                    log.warning("%s: %s", self.robot, error)
                    self._problem = error.reason
                    self._clock.pause(time.monotonic())
                    self._queue.clear()
                    self._seek_due.clear()
        finally:
            state_task.cancel()
            with contextlib.suppress(Exception):
                token.undeclare()
            for server in self._servers:
                server.close()
            for publisher in self._publishers.values():
                publisher.close()
            self._source.close()

    # ------------------------------------------------------------ requests

    def _declare(self) -> None:
        names = [*self._source.topics, "replay"]
        if "joints" in names:
            names.append("joints/slow")
        for name in names:
            self._publishers[name] = self._session.declare_publisher(self._site, self.robot, name)
        answers: dict[str, Handler] = {
            "replay/request": self._on_request,
            "mesh/*": self._on_mesh,
            **dict.fromkeys(
                ("stop", "lease/request/*", "command/*", "jog/*", "recorder/request"), self._refuse
            ),
        }
        for name, handler in answers.items():
            self._servers.append(self._session.answer(self._site, self.robot, name, handler))

    async def _refuse(self, request: Request) -> bytes:
        code = (
            codes.REPLAY_IS_RECORDED if request.key.topic == "recorder/request" else codes.REPLAY_CANNOT_MOVE
        )
        raise RefusedError(code(file=self._source.file.path.name))

    async def _on_mesh(self, request: Request) -> bytes:
        try:
            return await asyncio.to_thread(self._source.file.attachment, f"mesh/{request.chunk}")
        except RecordingError as error:
            return await self._shape_of_robot(request.chunk, error.reason)

    async def _shape_of_robot(self, name: str, missing: Reason) -> bytes:
        """Fetch a shape from the recorded robot, if it is online: old recordings contain no shapes."""
        of = (self._source.of_site, self._source.of_robot)
        with contextlib.suppress(RobomeshError):
            if any((each.site, each.robot) == of for each in await self._session.present()):
                return await self._session.ask_bytes(
                    robot_key(*of, f"mesh/{name}"), timeout_s=_SHAPE_TIMEOUT_S
                )
        raise RefusedError(missing)

    async def _on_request(self, request: Request) -> schema.ReplayState:
        message = request.message
        assert isinstance(message, _Request)
        now = time.monotonic()
        try:
            match message.action:
                case _Request.PLAY:
                    ended = self._clock.at_end(now)
                    self._clock.play(now)
                    if ended:
                        self._seek_due.set()
                case _Request.PAUSE:
                    self._clock.pause(now)
                    self._seek_due.set()  # publish the exact state: fast replay thins it
                case _Request.SEEK:
                    self._clock.seek(message.position_s, now)
                    self._seek_due.set()
                case _Request.SPEED:
                    self._clock.set_speed(message.speed, now)
                case _Request.LOOP:
                    self._clock.loop = message.loop
                case _Request.CLOSE:
                    self.close()
        except ReplayError as error:
            raise RefusedError(error.reason) from None
        self._problem = None
        self._wake.set()
        return self.describe()

    # ------------------------------------------------------------ publications

    async def _step(self) -> None:
        """Publish due messages, read ahead, and sleep until the next message or request."""
        if self._seek_due.is_set():
            self._seek_due.clear()
            self._put_snapshot(await asyncio.to_thread(self._source.seek, self._at_ns()))
        if self._clock.playing:
            await self._publish_due()
        self._keep_alive()
        self._wake.clear()
        if not (self._closed.is_set() or self._seek_due.is_set()):
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._wake.wait(), self._sleep_s())

    def _at_ns(self) -> int:
        return self._source.start_ns + round(self._clock.position_s(time.monotonic()) * 1e9)

    def _put_snapshot(self, snapshot: Snapshot) -> None:
        """Publish the state at a new position."""
        self._queue.clear()
        self._last_put.clear()
        self._horizon_ns = self._at_ns()
        for topic, entries in snapshot.lists.items():
            publisher = self._publishers[topic]
            publisher.forget()
            for played in entries:
                publisher.remember_bytes(played.payload, source_time_ns=played.source_ns)
        for played in snapshot.newest:
            self._put(played)

    async def _publish_due(self) -> None:
        speed, at_ns = self._clock.speed, self._at_ns()
        if at_ns - self._horizon_ns > _MAX_BEHIND_S * speed * 1e9:
            self._seek_due.set()
            return
        if self._horizon_ns < at_ns + _AHEAD_S * speed * 0.5e9 and self._horizon_ns < self._source.end_ns:
            until_ns = at_ns + round(_AHEAD_S * speed * 1e9)
            upcoming, self._horizon_ns = await asyncio.to_thread(self._source.take, until_ns, speed=speed)
            if self._seek_due.is_set():
                return  # the position was changed in the meantime
            # Publish in the order of publication; the recording is in the order of receipt.
            self._queue = deque(sorted((*self._queue, *upcoming), key=lambda played: played.at_ns))
        now_ns = self._at_ns() + round(_BATCH_S * speed * 1e9)
        while self._queue and self._queue[0].at_ns <= now_ns:
            self._put(self._queue.popleft())
        now = time.monotonic()
        if self._clock.at_end(now) and not self._queue and self._horizon_ns >= self._source.end_ns:
            if not (self._clock.loop and self._clock.duration_s >= _MIN_LOOP_S):
                self._clock.pause(now)
            elif now - self._restarted_s >= _LOOP_EACH_S:
                self._restarted_s = now
                self._clock.play(now)
                self._seek_due.set()

    def _put(self, played: ReplayMessage) -> None:
        publisher = self._publishers[played.topic]
        publisher.put_bytes(played.payload, source_time_ns=played.source_ns, key_frame=played.key_frame)
        now = time.monotonic()
        self._last_put[played.topic] = _LastPut(played, now)
        if played.topic == "joints" and now - self._slow_s >= 0.95 / _SLOW_HZ:
            self._slow_s = now
            self._publishers["joints/slow"].put_bytes(played.payload, source_time_ns=played.source_ns)

    def _keep_alive(self) -> None:
        """Repeat fresh messages while paused or slow, so that they do not expire."""
        if self._clock.playing and self._clock.speed >= 1.0:
            return
        now, at_ns = time.monotonic(), self._at_ns()
        for last in list(self._last_put.values()):
            row = topics.topic(last.played.topic)
            if row.stale_after_s is None or row.history is History.KEY_FRAME:
                continue
            fresh = at_ns - last.played.at_ns <= row.stale_after_s * 1e9
            if fresh and now - last.put_s >= row.stale_after_s / 2:
                self._put(last.played)

    def _sleep_s(self) -> float:
        if not self._clock.playing or not self._queue:
            return _MAX_SLEEP_S
        left_s = (self._queue[0].at_ns - self._at_ns()) * 1e-9 / self._clock.speed
        return min(max(left_s, 0.0), _MAX_SLEEP_S)

    async def _publish_state(self) -> None:
        while True:
            self._publishers["replay"].put(self.describe())
            await asyncio.sleep(_STATE_EACH_S)
