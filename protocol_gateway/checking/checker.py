"""Client of a worker process that checks motions: keeps it running, and queries it with a timeout."""

import asyncio
import contextlib
import logging
import time
from collections import deque
from collections.abc import Collection, Mapping
from functools import partial
from typing import Any

from protocol_gateway.checking.worker_messages import (
    Checked,
    CheckMotion,
    CheckProgram,
    Extended,
    ExtendJog,
    Prepare,
    Prepared,
    ReplaceCells,
)
from protocol_gateway.seam.errors import CheckError
from robomesh import reason_codes as codes
from robomesh.files.worker import Worker, WorkerError
from robomesh.reasons import Reason
from robots.descriptions.cells import CellDescription
from robots.schema.errors import RobotError, reason_of

log = logging.getLogger(__name__)

# Share of the time until a command's deadline that its check may take: it still has to be sent and answered.
SHARE_OF_DEADLINE = 0.8
# The longest check of a motion, where the site file sets none: a multiple of the slowest of the last ones.
_TIMES_SLOWEST, _TIMES_REMEMBERED = 10.0, 20
_LEAST_TIMEOUT_S, _MOST_TIMEOUT_S = 2.0, 5.0
PROGRAM_TIMEOUT_S = 25.0
# A process that takes longer hangs, and is killed.
_HANG_TIMEOUT_S = 10.0
_PREPARE_TIMEOUT_S = 60.0
_RESTART_S = 5.0
_PENDING_POLL_S = 1.0
_REPLACE_POLL_S = 0.02
# Most processes for cells of several robots; beyond that, cells share processes.
MOST_PROCESSES = 8
_STARTING = codes.CHECK_STARTING()


class Checker:
    """Checker of motions, or of programs, of some robots. Separate ones, so that programs delay no motion.

    It processes one query at a time; the others wait until their timeouts.

    Args:
        cells: Cell of each robot, by the robot's name.
        start_now: Start the process immediately, so that the first motion does not wait; otherwise with the
            first program.
    """

    def __init__(self, cells: Mapping[str, CellDescription], *, start_now: bool) -> None:
        self._robots = tuple(cells)
        self._start_requested = asyncio.Event()
        if start_now:
            self._start_requested.set()
        # Also the settings of each process that is started later.
        self._cells = dict(cells)
        self._worker = Worker("protocol_gateway.checking.worker", self._cells)
        self._problems: dict[str, Reason | None] = dict.fromkeys(cells, _STARTING)
        self._lock = asyncio.Lock()
        self._failed: Reason | None = None
        self._process: int | None = None
        self._took_s: deque[float] = deque([0.0], maxlen=_TIMES_REMEMBERED)
        self._pending: tuple[str, ...] = ()
        self._replaced = asyncio.Event()

    @property
    def pid(self) -> int | None:
        """Process id of the worker process, while there is one."""
        return self._worker.pid

    def problem(self, robot: str) -> Reason | None:
        """Return why motions of a robot cannot be checked now; None: they can."""
        return self._problems[robot]

    def is_starting(self, robot: str) -> bool:
        """Return whether the check is starting, in contrast to a failure."""
        return self._problems[robot] == _STARTING

    async def run(self) -> None:
        """Keep the process running with every robot's cell prepared, until cancelled."""
        await self._start_requested.wait()
        try:
            while True:
                if self._worker.pid is None or self._worker.pid != self._process:
                    if self._failed is None:
                        self._problems = dict.fromkeys(self._robots, _STARTING)
                    self._process = await self._start_worker()
                elif self._pending:
                    with contextlib.suppress(WorkerError):
                        await self._prepare()
                waits_s = 0.1 if not self._pending else _PENDING_POLL_S
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(waits_s if self._process is not None else _RESTART_S):
                        await self._replaced.wait()
                self._replaced.clear()
        finally:
            await self._worker.close()

    async def _start_worker(self) -> int | None:
        try:
            await self._worker.start()
            process = self._worker.pid
            self._pending = self._robots
            await self._prepare()
        except Exception as error:
            why = _reason_of(error)
            if why != self._failed:
                log.error("motions cannot be checked: %s", why)
            self._failed = why
            self._problems = dict.fromkeys(self._robots, codes.CHECK_BROKEN(why))
            return None
        self._failed = None
        return process

    async def _prepare(self) -> None:
        """Prepare the robots that are not ready; ask again while links are being processed."""
        for robot in self._pending:
            answer = await self._prepare_robot(robot)
            if not answer.pending:
                self._pending = tuple(each for each in self._pending if each != robot)
                self._problems[robot] = answer.problem

    async def _prepare_robot(self, robot: str) -> Prepared:
        try:
            answer: Prepared = await self._worker.ask(Prepare(robot), timeout_s=_PREPARE_TIMEOUT_S)
        except WorkerError:
            raise
        except Exception as error:
            answer = Prepared(problem=codes.CHECK_IMPOSSIBLE(_reason_of(error)))
        if answer.problem is not None and not answer.pending:
            log.warning("%s: its motions cannot be checked: %s", robot, answer.problem)
        return answer

    async def replace(self, cells: Mapping[str, CellDescription]) -> None:
        """Check against other cells from now on; return when motions can be checked as before.

        Args:
            cells: New cell of some of its robots, by the robot's name.

        Raises:
            CheckError: If they cannot; then the new cells hold all the same.
        """
        new = {robot: cell for robot, cell in cells.items() if robot in self._cells}
        could = [robot for robot in new if self._problems[robot] is None]
        self._cells.update(new)
        if not self._start_requested.is_set():
            return
        try:
            await self._worker.ask(ReplaceCells(new), timeout_s=_PREPARE_TIMEOUT_S)
        except WorkerError as error:
            raise CheckError(error.reason) from None
        # Not before, because an answer about the old cells may have been on its way.
        self._problems |= dict.fromkeys(new, _STARTING)
        self._pending = (*self._pending, *(robot for robot in new if robot not in self._pending))
        self._replaced.set()
        try:
            async with asyncio.timeout(_PREPARE_TIMEOUT_S):
                while any(self._problems[robot] == _STARTING for robot in could):
                    await asyncio.sleep(_REPLACE_POLL_S)
        except TimeoutError:
            raise CheckError(_STARTING) from None
        for robot in could:
            if (problem := self._problems[robot]) is not None:
                raise CheckError(problem)

    @property
    def longest_s(self) -> float:
        """Longest time that the check of a motion should take, by the last ones on this machine [s]."""
        return min(max(_TIMES_SLOWEST * max(self._took_s), _LEAST_TIMEOUT_S), _MOST_TIMEOUT_S)

    async def motion(self, question: CheckMotion, *, timeout_s: float) -> Checked:
        """Check a motion.

        Raises:
            CheckError: If it could not be checked, or not in time; the text says why.
        """
        checked: Checked = await self._ask(question, timeout_s=timeout_s)
        return checked

    async def jog(self, question: ExtendJog, *, timeout_s: float) -> Extended:
        """Plan and check the next part of a jog.

        Raises:
            CheckError: If it could not be checked, or not in time; the text says why.
        """
        self._start_requested.set()
        extended: Extended = await self._ask(question, timeout_s=timeout_s)
        return extended

    async def program(self, question: CheckProgram) -> Checked:
        """Check a program.

        Raises:
            CheckError: If it could not be checked, or not in time; the text says why.
        """
        self._start_requested.set()
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(PROGRAM_TIMEOUT_S):
                while self._problems[question.robot] == _STARTING:
                    await asyncio.sleep(0.05)
        checked: Checked = await self._ask(question, timeout_s=PROGRAM_TIMEOUT_S)
        return checked

    async def _ask(self, question: CheckMotion | CheckProgram | ExtendJog, *, timeout_s: float) -> Any:
        if (problem := self._problems[question.robot]) is not None:
            raise CheckError(problem)
        start_s = time.monotonic()
        try:
            # A query is not started after its timeout.
            async with asyncio.timeout(timeout_s):
                await self._lock.acquire()
        except TimeoutError:
            raise CheckError(codes.CHECK_QUEUED_TOO_LONG(seconds=timeout_s)) from None
        asked = asyncio.ensure_future(self._answer(question, max(_HANG_TIMEOUT_S, timeout_s)))
        asked.add_done_callback(partial(self._on_done, time.monotonic()))
        # A late query goes on, because a restart of the process would make the next one late, too.
        done, _ = await asyncio.wait([asked], timeout=max(timeout_s - (time.monotonic() - start_s), 0.0))
        if not done:
            asked.add_done_callback(_log_late_failure)
            raise CheckError(codes.CHECK_TOO_SLOW(seconds=timeout_s, slowest=max(self._took_s)))
        return asked.result()

    async def _answer(self, question: CheckMotion | CheckProgram | ExtendJog, hang_timeout_s: float) -> Any:
        try:
            return await self._worker.ask(question, timeout_s=hang_timeout_s)
        except Exception as error:
            raise CheckError(codes.CHECK_FAILED(_reason_of(error))) from error

    def _on_done(self, began_s: float, asked: asyncio.Future[Any]) -> None:
        self._lock.release()
        self._took_s.append(time.monotonic() - began_s)
        if not asked.cancelled():
            asked.exception()  # retrieved, because the caller may have timed out


def _reason_of(error: Exception) -> Reason:
    """Return an error's reason; of an unexpected one its type and text."""
    match error:
        case WorkerError():
            return error.reason
        case RobotError():
            return reason_of(error)
    text = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    return codes.OTHER(detail=text)


def _log_late_failure(asked: asyncio.Future[Any]) -> None:
    """Log the failure of a query after its caller's timeout."""
    if not asked.cancelled() and (error := asked.exception()) is not None:
        log.warning("a check failed after its timeout: %s", error)


def make_checkers(
    surroundings: Mapping[str, CellDescription], *, start_now: Collection[str] = ()
) -> dict[str, Checker]:
    """Create the checker of each robot: robots of one cell share one, and a limited number serves all cells.

    A long query in one cell does not delay the cells of other checkers.

    Args:
        surroundings: Cell of each robot, by the robot's name.
        start_now: Robots whose checkers start immediately.
    """
    cells: dict[frozenset[str], dict[str, CellDescription]] = {}
    for name, cell in surroundings.items():
        cells.setdefault(frozenset(robot.name for robot in cell.robots), {})[name] = cell
    # Cells of one robot share a process: without other robots' paths, their checks are short.
    shares: list[dict[str, CellDescription]] = [{}]
    for names, robots in sorted(cells.items(), key=lambda each: len(each[0])):
        if len(names) == 1:
            shares[0] |= robots
        elif len(shares) <= MOST_PROCESSES:
            shares.append(dict(robots))
        else:
            min(shares[1:], key=len).update(robots)
    return {
        name: checker
        for share in shares
        if share
        for checker in [Checker(share, start_now=any(name in start_now for name in share))]
        for name in share
    }
