"""Commands to one robot: evaluated, audited, sent, answered.

    command                 evaluate -> check motion -> audit on disk -> evaluate again -> controller's socket
    STOP, dead-man stop     controller's socket -> audit (`stop_handler`)

Commands are serialized, so that they reach the controller in the order of the audit log; stops and renewals
do not wait. The second evaluation catches a stop or the end of the lease while the entry was being written,
and a command that has waited too long.
"""

import asyncio
import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

from protocol_gateway.audit.log import GATEWAY, Entry, Outcome
from protocol_gateway.authority import lease_rules, motion_owner
from protocol_gateway.authority.admission import (
    Verdict,
    admit,
    after_command,
    deadline_refusal,
    keep_answer,
    stop_refusal,
    wait_refusal,
)
from protocol_gateway.authority.lease_rules import MOTION_COMMANDS, Answer, Authority, Now, not_sent
from protocol_gateway.authority.preconditions import (
    Controller,
    controller_command,
    obstacle,
    predicted,
    target_of,
)
from protocol_gateway.control.checks import Checks
from protocol_gateway.control.effects import Finding
from protocol_gateway.drivers.driver import Activity
from protocol_gateway.errors import AuditError, CheckError, CommandError, LinkError
from protocol_gateway.motion import has_arrived, motion_may_be_held
from robomesh import reason_codes as codes
from robomesh.errors import RefusedError
from robomesh.messages import reason_message
from robomesh.schemas import robomesh_pb2 as schema
from robots.joints import Joints
from tests.protocol_gateway.old_authority.entries import command_entry
from tests.protocol_gateway.old_authority.leases import Leases
from tests.protocol_gateway.old_authority.stop_handler import ControlContext, StopHandler, read_clocks

_C = schema.CommandRequest.Command
_S = schema.Event.Severity

# A controller may still report a stop for this long after its reset.
RESET_SHOWS_WITHIN_S = 0.3
# Source of a program's steps, in the audit log.
PROGRAM = "program"


@dataclass(frozen=True)
class _Attempt:
    """Commands that go to the controller as one unit.

    Attributes:
        arrived_s: Time of arrival (monotonic).
        id_used: Their ids are used by the holder, so the answer is kept for a repeat.
        step: They are a step of the program that runs.
        begin: Called instead of sending a unit.
        outcome_text: Text of the answer in that case.
    """

    requests: tuple[schema.CommandRequest, ...]
    entries: tuple[Entry, ...]
    arrived_s: float
    id_used: bool = False
    step: bool = False
    begin: Callable[[], None] | None = None
    outcome_text: str = "it runs"


class Control:
    """Control of one robot: evaluates and executes its requests.

    Attributes:
        leases: The robot's lease.
        speed_percent: Speed last set by the gateway since the link came up; None: unknown.
    """

    def __init__(self, joints: Joints, context: ControlContext, checks: Checks | None = None) -> None:
        self._joints = joints
        self._context = context
        self._checks = checks
        self._stop_handler = StopHandler(context)
        self._audit_trail, self._journal, self._driver = context.audit_trail, context.journal, context.driver
        self.speed_percent: float | None = None
        self._reset_s: float | None = None
        self._last_unit_s = float("-inf")  # when the newest unit of commands was sent
        self._command_lock = asyncio.Lock()
        self.leases = Leases(context, self._stop_handler, self._command_lock)

    @property
    def authority(self) -> Authority:
        """State of lease and stop."""
        return self._context.authority

    def stop(self, *, by: str, reason: str, source: str) -> schema.StopAnswer:
        """Stop the robot; allowed for every sender at any time."""
        return self._stop_handler.stop(by=by, reason=reason, source=source)

    def link_lost(self, why: str) -> None:
        """Handle a lost or silent link: stop the robot if motion of the holder runs."""
        self.speed_percent = None  # the next connection may reach another controller
        lease = self.authority.lease
        if lease is not None and lease.motion is not None:
            self.stop(by=GATEWAY, reason=f"{lease.holder}'s motion ran, and {why}", source=GATEWAY)

    # --------------------------------------------------------------- commands

    async def command(
        self, request: schema.CommandRequest, *, operator: str, source: str
    ) -> schema.CommandAnswer:
        """Execute a command; the answer means that its unit is on the controller's socket.

        Raises:
            RefusedError: If it is refused, with the reason; nothing was sent.
        """
        return await self.commands([request], operator=operator, source=source)

    async def commands(
        self, requests: Sequence[schema.CommandRequest], *, operator: str, source: str
    ) -> schema.CommandAnswer:
        """Execute commands in order, as one unit, all or none.

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
        begin: Callable[[], None] | None = None,
        refused: Answer | None = None,
    ) -> Answer:
        """Execute commands like `commands`, but return a refusal as the answer.

        Args:
            begin: Called instead of sending a unit.
            refused: A refusal that is already known, to be audited and returned.
        """
        arrived_s = read_clocks().monotonic_s
        entries = tuple(command_entry(each, operator=operator, source=source) for each in requests)
        # HOLD can only slow the robot down, so it does not wait for checks of other commands.
        holds = all(each.command == _C.HOLD for each in requests)
        async with contextlib.nullcontext() if holds else self._command_lock:
            verdict = self.admit(requests, operator)
            if verdict.repeat:
                return verdict.answer
            problem = verdict.answer if not verdict.answer.accepted else None
            if refused is not None:
                problem = refused
            attempt = _Attempt(tuple(requests), entries, arrived_s, id_used=verdict.id_used, begin=begin)
            if holds and problem is None:
                attempt = self._cancel_preparing(attempt)
            return await self._do(attempt, problem)

    def _cancel_preparing(self, hold: _Attempt) -> _Attempt:
        """Cancel the programs that are being checked; if nothing moves, replace the HOLD by that.

        A HOLD sent to an arm at rest would make the controller refuse every motion.
        """
        cancelled = self._context.cancel_preparing(codes.PROGRAM_HOLD())
        lease = self.authority.lease
        rests = self.authority.moving is False and (lease is None or lease.motion is None)
        if not cancelled or not rests or self._context.program is not None:
            return hold
        return replace(
            hold, begin=lambda: None, outcome_text="the program was not started, and nothing is on hold"
        )

    async def step(self, request: schema.CommandRequest, *, operator: str) -> Answer:
        """Execute a step of the holder's program: evaluated like a command, except for its id."""
        arrived_s = read_clocks().monotonic_s
        entries = (command_entry(request, operator=operator, source=PROGRAM),)
        async with self._command_lock:
            self.leases.expire()
            problem = None
            if not lease_rules.holds(self.authority, operator, request.lease):
                problem = not_sent(codes.COMMAND_CONTROL_ENDED())
            return await self._do(_Attempt((request,), entries, arrived_s, step=True), problem)

    def admit(self, requests: Sequence[schema.CommandRequest], operator: str) -> Verdict:
        """Evaluate whether commands are the holder's, in time and new, and no stop forbids them."""
        self.leases.expire()
        authority, now = self.authority, read_clocks()
        for request in requests:
            verdict = admit(authority, request, operator=operator, now=now)
            if verdict.repeat or not verdict.answer.accepted:
                return verdict
            authority = after_command(authority, request)
        return verdict

    async def _do(self, attempt: _Attempt, problem: Answer | None) -> Answer:
        async with (
            contextlib.nullcontext()
            if self._checks is None or problem
            else self._checks.motion_lock(attempt.requests)
        ):
            problem = problem or self._refusal(attempt)
            send, finding = attempt.begin, Finding()
            if problem is None and send is None:
                try:
                    unit = self._driver.encode(*map(controller_command, attempt.requests))
                    send = partial(self._context.send, unit)
                except CommandError as error:
                    problem = not_sent(error.reason)
            if problem is None and self._checks is not None:
                finding = await self._checks.check(attempt.requests)
                problem = finding.refusal
            if problem is not None:
                self._keep_answer(attempt, problem)
                self._record(attempt.entries, Outcome.REFUSED, problem)
                return problem
            assert send is not None
            # The id is used before anything is sent, so that a repeat never executes the command again.
            self._keep_answer(attempt, not_sent(codes.COMMAND_BROKEN_OFF()))
            answer = await self._write_and_send(attempt, send, finding)
            self._keep_answer(attempt, answer)
            return answer

    async def _write_and_send(self, attempt: _Attempt, send: Callable[[], None], finding: Finding) -> Answer:
        warning = finding.warning
        entries = [
            replace(entry, text="" if warning is None else warning.text, reason=warning)
            for entry in attempt.entries
        ]
        try:
            await self._audit_trail.write_before(*entries)
        except AuditError as error:
            return not_sent(codes.COMMAND_NOT_WRITTEN(error.reason))
        problem = self._recheck(attempt, finding)
        if problem is None:
            try:
                send()
            except (LinkError, CheckError) as error:
                problem = not_sent(error.reason)
        if problem is not None:
            self._record(attempt.entries, Outcome.FAILED, problem)
            return problem
        now = read_clocks()
        isolated = now.monotonic_s - self._last_unit_s >= motion_owner.ANSWERED_WITHIN_S
        self._last_unit_s = now.monotonic_s
        names = ", ".join(_C.Name(request.command) for request in attempt.requests)
        if attempt.begin is None:
            controller = self._context.controller()
            for request in attempt.requests:
                # Each command starts from the state after the previous one.
                self._sent(request, now, controller, isolated=isolated)
                controller = predicted(request, controller, self._joints)
            text = f"{names} {'is' if len(attempt.requests) == 1 else 'are'} on the controller's socket"
        else:
            text = f"{names}: {attempt.outcome_text}"
        if warning is not None and (finding.is_violation or not attempt.step):
            self._journal.report(_S.WARNING, finding.code, f"{names}: {warning}", why=warning, command=names)
        if warning is not None:
            text = f"{text}; mind: {warning}"
        return Answer(True, text, warning)

    def _recheck(self, attempt: _Attempt, finding: Finding) -> Answer | None:
        """Evaluate again after the audit entry was written; return the refusal, None: send it."""
        self.leases.expire()
        if not lease_rules.holds(self.authority, attempt.entries[0].operator, attempt.requests[0].lease):
            return not_sent(codes.COMMAND_CONTROL_ENDED_MEANWHILE())
        if refusal := self._overtaken_by_hold(attempt) or self._refusal(attempt):
            return refusal
        changed = None if self._checks is None else self._checks.changed(finding)
        return None if changed is None else not_sent(codes.COMMAND_CHANGED(changed))

    def _overtaken_by_hold(self, attempt: _Attempt) -> Answer | None:
        """Return the refusal of a motion that a HOLD has overtaken; None: none has."""
        if not any(each.command in MOTION_COMMANDS for each in attempt.requests):
            return None
        lease, program = self.authority.lease, self._context.program
        if attempt.step:
            held = program is not None and (program.held or program.given_up)
        else:
            held = lease is not None and lease.last_id > attempt.requests[-1].id
        return not_sent(codes.COMMAND_HELD()) if held else None

    def _record(self, entries: Sequence[Entry], outcome: Outcome, answer: Answer) -> None:
        for entry in entries:
            self._audit_trail.write_later(
                replace(entry, outcome=outcome, text=answer.text, reason=answer.reason)
            )

    def _keep_answer(self, attempt: _Attempt, answer: Answer) -> None:
        if attempt.id_used:
            self._context.authority = keep_answer(self.authority, attempt.requests[-1], answer)

    def _refusal(self, attempt: _Attempt) -> Answer | None:
        """Return the refusal of commands, each evaluated after the previous ones; None: allowed."""
        authority, controller, now = self.authority, self._context.controller(), read_clocks()
        refusal = wait_refusal(attempt.arrived_s, now)
        motions = [each.command for each in attempt.requests if each.command in MOTION_COMMANDS]
        if len(motions) > 1 and _C.RESUME in motions:
            # Some controllers resume the held motion first, others drop it, so the path would be unknown.
            return not_sent(codes.COMMAND_TWO_UNITS())
        for request in attempt.requests:
            refusal = (
                refusal
                or deadline_refusal(request, now)
                or stop_refusal(authority, request)
                or self._latch_refusal(request)
                or (None if attempt.step else self._program_refusal(request))
                or self._obstacle(request, controller)
            )
            if refusal is not None:
                return refusal
            authority = after_command(authority, request)
            controller = predicted(request, controller, self._joints)
        return refusal

    def _latch_refusal(self, request: schema.CommandRequest) -> Answer | None:
        problem = self._context.latch.problem if request.command in MOTION_COMMANDS else None
        return None if problem is None else not_sent(codes.COMMAND_NOT_LATCHED(problem))

    def _program_refusal(self, request: schema.CommandRequest) -> Answer | None:
        program = self._context.program
        # The check of a program holds only at its speed.
        if program is None or request.command not in (MOTION_COMMANDS | {_C.SPEED}) - {_C.RESUME}:
            return None
        return not_sent(codes.COMMAND_PROGRAM_RUNS(name=program.name))

    def current_obstacle(self, request: schema.CommandRequest) -> Answer | None:
        """Return the refusal of a command by the controller's present state; None: allowed."""
        return self._obstacle(request, self._context.controller())

    def _obstacle(self, request: schema.CommandRequest, controller: Controller) -> Answer | None:
        status = controller.status
        now_s = read_clocks().monotonic_s
        just_reset = self._reset_s is not None and now_s - self._reset_s < RESET_SHOWS_WITHIN_S
        if just_reset and status.activity in (Activity.STOPPED, Activity.FAULT):
            # The controller still reports the stop that was just reset. If it is stopped, it refuses itself.
            controller = replace(controller, status=replace(status, activity=None))
        return obstacle(request, controller, self._joints)

    def _sent(
        self, request: schema.CommandRequest, now: Now, controller: Controller, *, isolated: bool
    ) -> None:
        latched = self.authority.stop
        target = target_of(request, controller, self._joints)
        self._context.authority = motion_owner.command_sent(
            self.authority,
            request,
            now,
            waypoints=() if target is None else (target,),
            arrived=self._has_arrived(),
            isolated=isolated,
        )
        program = self._context.program
        if program is not None and request.command in (_C.HOLD, _C.RESUME):
            self._context.program = replace(program, held=request.command == _C.HOLD)
        if program is not None and request.command == _C.RESET:
            given_up = program.held or controller.status.activity is Activity.HOLDING
            self._context.program = replace(program, given_up=given_up)
        if request.command == _C.SPEED:
            self.speed_percent = request.speed_percent
        if request.command == _C.RESET:
            self._reset_s = now.monotonic_s
            if latched is not None:
                self._context.write_latch()
                text = f"stop request {latched.id} was reset"
                self._journal.report(_S.INFO, "stop.reset", text, stop_id=latched.id)
        self._context.on_change()

    # ----------------------------------------------------------------- motion

    def send_latched_stop(self) -> None:
        """Send the latched stop, if there is one, when units can be sent again."""
        self._stop_handler.send_latched_stop()

    def status_changed(self) -> None:
        """Handle a changed controller status: after it, a stop or fault is not the one that was reset."""
        self._reset_s = None

    def refused(self) -> None:
        """Handle the controller's refusal of a unit."""
        self.speed_percent = None  # the refused unit is unknown, and may have been the speed
        before = self.authority
        self._context.authority = motion_owner.refused(before)
        if before is not self.authority:
            self._context.on_change()

    def observe(self, *, moving: bool | None) -> None:
        """Track whether the robot moves, several times a second; None: unknown."""
        if moving is None:
            return
        now = read_clocks()
        self._stop_orphan(moving)
        before = self.authority
        self._context.authority, uncommanded = motion_owner.observe(
            before,
            moving=moving,
            pending=motion_may_be_held(self._context.controller().status.activity),
            arrived=self._has_arrived(),
            now=now,
        )
        lease = self.authority.lease
        if uncommanded and not lease_rules.moved_recently(before, now):
            self._journal.report(
                _S.INFO if lease is None else _S.WARNING,
                "motion.foreign",
                "the robot began to move without a command of the gateway",
            )
        if uncommanded and lease is not None and not lease.tolerates_motion:
            self.leases.end(codes.ENDED_FOREIGN_MOTION(), uncommanded=True)
        if (before.lease and before.lease.motion is None) != (lease and lease.motion is None):
            self._context.on_change()
        self._stop_handler.check_heeded(moving=moving, now=now)

    def reported(self, activity: Activity | None, dated_s: float) -> None:
        """Follow a status unit; `dated_s`: older time stamp of it and the newest positions (monotonic)."""
        lease = self.authority.lease
        if lease is None or lease.motion is None:
            return
        resting = activity is Activity.IDLE and self._has_arrived()
        self._context.authority = motion_owner.reported(self.authority, resting=resting, dated_s=dated_s)

    def _stop_orphan(self, moving: bool) -> None:
        """Stop a motion that was commanded before the gateway was killed, and has no holder now."""
        mover, self._context.orphan = self._context.orphan, ""
        if mover and moving and self.authority.lease is None:
            text = f"dead-man: the gateway was killed while {mover} had control, and the robot still moves"
            self.stop(by=GATEWAY, reason=text, source=GATEWAY)

    def _has_arrived(self) -> bool:
        lease, controller = self.authority.lease, self._context.controller()
        if lease is None or lease.motion is None or controller.status.homed is False:
            return False  # at its home position, but not homed yet
        return has_arrived(lease.motion.target, controller.positions, self._joints.types)

    async def close(self) -> None:
        """End the lease, if there is one, and write pending audit entries."""
        self.leases.close()
        await self._audit_trail.settle()


def refusal(answer: Answer) -> RefusedError:
    """Return the error that refuses a request with an answer."""
    return RefusedError(answer.reason or answer.text, text=answer.text)


def command_answer(answer: Answer) -> schema.CommandAnswer:
    """Return the answer to a command that is accepted."""
    warning = None if answer.reason is None else reason_message(answer.reason)
    return schema.CommandAnswer(accepted=True, text=answer.text, warning=warning)
