"""The recorder service: captures on request or when a controller's trace goes on, and the flight recorder."""

import asyncio
import logging
import os
import time
from collections.abc import Callable, Coroutine, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path

from mcap_files.capture import Capture
from mcap_files.channel_names import INDEXING, SUFFIX
from mcap_files.errors import RecordingsError
from mcap_files.recover import State
from robomesh import reason_codes as codes
from robomesh.errors import MessageError, RefusedError
from robomesh.keys import WHOLE_SITE, robot_key
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.server import Request
from robomesh.session import Session
from services.recorder.attachments import Explainer, for_viewers, picture
from services.recorder.captures import Files, RobotRecorder
from services.recorder.disk import Disk, words
from services.recorder.events import Notices, disk_notices
from services.recorder.file_writer import Part
from services.recorder.finishing import Finisher, Job
from services.recorder.flight import FlightRecorder
from services.recorder.orphans import left_state, own
from services.recorder.serving import Serving
from services.recorder.settings import Settings
from services.recorder.subscriptions import Intake

log = logging.getLogger(__name__)

_TICK_S = 0.1
_BEATS = 10  # ticks
_EXPLAINED_WITHIN_S = 1.0
_ASK_AGAIN_AFTER_S = (0.1, 2.0)
_OWN_AGAIN_AFTER_S = 2.0
_MOST_ENDED = 100
_Request = schema.RecorderRequest
_State = schema.ControllerState
_S = schema.Event.Severity


async def serve(session: Session, settings: Settings) -> None:
    """Record what is asked for, until cancelled; open captures are closed then."""
    recorder = _Recorder(session, settings)
    try:
        await recorder.serve()
    finally:
        await recorder.end()


class _Robot:
    """What there is of one robot."""

    def __init__(self, recorder: "_Recorder", name: str) -> None:
        session, settings = recorder.session, recorder.settings
        files = Files(settings, name, recorder.intake, recorder.disk, self._explain)
        self.name = name
        self.recorder = recorder
        self.captures = RobotRecorder(files, recorder.finisher)
        self.flight: FlightRecorder | None = None
        if settings.flight is not None:
            self.flight = FlightRecorder(
                files,
                recorder.finisher,
                settings.flight,
                on_save=self._explain_save,
                say=partial(recorder.notices.say, name),
            )
        recorder.notices.ready(name)
        self.told = session.declare_publisher(settings.site, name, "recording")
        session.answer(settings.site, name, "recorder/request", self.on_request)

    async def on_request(self, request: Request) -> schema.Recording:
        """Begin or end a capture, or save the last minutes.

        Raises:
            RefusedError: Why not.
        """
        asked = request.message
        assert isinstance(asked, _Request)
        if asked.action == _Request.SAVE:
            if self.flight is None:
                raise RefusedError(codes.FLIGHT_NONE())
            return await self.flight.save("asked for", asked.name)
        if asked.action == _Request.TRACE_ON:
            self._check(asked.views)
            views = tuple(asked.views) or None
            recording = await self.captures.open(asked.name, views=views, started_by="request")
        else:
            recording = await self.close()
        self.tell()
        return recording

    async def close(self) -> schema.Recording:
        """End the capture, explained."""
        await self.recorder.explainer.settled(self.name, within_s=_EXPLAINED_WITHIN_S)
        return await self.captures.close()

    async def follow(self, state: _State, before: int) -> None:
        """A controller's trace, whoever turned it on, is a capture."""
        part = self.captures.part
        try:
            if state.trace == _State.YES and before != _State.YES and part is None:
                await self.captures.open("", views=None, started_by="trace")
            elif state.trace == _State.YES and before != _State.YES and part is not None:
                name = part.capture.about["name"]
                text = f"the controller's trace goes into {name}, which is being recorded already"
                self.recorder.notices.say(self.name, _S.INFO, "recorder.trace_joined", text, recording=name)
            elif state.trace == _State.NO and part and part.capture.about["started_by"] == "trace":
                await self.close()
        except RefusedError as error:
            self.recorder.notices.say(
                self.name, _S.ERROR, "recorder.refused", f"the trace is not recorded: {error}"
            )

    async def tick(self) -> None:
        """Go on with files that are long enough."""
        try:
            await self.captures.tick()
            if self.flight is not None:
                await self.flight.tick()
            text = ""
        except Exception as error:  # one robot's fault is not the others'
            log.exception("%s", self.name)
            text = f"the recorder of {self.name} failed, and goes on: {error or type(error).__name__}"
        said = f"the recorder of {self.name} works again"
        self.recorder.notices.is_so("recorder.failed", _S.ERROR, text, said, robot=self.name)

    def tell(self) -> None:
        """Publish how the capture is."""
        self.told.put(self.captures.describe())

    def explain_open(self) -> None:
        """What the robot is has become known."""
        for part in (self.captures.part, self.flight.part if self.flight and self.flight.saving else None):
            if part is not None:
                self._attach(part)

    def _check(self, views: Sequence[str]) -> None:
        """Whether there can be such views.

        Raises:
            RefusedError: If not.
        """
        known = self.recorder.explainer.known.get(self.name)
        if known is None or not known.description.views:
            return
        names = [view.name for view in known.description.views]
        for view in views:
            if view not in (*names, "-", "far") and not view.startswith("free-"):
                raise RefusedError(codes.VIEW_UNKNOWN_OF(view=view, robot=self.name, views=", ".join(names)))

    def _explain(self, part: Part) -> None:
        # A segment of the flight recorder is explained when it is kept.
        if part.capture.about["started_by"] != "flight":
            self._explain_save(part)

    def _explain_save(self, part: Part) -> None:
        self._attach(part)
        self.recorder.begin(self._picture(part))

    def _attach(self, part: Part) -> None:
        known = self.recorder.explainer.known.get(self.name)
        if known is None:
            return
        now_ns = time.time_ns()
        for each in known.attachments:
            part.capture.attach(each.name, each.media_type, each.data, time_ns=now_ns)
        if known.description.urdf:
            text = for_viewers(known)
            with self.recorder.intake.lock:
                log_time_ns = part.log_time_ns(time.monotonic_ns())
                part.capture.add_text("/robot_description", text, known.header, received_ns=log_time_ns)
                part.capture.hand_over()

    async def _picture(self, part: Part) -> None:
        settings = self.recorder.settings
        if (found := await picture(self.recorder.session, settings.site, self.name)) is not None:
            part.capture.attach(found.name, found.media_type, found.data, time_ns=time.time_ns())


class _Recorder:
    """A site's recorder."""

    def __init__(self, session: Session, settings: Settings) -> None:
        self.session, self.settings = session, settings
        self._loop = asyncio.get_running_loop()
        self._group = asyncio.TaskGroup()
        self._robots: dict[str, _Robot] = {}
        self.intake = Intake(session.zenoh_session, settings.site, session.ignored)
        self.disk = Disk(settings.folder, settings.marks, self._on_failed)
        self.finisher = Finisher()
        self.notices = Notices(session, settings.site)
        self.explainer = Explainer(session, settings.site, self._on_explained)
        self._serving = Serving(
            session,
            settings.site,
            settings.folder,
            open_now=self._open_now,
            flight=self._flight_runs,
            quotas=settings.quotas,
        )
        self._owned: int | None = None
        # Captures that the disk ended, by file: what the files themselves cannot tell.
        self._ended: dict[str, schema.Recording] = {}

    def _measure(self) -> None:
        """Numbers for who looks after it."""

        def recorded() -> list[schema.Recording]:
            return [robot.captures.last for robot in tuple(self._robots.values()) if robot.captures.part]

        measure, disk = self.session.measure, self.disk
        measure("captures", "Recordings that are open", lambda: len(recorded()))
        measure("disk_free_bytes", "Free on the disk of the recordings", lambda: disk.free_bytes)
        measure("disk_behind_seconds", "How long what waits for the disk has waited", lambda: disk.behind_s)
        measure("recording_level", "0: all; 1: no video; 2: states only; 3: nothing", lambda: disk.taken)

    async def serve(self) -> None:
        """Until cancelled."""
        self._measure()
        async with self._group as group:
            left = sorted(self.settings.folder.glob(f"*/*{SUFFIX}"))
            for robot in self.settings.robots:
                await self._add(robot)
            for work in (self.finisher.serve, self.explainer.serve, self._follow_traces, self._tick):
                group.create_task(work())
            group.create_task(self._watch())
            self.begin(self._recover(left))
            async for who, alive in self.session.watch_presence():
                if alive and who.site == self.settings.site:
                    if who.service == "gateway" and who.robot not in self._robots:
                        await self._add(who.robot)
                    self.begin(self._refresh_soon(who.robot))

    async def end(self) -> None:
        """Close what is open."""
        for robot in self._robots.values():
            with suppress(RefusedError):
                await robot.captures.close()
            if robot.flight is not None:
                await robot.flight.end()
        self.intake.close()
        self.disk.end()
        if self._owned is not None:
            os.close(self._owned)
        await self._serving.close()

    def begin(self, work: Coroutine[None, None, None]) -> None:
        """Do something beside, which ends nothing else when it fails."""

        async def guarded() -> None:
            try:
                await work
            except Exception:
                log.exception("the recorder goes on")

        self._group.create_task(guarded())

    async def _add(self, name: str) -> None:
        robot = self._robots[name] = _Robot(self, name)
        if robot.flight is not None:
            try:
                await robot.flight.begin()
            except OSError as error:
                log.error("%s: flight recorder: %s", name, error)

    async def _recover(self, left: Sequence[Path]) -> None:
        """Files of a recorder that was killed are made whole; their originals stay until that is done.

        Of a folder that is another recorder's too, one alone does it.
        """
        while (owned := await asyncio.to_thread(own, self.settings.folder)) is None:
            await asyncio.sleep(_OWN_AGAIN_AFTER_S)
        self._owned = owned
        for path in self.settings.folder.glob(f"*/*{INDEXING}"):
            if path.with_suffix(SUFFIX).name not in self.finisher.progress:
                path.unlink()  # of a writer that was killed; the file itself is whole
        for path in left:
            try:
                state = await asyncio.to_thread(left_state, path)
            except (RecordingsError, OSError) as error:
                log.warning("%s", error)
                continue
            if state is State.UNFINISHED:
                self.finisher.give(Job(path, (path,), {"recovered": "yes"}, self._recovered(path)))
            elif state is State.CLOSED:
                self.finisher.give(Job(path, (path,)))

    def _recovered(self, path: Path) -> Callable[[str | None], None]:
        def done(problem: str | None) -> None:
            if problem is None:
                text = f"{path.name} had not been closed; it is whole now"
                self.notices.say(path.parent.name, _S.INFO, "recorder.recovered", text, file=path.name)
            else:
                text = f"{path.name} had not been closed, and stays as it is: {problem}"
                self.notices.say(path.parent.name, _S.WARNING, "recorder.not_recovered", text)

        return done

    async def _follow_traces(self) -> None:
        before: dict[str, int] = {}
        key = robot_key(self.settings.site, WHOLE_SITE, "controller").replace("/-/", "/*/")
        async for sample in self.session.subscribe(key, newest=1000):
            name = sample.parsed.robot
            if (robot := self._robots.get(name)) is None:
                continue
            try:
                state = sample.message()
            except MessageError:
                continue
            assert isinstance(state, _State)
            was, before[name] = before.get(name, _State.KNOWN_UNSPECIFIED), state.trace
            await robot.follow(state, was)

    async def _tick(self) -> None:
        while True:
            for robot in tuple(self._robots.values()):
                await robot.tick()
            await asyncio.sleep(_TICK_S)

    async def _watch(self) -> None:
        """What goes on also while a disk hangs: see what it takes, and tell."""
        ticks = 0
        while True:
            self.disk.weigh()
            disk_notices(self.notices, self.disk)
            ticks += 1
            if ticks % _BEATS == 0:
                for robot in tuple(self._robots.values()):
                    robot.tell()
            await asyncio.sleep(_TICK_S)

    async def _refresh_soon(self, name: str) -> None:
        """A service has come alive: ask for what it published while the link was down."""
        # What it answers with is declared after its presence, on a busy machine much later.
        for after_s in _ASK_AGAIN_AFTER_S:
            await asyncio.sleep(after_s)
            await asyncio.to_thread(self._refresh, name)

    def _refresh(self, name: str) -> None:
        robots = tuple(self._robots) if name == WHOLE_SITE else (name,) if name in self._robots else ()
        with self.intake.lock:
            for each in robots:
                self.intake.robot(each).refresh()

    def _on_explained(self, name: str) -> None:
        if (robot := self._robots.get(name)) is not None:
            robot.explain_open()

    def _on_failed(self, capture: Capture, error: OSError) -> None:
        self._loop.call_soon_threadsafe(self._failed, capture, error)

    def _failed(self, capture: Capture, error: OSError) -> None:
        for robot in self._robots.values():
            if (part := robot.captures.failed(capture, error)) is not None:
                text = f"recording {capture.about['name']} ended: {words(error)}; what was written is kept"
                self.notices.say(robot.name, _S.CRITICAL, "recorder.ended", text)
                self._note_ended(robot.captures.last)
                robot.tell()
            elif robot.flight is not None and (part := robot.flight.failed(capture)) is not None:
                text = f"the flight recorder of {robot.name} keeps nothing now: {words(error)}"
                self.notices.say(robot.name, _S.CRITICAL, "recorder.flight_ended", text)
            if part is not None:
                self.begin(asyncio.to_thread(self.disk.mend, capture, part.missed))
                return
        # It was just being closed: who closes it mends it.
        text = f"{capture.path.name} was cut short: {words(error)}; what was written is kept"
        self.notices.say(capture.about["robot"], _S.CRITICAL, "recorder.ended", text)

    def _note_ended(self, last: schema.Recording) -> None:
        while len(self._ended) >= _MOST_ENDED:
            self._ended.pop(next(iter(self._ended)))
        self._ended[last.file] = ended = schema.Recording()
        ended.CopyFrom(last)

    def _flight_runs(self) -> bool:
        flights = [robot.flight for robot in self._robots.values() if robot.flight is not None]
        return self.settings.flight is not None and not any(flight.stopped for flight in flights)

    def _open_now(self) -> dict[str, schema.Recording]:
        folder = self.settings.folder
        found = {file: each for file, each in self._ended.items() if (folder / each.robot / file).exists()}
        for robot in self._robots.values():
            if robot.captures.part is not None:
                recording = robot.captures.describe()
                found[recording.file] = recording
            if robot.flight is not None and robot.flight.saving is not None and robot.flight.part is not None:
                recording = robot.flight.describe()
                found[recording.file] = recording
        return found
