"""Who controls one robot: lease requests judged, written down, in force; and the ends of a lease.

ACQUIRE, OFFER, ACCEPT, TAKE            judge -> audit on disk -> judge again
RELEASE, expiry, session's end, ASK     at once (with a dead-man stop if needed) -> audit
RENEW                                   at once; its lease's end tells how many there were
"""

import asyncio
import secrets
import time
from collections.abc import Callable
from functools import partial

from protocol_gateway.audit.log import GATEWAY, Entry, Outcome
from protocol_gateway.authority import lease_rules
from protocol_gateway.authority.lease_rules import Authority, LeaseEnd, LeaseOutcome, refused
from protocol_gateway.control.audit_trail import entry_of, lease_entry
from protocol_gateway.control.stop_handler import ControlContext, StopHandler, read_clocks
from protocol_gateway.errors import AuditError
from protocol_gateway.state_messages import lease_answer
from robomesh import reason_codes as codes
from robomesh.errors import RefusedError
from robomesh.reasons import Reason
from robomesh.schemas import robomesh_pb2 as schema

_A = schema.LeaseRequest.Action
_S = schema.Event.Severity


class Leases:
    """The lease of one robot.

    Args:
        command_lock: Held while a command, or a request that is written down first, is done.
    """

    def __init__(
        self, context: ControlContext, stop_handler: StopHandler, command_lock: asyncio.Lock
    ) -> None:
        self._context = context
        self._stop_handler = stop_handler
        self._command_lock = command_lock
        self._audit_trail, self._journal = context.audit_trail, context.journal
        self._expiry: asyncio.TimerHandle | None = None

    async def ask(self, request: schema.LeaseRequest, *, operator: str, source: str) -> schema.LeaseAnswer:
        """Answer a lease request.

        Raises:
            RefusedError: With what, why and what next.
        """
        judge = partial(self._judge_lease, request, operator, secrets.token_urlsafe(24))
        record = partial(lease_entry, request, operator=operator, source=source)
        if request.action in (_A.RENEW, _A.RELEASE, _A.ASK):
            # None of them moves anything, and the first two must be in time: they wait for no disk.
            asked_before = any(each.operator == operator for each in self._context.authority.asked_by)
            outcome = judge()
            unrecorded = request.action == _A.RENEW or (request.action == _A.ASK and asked_before)
            if outcome.answer.accepted and not unrecorded:
                self._audit_trail.write_later(record(Outcome.ACCEPTED, outcome.answer))
            return self._take_effect(outcome, record)
        async with self._command_lock:
            outcome = judge()
            if outcome.answer.accepted:
                try:
                    await self._audit_trail.write_before(record(Outcome.ACCEPTED, outcome.answer))
                except AuditError as error:
                    raise RefusedError(codes.LEASE_NOT_WRITTEN(error.reason)) from None
                outcome = judge()
            return self._take_effect(outcome, record)

    def _judge_lease(self, request: schema.LeaseRequest, operator: str, secret: str) -> LeaseOutcome:
        self.expire()
        read_only = self._context.controller().read_only
        if read_only is not None and request.action in (_A.ACQUIRE, _A.TAKE):
            return LeaseOutcome(self._context.authority, refused(codes.ROBOT_READ_ONLY(read_only)))
        return lease_rules.request_lease(
            self._context.authority, request, operator=operator, now=read_clocks(), secret=secret
        )

    def _take_effect(self, outcome: LeaseOutcome, record: Callable[..., Entry]) -> schema.LeaseAnswer:
        if not outcome.answer.accepted:
            self._audit_trail.write_later(record(Outcome.REFUSED, outcome.answer))
            raise RefusedError(outcome.answer.reason or outcome.answer.text)
        self._set_authority(outcome.authority)
        if outcome.ended is not None:
            self._after_lease_end(outcome.ended)
        return lease_answer(outcome.granted, read_clocks())

    def expire(self) -> None:
        """End a lease whose time is over."""
        authority, ended = lease_rules.expire(self._context.authority, read_clocks())
        if ended is not None:
            self._end(authority, ended, "EXPIRE")
        elif authority is not self._context.authority:
            self._set_authority(authority)

    def end_session(self, session: str) -> None:
        """A program's or page's session is gone: end the lease that was its."""
        authority, ended = lease_rules.end_session(self._context.authority, session)
        if ended is not None:
            self._end(authority, ended, "REVOKE")

    def end(self, why: Reason, *, foreign: bool = False) -> None:
        """End the lease, if there is one, for a reason of the gateway's; `foreign`: of foreign motion."""
        authority, ended = lease_rules.end_lease(self._context.authority, why, foreign=foreign)
        if ended is not None:
            self._end(authority, ended, "REVOKE")

    def _end(self, authority: Authority, ended: LeaseEnd, request: str) -> None:
        self._set_authority(authority)
        self._after_lease_end(ended)
        self._audit_trail.write_later(
            entry_of(
                request,
                operator=GATEWAY,
                source=GATEWAY,
                outcome=Outcome.ACCEPTED,
                text=ended.why.text,
                why=ended.why,
                holder=ended.holder,
                renewals=ended.renewals,
            )
        )

    def _after_lease_end(self, ended: LeaseEnd) -> None:
        if ended.stop:
            self._stop_handler.stop(by=GATEWAY, reason=f"dead-man: {ended.why}", source=GATEWAY)
        severity = _S.WARNING if ended.stop else _S.INFO
        text = f"control ended: {ended.why}{', its motion was stopped' if ended.stop else ''}"
        self._journal.report(severity, "lease.ended", text, why=ended.why, holder=ended.holder)

    def _set_authority(self, authority: Authority) -> None:
        """Take a new state, and set the alarm clock to its lease's end."""
        self._context.authority = authority
        if self._expiry is not None:
            self._expiry.cancel()
            self._expiry = None
        if authority.lease is not None:
            loop = asyncio.get_running_loop()
            left_s = authority.lease.until_s - time.monotonic()
            # A millisecond late rather than early: early, the alarm would find nothing to end.
            self._expiry = loop.call_later(max(0.0, left_s) + 0.001, self.expire)
        self._context.on_change()

    def close(self) -> None:
        """End the lease, if there still is one."""
        self.end(codes.ENDED_GATEWAY())
        if self._expiry is not None:
            self._expiry.cancel()
