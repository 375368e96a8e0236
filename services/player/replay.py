"""One replay: a recording published as a robot of its own, and asked to pause, seek, go faster."""

import asyncio
import contextlib
import logging
import time
from collections import deque
from dataclasses import dataclass

from mcap_files.errors import RecordingsError
from robomesh import reason_codes as codes
from robomesh import topics
from robomesh.errors import BusError, RefusedError
from robomesh.keys import replay_name, robot_key
from robomesh.publisher import Publisher
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.server import Answerer, Handler, Request
from robomesh.session import Session
from robomesh.topics import History
from services.player.clock import Clock
from services.player.errors import ReplayError
from services.player.recording_source import Played, Scene, Tape

log = logging.getLogger(__name__)


SERVICE = "player"
_Ask = schema.ReplayRequest
# Read ahead so much, by the replay's own time.
_AHEAD_S = 0.3
_STATE_EACH_S = 0.2
# What is due within this goes out together.
_TOGETHER_S = 0.002
_LONGEST_SLEEP_S = 0.05
# Further behind than this it goes on where it should be: a replay that cannot keep up shows less, not later.
_MOST_BEHIND_S = 1.0
_SLOW_HZ = 10.0
# What is shorter is a moment, and is not played again and again; nor is anything begun anew more often.
_SHORTEST_LOOP_S, _LOOP_EACH_S = 0.1, 0.5
_MESH_WITHIN_S = 5.0


@dataclass
class _Shown:
    """The last message of a topic, and when it was put on the mesh [s]."""

    played: Played
    put_s: float


class Replay:
    """A recording on the mesh.

    Args:
        identity: The robot's name is `replay-<identity>`.
    """

    def __init__(self, session: Session, site: str, identity: str, tape: Tape, clock: Clock) -> None:
        self.robot = replay_name(identity)
        self._session, self._site, self._tape, self._clock = session, site, tape, clock
        self._text = ""
        self._jump = asyncio.Event()
        self._closed = asyncio.Event()
        self._wake = asyncio.Event()
        self._waiting: deque[Played] = deque()
        self._horizon_ns = 0
        self._shown: dict[str, _Shown] = {}
        self._slow_s = 0.0
        self._looped_s = -_LOOP_EACH_S
        tape.names = type(tape.names)(tape.of_site, tape.of_robot, site, self.robot)
        tape.replay = schema.Description.Replay(
            id=identity, site=tape.of_site, robot=tape.of_robot, file=tape.file.path.name
        )
        tape.replay.start.FromNanoseconds(tape.start_ns)
        self._publishers: dict[str, Publisher] = {}
        self._answerers: list[Answerer] = []

    def describe(self) -> schema.ReplayState:
        """How far it is."""
        now, tape = time.monotonic(), self._tape
        state = schema.ReplayState(
            robot=self.robot,
            file=tape.file.path.name,
            of_site=tape.of_site,
            of_robot=tape.of_robot,
            duration_s=self._clock.duration_s,
            position_s=self._clock.position_s(now),
            speed=self._clock.speed,
            playing=self._clock.playing,
            loop=self._clock.loop,
            text=self._text,
        )
        state.timestamp.GetCurrentTime()
        state.start.FromNanoseconds(tape.start_ns)
        return state

    def close(self) -> None:
        """End it; `run` returns."""
        self._closed.set()
        self._wake.set()

    async def run(self) -> None:
        """Play until it is closed."""
        self._declare()
        token = self._session.declare_presence_of(self._site, self.robot, SERVICE, self._session.identity)
        telling = asyncio.create_task(self._tell())
        try:
            self._jump.set()
            while not self._closed.is_set():
                try:
                    await self._step()
                except RecordingsError as error:
                    log.warning("%s: %s", self.robot, error)
                    self._text = str(error)
                    self._clock.pause(time.monotonic())
                    self._waiting.clear()
                    self._jump.clear()
        finally:
            telling.cancel()
            with contextlib.suppress(Exception):
                token.undeclare()
            for answerer in self._answerers:
                answerer.close()
            for publisher in self._publishers.values():
                publisher.close()
            self._tape.close()

    # ------------------------------------------------------------ what is asked

    def _declare(self) -> None:
        names = [*self._tape.topics, "replay"]
        if "joints" in names:
            names.append("joints/slow")
        for name in names:
            self._publishers[name] = self._session.declare_publisher(self._site, self.robot, name)
        answers: dict[str, Handler] = {
            "replay/request": self._on_request,
            "mesh/*": self._on_mesh,
            **dict.fromkeys(("stop", "lease/request/*", "command/*", "recorder/request"), self._refuse),
        }
        for name, handler in answers.items():
            self._answerers.append(self._session.answer(self._site, self.robot, name, handler))

    async def _refuse(self, request: Request) -> bytes:
        code = (
            codes.REPLAY_IS_RECORDED if request.key.topic == "recorder/request" else codes.REPLAY_CANNOT_MOVE
        )
        raise RefusedError(code(file=self._tape.file.path.name))

    async def _on_mesh(self, request: Request) -> bytes:
        try:
            return await asyncio.to_thread(self._tape.file.attachment, f"mesh/{request.chunk}")
        except RecordingsError as error:
            return await self._mesh_of_robot(request.chunk, str(error))

    async def _mesh_of_robot(self, name: str, text: str) -> bytes:
        """Recorded before meshes were in the file: the robot itself, if it is there, has them."""
        of = (self._tape.of_site, self._tape.of_robot)
        with contextlib.suppress(BusError):
            if any((who.site, who.robot) == of for who in await self._session.present()):
                return await self._session.ask_bytes(robot_key(*of, f"mesh/{name}"), timeout_s=_MESH_WITHIN_S)
        raise RefusedError(codes.RECORDING_UNREADABLE(detail=text))

    async def _on_request(self, request: Request) -> schema.ReplayState:
        asked = request.message
        assert isinstance(asked, _Ask)
        now = time.monotonic()
        try:
            match asked.action:
                case _Ask.PLAY:
                    ended = self._clock.at_end(now)
                    self._clock.play(now)
                    if ended:
                        self._jump.set()
                case _Ask.PAUSE:
                    self._clock.pause(now)
                    self._jump.set()  # what was thinned is shown as it was
                case _Ask.SEEK:
                    self._clock.seek(asked.position_s, now)
                    self._jump.set()
                case _Ask.SPEED:
                    self._clock.set_speed(asked.speed, now)
                case _Ask.LOOP:
                    self._clock.loop = asked.loop
                case _Ask.CLOSE:
                    self.close()
        except ReplayError as error:
            raise RefusedError(error.reason) from None
        self._text = ""
        self._wake.set()
        return self.describe()

    # --------------------------------------------------------------- what is put

    async def _step(self) -> None:
        """Put what is due, read what comes, and sleep until there is something to do."""
        if self._jump.is_set():
            self._jump.clear()
            self._show(await asyncio.to_thread(self._tape.seek, self._at_ns()))
        if self._clock.playing:
            await self._play_on()
        self._keep_alive()
        self._wake.clear()
        if not (self._closed.is_set() or self._jump.is_set()):
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._wake.wait(), self._sleep_s())

    def _at_ns(self) -> int:
        return self._tape.start_ns + round(self._clock.position_s(time.monotonic()) * 1e9)

    def _show(self, scene: Scene) -> None:
        """What was so at the place that was gone to."""
        self._waiting.clear()
        self._shown.clear()
        self._horizon_ns = self._at_ns()
        for topic, entries in scene.lists.items():
            publisher = self._publishers[topic]
            publisher.forget()
            for played in entries:
                publisher.remember_bytes(played.payload, source_time_ns=played.source_ns)
        for played in scene.newest:
            self._put(played)

    async def _play_on(self) -> None:
        speed, at_ns = self._clock.speed, self._at_ns()
        if at_ns - self._horizon_ns > _MOST_BEHIND_S * speed * 1e9:
            self._jump.set()
            return
        if self._horizon_ns < at_ns + _AHEAD_S * speed * 0.5e9 and self._horizon_ns < self._tape.end_ns:
            until_ns = at_ns + round(_AHEAD_S * speed * 1e9)
            coming, self._horizon_ns = await asyncio.to_thread(self._tape.take, until_ns, speed=speed)
            if self._jump.is_set():
                return  # gone elsewhere meanwhile
            # What came late on its way belongs before what came sooner.
            self._waiting = deque(sorted((*self._waiting, *coming), key=lambda played: played.at_ns))
        now_ns = self._at_ns() + round(_TOGETHER_S * speed * 1e9)
        while self._waiting and self._waiting[0].at_ns <= now_ns:
            self._put(self._waiting.popleft())
        now = time.monotonic()
        if self._clock.at_end(now) and not self._waiting and self._horizon_ns >= self._tape.end_ns:
            if not (self._clock.loop and self._clock.duration_s >= _SHORTEST_LOOP_S):
                self._clock.pause(now)
            elif now - self._looped_s >= _LOOP_EACH_S:
                self._looped_s = now
                self._clock.play(now)
                self._jump.set()

    def _put(self, played: Played) -> None:
        publisher = self._publishers[played.topic]
        publisher.put_bytes(played.payload, source_time_ns=played.source_ns, key_frame=played.key_frame)
        now = time.monotonic()
        self._shown[played.topic] = _Shown(played, now)
        if played.topic == "joints" and now - self._slow_s >= 0.95 / _SLOW_HZ:
            self._slow_s = now
            self._publishers["joints/slow"].put_bytes(played.payload, source_time_ns=played.source_ns)

    def _keep_alive(self) -> None:
        """While it pauses or goes slowly, what was fresh at this place of the recording stays so."""
        if self._clock.playing and self._clock.speed >= 1.0:
            return
        now, at_ns = time.monotonic(), self._at_ns()
        for shown in list(self._shown.values()):
            row = topics.topic(shown.played.topic)
            if row.stale_after_s is None or row.history is History.KEY_FRAME:
                continue
            fresh = at_ns - shown.played.at_ns <= row.stale_after_s * 1e9
            if fresh and now - shown.put_s >= row.stale_after_s / 2:
                self._put(shown.played)

    def _sleep_s(self) -> float:
        if not self._clock.playing or not self._waiting:
            return _LONGEST_SLEEP_S
        left_s = (self._waiting[0].at_ns - self._at_ns()) * 1e-9 / self._clock.speed
        return min(max(left_s, 0.0), _LONGEST_SLEEP_S)

    async def _tell(self) -> None:
        while True:
            self._publishers["replay"].put(self.describe())
            await asyncio.sleep(_STATE_EACH_S)
