"""Audit entries of requests. No I/O; time is an argument."""

from hashlib import sha256

from protocol_gateway.audit.entry import Entry, Outcome
from protocol_gateway.audit.log import GATEWAY
from protocol_gateway.authority.lease_rules import Answer, LeaseEnd
from protocol_gateway.text_limits import LONGEST_SENTENCE
from robomesh.reasons import Reason
from robomesh.schemas.robomesh_pb2 import CommandRequest, LeaseRequest, StopAnswer
from robomesh.texts import one_line

# Source of a program's steps.
PROGRAM = "program"


def entry_of(
    request: str,
    *,
    time_ns: int,
    operator: str,
    source: str,
    outcome: Outcome,
    text: str,
    why: Reason | None = None,
    **values: object,
) -> Entry:
    """Create an entry; empty values are omitted, long ones shortened."""
    return Entry(
        time_ns=time_ns,
        operator=operator,
        source=source,
        request=request,
        outcome=outcome,
        text=text,
        reason=why,
        values={
            name: one_line(str(value), LONGEST_SENTENCE)
            for name, value in values.items()
            if value not in ("", 0)
        },
    )


def lease_entry(
    request: LeaseRequest, outcome: Outcome, answer: Answer, *, time_ns: int, operator: str, source: str
) -> Entry:
    """Create the entry of a lease request."""
    return entry_of(
        LeaseRequest.Action.Name(request.action),
        time_ns=time_ns,
        operator=operator,
        source=source,
        outcome=outcome,
        text=answer.text,
        why=answer.reason,
        ttl_s=request.ttl_s,
        to=request.to,
        reason=request.reason,
    )


def command_entry(request: CommandRequest, *, time_ns: int, operator: str, source: str) -> Entry:
    """Create the entry of an accepted command."""
    return entry_of(
        CommandRequest.Command.Name(request.command),
        time_ns=time_ns,
        operator=operator,
        source=source,
        outcome=Outcome.ACCEPTED,
        text="",
        id=str(request.id),
        joint_positions=" ".join(f"{value:.6g}" for value in request.joint_positions),
        speed_percent=f"{request.speed_percent:g}" if request.HasField("speed_percent") else "",
        stop_id=request.stop_id,
        program_name=request.program_name,
        program_sha256=sha256(request.program.encode()).hexdigest() if request.program else "",
    )


def stop_entry(
    result: Reason, answer: StopAnswer, *, time_ns: int, by: str, source: str, reason: str
) -> Entry:
    """Create the entry of a stop request."""
    return entry_of(
        "STOP",
        time_ns=time_ns,
        operator=by,
        source=source,
        outcome=Outcome.ACCEPTED if answer.sent else Outcome.FAILED,
        text=result.text,
        why=result,
        stop_id=answer.stop_id,
        reason=reason,
    )


def repeated_stop_entry(result: Reason, stop_id: int, *, time_ns: int, sent: bool) -> Entry:
    """Create the entry of a latched stop that the gateway sent again.

    Its request name differs, because a restart must not read it as a new stop.
    """
    return entry_of(
        "STOP_AGAIN",
        time_ns=time_ns,
        operator=GATEWAY,
        source=GATEWAY,
        outcome=Outcome.ACCEPTED if sent else Outcome.FAILED,
        text=result.text,
        why=result,
        stop_id=stop_id,
    )


def lease_end_entry(request: str, ended: LeaseEnd, *, time_ns: int) -> Entry:
    """Create the entry of a lease that the gateway ended."""
    return entry_of(
        request,
        time_ns=time_ns,
        operator=GATEWAY,
        source=GATEWAY,
        outcome=Outcome.ACCEPTED,
        text=ended.why.text,
        why=ended.why,
        holder=ended.holder,
        renewals=ended.renewals,
    )


def program_end_entry(outcome: Reason, done: bool, *, time_ns: int, operator: str) -> Entry:
    """Create the entry of a program's end."""
    return entry_of(
        "PROGRAM_END",
        time_ns=time_ns,
        operator=operator,
        source=PROGRAM,
        outcome=Outcome.ACCEPTED if done else Outcome.FAILED,
        text=outcome.text,
        why=outcome,
    )
