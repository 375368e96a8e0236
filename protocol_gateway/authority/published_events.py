"""Events that a robot's authority publishes. Pure functions."""

from protocol_gateway.authority.decisions import CheckVerdict, PublishEvent
from protocol_gateway.authority.events import JogEnded, ProgramEnded, StopRequested, StopResult
from protocol_gateway.authority.lease_rules import LeaseEnd
from robomesh import reason_codes as codes
from robomesh.reasons import Reason
from robomesh.schemas.robomesh_pb2 import Event

_S = Event.Severity


def stop_latched(stop: StopRequested, result: StopResult) -> PublishEvent:
    """Report a new stop; an error if its unit is not on the wire."""
    return PublishEvent(
        _S.WARNING if result.sent else _S.ERROR,
        "stop.latched",
        f"{result.reason} ({stop.by}: {stop.reason})",
        why=result.reason,
        values={"stop_id": result.id, "by": stop.by, "reason": stop.reason, "sent": result.sent},
    )


def stop_not_sent(stop: StopRequested, result: StopResult) -> PublishEvent:
    """Report a stop of a read-only robot."""
    text = f"{result.reason} ({stop.by}: {stop.reason})"
    return PublishEvent(_S.WARNING, "stop.not_sent", text, why=result.reason, values={"by": stop.by})


def stop_sent(result: StopResult) -> PublishEvent:
    """Report a latched stop that was sent on a new connection."""
    return _stop(_S.WARNING, "stop.sent", result.reason, result.id)


def stop_disobeyed(result: StopResult) -> PublishEvent:
    """Report a robot that still moves after its stop."""
    return _stop(_S.CRITICAL, "stop.disobeyed", result.reason, result.id)


def stop_reset(stop_id: int) -> PublishEvent:
    """Report the RESET of a stop."""
    text = f"stop request {stop_id} was reset"
    return PublishEvent(_S.INFO, "stop.reset", text, values={"stop_id": stop_id})


def recovery_sent(recovery: str, by: str, reason: str) -> PublishEvent:
    """Report a recovery that was sent to the controller."""
    why = codes.RECOVER_SENT(recovery=recovery, by=by, reason=reason)
    return PublishEvent(
        _S.WARNING, "recover.sent", why.text, why=why, values={"recovery": recovery, "by": by}
    )


def tool_confirmed(changes: str, by: str, reason: str) -> PublishEvent:
    """Report that an operator has confirmed the tool, payload or frame."""
    why = codes.RECOVER_CONFIRMED(changes=changes, by=by, reason=reason)
    return PublishEvent(
        _S.INFO, "recover.confirmed", why.text, why=why, values={"changes": changes, "by": by}
    )


def _stop(severity: Event.Severity, code: str, why: Reason, stop_id: int) -> PublishEvent:
    return PublishEvent(severity, code, why.text, why=why, values={"stop_id": stop_id})


def lease_ended(ended: LeaseEnd) -> PublishEvent:
    """Report the end of a lease."""
    return PublishEvent(
        _S.WARNING if ended.stop else _S.INFO,
        "lease.ended",
        f"control ended: {ended.why}{', its motion was stopped' if ended.stop else ''}",
        why=ended.why,
        values={"holder": ended.holder},
    )


def uncommanded_motion(leased: bool) -> PublishEvent:
    """Report a robot that moves without a command; a warning if an operator has control."""
    return PublishEvent(
        _S.WARNING if leased else _S.INFO,
        "motion.foreign",
        "the robot began to move without a command of the gateway",
    )


def check_warning(names: str, check_verdict: CheckVerdict) -> PublishEvent:
    """Report the warning of a check: of commands, or of a program."""
    text = f"{names}: {check_verdict.warning}"
    return PublishEvent(
        _S.WARNING, check_verdict.code, text, why=check_verdict.warning, values={"command": names}
    )


def jog_ended(event: JogEnded) -> PublishEvent:
    """Report the end of a jog."""
    return PublishEvent(
        _S.WARNING if event.failed else _S.INFO,
        event.outcome.code,
        event.outcome.text,
        why=event.outcome,
        values={"operator": event.operator},
    )


def program_ended(event: ProgramEnded) -> PublishEvent:
    """Report the end of a program."""
    severity = _S.INFO if event.problem is None else _S.WARNING
    return PublishEvent(
        severity,
        event.outcome.code,
        event.outcome.text,
        why=event.outcome,
        values={"program": event.name},
    )
