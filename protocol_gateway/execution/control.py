"""Control of one robot: hands events to its authority, and performs the decisions.

One command after the other is handed over, so that commands reach the controller in the order of the audit
log. A stop, and what the controller sends, is performed in the caller's callback. HOLD, RENEW, RELEASE and
ASK do not wait for earlier commands.
"""

import asyncio
import contextlib
import logging
import secrets
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from protocol_gateway.authority import audited_events, decisions, events
from protocol_gateway.authority.admission import Admission, admit_all, wait_refusal
from protocol_gateway.authority.audit_entry import PROGRAM
from protocol_gateway.authority.decisions import CheckVerdict, PlannedProgram, Snapshot
from protocol_gateway.authority.evaluation import RunningProgram
from protocol_gateway.authority.lease_rules import Answer, Authority
from protocol_gateway.authority.preconditions import ControllerState
from protocol_gateway.authority.robot_authority import RobotAuthority
from protocol_gateway.execution.audit_trail import AuditTrail
from protocol_gateway.execution.clocks import read_clocks
from protocol_gateway.execution.deadlines import CommandArrivals
from protocol_gateway.execution.motion_checks import MotionChecks
from protocol_gateway.persistence.latch_file import LatchFile
from protocol_gateway.seam.errors import AuditError, LinkError
from protocol_gateway.telemetry.journal import Journal
from protocol_gateway.telemetry.state_messages import lease_answer
from robomesh import reason_codes as codes
from robomesh.contract.messages import reason_message
from robomesh.errors import RefusedError
from robomesh.reasons import Reason
from robomesh.schemas import robomesh_pb2 as schema

log = logging.getLogger(__name__)


@dataclass(kw_only=True)
class Performers:
    """Targets of the decisions of one robot's authority.

    Attributes:
        latch: File that keeps the latched stop and its number across a restart.
        send: Writes what was prepared to the controller's socket immediately, or raises LinkError.
        controller: Returns the current state of the controller.
        publish: Publishes the state of lease, stop and program.
        confirm_set_up: Takes tool, payload and frame as they are now for right.
        controlled: Tells the driver whether an operator controls the robot.
        other_gateway: Returns why another gateway of the robot forbids control; None: there is none.
    """

    audit_trail: AuditTrail
    latch: LatchFile
    journal: Journal
    send: Callable[[object], None]
    controller: Callable[[], ControllerState]
    publish: Callable[[], None]
    confirm_set_up: Callable[[], None] = lambda: None
    controlled: Callable[[bool], None] = lambda taken: None
    other_gateway: Callable[[], Reason | None] = lambda: None


class Control:
    """Control of one robot.

    Args:
        checks: None: motions are not checked.

    Attributes:
        arrivals: Times of arrival of commands, which learns here that the gateway runs.
    """

    def __init__(
        self, robot_authority: RobotAuthority, performers: Performers, checks: MotionChecks | None = None
    ) -> None:
        self._robot_authority = robot_authority
        self._performers = performers
        self._checks = checks
        self._command_lock = asyncio.Lock()
        self._preparing: set[asyncio.Future[Reason]] = set()
        self._timer: asyncio.TimerHandle | None = None
        self.arrivals = CommandArrivals()

    @property
    def authority(self) -> Authority:
        """State of lease and stop."""
        return self._robot_authority.authority

    @property
    def program(self) -> RunningProgram | None:
        """Program that runs; None: none runs."""
        return self._robot_authority.program

    # --------------------------------------------------------------- requests

    def stop(
        self, *, by: str, reason: str, source: str, page: schema.PageReport | None = None
    ) -> schema.StopAnswer:
        """Stop the robot; allowed for every sender at any time."""
        shown = {} if page is None else audited_events.page_values(page)
        event = events.StopRequested(by=by, reason=reason, source=source, page=shown)
        result: events.StopResult = self.handle(event)
        return stop_answer(result)

    def answer_to_repeated_stop(self) -> schema.StopAnswer | None:
        """Return the answer to a stop while the unit of another one is in transit; None: none is.

        On any thread: it reads immutable values only.
        """
        result = self._robot_authority.stop_in_transit(read_clocks())
        return None if result is None else stop_answer(result)

    def record_repeated_stops(self, count: int, stop_id: int, *, by: str, reason: str, source: str) -> None:
        """Audit stops that were answered from memory, as one entry with the newest one's sender."""
        result = events.StopResult(codes.STOP_SENT(id=stop_id), stop_id, sent=True)
        event = events.StopRequested(by=by, reason=reason, source=source)
        entry = audited_events.stop_entry(event, result, read_clocks())
        self._performers.audit_trail.write_later(replace(entry, repeated=count - 1))

    async def lease(self, request: schema.LeaseRequest, *, operator: str, source: str) -> schema.LeaseAnswer:
        """Answer a lease request.

        Raises:
            RefusedError: If it is refused; the text says why and what to do.
        """
        secret = secrets.token_urlsafe(24)
        event = events.LeaseRequested(request=request, operator=operator, source=source, secret=secret)
        result: events.LeaseResult = await self._handle_in_turn(event)
        if not result.answer.accepted:
            raise RefusedError(result.answer.reason or result.answer.text)
        return lease_answer(result.granted, read_clocks())

    async def commands(
        self, requests: Sequence[schema.CommandRequest], *, operator: str, source: str
    ) -> schema.CommandAnswer:
        """Execute commands in order, as one unit, all or none.

        The answer means that the unit is on the controller's socket.

        Raises:
            RefusedError: If they are refused, with the reason; nothing was sent.
        """
        answer = await self.attempt(requests, operator=operator, source=source)
        if not answer.accepted:
            raise refusal(answer)
        return command_answer(answer)

    async def attempt(
        self,
        requests: Sequence[schema.CommandRequest],
        *,
        operator: str,
        source: str,
        program: PlannedProgram | None = None,
        refused: Answer | None = None,
    ) -> Answer:
        """Execute commands like `commands`, but return a refusal as the answer.

        Args:
            program: Program to start instead of sending a unit.
            refused: A refusal that is already known, to be audited and returned.
        """
        now = read_clocks()
        arrived_s = self.arrivals.arrived_s(now.monotonic_s)
        event = events.CommandsRequested(
            requests=tuple(requests),
            operator=operator,
            source=source,
            arrived=now._replace(monotonic_s=arrived_s),
            program=program,
            refused=refused,
            held_up=arrived_s < now.monotonic_s,
        )
        answer: Answer = await self._handle_in_turn(event)
        return answer

    async def step(self, request: schema.CommandRequest, *, operator: str) -> Answer:
        """Execute a step of the holder's program."""
        event = events.CommandsRequested(
            requests=(request,), operator=operator, source=PROGRAM, arrived=read_clocks(), step=True
        )
        answer: Answer = await self._handle_in_turn(event)
        return answer

    def admit(self, request: schema.CommandRequest, operator: str) -> Admission:
        """Evaluate whether a command is the holder's, in time and new, and no stop forbids it."""
        self.handle(events.TimePassed())
        now = read_clocks()
        if (late := wait_refusal(self.arrivals.arrived_s(now.monotonic_s), now)) is not None:
            return Admission(late)
        return admit_all(self.authority, (request,), operator=operator, now=now)

    @contextlib.contextmanager
    def preparing_program(self) -> Iterator[asyncio.Future[Reason]]:
        """Prepare a program; the future's result is the reason why it must not start."""
        cancelled: asyncio.Future[Reason] = asyncio.get_running_loop().create_future()
        self._preparing.add(cancelled)
        try:
            yield cancelled
        finally:
            self._preparing.discard(cancelled)

    def refusal_now(self, request: schema.CommandRequest) -> Answer | None:
        """Return the refusal of a command by the controller's present state; None: allowed."""
        return self._robot_authority.refusal_now(request, self._snapshot())

    async def close(self) -> None:
        """End the lease, if there is one, and write pending audit entries."""
        self.handle(events.LeaseEnded(codes.ENDED_GATEWAY()))
        self._set_timer(None)
        await self._performers.audit_trail.settle()

    # ---------------------------------------------------------------- decisions

    def handle(self, event: events.Event) -> Any:
        """Hand over an event, and perform its decisions, which wait for nothing; return its result."""
        handled, result = self._robot_authority.handle(event, self._snapshot()), None
        while True:
            try:
                decision = handled.send(result)
            except StopIteration as done:
                return done.value
            result = self._perform(decision)

    async def _handle_in_turn(self, event: events.LeaseRequested | events.CommandsRequested) -> Any:
        """Hand over a request after the earlier ones, unless it is immediate; return its result."""
        async with (
            contextlib.nullcontext() if event.is_immediate else self._command_lock,
            contextlib.AsyncExitStack() as cell,
        ):
            handled = self._robot_authority.handle(event, self._snapshot())
            result: Any = None
            while True:
                try:
                    decision = handled.send(result)
                except StopIteration as done:
                    return done.value
                match decision:
                    case decisions.EnterCell():
                        if self._checks is not None:
                            await cell.enter_async_context(self._checks.motion_lock(decision.requests))
                        result = self._snapshot()
                    case decisions.CheckMotion():
                        if self._checks is None:
                            result = CheckVerdict()
                        else:
                            result = await self._checks.check(decision.requests)
                    case decisions.Append():
                        result = await self._append(decision), self._snapshot()
                    case _:
                        result = self._perform(decision)

    def _perform(self, decision: decisions.Decision) -> Any:
        """Perform a decision that waits for nothing, and return its result.

        Raises:
            TypeError: If the decision must be awaited.
        """
        match decision:
            case decisions.Send():
                return self._send(decision)
            case decisions.Recheck():
                return None if self._checks is None else self._checks.why_changed(decision.check_verdict)
            case decisions.EnterCell() | decisions.CheckMotion() | decisions.Append():
                raise TypeError(f"{type(decision).__name__} cannot be performed without waiting")
        try:
            return self._perform_rest(decision)
        except Exception:
            # A stop must be latched and audited, and a motion booked, whatever fails beside it.
            log.exception("%s failed", type(decision).__name__)
            return None

    def _perform_rest(self, decision: decisions.Decision) -> Any:
        performers = self._performers
        match decision:
            case decisions.NumberStop():
                return performers.latch.next_number(decision.last, read_clocks().wall_ns)
            case decisions.CancelPrograms():
                return self._cancel_programs(decision.why)
            case decisions.AppendLater():
                performers.audit_trail.write_later(decision.entry)
            case decisions.KeepLatch():
                performers.latch.keep(decision.stop, decision.last_stop_id)
            case decisions.PublishState():
                performers.publish()
            case decisions.ConfirmSetUp():
                performers.confirm_set_up()
            case decisions.PublishEvent():
                performers.journal.report(
                    decision.severity, decision.code, decision.text, why=decision.why, **decision.values
                )
            case decisions.SetTimer():
                self._set_timer(decision.at_s)
            case decisions.Controlled():
                performers.controlled(decision.taken)
        return None

    def _snapshot(self) -> Snapshot:
        return Snapshot(
            now=read_clocks(),
            controller=self._performers.controller(),
            latch_problem=self._performers.latch.problem,
            closed=self._performers.other_gateway()
            or (None if self._checks is None else self._checks.why_cell_closed),
        )

    def _send(self, decision: decisions.Send) -> Reason | None:
        try:
            self._performers.send(decision.unit)
        except LinkError as error:
            return error.reason
        except Exception as error:
            if not decision.urgent:
                raise
            log.exception("the stop unit was not sent")
            return codes.OTHER(detail=f"{type(error).__name__}: see the gateway's log")
        return None

    def _cancel_programs(self, why: Reason) -> bool:
        for each in self._preparing:
            if not each.done():
                each.set_result(why)
        return bool(self._preparing)

    async def _append(self, decision: decisions.Append) -> Reason | None:
        try:
            await self._performers.audit_trail.write_before(*decision.entries)
        except AuditError as error:
            return error.reason
        return None

    def _set_timer(self, at_s: float | None) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if at_s is not None:
            # A millisecond late: an early timer would find an unexpired lease.
            left_s = max(0.0, at_s - time.monotonic()) + 0.001
            self._timer = asyncio.get_running_loop().call_later(left_s, self.handle, events.TimePassed())


def refusal(answer: Answer) -> RefusedError:
    """Return the error that refuses a request with an answer."""
    return RefusedError(answer.reason or answer.text, text=answer.text)


def stop_answer(result: events.StopResult) -> schema.StopAnswer:
    """Return the answer to a stop."""
    reason = reason_message(result.reason)
    return schema.StopAnswer(stop_id=result.id, sent=result.sent, text=result.reason.text, reason=reason)


def command_answer(answer: Answer) -> schema.CommandAnswer:
    """Return the answer to a command that is accepted."""
    warning = None if answer.reason is None else reason_message(answer.reason)
    return schema.CommandAnswer(accepted=True, text=answer.text, warning=warning)
