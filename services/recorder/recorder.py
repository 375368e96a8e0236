"""Recorder service: captures on request or while a controller's trace is on, and the flight recorder."""

import asyncio
import logging
import os
import time
from collections.abc import Callable, Coroutine, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path

from robomesh import reason_codes as codes
from robomesh.contract.keys import CLOSE, FAR, FREE, WHOLE_SITE, robot_key
from robomesh.errors import MessageError, RefusedError
from robomesh.reasons import Reason
from robomesh.recordings.changes import set_labels
from robomesh.recordings.errors import RecordingsError
from robomesh.recordings.names import INDEXING, ROBOT_DESCRIPTION, SUFFIX
from robomesh.recordings.recovery.recover import State
from robomesh.recordings.writing.capture import Capture
from robomesh.requests.server import Request
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import Session
from services.recorder.attachments import DescriptionCache, picture, self_contained_urdf
from services.recorder.captures import CaptureFiles, RobotRecorder
from services.recorder.changes import RecordingChanges
from services.recorder.disk import Disk, error_text
from services.recorder.events import EventReporter, report_disk
from services.recorder.file_writer import CaptureSink
from services.recorder.flight import FlightRecorder
from services.recorder.indexing import IndexingQueue, Job
from services.recorder.left_files import left_state, lock_folder
from services.recorder.reading.serving import RecordingServer
from services.recorder.reading.uses import RecordingUses
from services.recorder.settings import Settings
from services.recorder.subscriptions import Subscriptions

log = logging.getLogger(__name__)

_TICK_S = 0.1
_BEATS = 10  # ticks
_SHAPES_WITHIN_S = 1.0
_REFRESH_AFTER_S = (0.1, 2.0)
_LOCK_RETRY_S = 2.0
_MAX_ENDED = 100
_Request = schema.RecorderRequest
_State = schema.ControllerState
_S = schema.Event.Severity


async def serve(session: Session, settings: Settings) -> None:
    """Record a site's robots until cancelled, then close open captures."""
    recorder = _Recorder(session, settings)
    try:
        await recorder.serve()
    finally:
        await recorder.end()


class _Robot:
    """Capture, flight recorder and request handler of one robot."""

    def __init__(self, recorder: "_Recorder", name: str) -> None:
        session, settings = recorder.session, recorder.settings
        files = CaptureFiles(settings, name, recorder.subscriptions, recorder.disk, self._on_open)
        self.name = name
        self.recorder = recorder
        self.captures = RobotRecorder(files, recorder.indexing_queue)
        self.flight: FlightRecorder | None = None
        if settings.flight.minutes:
            self.flight = FlightRecorder(
                files,
                recorder.indexing_queue,
                settings.flight,
                on_save=self._add_description,
                report=partial(recorder.events.report, name),
            )
        recorder.events.declare(name)
        self.publisher = session.declare_publisher(settings.site, name, "recording")
        session.answer(settings.site, name, "recorder/request", self.on_request)

    async def on_request(self, request: Request) -> schema.Recording:
        """Begin or end a capture, or save the last minutes.

        Raises:
            RefusedError: If that is not possible.
        """
        message = request.message
        assert isinstance(message, _Request)
        if message.action == _Request.SAVE:
            if self.flight is None:
                raise RefusedError(codes.FLIGHT_NONE())
            return await self.flight.save("requested", message.name)
        if message.action == _Request.TRACE_ON:
            self._check(message.views)
            views = tuple(message.views) or None
            recording = await self.captures.open(message.name, views=views, started_by="request")
        else:
            recording = await self.close()
        self.publish()
        return recording

    async def close(self) -> schema.Recording:
        """End the capture with its attachments."""
        await self.recorder.descriptions.wait_for_shapes(self.name, within_s=_SHAPES_WITHIN_S)
        return await self.captures.close()

    async def on_trace(self, state: _State, previous: int) -> None:
        """Open a capture when the controller's trace is switched on, and close it when it is switched off."""
        part = self.captures.part
        try:
            if state.trace == _State.YES and previous != _State.YES and part is None:
                await self.captures.open("", views=None, started_by="trace")
            elif state.trace == _State.YES and previous != _State.YES and part is not None:
                name = part.capture.about["name"]
                text = f"the controller's trace is recorded in {name}, which was already open"
                self.recorder.events.report(self.name, _S.INFO, "recorder.trace_joined", text, recording=name)
            elif state.trace == _State.NO and part and part.capture.about["started_by"] == "trace":
                await self.close()
        except RefusedError as error:
            self.recorder.events.report(
                self.name, _S.ERROR, "recorder.refused", f"the trace is not recorded: {error}"
            )

    async def tick(self) -> None:
        """Begin next files when due; report an error instead of raising it."""
        try:
            await self.captures.tick()
            if self.flight is not None:
                await self.flight.tick()
            text = ""
        except Exception as error:  # an error of one robot must not stop the others' recordings
            log.exception("%s", self.name)
            text = f"the recorder of {self.name} failed and tries again: {error or type(error).__name__}"
        over = f"the recorder of {self.name} works again"
        self.recorder.events.report_state("recorder.failed", _S.ERROR, text, over, robot=self.name)

    def publish(self) -> None:
        """Publish the state of the capture."""
        self.publisher.put(self.captures.describe())

    def attach_description(self) -> None:
        """Attach the robot's new description to the open files."""
        for part in (self.captures.part, self.flight.part if self.flight and self.flight.saving else None):
            if part is not None:
                self._attach(part)

    def _check(self, views: Sequence[str]) -> None:
        """Check the names of views against the robot's description, if it is known.

        Raises:
            RefusedError: If the robot has no view of that name.
        """
        known = self.recorder.descriptions.known.get(self.name)
        if known is None or not known.description.views:
            return
        names = [*(view.name for view in known.description.views), FREE, CLOSE, FAR]
        for view in views:
            if view not in (*names, "-") and not view.startswith("free-"):
                raise RefusedError(codes.VIEW_UNKNOWN_OF(view=view, robot=self.name, views=", ".join(names)))

    def _on_open(self, part: CaptureSink) -> None:
        # A segment of the flight recorder gets its attachments when it is saved.
        if part.capture.about["started_by"] != "flight":
            self._add_description(part)

    def _add_description(self, part: CaptureSink) -> None:
        self._attach(part)
        self.recorder.start(self._picture(part))

    def _attach(self, part: CaptureSink) -> None:
        known = self.recorder.descriptions.known.get(self.name)
        if known is None:
            return
        now_ns = time.time_ns()
        for each in known.attachments:
            part.capture.attach(each.name, each.media_type, each.data, time_ns=now_ns)
        if known.description.urdf:
            text = self_contained_urdf(known)
            with self.recorder.subscriptions.lock:
                log_time_ns = part.log_time_ns(time.monotonic_ns())
                part.capture.add_text(ROBOT_DESCRIPTION, text, known.header, received_ns=log_time_ns)
                part.capture.hand_over()

    async def _picture(self, part: CaptureSink) -> None:
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
        self.subscriptions = Subscriptions(session.zenoh_session, settings.site, session.ignored)
        self.disk = Disk(settings.folder, settings.free, self._on_failed)
        self.indexing_queue = IndexingQueue()
        self.events = EventReporter(session, settings.site)
        self.descriptions = DescriptionCache(session, settings.site, self._on_known)
        self._uses = RecordingUses()
        self._serving = RecordingServer(
            session,
            settings.site,
            settings.folder,
            open_now=self._open_now,
            flight=self._flight_runs,
            quotas=settings.quotas,
            uses=self._uses,
        )
        self._changes = RecordingChanges(
            settings.folder,
            describe=self._serving.describe,
            is_used=self._use_of,
            free_reserve=self.disk.free_reserve,
            report=self.events.report_reason,
        )
        session.answer(settings.site, WHOLE_SITE, "recordings/request/*", self._change)
        self._folder_lock: int | None = None
        # Captures that a disk error ended, by file: the files do not contain the reason.
        self._ended: dict[str, schema.Recording] = {}

    def _measure(self) -> None:
        """Register the recorder's metrics."""

        def recorded() -> list[schema.Recording]:
            return [robot.captures.last for robot in tuple(self._robots.values()) if robot.captures.part]

        measure, disk = self.session.measure, self.disk
        measure("captures", "Recordings that are open", lambda: len(recorded()))
        measure("disk_free_bytes", "Free on the disk of the recordings", lambda: disk.free_bytes)
        measure("disk_low", "Whether less is free than the site file's warning mark", lambda: disk.is_low)
        measure("disk_behind_seconds", "Age of the data that waits for the disk", lambda: disk.behind_s)
        measure("recording_level", "0: all; 1: no video; 2: states only; 3: nothing", lambda: disk.level)

    async def serve(self) -> None:
        """Record until cancelled."""
        self._measure()
        async with self._group as group:
            left = sorted(self.settings.folder.glob(f"*/*{SUFFIX}"))
            for robot in self.settings.robots:
                await self._add(robot)
            for work in (self.indexing_queue.serve, self.descriptions.serve, self._follow_traces, self._tick):
                group.create_task(work())
            group.create_task(self._watch())
            self.start(self._recover(left))
            async for presence, alive in self.session.watch_presence():
                if alive and presence.site == self.settings.site:
                    if presence.service == "gateway" and presence.robot not in self._robots:
                        await self._add(presence.robot)
                    self.start(self._refresh_soon(presence.robot))

    async def end(self) -> None:
        """Close open files and release the folder."""
        for robot in self._robots.values():
            with suppress(RefusedError):
                await robot.captures.close()
            if robot.flight is not None:
                await robot.flight.end()
        self.subscriptions.close()
        self.disk.end()
        if self._folder_lock is not None:
            os.close(self._folder_lock)
        await self._serving.close()

    def start(self, work: Coroutine[None, None, None]) -> None:
        """Run a coroutine in the background; log its errors."""

        async def guarded() -> None:
            try:
                await work
            except Exception:
                log.exception("a background task of the recorder failed")

        self._group.create_task(guarded())

    async def _add(self, name: str) -> None:
        robot = self._robots[name] = _Robot(self, name)
        if robot.flight is not None:
            try:
                await robot.flight.begin()
            except OSError as error:
                log.error("%s: flight recorder: %s", name, error)

    async def _recover(self, left: Sequence[Path]) -> None:
        """Queue the recovery of files that a killed recorder left; each original stays until that succeeds.

        Recorders that share a folder take its lock, so that only one of them recovers.
        """
        while (lock := await asyncio.to_thread(lock_folder, self.settings.folder)) is None:
            await asyncio.sleep(_LOCK_RETRY_S)
        self._folder_lock = lock
        try:
            await asyncio.to_thread(self._changes.recover)
        except OSError as error:
            log.error("%s: %s", self.settings.folder, error)
        for path in self.settings.folder.glob(f"*/*{INDEXING}"):
            if path.with_suffix(SUFFIX).name not in self.indexing_queue.progress:
                path.unlink()  # left by a killed indexer; the recording itself is complete
        for path in left:
            try:
                state = await asyncio.to_thread(left_state, path)
            except (RecordingsError, OSError) as error:
                log.warning("%s", error)
                continue
            if state is State.UNFINISHED:
                self.indexing_queue.submit(Job(path, (path,), {"recovered": "yes"}, self._recovered(path)))
            elif state is State.CLOSED:
                self.indexing_queue.submit(Job(path, (path,)))

    def _recovered(self, path: Path) -> Callable[[str | None], None]:
        def done(problem: str | None) -> None:
            if problem is None:
                text = f"{path.name} had not been closed; it is complete now"
                self.events.report(path.parent.name, _S.INFO, "recorder.recovered", text, file=path.name)
            else:
                text = f"{path.name} had not been closed and could not be recovered: {problem}"
                self.events.report(path.parent.name, _S.WARNING, "recorder.not_recovered", text)

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
            previous, before[name] = before.get(name, _State.KNOWN_UNSPECIFIED), state.trace
            await robot.on_trace(state, previous)

    async def _tick(self) -> None:
        while True:
            for robot in tuple(self._robots.values()):
                await robot.tick()
            await asyncio.sleep(_TICK_S)

    async def _watch(self) -> None:
        """Update the recording level and publish events and states; must also run while a disk hangs."""
        ticks = 0
        while True:
            self.disk.update_level()
            report_disk(self.events, self.disk)
            ticks += 1
            if ticks % _BEATS == 0:
                for robot in tuple(self._robots.values()):
                    robot.publish()
            await asyncio.sleep(_TICK_S)

    async def _refresh_soon(self, name: str) -> None:
        """Query a service that came online for what it published while the link was down."""
        # The service declares its queryables after its presence, on a busy machine much later.
        for after_s in _REFRESH_AFTER_S:
            await asyncio.sleep(after_s)
            await asyncio.to_thread(self._refresh, name)

    def _refresh(self, name: str) -> None:
        robots = tuple(self._robots) if name == WHOLE_SITE else (name,) if name in self._robots else ()
        with self.subscriptions.lock:
            for each in robots:
                self.subscriptions.robot(each).refresh()

    async def _change(self, request: Request) -> schema.Recording:
        recording = await self._changes.change(request)
        if (ended := self._ended.get(recording.file)) is not None:
            set_labels(ended, recording.history)
        for robot in self._robots.values():
            part = robot.captures.part
            if part is not None and part.capture.path.name == recording.file and recording.history:
                part.labels = recording.history[-1]
                robot.publish()
        return recording

    def _use_of(self, file: str, name: str) -> Reason | None:
        """Return the reason why a recording must not be deleted now; called on another thread."""
        if file in self._open_files:
            return codes.RECORDING_WRITTEN(name=name)
        if file in self.indexing_queue.progress:
            return codes.RECORDING_INDEXED(name=name)
        return self._uses.of(file, name)

    @property
    def _open_files(self) -> set[str]:
        found = set()
        for robot in tuple(self._robots.values()):
            if (part := robot.captures.part) is not None:
                found.add(part.capture.path.name)
            if robot.flight is not None and robot.flight.saving is not None:
                found.add(robot.flight.saving.name)
        return found

    def _on_known(self, name: str) -> None:
        if (robot := self._robots.get(name)) is not None:
            robot.attach_description()

    def _on_failed(self, capture: Capture, error: OSError) -> None:
        self._loop.call_soon_threadsafe(self._failed, capture, error)

    def _failed(self, capture: Capture, error: OSError) -> None:
        for robot in self._robots.values():
            if (part := robot.captures.failed(capture, error)) is not None:
                text = (
                    f"recording {capture.about['name']} ended: {error_text(error)}; what was written is kept"
                )
                self.events.report(robot.name, _S.CRITICAL, "recorder.ended", text)
                self._note_ended(robot.captures.last)
                robot.publish()
            elif robot.flight is not None and (part := robot.flight.failed(capture)) is not None:
                text = f"the flight recorder of {robot.name} stopped: {error_text(error)}"
                self.events.report(robot.name, _S.CRITICAL, "recorder.flight_ended", text)
            if part is not None:
                self.start(asyncio.to_thread(self.disk.repair, capture, part.missed))
                return
        # The file was being closed; `Disk.close` repairs it.
        text = f"{capture.path.name} was cut short: {error_text(error)}; what was written is kept"
        self.events.report(capture.about["robot"], _S.CRITICAL, "recorder.ended", text)

    def _note_ended(self, last: schema.Recording) -> None:
        while len(self._ended) >= _MAX_ENDED:
            self._ended.pop(next(iter(self._ended)))
        self._ended[last.file] = ended = schema.Recording()
        ended.CopyFrom(last)

    def _flight_runs(self) -> bool:
        flights = [robot.flight for robot in self._robots.values() if robot.flight is not None]
        return self.settings.flight.minutes > 0 and not any(flight.stopped for flight in flights)

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
