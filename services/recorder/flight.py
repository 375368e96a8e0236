"""The flight recorder: a robot's last minutes in short files on the disk, kept when something happens."""

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

from mcap_files.capture import Capture, is_being_written
from mcap_files.channel_names import SUFFIX
from mcap_files.errors import CaptureError
from mcap_files.recover import State, state_of
from robomesh import reason_codes as codes
from robomesh.errors import MessageError, RefusedError
from robomesh.messages import decode
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.topics import Topic
from services.recorder.captures import Files, check_name
from services.recorder.disk import words
from services.recorder.file_writer import STATES, Part
from services.recorder.finishing import Finisher, Job
from services.recorder.settings import MIB, Flight

log = logging.getLogger(__name__)

FOLDER = ".flight"
SOURCE = "recorder"
_S = schema.Event.Severity
_SEGMENTS = 10
_SHORTEST_S = 5.0
_AGAIN_AFTER_S = 5.0
# And of a save that failed, at first.
_SAVE_AGAIN_AFTER_S = 30.0
# Endings: of what is to be saved, should this process not live to do it; of what cannot be read.
_MARK = ".save.json"
_DAMAGED = ".damaged"
_RECOVERED = {"started_by": "flight", "recovered": "yes"}
_KILLED = "the recorder was killed, or its machine lost power"


@dataclass(frozen=True)
class _Save:
    """Segments that become a file.

    Attributes:
        segments: None of them are known as long as more follow.
    """

    target: Path
    about: dict[str, str]
    segments: tuple[Path, ...] = ()

    def note(self, folder: Path) -> None:
        """Write down what is to be saved, should this process not live to do it."""
        names = [each.name for each in self.segments]
        with suppress(OSError):  # it is saved all the same, if this process lives
            self.mark(folder).write_text(json.dumps({"about": self.about, "segments": names}))

    def mark(self, folder: Path) -> Path:
        """The file where it is written down."""
        return folder / f"{self.target.stem}{_MARK}"


class FlightRecorder:
    """One robot's. Its folder holds segments, oldest first by name.

    Args:
        on_save: Told of the open segment when a save begins, to explain it.
        say: Told what a robot's people should know: how grave, code, text.
    """

    def __init__(
        self,
        files: Files,
        finisher: Finisher,
        flight: Flight,
        *,
        on_save: Callable[[Part], None],
        say: Callable[[schema.Event.Severity, str, str], None],
    ) -> None:
        self._files, self._finisher, self._flight = files, finisher, flight
        self._folder = files.settings.folder / FOLDER / files.robot
        self._target = files.settings.folder / files.robot
        self._loop = asyncio.get_running_loop()
        self._lock = asyncio.Lock()
        self._retry_at = 0.0
        # Being saved: until when what follows belongs to it, since when, what it is.
        self._until = self._since = 0.0
        self._about: dict[str, str] = {}
        # Of a save that is under way, and must stay until it is done.
        self._given: set[Path] = set()
        # Saves that failed, by target: when they are tried again, and after how long the next time.
        self._unsaved: dict[Path, tuple[float, float, _Save]] = {}
        self._on_save, self._say = on_save, say
        # When each segment was first seen closed: the clock, and so a file's time, may be set.
        self._closed_at: dict[Path, float] = {}
        self.part: Part | None = None
        # The file that the last minutes become.
        self.saving: Path | None = None
        # The disk takes nothing.
        self.stopped = False

    async def begin(self) -> None:
        """Go on; what an earlier process was about to save, or left when it was killed, is saved."""
        for save in await asyncio.to_thread(self._left):
            await self._give(save)
        await self.tick()

    async def save(self, cause: str, name: str = "") -> schema.Recording:
        """Keep the last minutes and what follows; another cause meanwhile lets it go on for longer.

        Raises:
            RefusedError: If the disk takes nothing, or it cannot have that name.
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
            self._until, answer = now + self._flight.after_s, self.describe()
            assert self.saving is not None
            await asyncio.to_thread(_Save(self.saving, self._about).note, self._folder)
            return answer

    def describe(self) -> schema.Recording:
        """What is being saved, as far as it is the open segment's."""
        assert self.part is not None
        assert self.saving is not None
        recording = self.part.describe()
        recording.name, recording.cause = self._about["name"], self._about["cause"]
        recording.file = self.saving.name
        return recording

    async def tick(self) -> None:
        """Begin the next segment, drop what is too old, end a save."""
        async with self._lock:
            now = time.monotonic()
            for at, wait_s, save in tuple(self._unsaved.values()):
                if now >= at:
                    self._unsaved[save.target] = (inf, wait_s * 2, save)
                    await self._give(save)
            if self._about and (now >= self._until or self._long(now)):
                await self._end_save(now)
            elif self.part is None:
                if now >= self._retry_at:
                    await self._next()
            elif self._full(self.part) and now >= self._retry_at:
                await self._next()
                await asyncio.to_thread(self._drop)

    def failed(self, part_of: Capture) -> Part | None:
        """The disk took no more of a segment; None: of somebody else's."""
        part = self.part
        if part is None or part.capture is not part_of:
            return None
        self.part, self._retry_at, self.stopped = None, time.monotonic() + _AGAIN_AFTER_S, True
        self._files.detach(part)
        return part

    async def end(self) -> None:
        """Close the open segment; what was to be saved is, at the next start."""
        if self.part is not None:
            part, self.part = self.part, None
            with suppress(OSError):
                await self._files.close(part)

    def _saw(self, row: Topic, payload: bytes) -> None:
        """A publication; on the intake's thread."""
        if row.schema is schema.Event:
            with suppress(MessageError):
                event = decode(schema.Event, payload)
                if event.severity >= self._flight.severity and event.source != SOURCE:
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
                return  # no other can be begun: what followed is in this one
        segments = await asyncio.to_thread(self._segments)
        done = [each for each in segments if self.part is None or each != self.part.capture.path]
        assert self.saving is not None
        save = _Save(self.saving, self._about, tuple(done))
        self._about, self.saving = {}, None
        await self._give(save)

    async def _next(self) -> None:
        path = self._folder / f"{datetime.now(UTC):%Y-%m-%dT%H-%M-%S.%f}Z{SUFFIX}"
        before, about = self.part, {"name": "flight", "started_by": "flight"}
        try:
            self.part = await self._files.open(path, about, STATES, saw=self._saw, instead_of=before)
        except CaptureError as error:
            log.error("flight recorder: %s", error)
            self._retry_at, self.stopped = time.monotonic() + _AGAIN_AFTER_S, self.part is None
            return
        self.stopped = False
        if before is not None:
            with suppress(OSError):
                await self._files.close(before)

    def _full(self, part: Part) -> bool:
        most = self._files.settings.split.mib * MIB / _SEGMENTS
        longest_s = max(self._flight.minutes * 60 / _SEGMENTS, _SHORTEST_S)
        return part.age_s >= longest_s or part.capture.size >= most or part.clock_was_set()

    def _long(self, now: float) -> bool:
        return now - self._since > self._files.settings.split.minutes * 60

    def _segments(self) -> list[Path]:
        return [each for each in sorted(self._folder.glob(f"*{SUFFIX}")) if each not in self._given]

    def _drop(self) -> None:
        """Remove what is older than the minutes that are kept, or more than the space that is."""
        if self._about:
            return
        now, open_now = time.monotonic(), self.part.capture.path if self.part is not None else None
        closed = [each for each in self._segments() if each != open_now]
        self._closed_at = {each: self._closed_at.get(each, now) for each in closed}
        room = self._files.settings.split.mib * MIB
        for segment in reversed(closed):
            with suppress(OSError):
                room -= segment.stat().st_size
                if now - self._closed_at[segment] > self._flight.minutes * 60 or room < 0:
                    segment.unlink()

    def _target_of(self, segments: list[Path], name: str) -> Path:
        return self._target / f"{segments[0].name.removesuffix(SUFFIX)}_{name}{SUFFIX}"

    def _left(self) -> list[_Save]:
        """What an earlier process left to be saved; what is no recording is put aside."""
        states: dict[Path, State] = {}
        for segment in self._segments():
            try:
                if not is_being_written(segment):
                    states[segment] = state_of(segment)
            except (CaptureError, OSError) as error:
                self._put_aside(segment, error)
        saves, begun = [], {"name": "killed", "cause": _KILLED}
        any_begun = False
        for mark in sorted(self._folder.glob(f"*{_MARK}")):
            target = self._target / f"{mark.name.removesuffix(_MARK)}{SUFFIX}"
            try:
                noted = json.loads(mark.read_text())
                about, names = {**begun, **noted["about"]}, [str(each) for each in noted["segments"]]
            except (OSError, ValueError, KeyError, TypeError):
                about, names = begun, []
            segments = tuple(each for each in states if each.name in names)
            if _is_indexed(target):  # the kill came after it was saved
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

    def _put_aside(self, segment: Path, error: Exception) -> None:
        with suppress(OSError):
            segment.rename(segment.with_suffix(_DAMAGED))
        text = f"a segment of the flight recorder cannot be read, and is put aside: {error}"
        self._loop.call_soon_threadsafe(self._say, _S.WARNING, "recorder.damaged", text)

    async def _give(self, save: _Save) -> None:
        self._given |= set(save.segments)
        try:
            await asyncio.to_thread(save.target.parent.mkdir, parents=True, exist_ok=True)
        except OSError as error:
            self._on_saved(save, words(error))
            return
        await asyncio.to_thread(save.note, self._folder)
        self._finisher.give(Job(save.target, save.segments, save.about, partial(self._on_saved, save)))

    def _on_saved(self, save: _Save, problem: str | None) -> None:
        name = save.about["name"]
        if problem is None:
            for each in (*save.segments, save.mark(self._folder)):
                with suppress(OSError):
                    each.unlink(missing_ok=True)
            self._given -= set(save.segments)
            if self._unsaved.pop(save.target, None) is not None:
                self._say(_S.INFO, "recorder.saved", f"{name} is saved after all: {save.target.name}")
            return
        _, wait_s, _ = self._unsaved.get(save.target, (0.0, _SAVE_AGAIN_AFTER_S, save))
        if save.target not in self._unsaved:
            text = f"{name} is not saved: {problem}; its segments are kept, and it is tried again"
            self._say(_S.CRITICAL, "recorder.not_saved", text)
        self._unsaved[save.target] = (time.monotonic() + wait_s, wait_s, save)


def _is_indexed(path: Path) -> bool:
    with suppress(CaptureError):
        return state_of(path) is State.INDEXED
    return False
