"""One robot's captures: one at a time, in as many files as it takes."""

import asyncio
import logging
import re
import time
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path

from mcap_files.capture import Capture
from mcap_files.channel_names import SUFFIX
from mcap_files.errors import CaptureError
from robomesh import reason_codes as codes
from robomesh.errors import KeyNameError, RefusedError
from robomesh.keys import check_chunk
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wall_clock import WallClock
from services.recorder.disk import Disk, words
from services.recorder.file_writer import STATES, Part, Saw
from services.recorder.finishing import Finisher, Job
from services.recorder.settings import MIB, Settings
from services.recorder.subscriptions import Intake

log = logging.getLogger(__name__)

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,80}")
_NO_VIEW = "-"


def check_name(name: str) -> str:
    """A recording's name, which becomes a file's.

    Raises:
        RefusedError: If it cannot.
    """
    if not _NAME.fullmatch(name):
        raise RefusedError(codes.RECORDING_NAME(name=name[:100]))
    return name


class Files:
    """A robot's files: opened, given what comes, closed.

    Args:
        on_open: Told of each file that was opened, to explain it.
    """

    def __init__(
        self, settings: Settings, robot: str, intake: Intake, disk: Disk, on_open: Callable[[Part], None]
    ) -> None:
        self.settings, self.robot, self.disk = settings, robot, disk
        self.intake = intake
        self._on_open = on_open

    async def open(
        self,
        path: Path,
        about: Mapping[str, str],
        names: frozenset[str],
        *,
        saw: Saw | None = None,
        instead_of: Part | None = None,
    ) -> Part:
        """Open a file for these topics; what is told to `instead_of` so far ends there, with no gap.

        Raises:
            CaptureError: If it cannot be created.
        """
        whole = {"site": self.settings.site, "robot": self.robot, **about}
        # Both clocks at one moment: what comes between two moments would move every message.
        begun_ns = time.monotonic_ns()
        start_ns = WallClock().latest_ns(begun_ns)
        capture = await asyncio.to_thread(Capture, path, whole, start_ns=start_ns)
        part = Part(capture, self.disk, saw, begun_ns=begun_ns)
        if self.settings.site_file:
            data = self.settings.site_file.encode()
            capture.attach("site.toml", "application/toml", data, time_ns=capture.start_ns)
        self.disk.open(capture)
        await asyncio.to_thread(self._attach, part, names, instead_of)
        self._on_open(part)
        return part

    async def close(self, part: Part) -> None:
        """Close a file; what arrived before is in it.

        Raises:
            OSError: If the disk refuses.
        """
        await asyncio.to_thread(self._close, part)

    def detach(self, part: Part) -> None:
        """Give a file nothing more."""
        with self.intake.lock:
            taps = self.intake.robot(self.robot)
            self.count(part)
            taps.detach(part)

    def count(self, part: Part) -> None:
        """See what never came for a file."""
        with self.intake.lock:
            if (lost := self.intake.robot(self.robot).lost(part)) is not None:
                part.lost = lost

    def _attach(self, part: Part, names: frozenset[str], instead_of: Part | None) -> None:
        with self.intake.lock:
            taps = self.intake.robot(self.robot)
            if instead_of is not None:
                taps.sweep()
                self.count(instead_of)
            taps.attach(part, names)
            if instead_of is not None:
                taps.detach(instead_of)

    def _close(self, part: Part) -> None:
        with self.intake.lock:
            self.intake.robot(self.robot).sweep()
            self.detach(part)
        self.disk.close(part.capture, part.missed)


class RobotRecorder:
    """A robot's capture, on request or while its controller traces."""

    def __init__(self, files: Files, finisher: Finisher) -> None:
        self._files, self._finisher = files, finisher
        self._settings, self._robot = files.settings, files.robot
        self._folder = files.settings.folder / files.robot
        self._lock = asyncio.Lock()
        self._names = STATES
        self.part: Part | None = None
        # The open capture, or the last one.
        self.last = schema.Recording(site=self._settings.site, robot=self._robot)

    async def open(self, name: str, *, views: tuple[str, ...] | None, started_by: str) -> schema.Recording:
        """Begin a capture.

        Args:
            views: Whose video it holds; None: as the settings say.

        Raises:
            RefusedError: If one is open, or it cannot have that name, or the disk refuses.
        """
        async with self._lock:
            if self.part is not None:
                now_as = self.part.capture.about["name"]
                raise RefusedError(codes.RECORDING_OPEN(robot=self._robot, name=now_as))
            now = datetime.now(UTC)
            name = check_name(name or now.strftime(f"{self._robot}-%H%M%S"))
            self._names = STATES | _videos(self._settings.views if views is None else views)
            about = {"name": name, "started_by": started_by}
            try:
                self.part = await self._files.open(self._path(name, 1), about, self._names)
            except CaptureError as error:
                raise RefusedError(codes.RECORDING_FAILED(detail=error)) from None
            log.info("%s/%s: recording %s", self._settings.site, self._robot, self.part.capture.path.name)
            return self.describe()

    async def close(self) -> schema.Recording:
        """End the capture; what arrived before is in it. It is indexed afterwards, beside what comes next.

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
            self.last.open, self.last.problem = False, problem
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
                following = await self._files.open(path, about, self._names, instead_of=part)
            except CaptureError as error:
                log.error("%s: goes on, since no other can be begun: %s", capture.path.name, error)
                return
            if self.part is not part:  # the disk took no more of it meanwhile: the recording has ended
                await self._end(following, about={})
                return
            self.part = following
            await self._end(part, about={"part": str(number)})

    def failed(self, part_of: Capture, error: OSError) -> Part | None:
        """The disk took no more of a file; None: of somebody else's."""
        part = self.part
        if part is None or part.capture is not part_of:
            return None
        self.part = None
        self._files.detach(part)
        self.last = part.describe()
        self.last.open, self.last.problem = False, f"ended: {words(error)}"
        return part

    def describe(self) -> schema.Recording:
        """The open capture as it is now, or the last one."""
        if self.part is not None:
            self._files.count(self.part)
            self.last = self.part.describe()
        if (indexing := self._finisher.progress.get(self.last.file)) is not None:
            self.last.indexing = indexing
        else:
            self.last.ClearField("indexing")
        return self.last

    async def _end(self, part: Part, *, about: dict[str, str]) -> str:
        """Close a file and have it indexed; what was wrong, in words."""
        try:
            await self._files.close(part)
        except OSError as error:  # the disk has told it
            return f"ended: {words(error)}"
        path = part.capture.path
        self._finisher.give(Job(path, (path,), about))
        return ""

    def _path(self, name: str, part: int) -> Path:
        number = f".part{part}" if part > 1 else ""
        return self._folder / f"{datetime.now(UTC):%Y-%m-%dT%H-%M-%S.%f}Z_{name}{number}{SUFFIX}"


def _videos(views: tuple[str, ...]) -> frozenset[str]:
    """The topics of views' video.

    Raises:
        RefusedError: If one can be no view.
    """
    try:
        return frozenset(f"video/{check_chunk(view, 'view')}" for view in views if view != _NO_VIEW)
    except KeyNameError as error:
        raise RefusedError(codes.INVALID(detail=error)) from None
