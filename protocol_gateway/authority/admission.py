"""Whether a command may be done: it is its holder's, in time and new, and no stop forbids it. No I/O.

    id > the last one           judged, and used up whatever becomes of it
    id = the last one           the same content: the first answer again, nothing is done
                                other content: refused; the answer of the first is kept
    id < the last one, or 0     refused
    not_after has passed        refused: it was delayed on the way
    waited here for over 1 s    refused: its sender may have been told that nobody answered
    a stop is latched           motion refused; RESET only with that stop's id, and while the robot stands

What the controller's state and the joints' limits forbid is for `obstacles` to say.
"""

import hmac
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
from robomesh import reason_codes as codes
from robomesh.reasons import Reason
from robomesh.schemas.robomesh_pb2 import CommandRequest

_RESET = CommandRequest.Command.RESET

# Well below the time after which who asks is told that nobody answered (2 s unless he says otherwise).
LONGEST_WAIT_S = 1.0


class Verdict(NamedTuple):
    """Whether a command may go on; `repeat`: it was answered before, and is not done again."""

    answer: Answer
    repeat: bool = False
    id_used: bool = False  # its id is the holder's, so the answer is kept for a repeat


def admit(authority: Authority, request: CommandRequest, *, operator: str, now: Now) -> Verdict:
    """Whether a command comes from the holder, in time and for the first time, and no stop forbids it.

    What the controller's state and the joints' limits forbid is for `obstacles` to say.
    """
    if not holds(authority, operator, request.lease) or authority.lease is None:
        return Verdict(not_sent(why_not_holder(authority, operator)))
    lease = authority.lease
    if request.id == lease.last_id and lease.last_answer is not None and lease.last_content is not None:
        if content_of(request) == lease.last_content:
            return Verdict(lease.last_answer, repeat=True)
        used = codes.COMMAND_ID_USED(id=request.id, what=lease.last_content.in_words())
        return Verdict(not_sent(used))
    if request.id <= lease.last_id:
        return Verdict(not_sent(codes.COMMAND_ID_OLD(id=request.id, last=lease.last_id)))
    refusal = deadline_refusal(request, now) or stop_refusal(authority, request)
    return Verdict(refusal or Answer(True, ""), id_used=True)


def content_of(request: CommandRequest) -> Content:
    """Return what a request asks for: two requests of one id are the same command if these are equal."""
    return Content(
        command=request.command,
        joint_positions=tuple(request.joint_positions),
        speed_percent=request.speed_percent if request.HasField("speed_percent") else None,
        stop_id=request.stop_id,
        program=request.program,
        program_name=request.program_name,
    )


def deadline_refusal(request: CommandRequest, now: Now) -> Answer | None:
    """Why a command comes too late; None: it does not."""
    if not request.HasField("not_after"):
        return None
    late_s = (now.wall_ns - request.not_after.ToNanoseconds()) * 1e-9
    if late_s <= 0:
        return None
    return not_sent(codes.COMMAND_LATE(seconds=late_s))


def wait_refusal(arrived_s: float, now: Now) -> Answer | None:
    """Why a command has waited for too long in the gateway; None: it has not.

    Args:
        arrived_s: When it arrived (monotonic).
    """
    waited_s = now.monotonic_s - arrived_s
    if waited_s <= LONGEST_WAIT_S:
        return None
    return not_sent(codes.COMMAND_WAITED(waited=waited_s, seconds=LONGEST_WAIT_S))


def stop_refusal(authority: Authority, request: CommandRequest) -> Answer | None:
    """Why a latched stop, or that there is none, forbids a command; None: it does not."""
    reason = _stopped(authority, request)
    return None if reason is None else not_sent(reason)


def _stopped(authority: Authority, request: CommandRequest) -> Reason | None:
    stop = authority.stop
    if request.command == _RESET:
        if stop is None:
            return codes.STOP_NOT_LATCHED(id=request.stop_id) if request.stop_id else None
        if stop.id != request.stop_id:
            return codes.STOP_OTHER(asked=request.stop_id, id=stop.id, by=stop.by, reason=stop.reason)
        return codes.STOP_MOVING(id=stop.id) if authority.moving else None
    if stop is not None and request.command in MOTION_COMMANDS:
        return codes.STOP_LATCHED(id=stop.id, by=stop.by, reason=stop.reason)
    return None


def keep_answer(authority: Authority, request: CommandRequest, answer: Answer) -> Authority:
    """Keep a command's answer for its repeat; the id is used up from now on."""
    lease = authority.lease
    if lease is None or not hmac.compare_digest(lease.secret.encode(), request.lease.encode()):
        return authority
    if request.id < lease.last_id:
        return authority  # a HOLD overtook it
    return replace(
        authority,
        lease=replace(lease, last_id=request.id, last_content=content_of(request), last_answer=answer),
    )


def after_command(authority: Authority, request: CommandRequest) -> Authority:
    """The authority that a command leaves to the one behind it in the same unit: its id is used up."""
    if request.command == _RESET and authority.stop is not None and authority.stop.id == request.stop_id:
        authority = replace(authority, stop=None)
    return keep_answer(authority, request, Answer(True, ""))
