"""Captures of one robot: one at a time, split into several files if it is long."""

import asyncio
import logging
import re
import time
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path

from robomesh import reason_codes as codes
from robomesh.contract.keys import check_chunk
from robomesh.errors import KeyNameError, RefusedError
from robomesh.publications.wall_clock import WallClock
from robomesh.reasons import Reason
from robomesh.recordings.errors import CaptureError
from robomesh.recordings.files import set_problem
from robomesh.recordings.names import SUFFIX
from robomesh.recordings.writing.capture import Capture
from robomesh.schemas import robomesh_pb2 as schema
from services.recorder.disk import Disk, ended_by
from services.recorder.file_writer import STATES, CaptureSink, OnPublication
from services.recorder.indexing import IndexingQueue, Job
from services.recorder.settings import MIB, Settings
from services.recorder.subscriptions import Subscriptions

log = logging.getLogger(__name__)

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,80}")
_NO_VIEW = "-"


def check_name(name: str) -> str:
    """Return a recording's name if it can be part of a file name.

    Raises:
        RefusedError: If it cannot.
    """
    if not _NAME.fullmatch(name):
        raise RefusedError(codes.RECORDING_NAME(name=name[:100]))
    return name


class CaptureFiles:
    """Opens, fills and closes the files of a robot.

    Args:
        on_open: Called with each opened file, to add its attachments.
    """

    def __init__(
        self,
        settings: Settings,
        robot: str,
        subscriptions: Subscriptions,
        disk: Disk,
        on_open: Callable[[CaptureSink], None],
    ) -> None:
        self.settings, self.robot, self.disk = settings, robot, disk
        self.subscriptions = subscriptions
        self._on_open = on_open

    async def open(
        self,
        path: Path,
        about: Mapping[str, str],
        names: frozenset[str],
        *,
        on_publication: OnPublication | None = None,
        replaces: CaptureSink | None = None,
    ) -> CaptureSink:
        """Open a file for these topics; it continues `replaces` without a gap or an overlap.

        Raises:
            CaptureError: If it cannot be created.
        """
        metadata = {"site": self.settings.site, "robot": self.robot, **about}
        # Both clocks are read at one moment: a difference would shift every message.
        begun_ns = time.monotonic_ns()
        start_ns = WallClock().latest_ns(begun_ns)
        capture = await asyncio.to_thread(Capture, path, metadata, start_ns=start_ns)
        part = CaptureSink(capture, self.disk, on_publication, begun_ns=begun_ns)
        if self.settings.site_file:
            data = self.settings.site_file.encode()
            capture.attach("site.toml", "application/toml", data, time_ns=capture.start_ns)
        self.disk.open(capture)
        await asyncio.to_thread(self._attach, part, names, replaces)
        self._on_open(part)
        return part

    async def close(self, part: CaptureSink) -> None:
        """Close a file after writing everything that arrived before.

        Raises:
            OSError: If the write fails.
        """
        await asyncio.to_thread(self._close, part)

    def detach(self, part: CaptureSink) -> None:
        """Stop adding publications to a file."""
        with self.subscriptions.lock:
            topics = self.subscriptions.robot(self.robot)
            self.count(part)
            topics.detach(part)

    def count(self, part: CaptureSink) -> None:
        """Update a file's count of lost publications."""
        with self.subscriptions.lock:
            if (lost := self.subscriptions.robot(self.robot).lost(part)) is not None:
                part.lost = lost

    def _attach(self, part: CaptureSink, names: frozenset[str], replaces: CaptureSink | None) -> None:
        with self.subscriptions.lock:
            topics = self.subscriptions.robot(self.robot)
            if replaces is not None:
                topics.drain()
                self.count(replaces)
            topics.attach(part, names)
            if replaces is not None:
                topics.detach(replaces)

    def _close(self, part: CaptureSink) -> None:
        with self.subscriptions.lock:
            self.subscriptions.robot(self.robot).drain()
            self.detach(part)
        self.disk.close(part.capture, part.missed)


class RobotRecorder:
    """Capture of a robot, on request or while its controller traces."""

    def __init__(self, files: CaptureFiles, indexing_queue: IndexingQueue) -> None:
        self._files, self._queue = files, indexing_queue
        self._settings, self._robot = files.settings, files.robot
        self._folder = files.settings.folder / files.robot
        self._lock = asyncio.Lock()
        self._names = STATES
        self.part: CaptureSink | None = None
        # Describes the open capture, or the last one.
        self.last = schema.Recording(site=self._settings.site, robot=self._robot)

    async def open(self, name: str, *, views: tuple[str, ...] | None, started_by: str) -> schema.Recording:
        """Begin a capture.

        Args:
            views: Views to record as video; None for those of the settings.

        Raises:
            RefusedError: If a capture is open, the name is invalid, or the file cannot be created.
        """
        async with self._lock:
            if self.part is not None:
                open_name = self.part.capture.about["name"]
                raise RefusedError(codes.RECORDING_OPEN(robot=self._robot, name=open_name))
            now = datetime.now(UTC)
            name = check_name(name or now.strftime(f"{self._robot}-%H%M%S"))
            self._names = STATES | _videos(self._settings.views if views is None else views)
            about = {"name": name, "started_by": started_by}
            try:
                self.part = await self._files.open(self._path(name, 1), about, self._names)
            except CaptureError as error:
                raise RefusedError(codes.RECORDING_FAILED(error.reason)) from None
            log.info("%s/%s: recording %s", self._settings.site, self._robot, self.part.capture.path.name)
            return self.describe()

    async def close(self) -> schema.Recording:
        """End the capture after writing everything that arrived before; index its file in the background.

        Raises:
            RefusedError: If none is open.
        """
        async with self._lock:
            part = self.part
            if part is None:
                raise RefusedError(codes.RECORDING_NOT_OPEN(robot=self._robot))
            self.part = None
            problem = await self._end(part, about={})
            self.last = part.describe()
            self.last.open = False
            if problem is not None:
                set_problem(self.last, problem)
            log.info("%s/%s: recorded %s", self._settings.site, self._robot, part.capture.path.name)
            return self.last

    async def tick(self) -> None:
        """Begin the next file when this one is long or large enough, or the machine's clock was set."""
        async with self._lock:
            if (part := self.part) is None:
                return
            split, capture = self._settings.split, part.capture
            full = part.age_s >= split.minutes * 60 or capture.size >= split.mib * MIB
            if not (full or part.clock_was_set()):
                return
            number = int(capture.about.get("part", "1"))
            about = {**capture.about, "part": str(number + 1)}
            path = self._path(about["name"], number + 1)
            try:
                following = await self._files.open(path, about, self._names, replaces=part)
            except CaptureError as error:
                log.error(
                    "%s: the next file cannot be created, so this one continues: %s", capture.path.name, error
                )
                return
            if self.part is not part:  # the disk failed in the meantime, which ended the recording
                await self._end(following, about={})
                return
            self.part = following
            await self._end(part, about={"part": str(number)})

    def failed(self, capture: Capture, error: OSError) -> CaptureSink | None:
        """End the capture after a disk error; return its part, or None if the file is not this capture's."""
        part = self.part
        if part is None or part.capture is not capture:
            return None
        self.part = None
        self._files.detach(part)
        self.last = part.describe()
        self.last.open = False
        set_problem(self.last, ended_by(error))
        return part

    def describe(self) -> schema.Recording:
        """Describe the open capture, or the last one."""
        if self.part is not None:
            self._files.count(self.part)
            self.last = self.part.describe()
        if (indexing := self._queue.progress.get(self.last.file)) is not None:
            self.last.indexing = indexing
        else:
            self.last.ClearField("indexing")
        return self.last

    async def _end(self, part: CaptureSink, *, about: dict[str, str]) -> Reason | None:
        """Close a file and queue it for indexing; return the problem, if any."""
        try:
            await self._files.close(part)
        except OSError as error:  # the disk has already reported it
            return ended_by(error)
        path = part.capture.path
        self._queue.submit(Job(path, (path,), about))
        return None

    def _path(self, name: str, part: int) -> Path:
        number = f".part{part}" if part > 1 else ""
        return self._folder / f"{datetime.now(UTC):%Y-%m-%dT%H-%M-%S.%f}Z_{name}{number}{SUFFIX}"


def _videos(views: tuple[str, ...]) -> frozenset[str]:
    """Return the video topics of these views.

    Raises:
        RefusedError: If a view's name is invalid.
    """
    try:
        return frozenset(f"video/{check_chunk(view, 'view')}" for view in views if view != _NO_VIEW)
    except KeyNameError as error:
        raise RefusedError(codes.INVALID(error.reason)) from None
