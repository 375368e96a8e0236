"""Authority over one robot: the one owner of its lease, its latched stop, its commands, its program or jog.

`handle(event, seen)` yields decisions in the order in which they must be performed. No I/O, no clock.

    event            decisions, in this order
    ---------------  -----------------------------------------------------------------------------------
    stop             wire -> latch -> latch file -> programs cancelled -> published -> audit later
    jog part         evaluated -> wire: checked before, and its command is in the audit log
    end of a jog     hold on the wire -> at rest, reset on the wire -> published -> audit later
    commands, step   admitted -> cell -> evaluated -> checked -> audit on disk -> evaluated again -> wire
    lease: ACQUIRE,  evaluated -> audit on disk -> evaluated again -> applied
      OFFER, ACCEPT, TAKE
    lease: RELEASE,  evaluated -> audit later -> applied; RENEW and a repeated ASK are not audited
      RENEW, ASK
    end of a lease   stop, if its motion may run -> published -> audit later
    link restored    the latched stop on the wire -> audit later
    fate unknown     as a stop

`execution.control` performs the decisions: it hands over one command after the other, so that they reach the
controller in the order of the audit log. Stops, HOLD, renewals and releases do not wait.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, assert_never

from protocol_gateway.authority import (
    audited_events,
    decisions,
    evaluation,
    events,
    lease_rules,
    motion_owner,
    published_events,
    stop_rules,
)
from protocol_gateway.authority.admission import Admission, keep_answer
from protocol_gateway.authority.audit_entry import GATEWAY, JOG, Outcome
from protocol_gateway.authority.audited_events import command_entries, lease_entry
from protocol_gateway.authority.decisions import CheckVerdict, Decisions, Snapshot
from protocol_gateway.authority.evaluation import RunningProgram
from protocol_gateway.authority.events import LeaseResult, StopResult
from protocol_gateway.authority.lease_rules import Answer, Authority, LeaseEnd, Now, not_sent, refused
from protocol_gateway.authority.preconditions import (
    ControllerState,
    controller_command,
    controller_commands,
    predicted,
    target_of,
)
from protocol_gateway.link.link import LinkState
from protocol_gateway.link.motion import has_arrived, motion_may_be_held
from protocol_gateway.seam import Activity, Mode, Stop
from protocol_gateway.seam.errors import CommandError
from robomesh import reason_codes as codes
from robomesh.reasons import Reason
from robomesh.requests.request_queue import RateLimit
from robomesh.schemas.robomesh_pb2 import CommandRequest, LeaseRequest, Recover
from robots.kinematics.joints import Joints

_A = LeaseRequest.Action
_C = CommandRequest.Command

# New stops while one is latched; those beyond count as repeated.
NEW_STOPS_PER_S, NEW_STOPS_BURST = 1.0, 5
# Longer than any arm needs to come to rest: after this time, a moving arm has ignored its stop unit.
HEED_TIMEOUT_S = 2.0


class RobotAuthority:
    """Lease, latched stop, commands and program of one robot.

    Args:
        authority: State of lease and stop at the start.
        prepare: Returns what is sent of commands, all or none; raises CommandError.
        orphan: Operator of a motion that may still run from before the gateway was killed; empty: none.
    """

    def __init__(
        self, authority: Authority, joints: Joints, prepare: Callable[..., object], *, orphan: str = ""
    ) -> None:
        self._authority = authority
        self._program: RunningProgram | None = None
        self._joints = joints
        self._prepare = prepare
        self._orphan = orphan
        self._last_unit_s = float("-inf")  # when the newest unit of commands was sent
        self._disobeyed_reported_s = 0.0
        # The latched stop, if its unit was sent and no RESET is under way: its operator, source and result.
        self._last_stop: tuple[str, str, StopResult] | None = None
        self._new_stops = RateLimit(per_s=NEW_STOPS_PER_S, burst=NEW_STOPS_BURST)

    @property
    def authority(self) -> Authority:
        """State of lease and stop."""
        return self._authority

    @property
    def program(self) -> RunningProgram | None:
        """Program that runs; None: none runs."""
        return self._program

    def handle(self, event: events.Event, seen: Snapshot) -> Decisions[Any]:
        """Return the decisions on an event, to be performed one after the other, each with its result.

        The generator returns the result of a request.
        """
        match event:
            case events.StopRequested():
                return (yield from self._stop(event, seen))
            case events.LeaseRequested():
                return (yield from self._lease_requested(event, seen))
            case events.CommandsRequested():
                return (yield from self._commands_requested(event, seen))
            case events.JogPartReady():
                return (yield from self._jog_part(event, seen))
            case events.JogEnding():
                yield from self._end_jog(event.why, seen, hold=event.hold)
            case events.JogHeld():
                yield from self._give_jog_up(event.percent, seen)
            case events.JogEnded():
                self._program = None
                yield published_events.jog_ended(event)
                yield decisions.AppendLater(audited_events.jog_end_entry(event, seen.now))
                yield decisions.PublishState()
            case events.ProgramEnded():
                self._program = None
                yield published_events.program_ended(event)
                yield decisions.AppendLater(audited_events.program_end_entry(event, seen.now))
                yield decisions.PublishState()
            case events.TimePassed():
                yield from self._expire(seen)
                yield from self._stop_in_local_control(seen)
            case events.SessionEnded():
                yield from self._end_lease(lease_rules.end_session(self._authority, event.session), seen)
            case events.LeaseEnded():
                yield from self._end_lease(lease_rules.end_lease(self._authority, event.why), seen)
            case events.LinkLost():
                yield from self._link_lost(event.why, seen)
            case events.LinkRestored():
                yield from self._send_latched_stop(seen)
            case events.FateUnknown():
                yield from self._stop_by_gateway(codes.STOP_FATE_UNKNOWN(event.why), seen)
            case events.StatusChanged():
                self._authority = replace(self._authority, reset_s=None)
            case events.StatusReported():
                resting = event.activity is Activity.IDLE and self._has_arrived(seen.controller)
                self._authority = motion_owner.follow_status(
                    self._authority, resting=resting, dated_s=event.dated_s
                )
            case events.UnitRefused():
                # The refused unit is unknown, and may have been the speed.
                before = replace(self._authority, speed_percent=None)
                self._authority = motion_owner.drop_refused(before)
                if before is not self._authority:
                    yield decisions.PublishState()
            case events.MotionObserved():
                yield from self._motion_observed(event.moving, seen)
            case _:
                assert_never(event)
        return None

    def stop_in_transit(self, now: Now) -> StopResult | None:
        """Return the result of the latched stop if its unit was sent just now. On any thread."""
        last, authority = self._last_stop, self._authority
        if last is None or authority.stop is None or authority.stop.id != last[2].id:
            return None
        return None if stop_rules.in_transit_since(authority, now) is None else last[2]

    def refusal_now(self, request: CommandRequest, seen: Snapshot) -> Answer | None:
        """Return the refusal of a command by the controller's present state; None: allowed."""
        return evaluation.controller_refusal(request, self._authority, seen.controller, seen, self._joints)

    # ------------------------------------------------------------------ stops

    def _stop(self, stop: events.StopRequested, seen: Snapshot) -> Decisions[StopResult]:
        """Send the stop unit and latch the stop.

        While one is latched, a repeated request of its sender is the same stop; so is any other request
        beyond a rate, because a flood may have many names. Its unit is sent again unless one is in transit.
        """
        read_only, up = seen.controller.read_only, seen.controller.link.state is LinkState.UP
        sent_s = stop_rules.in_transit_since(self._authority, seen.now) if up else None
        if read_only is not None:
            # No operator could reset the latch, and the gateway never sends motion to this robot.
            result = StopResult(codes.STOP_READ_ONLY(read_only))
            yield published_events.stop_not_sent(stop, result)
        elif (problem := (yield from self._send_stop_unit()) if sent_s is None else None) is None and (
            repeated := self._repeated(stop, seen)
        ):
            result = repeated
            if sent_s is None:
                self._authority = stop_rules.mark_sent(self._authority, result.id, seen.now.monotonic_s)
        else:
            number = yield decisions.NumberStop(self._authority.last_stop_id)
            self._authority, latched = stop_rules.latch_stop(
                self._authority, by=stop.by, reason=stop.reason, now=seen.now, number=number
            )
            if problem is None:
                result = StopResult(codes.STOP_SENT(id=latched.id), latched.id, sent=True)
                self._authority = stop_rules.mark_sent(
                    self._authority, latched.id, sent_s or seen.now.monotonic_s
                )
            else:
                result = StopResult(codes.STOP_NOT_SENT(problem, id=latched.id), latched.id)
            self._last_stop = (stop.by, stop.source, result) if result.sent else None
            stop = replace(stop, reason=latched.reason)
            yield decisions.KeepLatch(latched, latched.id)
            yield decisions.CancelPrograms(codes.PROGRAM_STOPPED(by=stop.by, reason=stop.reason))
            yield decisions.PublishState()
            yield published_events.stop_latched(stop, result)
        yield decisions.AppendLater(audited_events.stop_entry(stop, result, seen.now))
        return result

    def _repeated(self, stop: events.StopRequested, seen: Snapshot) -> StopResult | None:
        """Return the result of the latched stop if a request repeats it; None: it is a new stop."""
        if self._authority.stop is None or self._last_stop is None:
            return None
        by, source, result = self._last_stop
        same = (by, source) == (stop.by, stop.source)
        return result if same or not self._new_stops.take(seen.now.monotonic_s) else None

    def _stop_by_gateway(self, reason: Reason, seen: Snapshot) -> Decisions[None]:
        yield from self._stop(events.StopRequested(by=GATEWAY, reason=reason, source=GATEWAY), seen)

    def _send_latched_stop(self, seen: Snapshot) -> Decisions[None]:
        """Send the latched stop, if there is one, again: the controller may have missed it."""
        latched = self._authority.stop
        if latched is None or seen.controller.read_only or (yield from self._send_stop_unit()) is not None:
            return
        self._authority = stop_rules.mark_sent(self._authority, latched.id, seen.now.monotonic_s, first=True)
        yield decisions.PublishState()
        result = StopResult(codes.STOP_SENT_AGAIN(id=latched.id), latched.id, sent=True)
        yield published_events.stop_sent(result)
        yield decisions.AppendLater(audited_events.repeated_stop_entry(result, seen.now))

    def _check_heeded(self, moving: bool, seen: Snapshot) -> Decisions[None]:
        """Report a robot that still moves after its stop, and send the stop again."""
        latched, first_s = self._authority.stop, self._authority.stopping_s
        if not moving or latched is None or first_s is None or seen.controller.read_only is not None:
            return
        if seen.now.monotonic_s - max(first_s, self._disobeyed_reported_s) < HEED_TIMEOUT_S:
            return
        self._disobeyed_reported_s = seen.now.monotonic_s
        problem = yield from self._send_stop_unit()
        why = codes.STOP_DISOBEYED(problem or codes.STOP_UNIT_REPEATED(), id=latched.id)
        result = StopResult(why, latched.id, sent=problem is None)
        yield published_events.stop_disobeyed(result)
        yield decisions.AppendLater(audited_events.repeated_stop_entry(result, seen.now))

    def _send_stop_unit(self) -> Decisions[Reason | None]:
        """Send the stop unit; return the reason of a failure."""
        try:
            unit = self._prepare(Stop())
        except CommandError as error:
            return codes.STOP_SENT_LATER(error.reason)
        problem = yield decisions.Send(unit, urgent=True)
        return None if problem is None else codes.STOP_SENT_LATER(problem)

    # ----------------------------------------------------------------- leases

    def _lease_requested(self, event: events.LeaseRequested, seen: Snapshot) -> Decisions[LeaseResult]:
        asked_before = any(each.operator == event.operator for each in self._authority.asked_by)
        unrecorded = event.request.action == _A.RENEW or (event.request.action == _A.ASK and asked_before)
        outcome = yield from self._evaluate_lease(event, seen)
        if outcome.answer.accepted and not unrecorded:
            entry = lease_entry(event, Outcome.ACCEPTED, outcome.answer, seen.now)
            if event.is_immediate:
                yield decisions.AppendLater(entry)
            else:
                problem, seen = yield decisions.Append((entry,))
                if problem is not None:
                    return LeaseResult(refused(codes.LEASE_NOT_WRITTEN(problem)))
                outcome = yield from self._evaluate_lease(event, seen)
        if not outcome.answer.accepted:
            yield decisions.AppendLater(lease_entry(event, Outcome.REFUSED, outcome.answer, seen.now))
            return LeaseResult(outcome.answer)
        yield from self._set_authority(outcome.authority, outcome.ended, seen)
        return LeaseResult(outcome.answer, outcome.granted)

    def _evaluate_lease(
        self, event: events.LeaseRequested, seen: Snapshot
    ) -> Decisions[lease_rules.LeaseOutcome]:
        yield from self._expire(seen)
        read_only = seen.controller.read_only
        if read_only is not None and event.request.action in (_A.ACQUIRE, _A.TAKE):
            return lease_rules.LeaseOutcome(self._authority, refused(codes.ROBOT_READ_ONLY(read_only)))
        if seen.closed is not None and event.request.action in (_A.ACQUIRE, _A.TAKE):
            return lease_rules.LeaseOutcome(self._authority, refused(seen.closed))
        return lease_rules.request_lease(
            self._authority, event.request, operator=event.operator, now=seen.now, secret=event.secret
        )

    def _expire(self, seen: Snapshot) -> Decisions[None]:
        """End the lease if it has expired."""
        yield from self._end_lease(lease_rules.expire(self._authority, seen.now), seen, "EXPIRE")

    def _end_lease(
        self, outcome: tuple[Authority, LeaseEnd | None], seen: Snapshot, request: str = "REVOKE"
    ) -> Decisions[None]:
        """Apply a change of the lease that no operator has requested, if there is one."""
        authority, ended = outcome
        if authority is not self._authority:
            yield from self._set_authority(authority, ended, seen)
        if ended is not None:
            yield decisions.AppendLater(audited_events.lease_end_entry(request, ended, seen.now))

    def _set_authority(self, authority: Authority, ended: LeaseEnd | None, seen: Snapshot) -> Decisions[None]:
        """Set the state; stop the motion of a lease that has ended, before anything else."""
        changed = _secret(authority) != _secret(self._authority)
        first_percent = seen.controller.capabilities.first_speed_percent
        if changed and first_percent is not None:
            # The speed of one operator is not that of the next one.
            authority = replace(authority, speed_percent=first_percent)
        self._authority = authority
        if ended is not None and ended.stop:
            yield from self._stop_by_gateway(codes.STOP_CONTROL_ENDED(ended.why), seen)
        yield decisions.SetTimer(None if authority.lease is None else authority.lease.until_s)
        if changed:
            yield decisions.Controlled(authority.lease is not None)
        yield decisions.PublishState()
        if ended is not None:
            yield published_events.lease_ended(ended)

    # --------------------------------------------------------------- commands

    def _commands_requested(self, command: events.CommandsRequested, seen: Snapshot) -> Decisions[Answer]:
        yield from self._expire(seen)
        admission = evaluation.admit_commands(command, self._authority, seen.now)
        if admission.repeat:
            return admission.answer
        problem = command.refused or (None if admission.answer.accepted else admission.answer)
        if admission.answer.accepted and not command.step:
            yield from self._end_jog(codes.JOG_COMMANDED(names=command.names), seen)
        sends = command.program is None and not _confirms(command)
        if problem is None and command.is_immediate:
            cancelled = yield decisions.CancelPrograms(codes.PROGRAM_HOLD())
            rests = self._authority.moving is False and self._authority.motion is None
            # A HOLD sent to an arm at rest would make the controller refuse every motion. The end of a jog
            # has its own HOLD; this one waits for the disk, and could follow the RESET that ends the jog.
            sends = not (self._program.program.is_jog if self._program else cancelled and rests)
        if problem is None:
            seen = yield decisions.EnterCell(command.requests)
            problem = evaluation.refusal_of(command, self._authority, self._program, seen, self._joints)
        unit, check_verdict = (
            None,
            CheckVerdict(start=None if command.program is None else command.program.start),
        )
        if problem is None and sends:
            try:
                unit = self._prepare(*controller_commands(command.requests, seen.controller, self._joints))
            except CommandError as error:
                problem = not_sent(error.reason)
        if problem is None and command.program is None:
            check_verdict = yield decisions.CheckMotion(command.requests)
            problem = check_verdict.refusal
        if problem is None:
            # The id is used before anything is sent, so that a repeat never executes the command again.
            self._keep_answer(command, not_sent(codes.COMMAND_BROKEN_OFF()), admission)
            answer: Answer = yield from self._write_and_send(command, unit, check_verdict)
        else:
            answer = problem
            yield from _record(command, Outcome.REFUSED, answer)
        self._keep_answer(command, answer, admission)
        return answer

    def _write_and_send(
        self, command: events.CommandsRequested, unit: object, check_verdict: CheckVerdict
    ) -> Decisions[Answer]:
        warning = check_verdict.warning
        if any(request.command == _C.RESET for request in command.requests):
            self._last_stop = None  # a stop from now on is a new one, and the RESET does not clear it
        accepted = Answer(True, "" if warning is None else warning.text, warning)
        unwritten, seen = yield decisions.Append(command_entries(command, Outcome.ACCEPTED, accepted))
        if unwritten is not None:
            return not_sent(codes.COMMAND_NOT_WRITTEN(unwritten))
        yield from self._expire(seen)
        problem = evaluation.refusal_meanwhile(command, self._authority, self._program, seen, self._joints)
        if problem is None and (changed := (yield decisions.Recheck(check_verdict))) is not None:
            runs = command.program is not None and not command.program.is_jog
            problem = not_sent(codes.PROGRAM_MOVED() if runs else codes.COMMAND_CHANGED(changed))
        if problem is None and unit is not None:
            failure = yield decisions.Send(unit)
            problem = None if failure is None else not_sent(failure)
        if problem is not None:
            yield from _record(command, Outcome.FAILED, problem)
            return problem
        text = yield from self._book(command, unit, seen)
        if warning is None:
            return Answer(True, text)
        if check_verdict.is_violation or not command.step:
            yield published_events.check_warning(command.names, check_verdict)
        return Answer(True, f"{text}; mind: {warning}", warning)

    def _book(self, command: events.CommandsRequested, unit: object, seen: Snapshot) -> Decisions[str]:
        """Apply commands after their unit was sent; return the answer's text."""
        now_s, controller = seen.now.monotonic_s, seen.controller
        isolated = now_s - self._last_unit_s >= motion_owner.ANSWERED_WITHIN_S
        self._last_unit_s = now_s
        if command.program is not None:
            self._program = RunningProgram(program=command.program)
            return f"{command.names}: it runs"
        if _confirms(command):
            changes = "" if controller.set_up is None else controller.set_up.values["changes"]
            (request,) = command.requests
            yield decisions.ConfirmSetUp()
            yield published_events.tool_confirmed(changes, command.operator, request.recover.reason)
            yield decisions.PublishState()
            return f"{changes}: confirmed"
        if unit is None:
            return f"{command.names}: nothing is started any more, and nothing is on hold"
        for request in command.requests:
            latched, target = self._authority.stop, target_of(request, controller, self._joints)
            self._authority = motion_owner.record_command(
                self._authority,
                request,
                seen.now,
                waypoints=() if target is None else (target,),
                arrived=self._has_arrived(seen.controller),
                isolated=isolated,
            )
            self._program = self._program and self._program.after(request, controller)
            if request.command == _C.RESET and latched is not None:
                yield decisions.KeepLatch(self._authority.stop, self._authority.last_stop_id)
                yield published_events.stop_reset(latched.id)
            if request.command == _C.RECOVER:
                recovery = audited_events.recovery_name(request)
                yield published_events.recovery_sent(recovery, command.operator, request.recover.reason)
                return f"{recovery} is on the controller's socket; the robot's state shows what becomes of it"
            yield decisions.PublishState()
            # Each command starts from the state after the previous one.
            controller = predicted(request, controller, self._joints)
        if command.step and command.moves and self._program is not None:
            # From now on the lease's motion holds this target.
            self._program = replace(self._program, done=self._program.done + 1)
        return f"{command.names} {'is' if len(command.requests) == 1 else 'are'} on the controller's socket"

    # ------------------------------------------------------------------- jogs

    def _jog_part(self, part: events.JogPartReady, seen: Snapshot) -> Decisions[Reason | None]:
        """Send the next part of the jog that runs; return why it was not sent."""
        yield from self._expire(seen)
        program = self._program
        if program is None or program.ending is not None:
            return codes.COMMAND_HELD()
        requests = (
            CommandRequest(command=_C.SPEED, speed_percent=part.percent),
            CommandRequest(command=_C.MOVE_ABSOLUTE, joint_positions=part.target),
        )
        if not lease_rules.holds(self._authority, part.operator, part.secret):
            return codes.COMMAND_CONTROL_ENDED()
        command = events.CommandsRequested(
            requests=requests, operator=part.operator, source=JOG, arrived=seen.now, step=True
        )
        refusal = evaluation.refusal_of(command, self._authority, program, seen, self._joints)
        if refusal is not None:
            return refusal.reason
        if (changed := (yield decisions.Recheck(part.check_verdict))) is not None:
            return codes.COMMAND_CHANGED(changed)
        return (yield from self._send_for_jog(requests, seen))

    def _end_jog(self, why: Reason, seen: Snapshot, *, hold: bool = True) -> Decisions[None]:
        """End a jog that runs and does not end already; stop the robot if its hold cannot be sent."""
        program = self._program
        if program is None or not program.program.is_jog or program.ending is not None:
            return
        self._program = replace(program, ending=why)
        # A HOLD sent to an arm at rest would make the controller refuse every motion.
        if not hold or self._authority.motion is None:
            return
        problem = yield from self._send_for_jog((CommandRequest(command=_C.HOLD),), seen)
        if problem is not None:
            yield from self._stop_by_gateway(problem, seen)

    def _give_jog_up(self, percent: float | None, seen: Snapshot) -> Decisions[None]:
        """Discard the rest of a jog that is on hold, and set the operator's speed again."""
        requests = []
        # RESET would also clear a stop.
        if seen.controller.status.activity is Activity.HOLDING and self._authority.stop is None:
            requests.append(CommandRequest(command=_C.RESET))
        if percent is not None and percent != self._authority.speed_percent and self._authority.stop is None:
            requests.append(CommandRequest(command=_C.SPEED, speed_percent=percent))
        if not requests or (yield from self._send_for_jog(requests, seen)) is not None:
            return
        if requests[0].command == _C.RESET:
            self._authority = motion_owner.drop_held(self._authority)

    def _send_for_jog(self, requests: Sequence[CommandRequest], seen: Snapshot) -> Decisions[Reason | None]:
        """Send commands of a jog as one unit, and apply them; return why they were not sent."""
        try:
            unit = self._prepare(*map(controller_command, requests))
        except CommandError as error:
            return error.reason
        problem: Reason | None = yield decisions.Send(unit)
        if problem is not None:
            return problem
        self._last_unit_s = seen.now.monotonic_s
        for request in requests:
            target = target_of(request, seen.controller, self._joints)
            self._authority = motion_owner.record_command(
                self._authority,
                request,
                seen.now,
                waypoints=() if target is None else (target,),
                arrived=self._has_arrived(seen.controller),
                isolated=False,
                replaces=True,
            )
        return None

    def _keep_answer(self, command: events.CommandsRequested, answer: Answer, admission: Admission) -> None:
        if admission.id_used:
            self._authority = keep_answer(self._authority, command.requests[-1], answer)

    # ------------------------------------------------------------- controller

    def _link_lost(self, why: str, seen: Snapshot) -> Decisions[None]:
        """Stop the robot if motion of the holder runs: its position is unknown now."""
        # The next connection may reach another controller.
        first_percent = seen.controller.capabilities.first_speed_percent
        self._authority = replace(self._authority, speed_percent=first_percent)
        self._last_stop = None
        lease = self._authority.lease
        if lease is not None and lease.motion is not None:
            yield from self._stop_by_gateway(codes.STOP_LINK_LOST(holder=lease.holder, detail=why), seen)

    def _stop_in_local_control(self, seen: Snapshot) -> Decisions[None]:
        """Stop a motion of the holder after the controller changed to local control.

        Drivers that follow their motions have ended it by then. A person at the robot expects none of ours.
        """
        lease = self._authority.lease
        if seen.controller.status.mode is Mode.LOCAL and lease is not None and lease.motion is not None:
            yield from self._stop_by_gateway(codes.STOP_WENT_LOCAL(holder=lease.holder), seen)

    def _motion_observed(self, moving: bool, seen: Snapshot) -> Decisions[None]:
        orphaned_by, self._orphan = self._orphan, ""
        if orphaned_by and moving and self._authority.lease is None:
            yield from self._stop_by_gateway(codes.STOP_GATEWAY_KILLED(holder=orphaned_by), seen)
        before = self._authority
        self._authority, uncommanded = motion_owner.follow_motion(
            before,
            moving=moving,
            pending=motion_may_be_held(seen.controller.status.activity),
            arrived=self._has_arrived(seen.controller),
            now=seen.now,
        )
        lease = self._authority.lease
        if uncommanded and not lease_rules.moved_recently(before, seen.now):
            yield published_events.uncommanded_motion(lease is not None)
        if uncommanded and lease is not None and not lease.tolerates_motion:
            why = codes.ENDED_FOREIGN_MOTION()
            yield from self._end_lease(lease_rules.end_lease(self._authority, why, uncommanded=True), seen)
        if (before.motion is None) != (lease is None or lease.motion is None):
            yield decisions.PublishState()
        yield from self._check_heeded(moving, seen)

    def _has_arrived(self, controller: ControllerState) -> bool:
        motion = self._authority.motion
        if motion is None or controller.status.homed is False:
            return False  # at its home position, but not homed yet
        return has_arrived(motion.target, controller.positions, self._joints.types)


def _secret(authority: Authority) -> str:
    return "" if authority.lease is None else authority.lease.secret


def _confirms(command: events.CommandsRequested) -> bool:
    """Return whether a command only confirms what the arm carries: nothing is sent."""
    return any(
        each.command == _C.RECOVER and each.recover.recovery == Recover.CONFIRM_TOOL
        for each in command.requests
    )


def _record(command: events.CommandsRequested, outcome: Outcome, answer: Answer) -> Decisions[None]:
    for entry in command_entries(command, outcome, answer):
        yield decisions.AppendLater(entry)
