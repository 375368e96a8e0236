"""Admission of commands: from the holder, in time and new, and not forbidden by a stop. No I/O.

    id > the last one           evaluated; the id is used even if the command fails
    id = the last one           same content: the first answer again, nothing is executed
                                other content: refused; the first answer is kept
    id < the last one, or 0     refused
    not_after has passed        refused: it was delayed on the way
    not_after is too far ahead  refused, except HOLD: it is not in the gateway's time, so no delay would show
    waited here for over 1 s    refused: its sender may have timed out
    a stop is latched           motion refused; RESET only with that stop's id, and while the robot rests

`preconditions` evaluates the controller's state and the joint limits.
"""

import hmac
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from protocol_gateway.authority.lease_rules import (
    MOTION_COMMANDS,
    Answer,
    Authority,
    Content,
    Now,
    holds,
    not_sent,
    why_not_holder,
)
from protocol_gateway.authority.stop_rules import may_move
from robomesh import reason_codes as codes
from robomesh.contract.enum_names import enum_name
from robomesh.reasons import Reason
from robomesh.schemas.robomesh_pb2 import CommandRequest

_C = CommandRequest.Command
_RESET = _C.RESET

# Longest time from now to a command's `not_after` [s], above what any client of robomesh waits for an answer.
# HOLD has no limit, because it only ends motion.
_LONGEST_DEADLINE_S = 5.0
_LONGEST_DEADLINES_S = {_C.RUN_PROGRAM: 65.0, _C.HOLD: math.inf}
# Well below the client's default timeout of 2 s.
LONGEST_WAIT_S = 1.0


class Admission(NamedTuple):
    """Result of the admission; `repeat`: the command was answered before, and is not executed again."""

    answer: Answer
    repeat: bool = False
    id_used: bool = False  # the id is used by the holder, so the answer is kept for a repeat


def admit(authority: Authority, request: CommandRequest, *, operator: str, now: Now) -> Admission:
    """Evaluate whether a command is the holder's, in time and new, and no stop forbids it."""
    if not holds(authority, operator, request.lease) or authority.lease is None:
        return Admission(not_sent(why_not_holder(authority, operator)))
    lease = authority.lease
    if request.id == lease.last_id and lease.last_answer is not None and lease.last_content is not None:
        if content_of(request) == lease.last_content:
            return Admission(lease.last_answer, repeat=True)
        used = codes.COMMAND_ID_USED(id=request.id, what=lease.last_content.description())
        return Admission(not_sent(used))
    if request.id <= lease.last_id:
        return Admission(not_sent(codes.COMMAND_ID_OLD(id=request.id, last=lease.last_id)))
    refusal = deadline_refusal(request, now) or stop_refusal(authority, request, now)
    return Admission(refusal or Answer(True, ""), id_used=True)


def admit_all(
    authority: Authority, requests: Sequence[CommandRequest], *, operator: str, now: Now
) -> Admission:
    """Evaluate commands of one unit, each after the previous ones; return the first refusal or repeat."""
    for request in requests:
        admission = admit(authority, request, operator=operator, now=now)
        if admission.repeat or not admission.answer.accepted:
            break
        authority = after_command(authority, request)
    return admission


def content_of(request: CommandRequest) -> Content:
    """Return a request's content: requests of one id with equal content are the same command."""
    jog = request.jog
    return Content(
        command=request.command,
        joint_positions=tuple(request.joint_positions),
        speed_percent=request.speed_percent if request.HasField("speed_percent") else None,
        stop_id=request.stop_id,
        program=request.program,
        program_name=request.program_name,
        jog=(jog.frame, jog.axis, jog.joint, jog.speed) if request.HasField("jog") else None,
        recover=(request.recover.recovery, request.recover.reason, request.recover.looked),
    )


def deadline_refusal(request: CommandRequest, now: Now) -> Answer | None:
    """Return the refusal of a command after its deadline, or long before it; None: it is in time."""
    if not request.HasField("not_after"):
        return None
    left_s = time_left_s(request, now)
    longest_s = longest_deadline_s(request)
    if left_s < 0:
        return not_sent(codes.COMMAND_LATE(seconds=-left_s))
    if left_s > longest_s:
        name = enum_name(_C, request.command)
        return not_sent(codes.COMMAND_DEADLINE_FAR(seconds=left_s, command=name, most=longest_s))
    return None


def longest_deadline_s(request: CommandRequest) -> float:
    """Return the longest time from now to a command's `not_after` [s]."""
    return _LONGEST_DEADLINES_S.get(request.command, _LONGEST_DEADLINE_S)


def time_left_s(request: CommandRequest, now: Now) -> float:
    """Return the time until a command's `not_after`, negative after it [s]."""
    return (request.not_after.ToNanoseconds() - now.gateway_ns) * 1e-9


def wait_refusal(arrived_s: float, now: Now) -> Answer | None:
    """Return the refusal of a command that has waited too long in the gateway; None: it has not.

    Args:
        arrived_s: Time of its arrival (monotonic).
    """
    waited_s = now.monotonic_s - arrived_s
    if waited_s <= LONGEST_WAIT_S:
        return None
    return not_sent(codes.COMMAND_WAITED(waited=waited_s, seconds=LONGEST_WAIT_S))


def stop_refusal(authority: Authority, request: CommandRequest, now: Now) -> Answer | None:
    """Return the refusal of a command because of a latched stop, or of a RESET without one; None: allowed."""
    reason = _stopped(authority, request, now)
    return None if reason is None else not_sent(reason)


def _stopped(authority: Authority, request: CommandRequest, now: Now) -> Reason | None:
    stop = authority.stop
    if request.command == _RESET:
        if stop is None:
            return codes.STOP_NOT_LATCHED(id=request.stop_id) if request.stop_id else None
        if stop.id != request.stop_id:
            return codes.STOP_OTHER(asked=request.stop_id, id=stop.id, by=stop.by, reason=stop.reason)
        return codes.STOP_MOVING(id=stop.id) if may_move(authority, now) else None
    if stop is not None and request.command in MOTION_COMMANDS:
        return codes.STOP_LATCHED(id=stop.id, by=stop.by, reason=stop.reason)
    return None


def keep_answer(authority: Authority, request: CommandRequest, answer: Answer) -> Authority:
    """Keep a command's answer for its repeat, and mark the id as used."""
    lease = authority.lease
    if lease is None or not hmac.compare_digest(lease.secret.encode(), request.lease.encode()):
        return authority
    if request.id < lease.last_id:
        return authority  # a HOLD overtook this command
    return replace(
        authority,
        lease=replace(lease, last_id=request.id, last_content=content_of(request), last_answer=answer),
    )


def after_command(authority: Authority, request: CommandRequest) -> Authority:
    """Return the authority after a command, for the next command of the same unit."""
    if request.command == _RESET and authority.stop is not None and authority.stop.id == request.stop_id:
        authority = replace(authority, stop=None)
    return keep_answer(authority, request, Answer(True, ""))
