"""Whether a command may be done: it is its holder's, in time and new, and no stop forbids it. No I/O.

    id > the last one           judged, and used up whatever becomes of it
    id = the last one           a repeat: the first answer again, nothing is done
    id < the last one, or 0     refused
    not_after has passed        refused: it was delayed on the way
    waited here for over 1 s    refused: its sender may have been told that nobody answered
    a stop is latched           motion refused; RESET only with that stop's id

What the controller's state and the joints' limits forbid is for `protocol_gateway.obstacles` to say.
"""

import hmac
from dataclasses import replace
from typing import NamedTuple

from bus.schemas.robomesh_pb2 import CommandRequest
from protocol_gateway.authority import MOTION_COMMANDS, Answer, Authority, Now, holds, why_not_holder

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

    What the controller's state and the joints' limits forbid is `protocol_gateway.obstacles`' to say.
    """
    if not holds(authority, operator, request.lease) or authority.lease is None:
        return Verdict(Answer(False, f"Not sent: {why_not_holder(authority, operator)}."))
    lease = authority.lease
    if request.id == lease.last_id and lease.last_answer is not None:
        return Verdict(lease.last_answer, repeat=True)
    if request.id <= lease.last_id:
        return Verdict(
            Answer(
                False,
                f"Not sent: id {request.id} is not higher than {lease.last_id}, the last one under this "
                "lease: count up with each command.",
            )
        )
    refusal = lateness(request, now) or stop_refusal(authority, request)
    if refusal:
        return Verdict(Answer(False, refusal), counted=True)
    return Verdict(Answer(True, ""), counted=True)


def lateness(request: CommandRequest, now: Now) -> str:
    """Why a command comes too late; empty: it does not."""
    if not request.HasField("not_after"):
        return ""
    late_s = (now.wall_ns - request.not_after.ToNanoseconds()) * 1e-9
    if late_s <= 0:
        return ""
    return (
        f"Not sent: it came {late_s:.2f} s after its not_after: delayed on the way, or dated by another "
        "clock than the gateway's (`now` in each lease answer)."
    )


def delay(arrived_s: float, now: Now) -> str:
    """Why a command has waited for too long in the gateway; empty: it has not.

    Args:
        arrived_s: When it arrived (monotonic).
    """
    waited_s = now.monotonic_s - arrived_s
    if waited_s <= LONGEST_WAIT_S:
        return ""
    return (
        f"Not sent: it waited {waited_s:.1f} s in the gateway (for the audit log, or others before it); "
        f"after {LONGEST_WAIT_S:g} s nobody may be waiting for it: send it again."
    )


def stop_refusal(authority: Authority, request: CommandRequest) -> str:
    """Why a latched stop forbids a command; empty: it does not."""
    stop = authority.stop
    if request.command == _RESET:
        if stop is None and request.stop_id:
            return f"Not sent: stop {request.stop_id} is not latched; nothing is."
        if stop is not None and stop.id != request.stop_id:
            return (
                f"Not sent: RESET names stop {request.stop_id}, but stop {stop.id} is latched "
                f"({stop.by}: {stop.reason}): see to it, then send RESET with stop_id {stop.id}."
            )
    elif stop is not None and request.command in MOTION_COMMANDS:
        return (
            f"Not sent: stop {stop.id} is latched ({stop.by}: {stop.reason}): "
            f"see to it, then send RESET with stop_id {stop.id}."
        )
    return ""


def remember(authority: Authority, request: CommandRequest, answer: Answer) -> Authority:
    """Keep a command's answer for its repeat; the id is used up from now on."""
    lease = authority.lease
    if lease is None or not hmac.compare_digest(lease.secret.encode(), request.lease.encode()):
        return authority
    return replace(authority, lease=replace(lease, last_id=request.id, last_answer=answer))
