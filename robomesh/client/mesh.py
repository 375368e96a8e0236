"""The mesh for asynchronous programs: robots, services, events and alarms of all sites."""

from collections.abc import Generator, Sequence
from contextlib import AsyncExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from robomesh.client.connection import connected, connection_settings
from robomesh.client.recordings.descriptions import (
    RecordingInfo,
    find_recording,
    list_recordings,
    recording_info,
)
from robomesh.client.recordings.recorder_file import RecorderFile
from robomesh.client.recordings.recording import AsyncRecording
from robomesh.client.recordings.sources import MeshSource
from robomesh.client.robot.robot import AsyncRobot, events_of
from robomesh.client.robot.samples import Alarm, Event, alarm_of
from robomesh.client.robot.streams import AsyncStream
from robomesh.contract.endpoints import DEFAULT_ROUTER
from robomesh.contract.keys import ROOT, WHOLE_SITE, PresenceKey
from robomesh.errors import RobomeshError, SessionError
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.last_values import last_values
from robomesh.wire.session import Session

_Change = schema.RecordingRequest


class RobotNotFoundError(RobomeshError):
    """No robot on the mesh has the name, or several have it.

    Attributes:
        robots: The robots on the mesh: "site/robot".
        found: Those that have the name; empty: none.
        gone_sites: Sites that are gone with all of their robots, if the caller looked for them.
    """

    def __init__(self, text: str, robots: Sequence[str], found: Sequence[str] = ()) -> None:
        super().__init__(text, robots, found)
        self.robots, self.found = tuple(robots), tuple(found)
        self.gone_sites: tuple[str, ...] = ()

    def __str__(self) -> str:
        if self.found:
            return f"{self.args[0]!r} is at several sites; say which: {', '.join(self.found)}"
        gone = (
            f"; gone, with all of its robots: site {', site '.join(self.gone_sites)}"
            if self.gone_sites
            else ""
        )
        return f"no robot {self.args[0]!r} on the mesh; there are: {', '.join(self.robots) or 'none'}{gone}"


@dataclass(frozen=True)
class Service:
    """A running service.

    Attributes:
        robot: "-": it serves the whole site.
        id: Of its process; new at each start.
    """

    site: str
    robot: str
    service: str
    id: str


def find_robot(present: Sequence[PresenceKey], text: str) -> tuple[str, str]:
    """Return site and name of the robot that `robot` or `site/robot` names.

    Raises:
        RobotNotFoundError: If there is none, or several sites have a robot of that name.
    """
    robots = sorted({(key.site, key.robot) for key in present if key.robot != WHOLE_SITE})
    found = [each for each in robots if text in (each[1], "/".join(each))]
    if len(found) != 1:
        raise RobotNotFoundError(
            text, ["/".join(each) for each in robots], ["/".join(each) for each in found]
        )
    return found[0]


class AsyncMesh:
    """A connection to the mesh, for asynchronous programs; an asynchronous context manager.

    Args:
        router: Address of a router, or of several to try in order: "tcp/HOST:PORT", "tls/HOST:PORT".
        keys: Bundle from `robomesh keys`, for a mesh with certificates.
        timeout_s: How long to wait for a router [s]; None: forever.
    """

    def __init__(
        self,
        router: str | Sequence[str] = DEFAULT_ROUTER,
        *,
        keys: str | Path | None = None,
        timeout_s: float | None = 2.0,
    ) -> None:
        self._where = router, None if keys is None else Path(keys), timeout_s
        self._opened: Session | None = None
        self._close = AsyncExitStack()

    def __await__(self) -> Generator[Any, None, Self]:
        return self.__aenter__().__await__()

    async def __aenter__(self) -> Self:
        await self.open()
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()

    async def open(self) -> None:
        """Connect, unless connected; `async with` and `await robomesh.connect_async()` do it.

        Raises:
            SessionError: If no router answers, or it does not accept the certificate.
        """
        if self._opened is not None:
            return
        router, keys, timeout_s = self._where
        settings = connection_settings(router, keys, wait_s=timeout_s)
        self._opened = await self._close.enter_async_context(connected(settings))

    async def close(self) -> None:
        """Disconnect; all streams end."""
        await self._close.aclose()

    def __repr__(self) -> str:
        return f"<mesh at {self._where[0]}>"

    @property
    def session(self) -> Session:
        """The session: for what this class does not offer."""
        if self._opened is None:
            raise SessionError("not connected: use `async with robomesh.connect_async() as mesh`")
        return self._opened

    async def robot(self, name: str) -> AsyncRobot:
        """Return the robot that "robot" or "site/robot" names.

        Raises:
            RobotNotFoundError: If there is none, or several sites have a robot of that name.
        """
        return AsyncRobot(self.session, *find_robot(await self.session.present(), name))

    async def robots(self) -> list[AsyncRobot]:
        """Return the robots of all sites that have a running service, by name."""
        present = await self.session.present()
        names = sorted({(key.site, key.robot) for key in present if key.robot != WHOLE_SITE})
        return [AsyncRobot(self.session, *each) for each in names]

    async def services(self) -> list[Service]:
        """Return the running services of all sites, by name."""
        return [Service(*key) for key in await self.session.present()]

    def events(self, *, history: bool = True) -> AsyncStream[Event]:
        """Return the events of all robots and services.

        Args:
            history: Begin with the last 100 of each service, oldest first.
        """
        return AsyncStream(events_of(self.session, f"{ROOT}/*/*/events/**", history=history))

    async def alarms(self) -> list[Alarm]:
        """Return the alarms of all sites: all except ended and acknowledged ones, most urgent first."""
        lists = await last_values(self.session, f"{ROOT}/*/{WHOLE_SITE}/alarms")
        alarms = [
            alarm for each in lists.values() if isinstance(each, schema.AlarmList) for alarm in each.alarms
        ]
        alarms.sort(key=lambda alarm: (-alarm.priority, alarm.since.ToNanoseconds()))
        return [alarm_of(alarm) for alarm in alarms]

    async def recordings(self) -> list[RecordingInfo]:
        """Return the recordings of all sites, newest first, without those of recorders that do not answer.

        Raises:
            RobomeshError: If no recorder answers.
        """
        return await list_recordings(self.session)

    async def open_recording(self, recording: str | RecordingInfo) -> AsyncRecording:
        """Return a recording of a site, which is read through the mesh as it is needed.

        Args:
            recording: "name", "site/name" or "site/file", the newest of that name; or one of `recordings`.

        Raises:
            RecordingError: If no recording has the name; the text lists the newest ones.
            RobomeshError: If its recorder refuses or does not answer.
        """
        file, site = await self._recorder_file(recording)
        return AsyncRecording(MeshSource(file, recording_info(await file.describe(), site)))

    async def fetch_recording(self, recording: str | RecordingInfo, out: str | Path = ".") -> Path:
        """Copy a recording's file to this machine, and return its path; an interrupted copy is resumed.

        Args:
            recording: As for `open_recording`.
            out: Path of the copy, or a folder.

        Raises:
            RecordingError: If no recording has the name, or the file changes meanwhile.
            RobomeshError: If its recorder refuses or does not answer.
            OSError: If the copy cannot be written.
        """
        file, _ = await self._recorder_file(recording)
        return (await file.fetch(Path(out))).file

    async def change_recording(
        self,
        recording: str | RecordingInfo,
        *,
        name: str | None = None,
        note: str | None = None,
        tags: Sequence[str] | None = None,
    ) -> RecordingInfo:
        """Set a recording's name, note or tags, and return its description; its file stays as recorded.

        Args:
            recording: As for `open_recording`; a name must be that of one recording only.
            name: At most 60 characters, which a file's name may have.
            note: At most 2000 characters; empty: none.
            tags: All tags from then on, at most 20.

        Raises:
            RecordingError: If no recording has the name, or several have it.
            RobomeshError: If its recorder refuses or does not answer; `recording.conflict`: it was changed
                meanwhile.
        """
        file, info = await self._changeable(recording)
        if name is not None:
            info = await self._change(file, info, _Change(action=_Change.RENAME, name=name))
        if note is not None:
            info = await self._change(file, info, _Change(action=_Change.NOTE, note=note))
        if tags is not None:
            info = await self._change(file, info, _Change(action=_Change.TAG, tags=tags))
        return info

    async def delete_recording(self, recording: str | RecordingInfo, *, reason: str) -> RecordingInfo:
        """Delete a recording's file for good, and return its last description.

        Args:
            recording: As for `change_recording`.
            reason: Every operator sees it.

        Raises:
            RecordingError: If no recording has the name, or several have it.
            RobomeshError: If its recorder refuses, as while it is in use, or does not answer.
        """
        file, info = await self._changeable(recording)
        return await self._change(file, info, _Change(action=_Change.DELETE, reason=reason))

    async def _changeable(self, recording: str | RecordingInfo) -> tuple[RecorderFile, RecordingInfo]:
        if isinstance(recording, str):
            recording = await find_recording(self.session, recording, only=True)
        file, _ = await self._recorder_file(recording)
        return file, recording

    async def _change(
        self, file: RecorderFile, info: RecordingInfo, request: schema.RecordingRequest
    ) -> RecordingInfo:
        request.based_on = info.message.changes
        return recording_info(await file.change(request), info.recorder_site)

    async def _recorder_file(self, recording: str | RecordingInfo) -> tuple[RecorderFile, str]:
        if isinstance(recording, str):
            recording = await find_recording(self.session, recording)
        site = recording.recorder_site
        return RecorderFile(self.session, site, recording.file, asker=self.session.own_name), site
