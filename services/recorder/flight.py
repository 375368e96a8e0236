"""Flight recorder: a ring of short files with a robot's last minutes, saved after an event."""

import asyncio
import json
import logging
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from math import inf
from pathlib import Path

from robomesh import reason_codes as codes
from robomesh.contract.messages import decode
from robomesh.contract.topics import Topic
from robomesh.errors import MessageError, RefusedError
from robomesh.recordings.errors import CaptureError
from robomesh.recordings.names import FLIGHT_FOLDER, SUFFIX
from robomesh.recordings.recovery.recover import State, state_of
from robomesh.recordings.writing.capture import Capture, is_being_written
from robomesh.schemas import robomesh_pb2 as schema
from services.recorder.captures import CaptureFiles, check_name
from services.recorder.disk import error_text
from services.recorder.file_writer import STATES, CaptureSink
from services.recorder.indexing import IndexingQueue, Job
from services.recorder.settings import MIB
from services.recorder.settings import Flight as Settings

log = logging.getLogger(__name__)

SOURCE = "recorder"
_S = schema.Event.Severity
_SEGMENTS = 10
_MIN_SEGMENT_S = 5.0
_RETRY_S = 5.0
# First retry interval of a failed save; it doubles each time.
_SAVE_RETRY_S = 30.0
# Extension of the files that list a save in progress, so that a save survives a kill of this process.
_MARK = ".save.json"
# Extension of unreadable segments.
_DAMAGED = ".damaged"
_RECOVERED = {"started_by": "flight", "recovered": "yes"}
_KILLED = "the recorder was killed, or its machine lost power"


@dataclass(frozen=True)
class _Save:
    """Segments to merge into one file.

    Attributes:
        segments: Empty while the save is still recording.
    """

    target: Path
    about: dict[str, str]
    segments: tuple[Path, ...] = ()

    def write_mark(self, folder: Path) -> None:
        """Write the mark, from which a later process can finish this save."""
        names = [each.name for each in self.segments]
        with suppress(OSError):  # without a mark, this process can still save
            self.mark(folder).write_text(json.dumps({"about": self.about, "segments": names}))

    def mark(self, folder: Path) -> Path:
        """Return the path of this save's mark."""
        return folder / f"{self.target.stem}{_MARK}"


class FlightRecorder:
    """Flight recorder of one robot. Its folder holds segments, oldest first by name.

    Args:
        on_save: Called with the open segment when a save begins, to add its attachments.
        report: Called with severity, code and text of an event.
    """

    def __init__(
        self,
        files: CaptureFiles,
        indexing_queue: IndexingQueue,
        settings: Settings,
        *,
        on_save: Callable[[CaptureSink], None],
        report: Callable[[schema.Event.Severity, str, str], None],
    ) -> None:
        self._files, self._queue, self._settings = files, indexing_queue, settings
        self._folder = files.settings.folder / FLIGHT_FOLDER / files.robot
        self._target = files.settings.folder / files.robot
        self._loop = asyncio.get_running_loop()
        self._lock = asyncio.Lock()
        self._retry_at = 0.0
        # The save that is recording: its end, its start and its metadata (empty: no save is recording).
        self._until = self._since = 0.0
        self._about: dict[str, str] = {}
        # Segments of submitted saves; they are kept until the save is done.
        self._submitted: set[Path] = set()
        # Failed saves by target: time of the next attempt, interval after it, the save.
        self._failed_saves: dict[Path, tuple[float, float, _Save]] = {}
        self._on_save, self._report = on_save, report
        # Monotonic time at which each segment was first seen closed; a file's own time is a settable clock's.
        self._closed_at: dict[Path, float] = {}
        self.part: CaptureSink | None = None
        # Target of the save that is recording.
        self.saving: Path | None = None
        # The disk refuses new segments.
        self.stopped = False

    async def begin(self) -> None:
        """Start recording; finish saves that an earlier process left when it was killed."""
        for save in await asyncio.to_thread(self._pending_saves):
            await self._submit(save)
        await self.tick()

    async def save(self, cause: str, name: str = "") -> schema.Recording:
        """Save the last minutes and what follows; a further cause extends a save that is recording.

        Raises:
            RefusedError: If no segment is open because of the disk, or the name is invalid.
        """
        name = check_name(name or f"flight-{datetime.now(UTC):%H%M%S}")
        async with self._lock:
            if self.part is None:
                raise RefusedError(codes.FLIGHT_NOT_RUNNING(robot=self._files.robot))
            now = time.monotonic()
            if not self._about:
                self._about, self._since = {"name": name, "cause": cause, "started_by": "flight"}, now
                self.saving = self._target_of(self._segments() or [self.part.capture.path], name)
                log.info("%s: the last minutes are saved: %s", self._files.robot, cause)
                self._on_save(self.part)
            self._until, answer = now + self._settings.after_s, self.describe()
            assert self.saving is not None
            await asyncio.to_thread(_Save(self.saving, self._about).write_mark, self._folder)
            return answer

    def describe(self) -> schema.Recording:
        """Describe the save that is recording; counts are those of the open segment."""
        assert self.part is not None
        assert self.saving is not None
        recording = self.part.describe()
        recording.name, recording.cause = self._about["name"], self._about["cause"]
        recording.file = self.saving.name
        return recording

    async def tick(self) -> None:
        """Begin the next segment, remove old ones, end or retry saves, when due."""
        async with self._lock:
            now = time.monotonic()
            for at, wait_s, save in tuple(self._failed_saves.values()):
                if now >= at:
                    self._failed_saves[save.target] = (inf, wait_s * 2, save)
                    await self._submit(save)
            if self._about and (now >= self._until or self._is_too_long(now)):
                await self._end_save(now)
            elif self.part is None:
                if now >= self._retry_at:
                    await self._next()
            elif self._is_full(self.part) and now >= self._retry_at:
                await self._next()
                await asyncio.to_thread(self._remove_old)

    def failed(self, capture: Capture) -> CaptureSink | None:
        """Drop the open segment after a disk error; return it, or None if the file is not this recorder's."""
        part = self.part
        if part is None or part.capture is not capture:
            return None
        self.part, self._retry_at, self.stopped = None, time.monotonic() + _RETRY_S, True
        self._files.detach(part)
        return part

    async def end(self) -> None:
        """Close the open segment; a save that is recording is finished at the next start."""
        if self.part is not None:
            part, self.part = self.part, None
            with suppress(OSError):
                await self._files.close(part)

    def _on_publication(self, row: Topic, payload: bytes) -> None:
        """Start a save if a publication is a severe event. Runs on the subscriptions' thread."""
        if row.schema is schema.Event:
            with suppress(MessageError):
                event = decode(schema.Event, payload)
                if event.severity >= self._settings.least_severity and event.source != SOURCE:
                    self._loop.call_soon_threadsafe(self._on_event, event.text)

    def _on_event(self, text: str) -> None:
        task = self._loop.create_task(self.save(text))
        task.add_done_callback(lambda done: done.exception())

    async def _end_save(self, now: float) -> None:
        if (before := self.part) is not None:
            if now < self._retry_at:
                return
            await self._next()
            if self.part is before:
                return  # the next segment cannot be created; this one still belongs to the save
        segments = await asyncio.to_thread(self._segments)
        done = [each for each in segments if self.part is None or each != self.part.capture.path]
        assert self.saving is not None
        save = _Save(self.saving, self._about, tuple(done))
        self._about, self.saving = {}, None
        await self._submit(save)

    async def _next(self) -> None:
        path = self._folder / f"{datetime.now(UTC):%Y-%m-%dT%H-%M-%S.%f}Z{SUFFIX}"
        before, about = self.part, {"name": "flight", "started_by": "flight"}
        try:
            self.part = await self._files.open(
                path, about, STATES, on_publication=self._on_publication, replaces=before
            )
        except CaptureError as error:
            log.error("flight recorder: %s", error)
            self._retry_at, self.stopped = time.monotonic() + _RETRY_S, self.part is None
            return
        self.stopped = False
        if before is not None:
            with suppress(OSError):
                await self._files.close(before)

    def _is_full(self, part: CaptureSink) -> bool:
        most = self._files.settings.split.mib * MIB / _SEGMENTS
        longest_s = max(self._settings.minutes * 60 / _SEGMENTS, _MIN_SEGMENT_S)
        return part.age_s >= longest_s or part.capture.size >= most or part.clock_was_set()

    def _is_too_long(self, now: float) -> bool:
        return now - self._since > self._files.settings.split.minutes * 60

    def _segments(self) -> list[Path]:
        return [each for each in sorted(self._folder.glob(f"*{SUFFIX}")) if each not in self._submitted]

    def _remove_old(self) -> None:
        """Remove segments beyond the configured minutes or size."""
        if self._about:
            return
        now, open_now = time.monotonic(), self.part.capture.path if self.part is not None else None
        closed = [each for each in self._segments() if each != open_now]
        self._closed_at = {each: self._closed_at.get(each, now) for each in closed}
        room = self._files.settings.split.mib * MIB
        for segment in reversed(closed):
            with suppress(OSError):
                room -= segment.stat().st_size
                if now - self._closed_at[segment] > self._settings.minutes * 60 or room < 0:
                    segment.unlink()

    def _target_of(self, segments: list[Path], name: str) -> Path:
        return self._target / f"{segments[0].name.removesuffix(SUFFIX)}_{name}{SUFFIX}"

    def _pending_saves(self) -> list[_Save]:
        """Return the unfinished saves of an earlier process; quarantine unreadable segments."""
        states: dict[Path, State] = {}
        for segment in self._segments():
            try:
                if not is_being_written(segment):
                    states[segment] = state_of(segment)
            except (CaptureError, OSError) as error:
                self._quarantine(segment, error)
        saves, begun = [], {"name": "killed", "cause": _KILLED}
        any_begun = False
        for mark in sorted(self._folder.glob(f"*{_MARK}")):
            target = self._target / f"{mark.name.removesuffix(_MARK)}{SUFFIX}"
            try:
                stored = json.loads(mark.read_text())
                about, names = {**begun, **stored["about"]}, [str(each) for each in stored["segments"]]
            except (OSError, ValueError, KeyError, TypeError):
                about, names = begun, []
            segments = tuple(each for each in states if each.name in names)
            if _is_indexed(target):  # the process was killed after the save was done
                for segment in segments:
                    segment.unlink(missing_ok=True)
            elif segments:
                saves.append(_Save(target, {**about, **_RECOVERED}, segments))
            elif not names:
                any_begun, begun = True, about
            if not any(save.target == target for save in saves):
                mark.unlink(missing_ok=True)
            for segment in segments:
                states.pop(segment)
        if states and (any_begun or State.UNFINISHED in states.values()):
            rest = tuple(states)
            save = _Save(self._target_of(list(rest), begun["name"]), {**begun, **_RECOVERED}, rest)
            saves.append(save)
        return saves

    def _quarantine(self, segment: Path, error: Exception) -> None:
        with suppress(OSError):
            segment.rename(segment.with_suffix(_DAMAGED))
        text = f"a segment of the flight recorder cannot be read and was renamed to *{_DAMAGED}: {error}"
        self._loop.call_soon_threadsafe(self._report, _S.WARNING, "recorder.damaged", text)

    async def _submit(self, save: _Save) -> None:
        self._submitted |= set(save.segments)
        try:
            await asyncio.to_thread(save.target.parent.mkdir, parents=True, exist_ok=True)
        except OSError as error:
            self._on_saved(save, error_text(error))
            return
        await asyncio.to_thread(save.write_mark, self._folder)
        self._queue.submit(Job(save.target, save.segments, save.about, partial(self._on_saved, save)))

    def _on_saved(self, save: _Save, problem: str | None) -> None:
        name = save.about["name"]
        if problem is None:
            for each in (*save.segments, save.mark(self._folder)):
                with suppress(OSError):
                    each.unlink(missing_ok=True)
            self._submitted -= set(save.segments)
            if self._failed_saves.pop(save.target, None) is not None:
                self._report(_S.INFO, "recorder.saved", f"{name} is saved now: {save.target.name}")
            return
        _, wait_s, _ = self._failed_saves.get(save.target, (0.0, _SAVE_RETRY_S, save))
        if save.target not in self._failed_saves:
            text = f"{name} is not saved: {problem}; its segments are kept, and the recorder tries again"
            self._report(_S.CRITICAL, "recorder.not_saved", text)
        self._failed_saves[save.target] = (time.monotonic() + wait_s, wait_s, save)


def _is_indexed(path: Path) -> bool:
    with suppress(CaptureError):
        return state_of(path) is State.INDEXED
    return False
