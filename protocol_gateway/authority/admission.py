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

from bus.schemas.robomesh_pb2 import CommandRequest
from protocol_gateway.authority.rules import (
    MOTION_COMMANDS,
    Answer,
    Authority,
    Content,
    Now,
    Why,
    holds,
    why_not_holder,
)

_RESET = CommandRequest.Command.RESET

# Well below the time after which who asks is told that nobody answered (2 s unless he says otherwise).
LONGEST_WAIT_S = 1.0


class Verdict(NamedTuple):
    """Whether a command may go on; `repeat`: it was answered before, and is not done again."""

    answer: Answer
    repeat: bool = False
    counted: bool = False  # its id is the holder's, so the answer is kept for a repeat


def admit(authority: Authority, request: CommandRequest, *, operator: str, now: Now) -> Verdict:
    """Whether a command comes from the holder, in time and for the first time, and no stop forbids it.

    What the controller's state and the joints' limits forbid is for `obstacles` to say.
    """
    if not holds(authority, operator, request.lease) or authority.lease is None:
        return Verdict(Answer(False, f"Not sent: {why_not_holder(authority, operator)}.", Why.NOT_IN_CONTROL))
    lease = authority.lease
    if request.id == lease.last_id and lease.last_answer is not None and lease.last_content is not None:
        if content_of(request) == lease.last_content:
            return Verdict(lease.last_answer, repeat=True)
        used = lease.last_content.in_words()
        return Verdict(
            Answer(False, f"Not sent: id {request.id} was used for {used}: count up with each command.")
        )
    if request.id <= lease.last_id:
        return Verdict(
            Answer(
                False,
                f"Not sent: id {request.id} is not higher than {lease.last_id}, the last one under this "
                "lease: count up with each command.",
            )
        )
    refusal = lateness(request, now) or stop_refusal(authority, request)
    return Verdict(refusal or Answer(True, ""), counted=True)


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


def lateness(request: CommandRequest, now: Now) -> Answer | None:
    """Why a command comes too late; None: it does not."""
    if not request.HasField("not_after"):
        return None
    late_s = (now.wall_ns - request.not_after.ToNanoseconds()) * 1e-9
    if late_s <= 0:
        return None
    return Answer(
        False,
        f"Not sent: it came {late_s:.2f} s after its not_after: delayed on the way, or dated by another "
        "clock than the gateway's (`now` in each lease answer).",
    )


def delay(arrived_s: float, now: Now) -> Answer | None:
    """Why a command has waited for too long in the gateway; None: it has not.

    Args:
        arrived_s: When it arrived (monotonic).
    """
    waited_s = now.monotonic_s - arrived_s
    if waited_s <= LONGEST_WAIT_S:
        return None
    return Answer(
        False,
        f"Not sent: it waited {waited_s:.1f} s in the gateway (for the audit log, or others before it); "
        f"after {LONGEST_WAIT_S:g} s nobody may be waiting for it: send it again.",
    )


def stop_refusal(authority: Authority, request: CommandRequest) -> Answer | None:
    """Why a latched stop, or that there is none, forbids a command; None: it does not."""
    text = _stopped(authority, request)
    return Answer(False, f"Not sent: {text}.", Why.STOPPED) if text else None


def _stopped(authority: Authority, request: CommandRequest) -> str:
    stop = authority.stop
    if request.command == _RESET:
        if stop is None and request.stop_id:
            return f"stop {request.stop_id} is not latched; nothing is"
        if stop is not None and stop.id != request.stop_id:
            return (
                f"RESET names stop {request.stop_id}, but stop {stop.id} is latched "
                f"({stop.by}: {stop.reason}): see to it, then send RESET with stop_id {stop.id}"
            )
        if stop is not None and authority.moving:
            return f"the robot still moves after stop {stop.id}: wait until it stands, then RESET"
    elif stop is not None and request.command in MOTION_COMMANDS:
        return (
            f"stop {stop.id} is latched ({stop.by}: {stop.reason}): "
            f"see to it, then send RESET with stop_id {stop.id}"
        )
    return ""


def remember(authority: Authority, request: CommandRequest, answer: Answer) -> Authority:
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


def used_up(authority: Authority, request: CommandRequest) -> Authority:
    """The authority that a command leaves to the one behind it in the same unit: its id is used up."""
    if request.command == _RESET and authority.stop is not None and authority.stop.id == request.stop_id:
        authority = replace(authority, stop=None)
    return remember(authority, request, Answer(True, ""))
