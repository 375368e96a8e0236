"""Events that a robot's authority publishes. Pure functions."""

from protocol_gateway.authority.effects import Finding, Report
from protocol_gateway.authority.events import JogEnded, ProgramEnded, StopRequested, StopResult
from protocol_gateway.authority.lease_rules import LeaseEnd
from robomesh import reason_codes as codes
from robomesh.reasons import Reason
from robomesh.schemas.robomesh_pb2 import Event

_S = Event.Severity


def stop_latched(stop: StopRequested, result: StopResult) -> Report:
    """Report a new stop; an error if its unit is not on the wire."""
    return Report(
        _S.WARNING if result.sent else _S.ERROR,
        "stop.latched",
        f"{result.reason} ({stop.by}: {stop.reason})",
        why=result.reason,
        values={"stop_id": result.id, "by": stop.by, "reason": stop.reason, "sent": result.sent},
    )


def stop_not_sent(stop: StopRequested, result: StopResult) -> Report:
    """Report a stop of a read-only robot."""
    text = f"{result.reason} ({stop.by}: {stop.reason})"
    return Report(_S.WARNING, "stop.not_sent", text, why=result.reason, values={"by": stop.by})


def stop_sent(result: StopResult) -> Report:
    """Report a latched stop that was sent on a new connection."""
    return _stop(_S.WARNING, "stop.sent", result.reason, result.id)


def stop_disobeyed(result: StopResult) -> Report:
    """Report a robot that still moves after its stop."""
    return _stop(_S.CRITICAL, "stop.disobeyed", result.reason, result.id)


def stop_reset(stop_id: int) -> Report:
    """Report the RESET of a stop."""
    text = f"stop request {stop_id} was reset"
    return Report(_S.INFO, "stop.reset", text, values={"stop_id": stop_id})


def recovery_sent(recovery: str, by: str, reason: str) -> Report:
    """Report a recovery that was sent to the controller."""
    why = codes.RECOVER_SENT(recovery=recovery, by=by, reason=reason)
    return Report(_S.WARNING, "recover.sent", why.text, why=why, values={"recovery": recovery, "by": by})


def tool_confirmed(changes: str, by: str, reason: str) -> Report:
    """Report that an operator has confirmed the tool, payload or frame."""
    why = codes.RECOVER_CONFIRMED(changes=changes, by=by, reason=reason)
    return Report(_S.INFO, "recover.confirmed", why.text, why=why, values={"changes": changes, "by": by})


def _stop(severity: Event.Severity, code: str, why: Reason, stop_id: int) -> Report:
    return Report(severity, code, why.text, why=why, values={"stop_id": stop_id})


def lease_ended(ended: LeaseEnd) -> Report:
    """Report the end of a lease."""
    return Report(
        _S.WARNING if ended.stop else _S.INFO,
        "lease.ended",
        f"control ended: {ended.why}{', its motion was stopped' if ended.stop else ''}",
        why=ended.why,
        values={"holder": ended.holder},
    )


def uncommanded_motion(leased: bool) -> Report:
    """Report a robot that moves without a command; a warning if an operator has control."""
    return Report(
        _S.WARNING if leased else _S.INFO,
        "motion.foreign",
        "the robot began to move without a command of the gateway",
    )


def check_warning(names: str, finding: Finding) -> Report:
    """Report the warning of a check: of commands, or of a program."""
    text = f"{names}: {finding.warning}"
    return Report(_S.WARNING, finding.code, text, why=finding.warning, values={"command": names})


def jog_ended(event: JogEnded) -> Report:
    """Report the end of a jog."""
    return Report(
        _S.WARNING if event.failed else _S.INFO,
        event.outcome.code,
        event.outcome.text,
        why=event.outcome,
        values={"operator": event.operator},
    )


def program_ended(event: ProgramEnded) -> Report:
    """Report the end of a program."""
    severity = _S.INFO if event.problem is None else _S.WARNING
    return Report(
        severity,
        event.outcome.code,
        event.outcome.text,
        why=event.outcome,
        values={"program": event.name},
    )
