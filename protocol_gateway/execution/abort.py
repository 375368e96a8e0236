"""Reasons to abort what the gateway does for the holder step by step: a program, or a jog."""

from protocol_gateway.authority import lease_rules
from protocol_gateway.authority.lease_rules import Authority
from robomesh import reason_codes as codes
from robomesh.reasons import Reason


def abort_reason(authority: Authority, operator: str, secret: str, last_stop_id: int) -> Reason | None:
    """Return why nothing more may be sent under a lease; None: it may.

    Args:
        last_stop_id: Number of the newest stop when it began.
    """
    if authority.stop is not None:
        return codes.PROGRAM_STOPPED(by=authority.stop.by, reason=authority.stop.reason)
    if authority.last_stop_id != last_stop_id:
        return codes.PROGRAM_STOPPED_BY_NUMBER(id=authority.last_stop_id)
    if not lease_rules.holds(authority, operator, secret):
        return codes.PROGRAM_CONTROL_ENDED(authority.ended or codes.ENDED_UNKNOWN())
    return None
