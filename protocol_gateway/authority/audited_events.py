"""Audit entries of the events that a robot's authority handles. Pure functions."""

import contextlib
import math
from collections.abc import Mapping
from hashlib import sha256

from protocol_gateway.authority.audit_entry import GATEWAY, JOG, PROGRAM, Entry, Outcome, entry_of
from protocol_gateway.authority.events import (
    CommandsRequested,
    JogEnded,
    LeaseRequested,
    ProgramEnded,
    StopRequested,
    StopResult,
)
from protocol_gateway.authority.lease_rules import Answer, LeaseEnd, Now
from protocol_gateway.seam.text_limits import LONGEST_TEXT
from robomesh.contract.enum_names import enum_name
from robomesh.reasons import Reason
from robomesh.schemas.robomesh_pb2 import CommandRequest, Jog, LeaseRequest, PageReport, Recover
from robomesh.texts import one_line


def lease_entry(event: LeaseRequested, outcome: Outcome, answer: Answer, now: Now) -> Entry:
    """Create the entry of a lease request."""
    request = event.request
    return entry_of(
        enum_name(LeaseRequest.Action, request.action),
        time_ns=now.wall_ns,
        operator=event.operator,
        source=event.source,
        outcome=outcome,
        text=answer.text,
        why=answer.reason,
        ttl_s=request.ttl_s,
        to=request.to,
        reason=request.reason,
        cause=enum_name(LeaseRequest.Cause, request.cause) if request.cause else "",
    )


def command_entries(event: CommandsRequested, outcome: Outcome, answer: Answer) -> tuple[Entry, ...]:
    """Create the entries of commands, one each."""
    return tuple(
        entry_of(
            enum_name(CommandRequest.Command, request.command),
            time_ns=event.arrived.wall_ns,
            operator=event.operator,
            source=event.source,
            outcome=outcome,
            text=answer.text,
            why=answer.reason,
            id=str(request.id),
            joint_positions=" ".join(f"{value:.6g}" for value in request.joint_positions),
            speed_percent=f"{request.speed_percent:g}" if request.HasField("speed_percent") else "",
            stop_id=request.stop_id,
            program_name=request.program_name,
            program_sha256=sha256(request.program.encode()).hexdigest() if request.program else "",
            **_jog_values(request),
            **_recover_values(request),
            **page_values(request.page),
        )
        for request in event.requests
    )


def _jog_values(request: CommandRequest) -> Mapping[str, str]:
    if not request.HasField("jog"):
        return {}
    jog = request.jog
    return {
        "jog_frame": enum_name(Jog.Frame, jog.frame),
        "jog_axis": f"joint {jog.joint}" if jog.frame == Jog.JOINT else enum_name(Jog.Axis, jog.axis),
        "jog_speed": f"{jog.speed:.6g}",
    }


def _recover_values(request: CommandRequest) -> Mapping[str, str]:
    if request.command != CommandRequest.RECOVER:
        return {}
    return {
        "recovery": recovery_name(request),
        "reason": request.recover.reason,
        "looked": "yes" if request.recover.looked else "no",
    }


def recovery_name(request: CommandRequest) -> str:
    """Return the name of a recovery, as the site file has it."""
    return enum_name(Recover.Recovery, request.recover.recovery).lower()


def page_values(report: PageReport) -> Mapping[str, str]:
    """Return what a page reports that it showed, as values of an entry; nothing verifies them."""
    values = {"page_view": one_line(report.view, LONGEST_TEXT)}
    if report.HasField("picture"):
        values["page_picture"] = str(report.picture)
    if report.HasField("picture_time"):
        with contextlib.suppress(ValueError):  # out of the range of dates
            values["page_picture_time"] = report.picture_time.ToJsonString()
    ages = {
        "page_picture_age_s": report.picture_age_s if report.HasField("picture_age_s") else math.nan,
        "page_state_age_s": report.state_age_s if report.HasField("state_age_s") else math.nan,
    }
    return values | {name: f"{age:.3f}" for name, age in ages.items() if math.isfinite(age)}


def stop_entry(event: StopRequested, result: StopResult, now: Now) -> Entry:
    """Create the entry of a stop request."""
    return entry_of(
        "STOP",
        time_ns=now.wall_ns,
        operator=event.by,
        source=event.source,
        outcome=Outcome.ACCEPTED if result.sent else Outcome.FAILED,
        text=result.reason.text,
        why=result.reason,
        stop_id=result.id,
        reason=event.reason,
        **event.page,
    )


def _gateway_entry(request: str, outcome: Outcome, why: Reason, now: Now, **values: object) -> Entry:
    return entry_of(
        request,
        time_ns=now.wall_ns,
        operator=GATEWAY,
        source=GATEWAY,
        outcome=outcome,
        text=why.text,
        why=why,
        **values,
    )


def repeated_stop_entry(result: StopResult, now: Now) -> Entry:
    """Create the entry of a latched stop that the gateway sent again.

    Its request name differs, because a restart must not read it as a new stop.
    """
    outcome = Outcome.ACCEPTED if result.sent else Outcome.FAILED
    return _gateway_entry("STOP_AGAIN", outcome, result.reason, now, stop_id=result.id)


def lease_end_entry(request: str, ended: LeaseEnd, now: Now) -> Entry:
    """Create the entry of a lease that the gateway ended."""
    return _gateway_entry(
        request, Outcome.ACCEPTED, ended.why, now, holder=ended.holder, renewals=ended.renewals
    )


def jog_end_entry(event: JogEnded, now: Now) -> Entry:
    """Create the entry of a jog's end."""
    return entry_of(
        "JOG_END",
        time_ns=now.wall_ns,
        operator=event.operator,
        source=JOG,
        outcome=Outcome.FAILED if event.failed else Outcome.ACCEPTED,
        text=event.outcome.text,
        why=event.outcome,
        **{"moved_rad" if event.rotary else "moved_m": f"{event.moved:.6g}"},
        duration_s=f"{event.duration_s:.3f}",
        keep_alives=event.keep_alives,
    )


def program_end_entry(event: ProgramEnded, now: Now) -> Entry:
    """Create the entry of a program's end."""
    return entry_of(
        "PROGRAM_END",
        time_ns=now.wall_ns,
        operator=event.operator,
        source=PROGRAM,
        outcome=Outcome.ACCEPTED if event.problem is None else Outcome.FAILED,
        text=event.outcome.text,
        why=event.outcome,
    )
