"""The store service: answers requests for programs, notes and layouts, publishes them, keeps what ran."""

import asyncio
import contextlib
import fcntl
import logging
import os
import time
from collections.abc import AsyncIterator, Callable
from functools import partial
from pathlib import Path

from robomesh import reason_codes as codes
from robomesh.contract.enum_names import enum_word
from robomesh.contract.keys import ROOT, WHOLE_SITE, check_name, is_replay
from robomesh.contract.messages import reason_message
from robomesh.contract.quotas import Quota
from robomesh.contract.topics import check_operator
from robomesh.errors import MessageError, RefusedError
from robomesh.publications.publisher import LIST_LENGTH, Publisher
from robomesh.reasons import Reason
from robomesh.requests.server import Request
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import Session
from services.errors import ServiceError
from services.store.layouts import Layouts
from services.store.notes import NoteBook
from services.store.programs import ProgramStore
from services.store.settings import MIB, Settings

log = logging.getLogger(__name__)

_S = schema.Event.Severity
_Version = schema.ProgramVersion
# A predecessor may still be ending.
_LOCK_WITHIN_S, _LOCK_RETRY_S = 10.0, 0.2
_MOST_SOURCES = 1000


class FolderInUseError(ServiceError):
    """Another store uses the folder."""


async def serve(session: Session, settings: Settings) -> None:
    """Serve a site's programs, notes and layouts until cancelled.

    Raises:
        FolderInUseError: If another store uses the folder.
        OSError: If the folder cannot be read.
    """
    folder = settings.folder / check_name(settings.site, "site")
    folder.mkdir(parents=True, exist_ok=True)
    most, most_of_runs, most_of_notes = (
        round(mib * MIB) for mib in (settings.most_mib, settings.runs_mib, settings.notes_mib)
    )
    store = ProgramStore(folder, most_bytes=most, most_run_bytes=most_of_runs)
    async with _locked(folder):
        notes = NoteBook(folder, most_bytes=most_of_notes)
        await _Service(session, settings, store, notes, Layouts(folder)).run()


class _Service:
    """One run of the service."""

    def __init__(
        self,
        session: Session,
        settings: Settings,
        store: ProgramStore,
        notes: NoteBook,
        layouts: Layouts,
    ) -> None:
        self._session, self._settings = session, settings
        self._store, self._notes, self._layouts = store, notes, layouts
        self._saves = Quota("program_saves", a_minute=settings.quotas.program_saves_a_minute)
        self._note_quota = Quota("notes", a_minute=settings.quotas.notes_a_minute)
        self._one_at_a_time = asyncio.Lock()
        self._layout_list = session.declare_publisher(settings.site, WHOLE_SITE, "layouts")
        self._lists: dict[str, Publisher] = {}
        self._events: dict[str, Publisher] = {}
        session.measure("programs", "Stored programs, without deleted ones", lambda: store.count)
        session.measure("programs_bytes", "Size of all saved versions", lambda: store.saved_bytes)
        session.measure("notes", "Notes, with withdrawn ones", lambda: notes.count)
        session.measure("notes_bytes", "Size of all notes", lambda: notes.bytes)

    async def run(self) -> None:
        """Run until cancelled."""
        for reason in await asyncio.to_thread(lambda: [*self._store.open()]):
            self._report(WHOLE_SITE, _S.ERROR, reason)
        for robot in (*self._settings.robots, *self._store.robots):
            self._add(robot)
        if (damaged := await asyncio.to_thread(self._layouts.open)) is not None:
            self._report(WHOLE_SITE, _S.ERROR, damaged)
        site = self._settings.site
        self._layout_list.put(self._layouts.message)
        self._session.answer(site, WHOLE_SITE, "layouts/request/*", self._change_layouts)
        self._session.answer(site, WHOLE_SITE, "programs/request/*", self._change)
        self._session.answer(site, WHOLE_SITE, "programs/read", self._read)
        self._session.answer(site, WHOLE_SITE, "notes/request/*", self._note)
        self._session.answer(site, WHOLE_SITE, "notes/withdraw/*", self._withdraw)
        self._session.answer(site, WHOLE_SITE, "notes/read", self._read_notes)
        async with asyncio.TaskGroup() as group:
            group.create_task(self._keep_runs())
            group.create_task(self._find_robots())

    async def _find_robots(self) -> None:
        """Accept programs of robots that are started from the page."""
        async for who, alive in self._session.watch_presence():
            of_robot = who.service == "gateway" and who.robot != WHOLE_SITE
            if alive and of_robot and who.site == self._settings.site:
                self._add(who.robot)

    def _add(self, robot: str) -> None:
        if robot not in self._lists:
            self._store.add_robot(robot)
            self._lists[robot] = self._session.declare_publisher(self._settings.site, robot, "programs")
            self._lists[robot].put(self._store.programs(robot))
            # In advance, so that the first note is not delayed; a restart keeps the notes in the history.
            events = self._events_of(robot)
            damaged = self._notes.open(robot)
            for event in self._notes.newest(robot, LIST_LENGTH):
                events.remember(event, source_time_ns=event.timestamp.ToNanoseconds())
            if damaged is not None:
                self._report(robot, _S.ERROR, damaged)

    async def _change(self, request: Request) -> schema.ProgramAnswer:
        """Save, rename, delete or restore a program; reply after the change is on disk.

        Raises:
            QuotaError: If the author saves too often.
            RefusedError: If the request is not possible.
        """
        asked = request.message
        assert isinstance(asked, schema.ProgramRequest)
        author = check_operator(request.chunk)
        self._saves.check(author, 1.0)
        self._saves.count(author, 1.0)
        async with self._one_at_a_time:
            answer, old_name = await asyncio.to_thread(self._store.change, asked, author, time.time_ns())
            if old_name is not None:
                self._lists[asked.robot].put(self._store.programs(asked.robot))
                reason = _reason(answer.version, old_name)
                self._report(asked.robot, _S.INFO, reason, id=answer.program.id)
        return answer

    async def _read(self, request: Request) -> schema.ProgramContent:
        asked = request.message
        assert isinstance(asked, schema.ProgramQuery)
        async with self._one_at_a_time:
            return await asyncio.to_thread(self._store.read, asked)

    async def _note(self, request: Request) -> schema.Event:
        """Write a note, or withdraw a note of the same author; reply after the change is on disk.

        Raises:
            QuotaError: If the author writes too often.
            RefusedError: If the request is not possible.
        """
        asked = request.message
        assert isinstance(asked, schema.NoteRequest)
        match asked.action:
            case schema.NoteRequest.WRITE:
                return await self._noted(request, asked, self._notes.write)
            case schema.NoteRequest.WITHDRAW:
                return await self._noted(request, asked, self._notes.withdraw)
            case _:
                raise RefusedError(codes.INVALID(codes.OTHER(detail="the request has no action")))

    async def _withdraw(self, request: Request) -> schema.Event:
        """Withdraw a note of any author; see `_note`."""
        asked = request.message
        assert isinstance(asked, schema.NoteRequest)
        return await self._noted(request, asked, partial(self._notes.withdraw, administrator=True))

    async def _noted(
        self,
        request: Request,
        asked: schema.NoteRequest,
        change: Callable[[schema.NoteRequest, str, int], tuple[schema.Event, bool]],
    ) -> schema.Event:
        author = check_operator(request.chunk)
        self._note_quota.check(author, 1.0)
        self._note_quota.count(author, 1.0)
        async with self._one_at_a_time:
            event, is_new = await asyncio.to_thread(change, asked, author, time.time_ns())
            if is_new:
                self._events_of(asked.robot).put(event)
                log.info("%s: %s", asked.robot, event.text)
        return event

    async def _read_notes(self, request: Request) -> schema.EventList:
        asked = request.message
        assert isinstance(asked, schema.NoteQuery)
        async with self._one_at_a_time:
            return await asyncio.to_thread(self._notes.read, asked)

    async def _change_layouts(self, request: Request) -> schema.LayoutList:
        """Save, rename or delete a layout; reply after the change is on disk.

        Raises:
            QuotaError: If the author saves too often.
            RefusedError: If the request is not possible.
        """
        asked = request.message
        assert isinstance(asked, schema.LayoutRequest)
        author = check_operator(request.chunk)
        self._saves.check(author, 1.0)
        self._saves.count(author, 1.0)
        async with self._one_at_a_time:
            await asyncio.to_thread(self._layouts.change, asked, author, time.time_ns())
            self._layout_list.put(self._layouts.message)
        action = enum_word(schema.LayoutRequest.Action, asked.action)
        log.info("%s: %s layout %r", author, action, asked.name)
        return self._layouts.message

    async def _keep_runs(self) -> None:
        key = f"{ROOT}/{self._settings.site}/*/program/source"
        async for sample in self._session.subscribe(key, newest=_MOST_SOURCES):
            robot = sample.parsed.robot
            if is_replay(robot):
                continue  # a replay runs nothing
            try:
                source = sample.message()
            except MessageError as error:
                log.warning("%s: %s", sample.key, error)
                continue
            assert isinstance(source, schema.ProgramSource)
            self._add(robot)
            try:
                async with self._one_at_a_time:
                    await asyncio.to_thread(self._store.keep_run, robot, source)
            except RefusedError as error:
                lost = codes.PROGRAMS_RUN_LOST(name=source.name, detail=error)
                self._report(robot, _S.WARNING, lost)

    def _events_of(self, robot: str) -> Publisher:
        if robot not in self._events:
            site = self._settings.site
            self._events[robot] = self._session.declare_publisher(site, robot, "events/store")
        return self._events[robot]

    def _report(self, robot: str, severity: schema.Event.Severity, reason: Reason, **values: str) -> None:
        event = schema.Event(
            severity=severity,
            code=reason.code,
            text=reason.text,
            source="store",
            values={**reason.values, **values},
            reason=reason_message(reason),
        )
        event.timestamp.GetCurrentTime()
        self._events_of(robot).put(event)
        log.log(logging.INFO if severity == _S.INFO else logging.WARNING, "%s: %s", robot, reason.text)


def _reason(version: schema.ProgramVersion, old_name: str) -> Reason:
    """Return what an event says of a new version."""
    values = {"author": version.author, "name": version.name}
    match version.change:
        case _Version.ASIDE:
            return codes.PROGRAMS_ASIDE(**values, version=version.number)
        case _Version.RENAMED:
            return codes.PROGRAMS_RENAMED(**values, old=old_name)
        case _Version.RESTORED:
            return codes.PROGRAMS_RESTORED(**values, version=version.number, from_version=version.based_on)
        case _Version.DELETED:
            return codes.PROGRAMS_DELETED(**values, reason=version.reason)
        case _:
            return codes.PROGRAMS_SAVED(**values, version=version.number)


@contextlib.asynccontextmanager
async def _locked(folder: Path) -> AsyncIterator[None]:
    """Lock the folder: two services would overwrite each other's versions. A kill releases the lock.

    Raises:
        FolderInUseError: If another service keeps it.
    """
    file = os.open(folder / ".lock", os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC, 0o600)
    try:
        until_s = time.monotonic() + _LOCK_WITHIN_S
        while True:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                if time.monotonic() > until_s:
                    raise FolderInUseError(f"{folder}: another store uses this folder") from None
                await asyncio.sleep(_LOCK_RETRY_S)
        yield
    finally:
        os.close(file)
