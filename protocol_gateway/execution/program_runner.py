"""Programs of the holder, run step by step: each step is evaluated and checked like any other command.

    RUN_PROGRAM   parse and check the whole program (worker process) -> evaluate -> audit on disk -> run
                  not started if HOLD, a stop, or the sender's timeout comes first
    each step     evaluate -> check against the present state of the cell -> audit on disk
                  -> controller's socket -> wait until the robot rests at the step's target

A program ends with its last step, with a stop, with the end of the lease, with a refused step, or if the
robot comes to rest elsewhere. HOLD and RESUME apply as with any motion. A RESET that drops a held motion also
ends its program.
"""

import asyncio
import logging
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from protocol_gateway.authority.admission import time_left_s
from protocol_gateway.authority.decisions import PlannedProgram
from protocol_gateway.authority.events import ProgramEnded
from protocol_gateway.authority.lease_rules import Answer, refused
from protocol_gateway.authority.preconditions import ControllerState
from protocol_gateway.checking.worker_messages import Checked
from protocol_gateway.execution.abort import abort_reason
from protocol_gateway.execution.clocks import read_clocks
from protocol_gateway.execution.control import Control, command_answer, refusal
from protocol_gateway.execution.motion_checks import MotionChecks
from protocol_gateway.seam import Activity
from protocol_gateway.seam.errors import CheckError
from protocol_gateway.seam.text_limits import LONGEST_TEXT
from protocol_gateway.telemetry.journal import Journal
from protocol_gateway.telemetry.state_messages import timestamp
from robomesh import reason_codes as codes
from robomesh.contract.messages import reason_message
from robomesh.reasons import Reason
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.texts import one_line
from robots.programs import MOST_BYTES
from robots.programs.steps import Step, StepKind

_C = schema.CommandRequest.Command
_S = schema.Event.Severity
_STATE = schema.ProgramState

_POLL_S = 0.02
# A robot that is already at its target may still begin to move: homing searches for its marks.
_START_TIMEOUT_S = 0.3
# Timeout of parsing and checking, even if the sender waits longer.
PREPARE_TIMEOUT_S = 25.0
# Time for the answer's way back: a refusal must arrive before the sender's timeout.
_ANSWER_MARGIN_S = 0.1

# No client waits for a step, so a check that timed out is repeated for this long.
_RECHECK_TIMEOUT_S = 10.0
_TOO_SLOW = frozenset({codes.CHECK_TOO_SLOW.name, codes.CHECK_QUEUED_TOO_LONG.name})

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class _Run:
    """A program, ready to run.

    Attributes:
        secret: Secret of the lease under which it runs.
        last_stop_id: Number of the newest stop at its check.
    """

    program: PlannedProgram
    operator: str
    secret: str
    last_stop_id: int
    lines: tuple[str, ...]
    checked: Checked


class _TimeLeft:
    """Time that the steps left of a program need, the first of which has just begun.

    Args:
        durations_s: Durations of the steps left, by the program's check.
    """

    def __init__(self, durations_s: Sequence[float], now_s: float) -> None:
        self._first_s, self._others_s = durations_s[0], sum(durations_s[1:])
        self._now_s = now_s

    def advance(self, now_s: float, *, paused: bool) -> float:
        """Return the time left [s]; a step that takes longer than checked leaves the time of the others."""
        self._first_s -= 0.0 if paused else now_s - self._now_s
        self._now_s = now_s
        return max(0.0, self._first_s) + self._others_s


@dataclass(frozen=True)
class _Prepared:
    """A program that was checked.

    Attributes:
        refused: Refusal; None: it may run.
        warning: Warning of the check.
    """

    refused: Answer | None = None
    warning: Reason | None = None
    run: _Run | None = None


class ProgramRunner:
    """Runner of one robot's programs, one at a time.

    Args:
        controller: Returns the current state of the controller.
        publish: Publishes the state of lease, stop and program.
        publish_source: Publishes the text of a program that starts; it blocks on nothing.

    Attributes:
        state: State of the current or last program; its timestamp is set when it is published.
    """

    def __init__(
        self,
        control: Control,
        checks: MotionChecks,
        *,
        journal: Journal,
        controller: Callable[[], ControllerState],
        publish: Callable[[], None],
        publish_source: Callable[[schema.ProgramSource], object],
    ) -> None:
        self._control, self._checks, self._journal = control, checks, journal
        self._controller, self._publish, self._publish_source = controller, publish, publish_source
        self.state = _STATE()
        self._wait_s: float | None = None
        self._time_left = _TimeLeft((0.0,), 0.0)
        self._task: asyncio.Task[None] | None = None

    @property
    def running(self) -> schema.ControllerState.Program | None:
        """State of the program that runs; None: none runs."""
        if self.state.outcome != _STATE.RUNNING:
            return None
        return schema.ControllerState.Program(held=not self._not_held(), wait_s=self._wait_s)

    async def run(
        self, request: schema.CommandRequest, *, operator: str, source: str
    ) -> schema.CommandAnswer:
        """Check a program and start it; the answer means that it runs.

        Raises:
            RefusedError: If it is refused, with the reason; the robot has not moved.
        """
        admission = self._control.admit(request, operator)
        if admission.repeat or not admission.answer.accepted:
            # A refusal here is final, even if its reason disappears, because the program was not planned.
            prepared = _Prepared(None if admission.answer.accepted else admission.answer)
            return await self._begin(request, prepared, operator=operator, source=source)
        with self._control.preparing_program() as cancelled:
            try:
                prepared = await self._prepare_in_time(request, cancelled, operator)
            except CheckError as error:
                prepared = _Prepared(refused(error.reason, what="Not run"))
            return await self._begin(request, prepared, operator=operator, source=source)

    async def _begin(
        self, request: schema.CommandRequest, prepared: "_Prepared", *, operator: str, source: str
    ) -> schema.CommandAnswer:
        run = prepared.run
        program = None if run is None else run.program
        answer = await self._control.attempt(
            [request], operator=operator, source=source, program=program, refused=prepared.refused
        )
        if not answer.accepted:
            raise refusal(answer)
        # A repeat gets the first answer, and its own program is not started.
        running = self._control.program
        if run is not None and running is not None and running.program is run.program:
            self._start(run)
        if prepared.warning is not None:
            text = f"{answer.text}; mind: {prepared.warning}"
            answer = answer._replace(text=text, reason=prepared.warning)
        return command_answer(answer)

    async def _prepare_in_time(
        self, request: schema.CommandRequest, cancelled: asyncio.Future[Reason], operator: str
    ) -> "_Prepared":
        """Prepare a program, unless the sender's timeout, a HOLD or a stop comes first.

        Raises:
            CheckError: If it could not be checked, or not in time.
        """
        waits_s = PREPARE_TIMEOUT_S
        if request.HasField("not_after"):
            waits_s = time_left_s(request, read_clocks()) - _ANSWER_MARGIN_S
        prepared = asyncio.ensure_future(self._prepare(request, operator))
        try:
            within_s = max(0.0, min(waits_s, PREPARE_TIMEOUT_S))
            await asyncio.wait((prepared, cancelled), timeout=within_s, return_when=asyncio.FIRST_COMPLETED)
            if cancelled.done():
                raise CheckError(cancelled.result())
            if prepared.done():
                return prepared.result()
        finally:
            prepared.cancel()
            await asyncio.gather(prepared, return_exceptions=True)
        if waits_s < PREPARE_TIMEOUT_S:
            raise CheckError(codes.PROGRAM_ASKER_GAVE_UP())
        raise CheckError(codes.PROGRAM_PLAN_TOO_SLOW(seconds=PREPARE_TIMEOUT_S))

    async def _prepare(self, request: schema.CommandRequest, operator: str) -> "_Prepared":
        """Check a program."""
        if len(request.program.encode()) > MOST_BYTES:
            raise CheckError(codes.PROGRAM_TOO_LONG(kib=MOST_BYTES // 1024))
        checked, check_verdict = await self._checks.program(request.program)
        newest_stop = self._control.authority.last_stop_id
        if check_verdict.refusal is not None:
            return _Prepared(check_verdict.refusal)
        first = next((step for step in checked.steps if step.target is not None), None)
        # Refuse now if the present state (not homed, on hold) would refuse the first step.
        if first is not None and (problem := self._control.refusal_now(_request(first, ""))) is not None:
            return _Prepared(problem)
        name = one_line(request.program_name, LONGEST_TEXT).strip() or "unnamed"
        if check_verdict.warning is not None:
            self._journal.report(
                _S.WARNING,
                check_verdict.code,
                f"program {name}: {check_verdict.warning}",
                why=check_verdict.warning,
                program=name,
            )
        targets = tuple(tuple(each.target.tolist()) for each in checked.steps if each.target is not None)
        program = PlannedProgram(name=name, targets=targets, start=check_verdict.start)
        lines = tuple(request.program.split("\n"))
        run = _Run(program, operator, request.lease, newest_stop, lines, checked)
        return _Prepared(None, check_verdict.warning, run)

    def _start(self, run: _Run) -> None:
        self._wait_s = None
        self.state = _STATE(
            outcome=_STATE.RUNNING,
            name=run.program.name,
            operator=run.operator,
            since=timestamp(time.time_ns()),
            steps=len(run.checked.steps),
            duration_s=sum(run.checked.durations_s),
            left_s=sum(run.checked.durations_s),
        )
        text = "\n".join(run.lines)
        self._publish_source(
            schema.ProgramSource(
                timestamp=self.state.since, name=self.state.name, operator=run.operator, text=text
            )
        )
        self._task = asyncio.create_task(self._run(run))

    async def close(self) -> None:
        """Cancel the program that runs."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)

    async def _run(self, run: _Run) -> None:
        text = f"{run.operator} runs program {run.program.name}"
        self._journal.report(
            _S.INFO, "program.started", text, operator=run.operator, program=run.program.name
        )
        problem: Reason | None = codes.PROGRAM_FAILED()
        try:
            problem = await self._run_steps(run)
        except asyncio.CancelledError:
            problem = codes.ENDED_GATEWAY()
            raise
        except Exception:
            log.exception("program %s failed", run.program.name)
        finally:
            self._end(run, problem)

    async def _run_steps(self, run: _Run) -> Reason | None:
        """Execute a program's steps; return the reason of an abort."""
        for number, step in enumerate(run.checked.steps):
            self._time_left = _TimeLeft(run.checked.durations_s[number:], time.monotonic())
            self.state.step, self.state.line = number + 1, step.line
            self.state.statement = one_line(run.lines[step.line - 1].partition("#")[0].strip(), LONGEST_TEXT)
            self._wait_s = step.seconds if step.kind is StepKind.WAIT else None
            self._publish()
            problem = await self._step(run, step)
            if problem is not None:
                return problem
        # Wait for the end of the motion, so that releasing the lease afterwards needs no stop.
        return await self._wait_until(run, self._motion_is_over)

    async def _step(self, run: _Run, step: Step) -> Reason | None:
        begin_s = time.monotonic()
        if step.kind is StepKind.WAIT:
            return await self._wait_until(run, lambda: time.monotonic() - begin_s >= (step.seconds or 0.0))
        while True:
            # A program held between two motions waits for RESUME, like a motion.
            if (problem := await self._wait_until(run, self._not_held)) is not None:
                return problem
            answer = await self._control.step(_request(step, run.secret), operator=run.operator)
            if _checked_too_slowly(answer) and time.monotonic() - begin_s < _RECHECK_TIMEOUT_S:
                continue
            if answer.accepted or answer.reason is None or answer.reason.code != codes.COMMAND_HELD.name:
                break
        if not answer.accepted:
            # The end of control or a stop is the cause, rather than the refusal that followed from it.
            return self._abort_reason(run) or answer.reason or codes.OTHER(detail=answer.text)
        if step.target is None:
            return None
        target = tuple(step.target.tolist())
        begun = not self._checks.is_resting_at(target)

        def arrived() -> bool:
            nonlocal begun
            begun = begun or not self._checks.is_resting_at(target)
            patience_s = 0.0 if begun else _START_TIMEOUT_S
            return self._checks.is_resting_at(target) and time.monotonic() - begin_s >= patience_s

        return await self._wait_until(run, arrived, moves=True)

    async def _wait_until(self, run: _Run, done: Callable[[], bool], *, moves: bool = False) -> Reason | None:
        """Wait until `done`; return the reason if the program must be aborted."""
        while True:
            # A wait of the program goes on during a hold.
            paused = self._wait_s is None and not self._not_held()
            self.state.left_s = self._time_left.advance(time.monotonic(), paused=paused)
            if (problem := self._abort_reason(run)) is not None:
                return problem
            if done():
                return None
            if moves and self._motion_is_over():
                return codes.PROGRAM_NOT_ARRIVED()
            await asyncio.sleep(_POLL_S)

    def _motion_is_over(self) -> bool:
        return self._control.authority.motion is None

    def _not_held(self) -> bool:
        program = self._control.program
        holding = self._controller().status.activity is Activity.HOLDING
        return not holding and (program is None or not program.held)

    def _abort_reason(self, run: _Run) -> Reason | None:
        why = abort_reason(self._control.authority, run.operator, run.secret, run.last_stop_id)
        program = self._control.program
        if why is None and program is not None and program.given_up:
            return codes.PROGRAM_GIVEN_UP()
        return why

    def _end(self, run: _Run, problem: Reason | None) -> None:
        self.state.outcome = _STATE.DONE if problem is None else _STATE.ENDED
        try:
            if problem is not None:
                self.state.text = problem.text
                self.state.reason.CopyFrom(reason_message(problem))
        finally:
            # While a program runs, other motion is refused.
            self._control.handle(ProgramEnded(run.program.name, run.operator, self.state.line, problem))


def _checked_too_slowly(answer: Answer) -> bool:
    reason = answer.reason
    return (
        not answer.accepted
        and reason is not None
        and reason.code == codes.CHECK_REQUIRED.name
        and any(cause.code in _TOO_SLOW for cause in reason.causes)
    )


def _request(step: Step, secret: str) -> schema.CommandRequest:
    request = schema.CommandRequest(lease=secret)
    match step.kind:
        case StepKind.HOME:
            request.command = _C.HOME
        case StepKind.MOVE:
            assert step.target is not None
            request.command = _C.MOVE_ABSOLUTE
            request.joint_positions.extend(step.target.tolist())
        case StepKind.SPEED:
            assert step.percent is not None
            request.command, request.speed_percent = _C.SPEED, step.percent
        case StepKind.TRACE:
            request.command = _C.TRACE_ON if step.on else _C.TRACE_OFF
    return request
