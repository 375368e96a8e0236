"""Changes of a cell: the check, the picture and the saved file change together or not at all.

    step                                            after a kill of the gateway
    ----------------------------------------------  ----------------------------------------
    1 the cell is closed: no control, no motion     old
    2 every robot rests and is free; audit on disk  old
    3 kinematics prepares the new content           old
    4 the check takes the new content               old
    5 the file is replaced                          new, and kinematics follows
    6 the new content is published                  new, and kinematics follows
    7 kinematics shows it, or 4 to 6 are undone     new; while undoing: what the file has
    8 the cell is open

A cell is also closed while kinematics shows another content than the one that motions are checked against.
A stop is never delayed.
"""

import asyncio
import contextlib
import logging
import time
from collections.abc import AsyncIterator, Collection, Mapping
from dataclasses import dataclass

from protocol_gateway.authority.audit_entry import MESH, Entry, Outcome, entry_of
from protocol_gateway.checking.cell_occupancy import CellOccupancy
from protocol_gateway.checking.checker import Checker
from protocol_gateway.configuration.settings import CellFile
from protocol_gateway.robot.robot import Robot
from protocol_gateway.seam.errors import AuditError, CheckError
from robomesh import reason_codes as codes
from robomesh.contract.keys import robot_key
from robomesh.contract.messages import reason_message
from robomesh.contract.quotas import Quota
from robomesh.contract.topics import check_operator
from robomesh.errors import RefusedError, RobomeshError
from robomesh.publications.publisher import Publisher
from robomesh.reasons import Reason
from robomesh.requests.server import Request
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.texts import one_line
from robomesh.wire.session import Session
from robots.descriptions.cells import CellDescription

log = logging.getLogger(__name__)

CELL = "CELL"
_S = schema.Event.Severity
# Reading meshes and building hulls takes seconds.
_PREPARE_TIMEOUT_S = 60.0
SHOWN_WITHIN_S = 30.0
_LONGEST_REASON = 200


@dataclass(frozen=True, kw_only=True)
class _Content:
    """A content of the cell.

    Attributes:
        cell: What motions are checked against.
    """

    version: str
    message: schema.CellContent
    cell: CellDescription


class _FailedError(RefusedError):
    """A change that was accepted and failed; the audit log has it."""


class CellChanges:
    """The content of one cell, and its changes; it belongs to the gateway of all its robots.

    Args:
        robots: The robots of the cell that this gateway serves, by name.
        elsewhere: Robots of the cell with another gateway.
        checkers: Worker processes of its checks.
        quota: Changes of each engineer.
    """

    def __init__(
        self,
        session: Session,
        site: str,
        *,
        robots: Mapping[str, Robot],
        elsewhere: Collection[str],
        file: CellFile,
        occupancy: CellOccupancy,
        checkers: Collection[Checker],
        quota: Quota,
    ) -> None:
        self._session, self._site, self._robots = session, site, robots
        self._elsewhere, self._file, self._occupancy = elsewhere, file, occupancy
        self._checkers, self._quota = checkers, quota
        self._first = next(iter(robots))
        self._content = self._load()
        self._previous = file.previous(self._first)
        self._known_problem = self._problem()
        self._changing_by = ""
        self._shown: dict[str, schema.CellShown] = {}
        self._kinematics: dict[str, set[str]] = {}
        self._changed = asyncio.Event()
        self._publishers: dict[str, Publisher] = {}

    def serve(self) -> None:
        """Publish the content, and answer requests."""
        for name in self._robots:
            self._publishers[name] = self._session.declare_publisher(self._site, name, "cell")
            self._session.answer(self._site, name, "cell/request/*", self._answer)
        self._publish()

    def _load(self) -> _Content:
        message = self._file.content(self._first)
        version, cell = self._file.describe(self._first, message)
        return _Content(version=version, message=message, cell=cell)

    # ------------------------------------------------------------ what is shown

    def on_shown(self, robot: str, shown: schema.CellShown) -> None:
        """Note which content a robot's kinematics shows."""
        self._shown[robot] = shown
        self._update()

    def on_presence(self, robot: str, identity: str, *, alive: bool) -> None:
        """Note that a kinematics process of a robot started or ended; what an ended one showed is stale."""
        present = self._kinematics.setdefault(robot, set())
        (present.add if alive else present.discard)(identity)
        if not present:
            self._shown.pop(robot, None)
        self._update()

    def _disagreement(self) -> Reason | None:
        """Return the reason if kinematics shows another content than motions are checked against."""
        for robot, shown in self._shown.items():
            if shown.version == self._content.version:
                continue
            if shown.HasField("problem"):
                cause = codes.OTHER(detail=shown.problem.text)
                return codes.CELL_NOT_FOLLOWED(cause, robot=robot)
            return codes.CELL_DISAGREES(robot=robot)
        return None

    def _update(self) -> None:
        if self._changing_by:
            self._occupancy.closed = codes.CELL_CHANGES(operator=self._changing_by, robot=self._first)
        else:
            self._occupancy.closed = self._disagreement()
        self._changed.set()

    # ---------------------------------------------------------------- requests

    async def _answer(self, request: Request) -> schema.CellAnswer:
        """Change the content, or say what would change.

        Raises:
            QuotaError: If the engineer asks too often.
            RefusedError: If it is refused; then nothing has changed.
        """
        asked, robot = request.message, request.key.robot
        assert isinstance(asked, schema.CellRequest)
        engineer = check_operator(request.chunk)
        self._quota.check(engineer, 1.0)
        self._quota.count(engineer, 1.0)
        try:
            return await self._change(asked, engineer)
        except _FailedError:
            raise
        except RefusedError as error:
            if not asked.dry_run:
                entry = self._entry(asked, engineer, Outcome.REFUSED, error.reason)
                self._robots[robot].audit_trail.write_later(entry)
            raise

    async def _change(self, asked: schema.CellRequest, engineer: str) -> schema.CellAnswer:
        if self._changing_by:
            raise RefusedError(codes.CELL_CHANGES(operator=self._changing_by, robot=self._first))
        problem = await asyncio.to_thread(self._problem)
        if problem != self._known_problem:
            self._known_problem = problem
            self._publish()
        if self._known_problem is not None:
            raise RefusedError(self._known_problem)
        if asked.based_on != self._content.version:
            raise RefusedError(codes.CELL_OUTDATED(robot=self._first))
        before = self._content
        # In a thread, because a long content takes a third of a second.
        message = await asyncio.to_thread(self._file.normal, self._first, asked.content)
        version, cell = await asyncio.to_thread(self._file.describe, self._first, message)
        changes = await asyncio.to_thread(self._file.changes, before.message, message)
        if version == before.version or not changes:
            raise RefusedError(codes.CELL_SAME(robot=self._first))
        answer = schema.CellAnswer(version=version, changes=changes)
        if asked.dry_run:
            # What would be refused is refused before a person confirms it.
            self._check_free()
            return answer
        async with self._closed(engineer, before):
            # After closing, so that no robot can begin to move.
            self._check_free()
            summary = self._file.summary(changes)
            accepted = self._entry(asked, engineer, Outcome.ACCEPTED, codes.CELL_ACCEPTED(summary=summary))
            try:
                # All robots, because each is checked in the new cell from now on.
                await asyncio.gather(
                    *(each.audit_trail.write_before(accepted) for each in self._robots.values())
                )
            except AuditError as error:
                raise RefusedError(error.reason) from None
            try:
                await self._take_over(before, _Content(version=version, message=message, cell=cell))
            except RefusedError as error:
                failed = self._entry(asked, engineer, Outcome.FAILED, codes.CELL_NOT_CHANGED(error.reason))
                for robot in self._robots.values():
                    robot.audit_trail.write_later(failed)
                raise _FailedError(error.reason) from error
        for name, robot in self._robots.items():
            why = codes.CELL_CHANGED(operator=engineer, robot=name, summary=summary)
            robot.journal.report(_S.INFO, why.code, why.text, why=why, version=version)
        return answer

    def _check_free(self) -> None:
        """Check that no robot of the cell is controlled or moves.

        Raises:
            RefusedError: If one is, or may.
        """
        for robot in self._robots.values():
            if (use := robot.use) is not None:
                raise RefusedError(use)

    def _problem(self) -> Reason | None:
        """Return why the content cannot be changed; None: it can."""
        if self._elsewhere:
            return codes.CELL_OTHER_GATEWAY(robot=min(self._elsewhere))
        return self._file.problem(self._first)

    @contextlib.asynccontextmanager
    async def _closed(self, engineer: str, before: _Content) -> AsyncIterator[None]:
        """Close the cell while the block runs.

        Raises:
            RefusedError: If another change was faster.
        """
        if self._changing_by:
            raise RefusedError(codes.CELL_CHANGES(operator=self._changing_by, robot=self._first))
        if self._content is not before:
            raise RefusedError(codes.CELL_OUTDATED(robot=self._first))
        self._changing_by = engineer
        self._update()
        self._publish()
        try:
            yield
        finally:
            self._changing_by = ""
            self._update()
            self._publish()

    def _entry(self, asked: schema.CellRequest, engineer: str, outcome: Outcome, why: Reason) -> Entry:
        return entry_of(
            CELL,
            time_ns=time.time_ns(),
            operator=engineer,
            source=MESH,
            outcome=outcome,
            text=why.text,
            why=why,
            reason=one_line(asked.reason, _LONGEST_REASON),
            based_on=asked.based_on[:64],
        )

    # --------------------------------------------------------------- take over

    async def _take_over(self, old: _Content, new: _Content) -> None:
        """Let kinematics, the check and the file take a new content, or none of them.

        Raises:
            RefusedError: If they did not; then all have the old content.
        """
        await self._prepare_kinematics(new)
        saved = False
        try:
            for checker in self._checkers:
                await checker.replace(dict.fromkeys(self._robots, new.cell))
            await asyncio.to_thread(self._file.save, self._first, new.message)
            saved = True
            self._set(new)
            await self._until_shown()
            self._previous = await asyncio.to_thread(self._file.previous, self._first)
        except Exception as error:
            reason = _reason_of(error)
            await self._take_back(old, reason, saved=saved)
            raise RefusedError(reason) from error

    async def _prepare_kinematics(self, new: _Content) -> None:
        wanted = schema.CellPreparation(version=new.version, content=new.message)
        for name in self._robots:
            key = robot_key(self._site, name, "cell/prepare")
            try:
                await self._session.ask(key, wanted, timeout_s=_PREPARE_TIMEOUT_S)
            except RobomeshError as error:
                cause = getattr(error, "reason", None) or codes.OTHER(detail=str(error))
                raise RefusedError(codes.CELL_NO_KINEMATICS(cause, robot=name)) from None

    async def _until_shown(self) -> None:
        """Wait until every robot's kinematics shows the present content.

        Raises:
            RefusedError: If one does not in time.
        """
        try:
            async with asyncio.timeout(SHOWN_WITHIN_S):
                while missing := self._not_showing():
                    self._changed.clear()
                    await self._changed.wait()
        except TimeoutError:
            raise RefusedError(codes.CELL_TAKEN_BACK(robot=missing, seconds=SHOWN_WITHIN_S)) from None

    def _not_showing(self) -> str:
        for name in self._robots:
            shown = self._shown.get(name)
            if shown is None or shown.version != self._content.version:
                return name
        return ""

    async def _take_back(self, old: _Content, why: Reason, *, saved: bool) -> None:
        """Restore the old content.

        Raises:
            RefusedError: If that fails; the cell then remains closed until kinematics shows what is checked.
        """
        try:
            if saved:
                await asyncio.to_thread(self._file.restore)
            for checker in self._checkers:
                await checker.replace(dict.fromkeys(self._robots, old.cell))
        except Exception as error:
            stuck = codes.CELL_STUCK(why, robot=self._first, detail=_reason_of(error).text)
            log.error("%s", stuck)
            self._robots[self._first].journal.report(_S.ERROR, stuck.code, stuck.text, why=stuck)
            raise RefusedError(stuck) from error
        finally:
            self._set(old)

    def _set(self, content: _Content) -> None:
        self._content = content
        self._update()
        self._publish()

    # ----------------------------------------------------------------- publish

    def _publish(self) -> None:
        content, file = self._content, self._file
        state = schema.CellState(
            cell=file.cell(self._first),
            version=content.version,
            content=content.message,
            changing=bool(self._changing_by),
            meshes=file.meshes(),
            robots=file.members(self._first),
            file=file.name,
        )
        state.timestamp.GetCurrentTime()
        if self._known_problem is not None:
            state.problem.CopyFrom(reason_message(self._known_problem))
        if self._previous is not None:
            state.previous.CopyFrom(self._previous)
        for publisher in self._publishers.values():
            publisher.put(state)


def _reason_of(error: Exception) -> Reason:
    """Return an error's reason; of an unexpected one its type and text."""
    match error:
        case RefusedError():
            return error.reason
        case CheckError():
            return codes.CELL_CHECK_FAILED(error.reason)
    log.exception("a change of a cell failed")
    return codes.CELL_CHECK_FAILED(codes.OTHER(detail=f"{type(error).__name__}: {error}"))
