"""Requests to move or control one robot: judged, written down, done, answered.

    command, ACQUIRE, OFFER, ACCEPT, TAKE   judge -> audit on disk -> judge again -> controller's socket
    STOP, dead-man stop                     controller's socket -> audit
    RELEASE, expiry                         at once (with a dead-man stop if needed) -> audit
    RENEW                                   at once; its lease's end tells how many there were

Commands wait for each other, so that they reach the controller in the order of the audit log; stops
and renewals wait for nothing. Between the two judgements the disk may take its time: a stop or the
lease's end in between is obeyed, and what has waited too long is not sent any more.
"""

import asyncio
import secrets
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

from bus.errors import RefusedError
from bus.schemas import robomesh_pb2 as schema
from protocol_gateway import authority as rules
from protocol_gateway.admission import Verdict, admit, delay, lateness, remember, stop_refusal
from protocol_gateway.audit import Entry, Outcome
from protocol_gateway.authority import Answer, Authority, LeaseEnd, LeaseOutcome, Now
from protocol_gateway.driver import Activity, Driver, Stop
from protocol_gateway.errors import AuditError, CommandError, LinkError
from protocol_gateway.journal import Journal
from protocol_gateway.ledger import Ledger, command_entry, entry_of, lease_entry
from protocol_gateway.motion import has_arrived, motion_may_be_held
from protocol_gateway.obstacles import Controller, controller_command, obstacle, target_of
from protocol_gateway.states import lease_answer
from robots.joints import Joints

_C = schema.CommandRequest.Command
_A = schema.LeaseRequest.Action
_S = schema.Event.Severity

# Longer than any arm takes to come to rest: one that still moves does not heed its stop unit.
HEEDED_WITHIN_S = 2.0
# A controller goes on telling the stop that was just reset for so long at most.
RESET_SHOWS_WITHIN_S = 0.3
GATEWAY = "gateway"


def _now() -> Now:
    return Now(time.monotonic(), time.time_ns())


def _plain(error: Exception) -> str:
    return str(error).removeprefix("not sent: ")


class Control:
    """The authority over one robot, with its audit log and the controller's socket.

    Args:
        send: Puts a unit on the controller's socket at once, or raises LinkError.
        controller: What is known of the controller now.
        on_change: Told when lease or stop changed.

    Attributes:
        authority: The state of `protocol_gateway.authority`.
    """

    def __init__(
        self,
        joints: Joints,
        driver: Driver,
        ledger: Ledger,
        journal: Journal,
        *,
        authority: Authority,
        send: Callable[[bytes], None],
        controller: Callable[[], Controller],
        on_change: Callable[[], None],
    ) -> None:
        self.authority = authority
        self._reset_s: float | None = None
        self._joints = joints
        self._driver = driver
        self._ledger = ledger
        self._journal = journal
        self._send = send
        self._controller = controller
        self._on_change = on_change
        self._one_at_a_time = asyncio.Lock()
        self._expiry: asyncio.TimerHandle | None = None
        self._told_disobeyed_s = 0.0

    # ------------------------------------------------------------------- stop

    def stop(self, *, by: str, reason: str, source: str) -> schema.StopAnswer:
        """Send the stop unit, latch it, and only then say and write down that it was so."""
        now = _now()
        if self._controller().read_only:
            return self._stop_of_read_only(by=by, reason=reason, source=source)
        problem = self._send_stop()
        self.authority, latched = rules.stop(self.authority, by=by, reason=reason, now=now)
        if not problem:
            self.authority = rules.stop_sent(self.authority, latched.id, now)
        text = f"stop request {latched.id} is on the controller's socket"
        if problem:
            text = f"stop request {latched.id} is latched, but not sent: {problem}"
        self._on_change()
        self._journal.say(
            _S.ERROR if problem else _S.WARNING,
            "stop.latched",
            f"{text} ({by}: {latched.reason})",
            stop_id=latched.id,
            by=by,
            sent=not problem,
        )
        self._ledger.after_later(
            entry_of(
                "STOP",
                operator=by,
                source=source,
                outcome=Outcome.FAILED if problem else Outcome.ACCEPTED,
                text=text,
                stop_id=latched.id,
                reason=latched.reason,
            )
        )
        return schema.StopAnswer(stop_id=latched.id, sent=not problem, text=text)

    def _stop_of_read_only(self, *, by: str, reason: str, source: str) -> schema.StopAnswer:
        """Nothing is sent, and nothing latched: nobody could clear it, and nothing needs it."""
        why = self._controller().read_only
        text = f"stop request not sent: stop it at its own panel, for it is read-only: {why}"
        self._journal.say(_S.ERROR, "stop.not_sent", f"{text} ({by}: {reason})", by=by)
        self._ledger.after_later(
            entry_of("STOP", operator=by, source=source, outcome=Outcome.FAILED, text=text, reason=reason)
        )
        return schema.StopAnswer(sent=False, text=text)

    def _send_stop(self) -> str:
        """Put the stop unit on the socket; why not, or nothing."""
        try:
            self._send(self._driver.encode(Stop()))
        except (LinkError, CommandError) as error:
            return f"{_plain(error)}; it is sent as soon as the link is back"
        return ""

    def link_is_back(self) -> None:
        """Send a latched stop (again): the controller may not have had it, or may have been restarted."""
        latched = self.authority.stop
        if latched is None or self._controller().read_only:
            return
        if not self._send_stop():
            self.authority = rules.stop_sent(self.authority, latched.id, _now())
            self._on_change()
            text = f"stop request {latched.id} was sent to the controller when its link came back"
            self._journal.say(_S.WARNING, "stop.sent", text, stop_id=latched.id)

    # ------------------------------------------------------------------ lease

    async def lease(self, request: schema.LeaseRequest, *, operator: str, source: str) -> schema.LeaseAnswer:
        """Answer a lease request.

        Raises:
            RefusedError: With what, why and what next.
        """
        judge = partial(self._judge_lease, request, operator, secrets.token_urlsafe(24))
        record = partial(lease_entry, request, operator=operator, source=source)
        if request.action in (_A.RENEW, _A.RELEASE):
            # Neither moves anything, and both must be in time: they wait for no disk.
            outcome = judge()
            if outcome.answer.accepted and request.action == _A.RELEASE:
                self._ledger.after_later(record(outcome=Outcome.ACCEPTED, text=outcome.answer.text))
            return self._take_effect(outcome, record)
        async with self._one_at_a_time:
            outcome = judge()
            if outcome.answer.accepted:
                try:
                    await self._ledger.before(record(outcome=Outcome.ACCEPTED, text=outcome.answer.text))
                except AuditError as error:
                    raise RefusedError(f"no control: {error}, so it would not be known who had it") from None
                outcome = judge()
            return self._take_effect(outcome, record)

    def _judge_lease(self, request: schema.LeaseRequest, operator: str, secret: str) -> LeaseOutcome:
        self.check_expiry()
        read_only = self._controller().read_only
        if read_only and request.action in (_A.ACQUIRE, _A.TAKE):
            return LeaseOutcome(self.authority, Answer(False, f"this robot is read-only: {read_only}"))
        return rules.request_lease(self.authority, request, operator=operator, now=_now(), secret=secret)

    def _take_effect(self, outcome: LeaseOutcome, record: Callable[..., Entry]) -> schema.LeaseAnswer:
        if not outcome.answer.accepted:
            self._ledger.after_later(record(outcome=Outcome.REFUSED, text=outcome.answer.text))
            raise RefusedError(outcome.answer.text)
        self._set_authority(outcome.authority)
        if outcome.ended is not None:
            self._after_lease_end(outcome.ended)
        return lease_answer(outcome.granted, _now())

    def check_expiry(self) -> None:
        """End a lease whose time is over."""
        authority, ended = rules.expire(self.authority, _now())
        if ended is not None:
            self._end(authority, ended, "EXPIRE")

    def end_lease(self, why: str, *, foreign: bool = False) -> None:
        """End the lease, if there is one, for a reason of the gateway's; `foreign`: of foreign motion."""
        authority, ended = rules.end_lease(self.authority, why, foreign=foreign)
        if ended is not None:
            self._end(authority, ended, "REVOKE")

    def _end(self, authority: Authority, ended: LeaseEnd, request: str) -> None:
        self._set_authority(authority)
        self._after_lease_end(ended)
        self._ledger.after_later(
            entry_of(
                request,
                operator=GATEWAY,
                source=GATEWAY,
                outcome=Outcome.ACCEPTED,
                text=ended.why,
                holder=ended.holder,
                renewals=ended.renewals,
            )
        )

    def _after_lease_end(self, ended: LeaseEnd) -> None:
        if ended.stop:
            self.stop(by=GATEWAY, reason=f"dead-man: {ended.why}", source=GATEWAY)
        severity = _S.WARNING if ended.stop else _S.INFO
        text = f"control ended: {ended.why}{', its motion was stopped' if ended.stop else ''}"
        self._journal.say(severity, "lease.ended", text, holder=ended.holder)

    def _set_authority(self, authority: Authority) -> None:
        """Take a new state, and set the alarm clock to its lease's end."""
        self.authority = authority
        if self._expiry is not None:
            self._expiry.cancel()
            self._expiry = None
        if authority.lease is not None:
            loop = asyncio.get_running_loop()
            left_s = authority.lease.until_s - time.monotonic()
            # A millisecond late rather than early: early, the alarm would find nothing to end.
            self._expiry = loop.call_later(max(0.0, left_s) + 0.001, self.check_expiry)
        self._on_change()

    # --------------------------------------------------------------- commands

    async def command(
        self, request: schema.CommandRequest, *, operator: str, source: str
    ) -> schema.CommandAnswer:
        """Do a command; answered when its unit is on the controller's socket.

        Raises:
            RefusedError: With what, why and what next; nothing was sent.
        """
        arrived_s = time.monotonic()
        entry = command_entry(request, operator=operator, source=source)
        async with self._one_at_a_time:
            self.check_expiry()
            verdict = admit(self.authority, request, operator=operator, now=_now())
            answer = verdict.answer
            if not verdict.repeat:
                answer = await self._do(request, verdict, arrived_s, entry)
        if not answer.accepted:
            raise RefusedError(answer.text)
        return schema.CommandAnswer(accepted=True, text=answer.text)

    async def _do(
        self, request: schema.CommandRequest, verdict: Verdict, arrived_s: float, entry: Entry
    ) -> Answer:
        refusal = verdict.answer.text or delay(arrived_s, _now()) or self._obstacle(request)
        unit = b""
        if not refusal:
            try:
                unit = self._driver.encode(controller_command(request))
            except CommandError as error:
                refusal = f"Not sent: {error}."
        if refusal:
            answer = Answer(False, refusal)
            if verdict.counted:
                self.authority = remember(self.authority, request, answer)
            self._ledger.after_later(replace(entry, outcome=Outcome.REFUSED, text=refusal))
            return answer
        # Used up before anything is done: whatever happens below, a repeat does not do it again.
        broken_off = Answer(False, "Not sent: it was broken off while it was being written down.")
        self.authority = remember(self.authority, request, broken_off)
        answer = await self._write_and_send(request, unit, arrived_s, entry)
        self.authority = remember(self.authority, request, answer)
        return answer

    async def _write_and_send(
        self, request: schema.CommandRequest, unit: bytes, arrived_s: float, entry: Entry
    ) -> Answer:
        try:
            await self._ledger.before(entry)
        except AuditError as error:
            return Answer(False, f"Not sent: {error}, and what is not written down is not done.")
        self.check_expiry()
        problem = self._no_longer(request, arrived_s, entry.operator)
        if not problem:
            try:
                self._send(unit)
            except LinkError as error:
                problem = f"Not sent: {_plain(error)}."
        if problem:
            self._ledger.after_later(replace(entry, outcome=Outcome.FAILED, text=problem))
            return Answer(False, problem)
        self._sent(request)
        return Answer(True, f"{_C.Name(request.command)} is on the controller's socket")

    def _no_longer(self, request: schema.CommandRequest, arrived_s: float, operator: str) -> str:
        """Why a command that was allowed is not any more, after it was written down."""
        if not rules.holds(self.authority, operator, request.lease):
            return "Not sent: control ended while the command was being written down."
        now = _now()
        return (
            delay(arrived_s, now)
            or lateness(request, now)
            or stop_refusal(self.authority, request)
            or self._obstacle(request)
        )

    def _obstacle(self, request: schema.CommandRequest) -> str:
        controller = self._controller()
        status = controller.status
        just_reset = self._reset_s is not None and time.monotonic() - self._reset_s < RESET_SHOWS_WITHIN_S
        if just_reset and status.activity in (Activity.STOPPED, Activity.FAULT):
            # It still tells the stop that was just reset; if it does refuse, it says so itself.
            controller = replace(controller, status=replace(status, activity=None))
        return obstacle(request, controller, self._joints)

    def _sent(self, request: schema.CommandRequest) -> None:
        now = _now()
        latched = self.authority.stop
        target = target_of(request, self._controller(), self._joints)
        self.authority = rules.command_sent(self.authority, request, now, target=target)
        if request.command == _C.RESET:
            self._reset_s = now.monotonic_s
            if latched is not None:
                text = f"stop request {latched.id} was reset"
                self._journal.say(_S.INFO, "stop.reset", text, stop_id=latched.id)
        self._on_change()

    # ----------------------------------------------------------------- motion

    def news(self) -> None:
        """The controller told something new of itself: after a RESET, a stop or fault is a new one."""
        self._reset_s = None

    def refused(self) -> None:
        """The controller refused a unit."""
        before, self.authority = self.authority, rules.refused(self.authority)
        if before is not self.authority:
            self._on_change()

    def observe(self, *, moving: bool | None) -> None:
        """Follow whether the robot moves; called some times a second. None: it is not known."""
        if moving is None:
            return
        now = _now()
        before = self.authority
        self.authority, foreign = rules.observe(
            before,
            moving=moving,
            pending=motion_may_be_held(self._controller().status.activity),
            arrived=self._has_arrived(),
            now=now,
        )
        lease = self.authority.lease
        if foreign and not rules.moved_recently(before, now):
            self._journal.say(
                _S.INFO if lease is None else _S.WARNING,
                "motion.foreign",
                "the robot began to move, and nobody commanded it through the gateway",
            )
        if foreign and lease is not None and not lease.tolerates_motion:
            self.end_lease("the robot began to move, and its holder had not commanded it", foreign=True)
        if (before.lease and before.lease.motion is None) != (lease and lease.motion is None):
            self._on_change()
        self._check_heeded(moving, now)

    def _has_arrived(self) -> bool:
        lease, controller = self.authority.lease, self._controller()
        if lease is None or lease.motion is None or controller.status.homed is False:
            return False  # a robot that is at its home, but does not know it, has still to be homed
        return has_arrived(lease.motion.target, controller.positions, self._joints.types)

    def _check_heeded(self, moving: bool, now: Now) -> None:
        latched = self.authority.stop
        if not moving or latched is None or latched.sent_s is None:
            return
        since_s = now.monotonic_s - max(latched.sent_s, self._told_disobeyed_s)
        if since_s < HEEDED_WITHIN_S:
            return
        self._told_disobeyed_s = now.monotonic_s
        problem = self._send_stop()
        self._journal.say(
            _S.CRITICAL,
            "stop.disobeyed",
            f"the robot moves although stop request {latched.id} was sent: use the emergency stop there "
            f"({problem or 'the stop unit was sent again'})",
            stop_id=latched.id,
        )

    async def close(self) -> None:
        """End the lease, if there still is one, and write what is still to be written."""
        self.end_lease("the gateway is being ended")
        if self._expiry is not None:
            self._expiry.cancel()
        await self._ledger.settle()
