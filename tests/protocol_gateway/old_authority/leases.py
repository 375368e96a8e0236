"""Lease of one robot: lease requests evaluated, audited and applied; and the ends of a lease.

ACQUIRE, OFFER, ACCEPT, TAKE            evaluate -> audit on disk -> evaluate again
RELEASE, expiry, session's end, ASK     applied immediately (with a dead-man stop if needed) -> audit
RENEW                                   applied immediately; the end of the lease counts the renewals
"""

import asyncio
import secrets
from collections.abc import Callable
from functools import partial

from protocol_gateway.audit.log import GATEWAY, Entry, Outcome
from protocol_gateway.authority import lease_rules
from protocol_gateway.authority.lease_rules import Authority, LeaseEnd, LeaseOutcome, refused
from protocol_gateway.errors import AuditError
from protocol_gateway.state_messages import lease_answer
from robomesh import reason_codes as codes
from robomesh.errors import RefusedError
from robomesh.reasons import Reason
from robomesh.schemas import robomesh_pb2 as schema
from tests.protocol_gateway.old_authority.entries import entry_of, lease_entry
from tests.protocol_gateway.old_authority.stop_handler import ControlContext, StopHandler, read_clocks

_A = schema.LeaseRequest.Action
_S = schema.Event.Severity


class Leases:
    """Lease of one robot.

    Args:
        command_lock: Held while a command, or a lease request that is audited first, is processed.
    """

    def __init__(
        self, context: ControlContext, stop_handler: StopHandler, command_lock: asyncio.Lock
    ) -> None:
        self._context = context
        self._stop_handler = stop_handler
        self._command_lock = command_lock
        self._audit_trail, self._journal = context.audit_trail, context.journal

    async def ask(self, request: schema.LeaseRequest, *, operator: str, source: str) -> schema.LeaseAnswer:
        """Answer a lease request.

        Raises:
            RefusedError: If it is refused; the text says why and what to do.
        """
        evaluate = partial(self._evaluate, request, operator, secrets.token_urlsafe(24))
        record = partial(lease_entry, request, operator=operator, source=source)
        if request.action in (_A.RENEW, _A.RELEASE, _A.ASK):
            # These requests move nothing, and RENEW and RELEASE are urgent: they do not wait for the disk.
            asked_before = any(each.operator == operator for each in self._context.authority.asked_by)
            outcome = evaluate()
            unrecorded = request.action == _A.RENEW or (request.action == _A.ASK and asked_before)
            if outcome.answer.accepted and not unrecorded:
                self._audit_trail.write_later(record(Outcome.ACCEPTED, outcome.answer))
            return self._apply(outcome, record)
        async with self._command_lock:
            outcome = evaluate()
            if outcome.answer.accepted:
                try:
                    await self._audit_trail.write_before(record(Outcome.ACCEPTED, outcome.answer))
                except AuditError as error:
                    raise RefusedError(codes.LEASE_NOT_WRITTEN(error.reason)) from None
                outcome = evaluate()
            return self._apply(outcome, record)

    def _evaluate(self, request: schema.LeaseRequest, operator: str, secret: str) -> LeaseOutcome:
        self.expire()
        read_only = self._context.controller().read_only
        if read_only is not None and request.action in (_A.ACQUIRE, _A.TAKE):
            return LeaseOutcome(self._context.authority, refused(codes.ROBOT_READ_ONLY(read_only)))
        return lease_rules.request_lease(
            self._context.authority, request, operator=operator, now=read_clocks(), secret=secret
        )

    def _apply(self, outcome: LeaseOutcome, record: Callable[..., Entry]) -> schema.LeaseAnswer:
        if not outcome.answer.accepted:
            self._audit_trail.write_later(record(Outcome.REFUSED, outcome.answer))
            raise RefusedError(outcome.answer.reason or outcome.answer.text)
        self._set_authority(outcome.authority, outcome.ended)
        return lease_answer(outcome.granted, read_clocks())

    def expire(self) -> None:
        """End the lease if it has expired."""
        authority, ended = lease_rules.expire(self._context.authority, read_clocks())
        if ended is not None:
            self._end(authority, ended, "EXPIRE")
        elif authority is not self._context.authority:
            self._set_authority(authority)

    def end_session(self, session: str) -> None:
        """End the lease of a program's or page's session that has ended."""
        authority, ended = lease_rules.end_session(self._context.authority, session)
        if ended is not None:
            self._end(authority, ended, "REVOKE")

    def end(self, why: Reason, *, uncommanded: bool = False) -> None:
        """End the lease, if there is one, for a reason of the gateway.

        Args:
            uncommanded: The lease ends because of uncommanded motion.
        """
        authority, ended = lease_rules.end_lease(self._context.authority, why, uncommanded=uncommanded)
        if ended is not None:
            self._end(authority, ended, "REVOKE")

    def _end(self, authority: Authority, ended: LeaseEnd, request: str) -> None:
        self._set_authority(authority, ended)
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

    def _set_authority(self, authority: Authority, ended: LeaseEnd | None = None) -> None:
        """Set the state; a stop of the motion comes before everything else, as in `RobotAuthority`."""
        self._context.authority = authority
        if ended is not None and ended.stop:
            self._stop_handler.stop(by=GATEWAY, reason=f"dead-man: {ended.why}", source=GATEWAY)
        self._context.set_timer(None if authority.lease is None else authority.lease.until_s)
        self._context.on_change()
        if ended is not None:
            severity = _S.WARNING if ended.stop else _S.INFO
            text = f"control ended: {ended.why}{', its motion was stopped' if ended.stop else ''}"
            self._journal.report(severity, "lease.ended", text, why=ended.why, holder=ended.holder)

    def close(self) -> None:
        """End the lease, if there is one."""
        self.end(codes.ENDED_GATEWAY())
