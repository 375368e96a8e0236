"""The recorder service: captures on request or when a controller's trace goes on, and their list."""

import asyncio
import logging
import re
import time
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from bus import topics
from bus.errors import MessageError, RefusedError
from bus.keys import WHOLE_SITE, robot_key
from bus.requests import Request
from bus.schemas import robomesh_pb2 as schema
from bus.session import Session
from bus.subscription import Subscription
from services.recorder.capture import REWRITE_AT_END_BYTES, Capture, CaptureError
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
    recorders = {robot: _Recorder(session, settings, robot) for robot in settings.robots}

    async def list_recordings(_: Request) -> schema.RecordingList:
        open_captures = {r.capture.path for r in recorders.values() if r.capture is not None}
        return await asyncio.to_thread(_list, settings.folder, open_captures)

    session.answer(settings.site, WHOLE_SITE, "recordings/list", list_recordings)
    for robot, recorder in recorders.items():
        session.answer(settings.site, robot, "recorder/request", recorder.on_request)
    try:
        async with asyncio.TaskGroup() as group:
            for recorder in recorders.values():
                group.create_task(recorder.follow_trace())
    finally:
        for recorder in recorders.values():
            if recorder.capture is not None:
                small = recorder.capture.path.stat().st_size < REWRITE_AT_END_BYTES
                await recorder.close(rewrite=small)


class _Recorder:
    """One robot's captures: one at a time."""

    def __init__(self, session: Session, settings: Settings, robot: str) -> None:
        self._session = session
        self._site = settings.site
        self._robot = robot
        self._folder = settings.folder / robot
        self._tasks: list[asyncio.Task[None]] = []
        self._subscriptions: list[Subscription] = []
        self._lock = asyncio.Lock()
        self.capture: Capture | None = None

    async def on_request(self, request: Request) -> schema.Recording:
        asked = request.message
        assert isinstance(asked, _Request)
        if asked.action == _Request.TRACE_ON:
            return await self.open(asked.name, started_by="request")
        if self.capture is None:
            raise RefusedError(f"{self._robot} is not being recorded")
        return await self.close(rewrite=True)

    async def follow_trace(self) -> None:
        """A controller's trace, whoever turned it on, is a capture."""
        before = _State.KNOWN_UNSPECIFIED
        async for sample in self._session.subscribe(
            robot_key(self._site, self._robot, "controller"), newest=50
        ):
            try:
                state = sample.message()
            except MessageError:
                continue
            assert isinstance(state, _State)
            try:
                if state.trace == _State.YES and before != _State.YES and self.capture is None:
                    await self.open("", started_by="trace")
                elif (
                    state.trace == _State.NO
                    and self.capture is not None
                    and self.capture.started_by == "trace"
                ):
                    await self.close(rewrite=True)
            except (RefusedError, CaptureError) as error:
                log.error("%s/%s: trace is on, but nothing is recorded: %s", self._site, self._robot, error)
            before = state.trace

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
            except CaptureError as error:
                raise RefusedError(str(error)) from None
            self.capture = capture
            rows = [row for row in topics.TOPICS.values() if row.recorded]
            self._subscriptions = [
                self._session.subscribe(robot_key(self._site, self._robot, row.name), newest=_NEWEST)
                for row in rows
            ]
            self._tasks = [asyncio.create_task(_write(each, capture)) for each in self._subscriptions]
            self._tasks.append(asyncio.create_task(self._keep_on_disk(capture)))
            log.info("%s/%s: recording %s", self._site, self._robot, path.name)
            return self._describe(capture)

    async def close(self, *, rewrite: bool) -> schema.Recording:
        """End the capture; what arrived before is in it."""
        async with self._lock:
            capture, self.capture = self.capture, None
            if capture is None:
                raise RefusedError(f"{self._robot} is not being recorded")
            lost = {key: each.lost(key) for each in self._subscriptions for key in each.keys}
            for subscription in self._subscriptions:
                subscription.close()  # what it holds is still read to its end
            *writers, keeper = self._tasks
            await asyncio.gather(*writers, return_exceptions=True)
            keeper.cancel()
            recording = self._describe(capture, lost)
            try:
                await asyncio.to_thread(capture.finish, lost, rewrite=rewrite)
            except (CaptureError, OSError) as error:
                log.error("%s", error)
                recording.problem = str(error)
            recording.open = False
            recording.bytes = capture.path.stat().st_size
            log.info("%s/%s: recorded %s", self._site, self._robot, capture.path.name)
            return recording

    async def _keep_on_disk(self, capture: Capture) -> None:
        flushes = 0
        while True:
            await asyncio.sleep(_FLUSH_EVERY_S)
            flushes += 1
            try:
                await asyncio.to_thread(capture.flush, sync=flushes % _SYNC_EVERY == 0)
            except OSError as error:
                log.error("%s: %s", capture.path, error.strerror)

    def _describe(self, capture: Capture, lost: dict[str, int] | None = None) -> schema.Recording:
        recording = schema.Recording(
            site=self._site,
            robot=self._robot,
            name=capture.name,
            file=capture.path.name,
            open=True,
            started_by=capture.started_by,
        )
        recording.start.FromNanoseconds(capture.start_ns)
        recording.duration.FromNanoseconds(time.time_ns() - capture.start_ns)
        for key, messages in sorted(capture.counts.items()):
            recording.topics.add(topic=key, messages=messages, lost=(lost or {}).get(key, 0))
        return recording


async def _write(subscription: Subscription, capture: Capture) -> None:
    row = subscription.topic
    async for sample in subscription:
        header = sample.header
        if sample.live:
            capture.add(
                sample.key,
                row,
                sequence=header.sequence,
                source_time_ns=header.source_time_ns,
                payload=sample.payload,
            )
        elif row.history is topics.History.KEY_FRAME:
            # A video that begins between two key frames could not be decoded.
            with suppress(MessageError):
                frames = sample.message()
                assert isinstance(frames, schema.VideoFrames)
                for frame in frames.frames:
                    capture.add(
                        sample.key,
                        row,
                        sequence=frame.sequence,
                        source_time_ns=frame.source_time_ns,
                        payload=frame.data,
                    )
        elif row.stale_after_s is None and row.history_schema is None:
            # What a robot is was told before the capture began, and explains it.
            capture.add(
                sample.key,
                row,
                sequence=header.sequence,
                source_time_ns=header.source_time_ns,
                payload=sample.payload,
            )


def _list(folder: Path, open_captures: set[Path]) -> schema.RecordingList:
    recordings = schema.RecordingList()
    for path in sorted(folder.glob(f"*/*{SUFFIX}"), key=lambda path: path.name, reverse=True):
        try:
            recording = describe_file(path)
        except RecordingError as error:
            recording = schema.Recording(file=path.name, robot=path.parent.name, problem=str(error))
        if path in open_captures:
            recording.open, recording.problem = True, ""
        recordings.recordings.append(recording)
    return recordings
