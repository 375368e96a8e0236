"""Authority over one robot: the one owner of its lease, its latched stop, its commands and its program.

`handle(event, seen)` yields effects in the order in which they must be performed. No I/O, no clock.

    event            effects, in this order
    ---------------  -----------------------------------------------------------------------------------
    stop             wire -> latch -> latch file -> programs cancelled -> published -> audit later
    command, step    admitted -> cell -> evaluated -> checked -> audit on disk -> evaluated again -> wire
    lease: ACQUIRE,  evaluated -> audit on disk -> evaluated again -> applied
      OFFER, ACCEPT, TAKE
    lease: RELEASE,  evaluated -> audit later -> applied; RENEW and a repeated ASK are not audited
      RENEW, ASK
    end of a lease   stop, if its motion may run -> published -> audit later
    link restored    the latched stop on the wire -> audit later

`control` performs the effects: it hands over one command after the other, so that they reach the controller
in the order of the audit log. Stops, HOLD, renewals and releases do not wait.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, assert_never

from protocol_gateway.audit.entry import Entry, Outcome
from protocol_gateway.audit.log import GATEWAY
from protocol_gateway.authority import lease_rules, motion_owner
from protocol_gateway.authority.admission import (
    Verdict,
    admit,
    after_command,
    keep_answer,
)
from protocol_gateway.authority.lease_rules import (
    Answer,
    Authority,
    LeaseEnd,
    LeaseOutcome,
    Now,
    not_sent,
    refused,
)
from protocol_gateway.authority.preconditions import (
    Controller,
    controller_command,
    predicted,
    target_of,
)
from protocol_gateway.control import events
from protocol_gateway.control.effects import (
    Append,
    AppendLater,
    CancelPrograms,
    CheckMotion,
    Effects,
    EnterCell,
    Finding,
    KeepLatch,
    NumberStop,
    Publish,
    Recheck,
    Report,
    Seen,
    Send,
    SendStop,
    SetTimer,
    StartProgram,
)
from protocol_gateway.control.entries import (
    PROGRAM,
    command_entry,
    lease_end_entry,
    lease_entry,
    program_end_entry,
    repeated_stop_entry,
    stop_entry,
)
from protocol_gateway.control.evaluation import (
    Attempt,
    RunningProgram,
    controller_refusal,
    overtaken_by_hold,
    refusal_of,
)
from protocol_gateway.drivers.driver import Activity, Stop
from protocol_gateway.errors import CommandError
from protocol_gateway.link.link import LinkState
from protocol_gateway.motion import has_arrived, motion_may_be_held
from robomesh import reason_codes as codes
from robomesh.messages import reason_message
from robomesh.reasons import Reason
from robomesh.schemas import robomesh_pb2 as schema
from robots.joints import Joints

_A = schema.LeaseRequest.Action
_C = schema.CommandRequest.Command
_S = schema.Event.Severity

# Longer than any arm needs to come to rest: after this time, a moving arm has ignored its stop unit.
HEED_TIMEOUT_S = 2.0
# A burst of dozens of units would fill the send buffer, which closes the connection.
IN_TRANSIT_S = 0.1


class RobotAuthority:
    """Lease, latched stop, commands and program of one robot.

    Args:
        authority: State of lease and stop at the start.
        encode: Encodes commands as one unit; raises CommandError.
        orphan: Operator of a motion that may still run from before the gateway was killed; empty: none.
    """

    def __init__(
        self,
        authority: Authority,
        joints: Joints,
        encode: Callable[..., bytes],
        *,
        orphan: str = "",
    ) -> None:
        self._authority = authority
        self._program: RunningProgram | None = None
        self._speed_percent: float | None = None
        self._joints = joints
        self._encode = encode
        self._orphan = orphan
        self._reset_s: float | None = None
        self._last_unit_s = float("-inf")  # when the newest unit of commands was sent
        self._disobeyed_reported_s = 0.0
        self._last_stop: tuple[str, str, Reason, schema.StopAnswer] | None = None  # operator, source

    @property
    def authority(self) -> Authority:
        """State of lease and stop."""
        return self._authority

    @property
    def program(self) -> RunningProgram | None:
        """Program that runs; None: none runs."""
        return self._program

    @property
    def speed_percent(self) -> float | None:
        """Speed last set by the gateway since the link came up; None: unknown."""
        return self._speed_percent

    def handle(self, event: events.Event, seen: Seen) -> Effects[Any]:
        """Return the effects of an event, to be performed one after the other, each with its result.

        The generator returns the result of a request.
        """
        match event:
            case events.StopRequested():
                return (yield from self._stop(seen, by=event.by, reason=event.reason, source=event.source))
            case events.LeaseRequested():
                return (yield from self._lease_requested(event, seen))
            case events.CommandsRequested():
                return (yield from self._commands_requested(event, seen))
            case events.StepRequested():
                return (yield from self._step_requested(event, seen))
            case events.AdmissionRequested():
                return (yield from self._admit(event.requests, event.operator, seen))
            case events.ProgramEnded():
                yield from self._program_ended(event, seen)
            case events.TimePassed():
                yield from self._expire(seen)
            case events.SessionEnded():
                yield from self._end_session(event.session, seen)
            case events.LeaseEnded():
                yield from self._end_lease(event.why, seen)
            case events.LinkLost():
                yield from self._link_lost(event.why, seen)
            case events.LinkRestored():
                yield from self._send_latched_stop(seen)
            case events.StatusChanged():
                self._reset_s = None
            case events.StatusReported():
                self._status_reported(event, seen)
            case events.UnitRefused():
                yield from self._unit_refused()
            case events.MotionObserved():
                yield from self._motion_observed(event.moving, seen)
            case _:
                assert_never(event)
        return None

    def obstacle(self, request: schema.CommandRequest, seen: Seen) -> Answer | None:
        """Return the refusal of a command by the controller's present state; None: allowed."""
        return controller_refusal(request, seen.controller, seen, self._joints, reset_s=self._reset_s)

    # ------------------------------------------------------------------ stops

    def _stop(self, seen: Seen, *, by: str, reason: str, source: str) -> Effects[schema.StopAnswer]:
        if seen.controller.read_only is not None:
            return (yield from self._stop_of_read_only(seen, by=by, reason=reason, source=source))
        sent_s = self._in_transit_since(seen)
        if sent_s is not None and self._last_stop is not None and self._last_stop[:2] == (by, source):
            _, _, result, answer = self._last_stop
            yield AppendLater(
                stop_entry(result, answer, time_ns=seen.now.wall_ns, by=by, source=source, reason=reason)
            )
            return answer
        problem = (yield from self._send_stop_unit()) if sent_s is None else None
        number = yield NumberStop(self._authority.last_stop_id)
        self._authority, latched = lease_rules.stop(
            self._authority, by=by, reason=reason, now=seen.now, number=number
        )
        yield KeepLatch(self._authority.stop, self._authority.last_stop_id)
        yield CancelPrograms(codes.PROGRAM_STOPPED(by=by, reason=latched.reason))
        if problem is None:
            self._authority = lease_rules.stop_sent(
                self._authority, latched.id, sent_s or seen.now.monotonic_s
            )
            result = codes.STOP_SENT(id=latched.id)
        else:
            result = codes.STOP_NOT_SENT(problem, id=latched.id)
        yield Publish()
        yield Report(
            _S.ERROR if problem else _S.WARNING,
            "stop.latched",
            f"{result} ({by}: {latched.reason})",
            why=result,
            values={"stop_id": latched.id, "by": by, "reason": latched.reason, "sent": not problem},
        )
        answer = _stop_answer(result, latched.id, sent=problem is None)
        self._last_stop = None if problem else (by, source, result, answer)
        yield AppendLater(
            stop_entry(result, answer, time_ns=seen.now.wall_ns, by=by, source=source, reason=latched.reason)
        )
        return answer

    def _stop_of_read_only(
        self, seen: Seen, *, by: str, reason: str, source: str
    ) -> Effects[schema.StopAnswer]:
        """Report and audit a stop of a read-only robot, without sending or latching it.

        No operator could reset the latch, and the gateway never sends motion to this robot.
        """
        why = seen.controller.read_only
        assert why is not None
        result = codes.STOP_READ_ONLY(why)
        yield Report(_S.ERROR, "stop.not_sent", f"{result} ({by}: {reason})", why=result, values={"by": by})
        answer = _stop_answer(result, 0, sent=False)
        yield AppendLater(
            stop_entry(result, answer, time_ns=seen.now.wall_ns, by=by, source=source, reason=reason)
        )
        return answer

    def _send_latched_stop(self, seen: Seen) -> Effects[None]:
        """Send the latched stop, if there is one, again: the controller may have missed it."""
        latched = self._authority.stop
        if latched is None or seen.controller.read_only:
            return
        if (yield from self._send_stop_unit()) is None:
            self._authority = lease_rules.stop_sent(
                self._authority, latched.id, seen.now.monotonic_s, first=True
            )
            yield Publish()
            result = codes.STOP_SENT_AGAIN(id=latched.id)
            yield Report(_S.WARNING, "stop.sent", result.text, why=result, values={"stop_id": latched.id})
            yield AppendLater(repeated_stop_entry(result, latched.id, time_ns=seen.now.wall_ns, sent=True))

    def _check_heeded(self, moving: bool, seen: Seen) -> Effects[None]:
        """Report a robot that still moves after its stop, and send the stop again."""
        latched, first_s = self._authority.stop, self._authority.stopping_s
        if not moving or latched is None or first_s is None:
            return
        if seen.now.monotonic_s - max(first_s, self._disobeyed_reported_s) < HEED_TIMEOUT_S:
            return
        self._disobeyed_reported_s = seen.now.monotonic_s
        problem = yield from self._send_stop_unit()
        result = codes.STOP_DISOBEYED(problem or codes.STOP_UNIT_REPEATED(), id=latched.id)
        yield Report(_S.CRITICAL, "stop.disobeyed", result.text, why=result, values={"stop_id": latched.id})
        yield AppendLater(
            repeated_stop_entry(result, latched.id, time_ns=seen.now.wall_ns, sent=problem is None)
        )

    def _in_transit_since(self, seen: Seen) -> float | None:
        """Return the time at which the latched stop's unit was sent (monotonic), if just now."""
        latched = self._authority.stop
        if latched is None or latched.sent_s is None or seen.controller.link.state is not LinkState.UP:
            return None
        return latched.sent_s if seen.now.monotonic_s - latched.sent_s < IN_TRANSIT_S else None

    def _send_stop_unit(self) -> Effects[Reason | None]:
        """Send the stop unit; return the reason of a failure."""
        try:
            unit = self._encode(Stop())
        except CommandError as error:
            return codes.STOP_SENT_LATER(error.reason)
        problem = yield SendStop(unit)
        return None if problem is None else codes.STOP_SENT_LATER(problem)

    # ----------------------------------------------------------------- leases

    def _lease_requested(self, event: events.LeaseRequested, seen: Seen) -> Effects[events.LeaseResult]:
        request, operator = event.request, event.operator
        asked_before = any(each.operator == operator for each in self._authority.asked_by)
        outcome = yield from self._evaluate_lease(event, seen)
        if outcome.answer.accepted:
            entry = _lease_entry(event, Outcome.ACCEPTED, outcome.answer, seen.now)
            unrecorded = request.action == _A.RENEW or (request.action == _A.ASK and asked_before)
            if not event.is_immediate:
                problem, seen = yield Append((entry,))
                if problem is not None:
                    return events.LeaseResult(refused(codes.LEASE_NOT_WRITTEN(problem)))
                outcome = yield from self._evaluate_lease(event, seen)
            elif not unrecorded:
                yield AppendLater(entry)
        if not outcome.answer.accepted:
            yield AppendLater(_lease_entry(event, Outcome.REFUSED, outcome.answer, seen.now))
            return events.LeaseResult(outcome.answer)
        yield from self._set_authority(outcome.authority, seen, ended=outcome.ended)
        return events.LeaseResult(outcome.answer, outcome.granted)

    def _evaluate_lease(self, event: events.LeaseRequested, seen: Seen) -> Effects[LeaseOutcome]:
        yield from self._expire(seen)
        read_only = seen.controller.read_only
        if read_only is not None and event.request.action in (_A.ACQUIRE, _A.TAKE):
            return LeaseOutcome(self._authority, refused(codes.ROBOT_READ_ONLY(read_only)))
        return lease_rules.request_lease(
            self._authority, event.request, operator=event.operator, now=seen.now, secret=event.secret
        )

    def _expire(self, seen: Seen) -> Effects[None]:
        """End the lease if it has expired."""
        authority, ended = lease_rules.expire(self._authority, seen.now)
        if ended is not None:
            yield from self._lease_ended("EXPIRE", authority, ended, seen)
        elif authority is not self._authority:
            yield from self._set_authority(authority, seen)

    def _end_session(self, session: str, seen: Seen) -> Effects[None]:
        authority, ended = lease_rules.end_session(self._authority, session)
        if ended is not None:
            yield from self._lease_ended("REVOKE", authority, ended, seen)

    def _end_lease(self, why: Reason, seen: Seen, *, uncommanded: bool = False) -> Effects[None]:
        """End the lease, if there is one.

        Args:
            uncommanded: The lease ends because of uncommanded motion.
        """
        authority, ended = lease_rules.end_lease(self._authority, why, uncommanded=uncommanded)
        if ended is not None:
            yield from self._lease_ended("REVOKE", authority, ended, seen)

    def _lease_ended(self, request: str, authority: Authority, ended: LeaseEnd, seen: Seen) -> Effects[None]:
        yield from self._set_authority(authority, seen, ended=ended)
        yield AppendLater(lease_end_entry(request, ended, time_ns=seen.now.wall_ns))

    def _set_authority(
        self, authority: Authority, seen: Seen, *, ended: LeaseEnd | None = None
    ) -> Effects[None]:
        """Set the state; stop the motion of a lease that has ended, before anything else."""
        self._authority = authority
        if ended is not None and ended.stop:
            yield from self._stop(seen, by=GATEWAY, reason=f"dead-man: {ended.why}", source=GATEWAY)
        yield SetTimer(None if authority.lease is None else authority.lease.until_s)
        yield Publish()
        if ended is not None:
            yield Report(
                _S.WARNING if ended.stop else _S.INFO,
                "lease.ended",
                f"control ended: {ended.why}{', its motion was stopped' if ended.stop else ''}",
                why=ended.why,
                values={"holder": ended.holder},
            )

    # --------------------------------------------------------------- commands

    def _commands_requested(self, event: events.CommandsRequested, seen: Seen) -> Effects[Answer]:
        entries = tuple(
            command_entry(each, time_ns=event.arrived.wall_ns, operator=event.operator, source=event.source)
            for each in event.requests
        )
        verdict = yield from self._admit(event.requests, event.operator, seen)
        if verdict.repeat:
            return verdict.answer
        problem = None if verdict.answer.accepted else verdict.answer
        if event.refused is not None:
            problem = event.refused
        attempt = Attempt(
            requests=event.requests,
            entries=entries,
            arrived_s=event.arrived.monotonic_s,
            id_used=verdict.id_used,
            program=event.program,
        )
        if event.is_immediate and problem is None:
            attempt = yield from self._cancel_programs(attempt)
        return (yield from self._attempt(attempt, problem, seen))

    def _cancel_programs(self, hold: Attempt) -> Effects[Attempt]:
        """Cancel the programs that are being checked; if nothing moves, send no HOLD.

        A HOLD sent to an arm at rest would make the controller refuse every motion.
        """
        cancelled = yield CancelPrograms(codes.PROGRAM_HOLD())
        lease = self._authority.lease
        rests = self._authority.moving is False and (lease is None or lease.motion is None)
        if not cancelled or not rests or self._program is not None:
            return hold
        return replace(hold, nothing_to_hold=True)

    def _step_requested(self, event: events.StepRequested, seen: Seen) -> Effects[Answer]:
        """Execute a step of the holder's program: evaluated like a command, except for its id."""
        entry = command_entry(
            event.request, time_ns=event.arrived.wall_ns, operator=event.operator, source=PROGRAM
        )
        yield from self._expire(seen)
        problem = None
        if not lease_rules.holds(self._authority, event.operator, event.request.lease):
            problem = not_sent(codes.COMMAND_CONTROL_ENDED())
        attempt = Attempt(
            requests=(event.request,), entries=(entry,), arrived_s=event.arrived.monotonic_s, step=True
        )
        answer: Answer = yield from self._attempt(attempt, problem, seen)
        if answer.accepted and attempt.moves and self._program is not None:
            # From now on the lease's motion holds this target.
            self._program = replace(self._program, done=self._program.done + 1)
        return answer

    def _admit(
        self, requests: Sequence[schema.CommandRequest], operator: str, seen: Seen
    ) -> Effects[Verdict]:
        """Evaluate whether commands are the holder's, in time and new, and no stop forbids them."""
        yield from self._expire(seen)
        authority = self._authority
        for request in requests:
            verdict = admit(authority, request, operator=operator, now=seen.now)
            if verdict.repeat or not verdict.answer.accepted:
                return verdict
            authority = after_command(authority, request)
        return verdict

    def _attempt(self, attempt: Attempt, problem: Answer | None, seen: Seen) -> Effects[Answer]:
        if problem is None:
            seen = yield EnterCell(attempt.requests)
            problem = self._refusal_of(attempt, seen)
        unit, finding = b"", Finding(start=None if attempt.program is None else attempt.program.start)
        if problem is None and not attempt.nothing_to_hold and attempt.program is None:
            try:
                unit = self._encode(*map(controller_command, attempt.requests))
            except CommandError as error:
                problem = not_sent(error.reason)
        if problem is None and attempt.program is None:
            finding = yield CheckMotion(attempt.requests)
            problem = finding.refusal
        if problem is not None:
            self._keep_answer(attempt, problem)
            yield from _record(attempt.entries, Outcome.REFUSED, problem)
            return problem
        # The id is used before anything is sent, so that a repeat never executes the command again.
        self._keep_answer(attempt, not_sent(codes.COMMAND_BROKEN_OFF()))
        answer: Answer = yield from self._write_and_send(attempt, unit, finding)
        self._keep_answer(attempt, answer)
        return answer

    def _write_and_send(self, attempt: Attempt, unit: bytes, finding: Finding) -> Effects[Answer]:
        warning = finding.warning
        text = "" if warning is None else warning.text
        unwritten, seen = yield Append(
            tuple(replace(entry, text=text, reason=warning) for entry in attempt.entries)
        )
        if unwritten is not None:
            return not_sent(codes.COMMAND_NOT_WRITTEN(unwritten))
        problem = yield from self._recheck(attempt, finding, seen)
        if problem is None and attempt.program is None and not attempt.nothing_to_hold:
            failure, seen = yield Send(unit)
            problem = None if failure is None else not_sent(failure)
        if problem is not None:
            yield from _record(attempt.entries, Outcome.FAILED, problem)
            return problem
        text = yield from self._book(attempt, seen)
        if warning is not None and (finding.is_violation or not attempt.step):
            yield Report(
                _S.WARNING,
                finding.code,
                f"{attempt.names}: {warning}",
                why=warning,
                values={"command": attempt.names},
            )
        if warning is not None:
            text = f"{text}; mind: {warning}"
        return Answer(True, text, warning)

    def _recheck(self, attempt: Attempt, finding: Finding, seen: Seen) -> Effects[Answer | None]:
        """Evaluate again after the audit entry was written; return the refusal, None: send it."""
        yield from self._expire(seen)
        if not lease_rules.holds(self._authority, attempt.entries[0].operator, attempt.requests[0].lease):
            return not_sent(codes.COMMAND_CONTROL_ENDED_MEANWHILE())
        overtaken = overtaken_by_hold(attempt, self._authority, self._program)
        if problem := overtaken or self._refusal_of(attempt, seen):
            return problem
        changed = yield Recheck(finding)
        if changed is None:
            return None
        return not_sent(codes.COMMAND_CHANGED(changed) if attempt.program is None else codes.PROGRAM_MOVED())

    def _book(self, attempt: Attempt, seen: Seen) -> Effects[str]:
        """Apply commands after their unit was sent; return the answer's text."""
        isolated = seen.now.monotonic_s - self._last_unit_s >= motion_owner.ANSWERED_WITHIN_S
        self._last_unit_s = seen.now.monotonic_s
        if attempt.nothing_to_hold:
            return f"{attempt.names}: the program was not started, and nothing is on hold"
        if attempt.program is not None:
            self._program = RunningProgram(name=attempt.program.name, targets=attempt.program.targets)
            yield StartProgram(attempt.program)
            return f"{attempt.names}: it runs"
        controller = seen.controller
        for request in attempt.requests:
            # Each command starts from the state after the previous one.
            yield from self._book_one(request, controller, seen, isolated=isolated)
            controller = predicted(request, controller, self._joints)
        return f"{attempt.names} {'is' if len(attempt.requests) == 1 else 'are'} on the controller's socket"

    def _book_one(
        self, request: schema.CommandRequest, controller: Controller, seen: Seen, *, isolated: bool
    ) -> Effects[None]:
        latched = self._authority.stop
        target = target_of(request, controller, self._joints)
        self._authority = motion_owner.command_sent(
            self._authority,
            request,
            seen.now,
            waypoints=() if target is None else (target,),
            arrived=self._has_arrived(seen.controller),
            isolated=isolated,
        )
        if self._program is not None and request.command in (_C.HOLD, _C.RESUME):
            self._program = replace(self._program, held=request.command == _C.HOLD)
        if self._program is not None and request.command == _C.RESET:
            given_up = self._program.held or controller.status.activity is Activity.HOLDING
            self._program = replace(self._program, given_up=given_up)
        if request.command == _C.SPEED:
            self._speed_percent = request.speed_percent
        if request.command == _C.RESET:
            self._reset_s = seen.now.monotonic_s
            if latched is not None:
                yield KeepLatch(self._authority.stop, self._authority.last_stop_id)
                text = f"stop request {latched.id} was reset"
                yield Report(_S.INFO, "stop.reset", text, values={"stop_id": latched.id})
        yield Publish()

    def _refusal_of(self, attempt: Attempt, seen: Seen) -> Answer | None:
        return refusal_of(attempt, self._authority, self._program, seen, self._joints, reset_s=self._reset_s)

    def _keep_answer(self, attempt: Attempt, answer: Answer) -> None:
        if attempt.id_used:
            self._authority = keep_answer(self._authority, attempt.requests[-1], answer)

    def _program_ended(self, event: events.ProgramEnded, seen: Seen) -> Effects[None]:
        self._program = None
        problem = event.problem
        if problem is None:
            outcome = codes.PROGRAM_DONE(program=event.name)
        else:
            outcome = codes.PROGRAM_ENDED(problem, program=event.name, line=event.line)
        severity = _S.INFO if problem is None else _S.WARNING
        yield Report(severity, outcome.code, outcome.text, why=outcome, values={"program": event.name})
        done = problem is None
        yield AppendLater(program_end_entry(outcome, done, time_ns=seen.now.wall_ns, operator=event.operator))
        yield Publish()

    # ------------------------------------------------------------- controller

    def _link_lost(self, why: str, seen: Seen) -> Effects[None]:
        """Stop the robot if motion of the holder runs: its position is unknown now."""
        self._speed_percent = None  # the next connection may reach another controller
        lease = self._authority.lease
        if lease is not None and lease.motion is not None:
            reason = f"{lease.holder}'s motion ran, and {why}"
            yield from self._stop(seen, by=GATEWAY, reason=reason, source=GATEWAY)

    def _status_reported(self, event: events.StatusReported, seen: Seen) -> None:
        resting = event.activity is Activity.IDLE and self._has_arrived(seen.controller)
        self._authority = motion_owner.reported(self._authority, resting=resting, dated_s=event.dated_s)

    def _unit_refused(self) -> Effects[None]:
        self._speed_percent = None  # the refused unit is unknown, and may have been the speed
        before = self._authority
        self._authority = motion_owner.refused(before)
        if before is not self._authority:
            yield Publish()

    def _motion_observed(self, moving: bool, seen: Seen) -> Effects[None]:
        yield from self._stop_orphan(moving, seen)
        before = self._authority
        self._authority, uncommanded = motion_owner.observe(
            before,
            moving=moving,
            pending=motion_may_be_held(seen.controller.status.activity),
            arrived=self._has_arrived(seen.controller),
            now=seen.now,
        )
        lease = self._authority.lease
        if uncommanded and not lease_rules.moved_recently(before, seen.now):
            yield Report(
                _S.INFO if lease is None else _S.WARNING,
                "motion.foreign",
                "the robot began to move without a command of the gateway",
            )
        if uncommanded and lease is not None and not lease.tolerates_motion:
            yield from self._end_lease(codes.ENDED_FOREIGN_MOTION(), seen, uncommanded=True)
        if (before.lease and before.lease.motion is None) != (lease and lease.motion is None):
            yield Publish()
        yield from self._check_heeded(moving, seen)

    def _stop_orphan(self, moving: bool, seen: Seen) -> Effects[None]:
        """Stop a motion that was commanded before the gateway was killed, and has no holder now."""
        mover, self._orphan = self._orphan, ""
        if mover and moving and self._authority.lease is None:
            text = f"dead-man: the gateway was killed while {mover} had control, and the robot still moves"
            yield from self._stop(seen, by=GATEWAY, reason=text, source=GATEWAY)

    def _has_arrived(self, controller: Controller) -> bool:
        lease = self._authority.lease
        if lease is None or lease.motion is None or controller.status.homed is False:
            return False  # at its home position, but not homed yet
        return has_arrived(lease.motion.target, controller.positions, self._joints.types)


def _record(entries: Sequence[Entry], outcome: Outcome, answer: Answer) -> Effects[None]:
    for entry in entries:
        yield AppendLater(replace(entry, outcome=outcome, text=answer.text, reason=answer.reason))


def _lease_entry(event: events.LeaseRequested, outcome: Outcome, answer: Answer, now: Now) -> Entry:
    return lease_entry(
        event.request, outcome, answer, time_ns=now.wall_ns, operator=event.operator, source=event.source
    )


def _stop_answer(result: Reason, stop_id: int, *, sent: bool) -> schema.StopAnswer:
    return schema.StopAnswer(stop_id=stop_id, sent=sent, text=result.text, reason=reason_message(result))
