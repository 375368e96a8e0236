"""The recorder service: captures on request or when a controller's trace goes on, and their list."""

import asyncio
import logging
import re
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from mcap.exceptions import McapError

from bus import topics
from bus.errors import MessageError, RefusedError
from bus.header import Header
from bus.keys import WHOLE_SITE, robot_key
from bus.requests import Request
from bus.schemas import robomesh_pb2 as schema
from bus.session import Session
from bus.subscription import Sample, Subscription
from services.recorder.capture import INDEXING, Capture, CaptureError, index
from services.recorder.files import SUFFIX, RecordingError, describe_file

log = logging.getLogger(__name__)

# A disk that stops for 10 s loses nothing: 100 Hz, and everything else of a robot, and some.
_NEWEST = 10_000
_FLUSH_EVERY_S = 0.1
_SYNC_EVERY = 10  # flushes
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,80}")
_Request = schema.RecorderRequest
_State = schema.ControllerState


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Whose captures go where."""

    site: str
    robots: tuple[str, ...]
    folder: Path


async def serve(session: Session, settings: Settings) -> None:
    """Record what is asked for, until cancelled; open captures are closed then."""
    for left in settings.folder.glob(f"*/*{INDEXING}"):
        left.unlink()  # of a writer that was killed; the file itself is whole
    recorders = {robot: _Recorder(session, settings, robot) for robot in settings.robots}

    async def list_recordings(_: Request) -> schema.RecordingList:
        open_now = {each.capture.path: each.describe() for each in recorders.values() if each.capture}
        return await asyncio.to_thread(_list, settings.folder, open_now)

    session.answer(settings.site, WHOLE_SITE, "recordings/list", list_recordings)
    for robot, recorder in recorders.items():
        session.answer(settings.site, robot, "recorder/request", recorder.on_request)
    try:
        async with asyncio.TaskGroup() as group:
            for recorder in recorders.values():
                group.create_task(recorder.follow_trace())
    finally:
        for recorder in recorders.values():
            await recorder.end()


class _Recorder:
    """One robot's captures: one at a time."""

    def __init__(self, session: Session, settings: Settings, robot: str) -> None:
        self._session = session
        self._site = settings.site
        self._robot = robot
        self._folder = settings.folder / robot
        self._writers: list[asyncio.Task[None]] = []
        self._keeper: asyncio.Task[None] | None = None
        self._indexing: set[asyncio.Task[None]] = set()
        self._subscriptions: list[Subscription] = []
        self._lock = asyncio.Lock()
        self.capture: Capture | None = None

    async def on_request(self, request: Request) -> schema.Recording:
        asked = request.message
        assert isinstance(asked, _Request)
        if asked.action == _Request.TRACE_ON:
            return await self.open(asked.name, started_by="request")
        return await self.close()

    async def follow_trace(self) -> None:
        """A controller's trace, whoever turned it on, is a capture."""
        before = _State.KNOWN_UNSPECIFIED
        key = robot_key(self._site, self._robot, "controller")
        async for sample in self._session.subscribe(key, newest=50):
            try:
                state = sample.message()
            except MessageError:
                continue
            assert isinstance(state, _State)
            went_on = state.trace == _State.YES and before != _State.YES
            before = state.trace
            try:
                if went_on and self.capture is None:
                    await self.open("", started_by="trace")
                elif state.trace == _State.NO and self.capture and self.capture.started_by == "trace":
                    await self.close()
            except (RefusedError, OSError) as error:
                log.error("%s/%s: the trace is not recorded: %s", self._site, self._robot, error)

    async def open(self, name: str, *, started_by: str) -> schema.Recording:
        """Begin a capture.

        Raises:
            RefusedError: If one is open, or it cannot have that name, or the disk refuses.
        """
        async with self._lock:
            if self.capture is not None:
                raise RefusedError(f"{self._robot} is being recorded already, as {self.capture.name!r}")
            now = datetime.now(UTC)
            name = name or now.strftime(f"{self._robot}-%H%M%S")
            if not _NAME.fullmatch(name):
                raise RefusedError(
                    f"name {name!r}: letters, digits, '_', '.' and '-', beginning with a letter or digit"
                )
            path = self._folder / f"{now:%Y-%m-%dT%H-%M-%S.%f}Z_{name}{SUFFIX}"
            try:
                capture = await asyncio.to_thread(
                    Capture, self._site, self._robot, name, started_by, path, time.time_ns()
                )
            except (CaptureError, OSError) as error:
                raise RefusedError(str(error)) from None
            self.capture = capture
            self._subscriptions = [
                self._session.subscribe(robot_key(self._site, self._robot, row.name), newest=_NEWEST)
                for row in topics.TOPICS.values()
                if row.recorded
            ]
            self._writers = [asyncio.create_task(self._write(each, capture)) for each in self._subscriptions]
            self._keeper = asyncio.create_task(self._keep_on_disk(capture))
            log.info("%s/%s: recording %s", self._site, self._robot, path.name)
            return self.describe()

    async def close(self) -> schema.Recording:
        """End the capture; what arrived before is in it. It is indexed afterwards, beside what comes next.

        Raises:
            RefusedError: If none is open.
        """
        async with self._lock:
            capture = self.capture
            if capture is None:
                raise RefusedError(f"{self._robot} is not being recorded")
            for subscription in self._subscriptions:
                subscription.close()  # what it holds is still read to its end
            await asyncio.gather(*self._writers)
            if self._keeper is not None:
                self._keeper.cancel()
            recording = self.describe()
            try:
                await asyncio.to_thread(capture.finish, self._missed())
                task = asyncio.create_task(self._index(capture.path))
                self._indexing.add(task)
                task.add_done_callback(self._indexing.discard)
            except OSError as error:
                recording.problem = f"not closed: {error.strerror}"
                log.error("%s: %s", capture.path, recording.problem)
            self.capture = None
            recording.open = False
            log.info("%s/%s: recorded %s", self._site, self._robot, capture.path.name)
            return recording

    async def end(self) -> None:
        """Close what is open, as the service ends; what is not indexed yet stays as it was written."""
        with suppress(RefusedError):
            await self.close()
        for task in self._indexing:
            task.cancel()

    async def _index(self, path: Path) -> None:
        try:
            await asyncio.to_thread(index, path)
        except (CaptureError, McapError, OSError) as error:
            log.error("%s: not indexed: %s", path, error)

    async def _keep_on_disk(self, capture: Capture) -> None:
        flushes = 0
        while True:
            await asyncio.sleep(_FLUSH_EVERY_S)
            flushes += 1
            try:
                await asyncio.to_thread(capture.flush, sync=flushes % _SYNC_EVERY == 0)
            except OSError as error:
                self._fail(capture, error)
                return

    def _fail(self, capture: Capture, error: OSError) -> None:
        """The disk takes no more: end the capture, so that nobody believes that it goes on."""
        if self.capture is capture:
            self.capture = None
            log.error("%s: recording ended: %s", capture.path, error.strerror)
            for subscription in self._subscriptions:
                subscription.close()
            capture.abandon()

    def _missed(self) -> dict[str, int]:
        return {key: each.missed(key) for each in self._subscriptions for key in each.keys}

    def describe(self) -> schema.Recording:
        """The open capture, as it is now."""
        capture = self.capture
        assert capture is not None
        missed = self._missed()
        recording = schema.Recording(
            site=self._site,
            robot=self._robot,
            name=capture.name,
            file=capture.path.name,
            open=True,
            started_by=capture.started_by,
            bytes=capture.path.stat().st_size,
        )
        recording.start.FromNanoseconds(capture.start_ns)
        recording.duration.FromNanoseconds(time.time_ns() - capture.start_ns)
        for key, messages in sorted(capture.counts.items()):
            recording.topics.add(topic=key, messages=messages, lost=missed.get(key, 0))
        return recording

    async def _write(self, subscription: Subscription, capture: Capture) -> None:
        async for sample in subscription:
            if self.capture is not capture:
                return
            received_ns = time.time_ns() - int((time.monotonic() - sample.received) * 1e9)
            try:
                for header, payload in _publications(sample, subscription.topic, capture.start_ns):
                    capture.add(sample.key, subscription.topic, header, payload, received_ns=received_ns)
            except MessageError as error:
                log.warning("%s: left out of the recording: %s", sample.key, error)
            except OSError as error:
                self._fail(capture, error)


def _publications(sample: Sample, row: topics.Topic, start_ns: int) -> Iterator[tuple[Header, bytes]]:
    """What of a sample belongs into a capture that began at `start_ns`.

    Raises:
        MessageError: If it is a list that cannot be read.
    """
    if sample.live:
        yield sample.header, sample.payload
    elif row.history is topics.History.KEY_FRAME:
        # A video that begins between two key frames could not be decoded.
        frames = sample.message()
        assert isinstance(frames, schema.VideoFrames)
        for frame in frames.frames:
            yield Header(frames.publisher, frame.sequence, frame.source_time_ns), frame.data
    elif row.history is topics.History.LAST_100:
        # What an outage took comes with a later answer; what is older than the capture is not its own.
        answer: Any = sample.message()
        ((_, entries),) = answer.ListFields() or ((None, ()),)
        for back, entry in enumerate(reversed(entries)):
            time_ns = entry.timestamp.ToNanoseconds()
            if time_ns >= start_ns:
                header = Header(sample.header.publisher, sample.header.sequence - back, time_ns)
                yield header, entry.SerializeToString()
    elif row.stale_after_s is None:
        # What a robot is was told before the capture began, and explains it.
        yield sample.header, sample.payload


def _list(folder: Path, open_now: dict[Path, schema.Recording]) -> schema.RecordingList:
    recordings = schema.RecordingList()
    for path in sorted(folder.glob(f"*/*{SUFFIX}"), key=lambda path: path.name, reverse=True):
        recording = open_now.get(path)
        if recording is None:
            try:
                recording = describe_file(path)
            except RecordingError as error:
                recording = schema.Recording(file=path.name, robot=path.parent.name, problem=str(error))
        recordings.recordings.append(recording)
    return recordings
