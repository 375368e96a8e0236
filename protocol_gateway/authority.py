"""Who may move a robot: lease, once-only commands, latched stop. No I/O; time is an argument.

Two states that do not know each other, the lease's and the stop's:

    lease    ACQUIRE  RENEW   RELEASE, expiry, another's TAKE  motion command  motion over  foreign motion
    -------  -------  ------  -------------------------------  --------------  -----------  --------------
    free     held     no      no                               no              -            free
    held     no*      held    free                             moving          -            free
    moving   no*      moving  free, and the robot is stopped   moving          held         -

    stop      STOP      RESET of this stop   RESET of another   motion command
    --------  --------  -------------------  -----------------  --------------
    clear     latched   no                   no                 yes
    latched   latched   clear                no                 no

"no" is a refusal in words, * but the holder's own ACQUIRE renews. OFFER and ACCEPT pass a lease that
does not move on to another operator; TAKE gives a reason. Every stop has a number of its own, so a
RESET never clears a stop that its sender has not seen. "moving" covers motion that is held (HOLD):
it would go on with anybody's RESUME. Foreign motion stops the robot too, where motion had been
commanded under the lease: it may be that motion, begun far too late.

    motion of the holder   seen to move   still 0.5 s   at its target   refused   30 s without motion
    --------------------   ------------   -----------   -------------   -------   -------------------
    commanded, not seen    seen           -             over after 2 s  over      over
    seen                   seen           over          -               -         -
"""

import hmac
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from bus.schemas.robomesh_pb2 import CommandRequest, LeaseRequest

DEFAULT_TTL_S = 2.0
SHORTEST_TTL_S = 0.5
LONGEST_TTL_S = 5.0

# Servos and brakes take their time: this long even a robot that is at its target already may begin to move.
START_S = 2.0
# A controller may do much else first: until then motion is that which was commanded, and not foreign.
LATEST_START_S = 30.0
# A controller that goes from one motion to the next is idle for a moment in between.
SETTLE_S = 0.5
# A robot that was moved by others this short a while ago may go on: no surprise to the next operator.
RECENT_S = 10.0

_C = CommandRequest.Command
MOTION_COMMANDS = frozenset({_C.HOME, _C.RESUME, _C.MOVE_ABSOLUTE, _C.MOVE_RELATIVE, _C.RUN_PROGRAM})


class Now(NamedTuple):
    """The two clocks: what has passed is measured on the first, dates are told on the second."""

    monotonic_s: float
    wall_ns: int


@dataclass(frozen=True, kw_only=True)
class Motion:
    """The holder's motion, from the command that began it.

    Attributes:
        last_s: When it was last commanded, or seen to move (monotonic).
        seen: It was seen to move.
        held: HOLD was sent; it goes on with RESUME.
        target: Where it goes [rad] or [m]; None: not known.
        newest: Nothing was commanded since, so a refusal of the controller's is an answer to it.
    """

    last_s: float
    seen: bool = False
    held: bool = False
    target: tuple[float, ...] | None = None
    newest: bool = True


class Answer(NamedTuple):
    """What became of a request, for its sender."""

    accepted: bool
    text: str


@dataclass(frozen=True, kw_only=True)
class Lease:
    """Control of a robot by one operator, for a time.

    Attributes:
        until_s: End, monotonic; `until_ns` is the same moment on the wall clock.
        last_id: Highest command id so far, and `last_answer` what it got.
        commanded: Motion was commanded under it.
        tolerates_motion: The robot moved by itself when the lease began, so that is no surprise.
    """

    holder: str
    secret: str = field(repr=False)
    since_ns: int
    ttl_s: float
    until_s: float
    until_ns: int
    last_id: int = 0
    last_answer: Answer | None = None
    offered_to: str = ""
    renewals: int = 0
    motion: Motion | None = None
    commanded: bool = False
    tolerates_motion: bool = False


@dataclass(frozen=True, kw_only=True)
class Stop:
    """A latched stop; `sent_s`: when its unit reached the controller's socket (monotonic)."""

    id: int
    by: str
    reason: str
    since_ns: int
    sent_s: float | None = None


@dataclass(frozen=True, kw_only=True)
class LeaseEnd:
    """A lease that is over. `stop`: its holder's motion runs, or may, so the robot must be stopped."""

    holder: str
    why: str
    renewals: int
    stop: bool


@dataclass(frozen=True, kw_only=True)
class Authority:
    """The whole state. `moving`: what was last seen, None before anything was."""

    lease: Lease | None = None
    stop: Stop | None = None
    last_stop_id: int = 0
    moving: bool | None = None
    # When motion was last seen that nobody commanded (monotonic).
    foreign_s: float | None = None


class LeaseOutcome(NamedTuple):
    """A lease request's outcome; `granted`: the lease to show to the asker, with its secret."""

    authority: Authority
    answer: Answer
    granted: Lease | None = None
    ended: LeaseEnd | None = None


def request_lease(
    authority: Authority, request: LeaseRequest, *, operator: str, now: Now, secret: str
) -> LeaseOutcome:
    """Answer ACQUIRE, RENEW, RELEASE, OFFER, ACCEPT, TAKE.

    Args:
        operator: Who asks, as the router vouches for it.
        secret: Fresh; becomes the lease's if one is granted.
    """
    lease = authority.lease
    action = LeaseRequest.Action
    mine = lease is not None and holds(authority, operator, request.lease)
    match request.action:
        case action.ACQUIRE if lease is None:
            return _grant(authority, request, operator=operator, now=now, secret=secret, text="control taken")
        case action.ACQUIRE | action.RENEW if mine and lease is not None:
            renewed = replace(_timed(lease, request.ttl_s, now), renewals=lease.renewals + 1)
            return LeaseOutcome(replace(authority, lease=renewed), Answer(True, "control renewed"), renewed)
        case action.RELEASE if mine and lease is not None:
            free, ended = end_lease(authority, f"{operator} gave control back")
            return LeaseOutcome(free, Answer(True, "control given back"), ended=ended)
        case action.OFFER if mine and lease is not None:
            offered = replace(lease, offered_to="" if request.to == operator else request.to)
            text = f"control offered to {offered.offered_to}" if offered.offered_to else "offer withdrawn"
            return LeaseOutcome(replace(authority, lease=offered), Answer(True, text), offered)
        case action.ACCEPT if lease is not None and lease.offered_to == operator:
            if lease.motion is not None:
                return _refused(
                    authority, f"{lease.holder}'s motion still runs: wait until it ends, then accept"
                )
            free, ended = end_lease(authority, f"handed over to {operator}")
            text = f"control taken over from {lease.holder}"
            granted = _grant(free, request, operator=operator, now=now, secret=secret, text=text)
            return granted._replace(ended=ended)
        case action.TAKE if lease is None or mine or request.reason.strip():
            free, ended = end_lease(authority, f"taken by {operator}: {request.reason.strip()}")
            granted = _grant(free, request, operator=operator, now=now, secret=secret, text="control taken")
            return granted._replace(ended=ended)
        case action.ACCEPT:
            return _refused(authority, f"control was not offered to {operator}: ask its holder, or ACQUIRE")
        case action.TAKE:
            return _refused(authority, "TAKE needs a reason: say in `reason` why control is taken away")
    return _refused(authority, why_not_holder(authority, operator))


def holds(authority: Authority, operator: str, secret: str) -> bool:
    """Whether the operator holds the lease, and this is its secret."""
    lease = authority.lease
    # Compared in constant time: how long a refusal takes must not spell the secret.
    return (
        lease is not None
        and hmac.compare_digest(lease.secret.encode(), secret.encode())
        and lease.holder == operator
    )


def expire(authority: Authority, now: Now) -> tuple[Authority, LeaseEnd | None]:
    """End the lease when its time is over."""
    lease = authority.lease
    if lease is None or now.monotonic_s < lease.until_s:
        return authority, None
    return end_lease(authority, f"{lease.holder}'s lease was not renewed within {lease.ttl_s:g} s")


def end_lease(authority: Authority, why: str, *, foreign: bool = False) -> tuple[Authority, LeaseEnd | None]:
    """End the lease, if there is one; says whether its holder's motion has to be stopped.

    Args:
        foreign: Because of motion that nobody is known to have commanded.
    """
    lease = authority.lease
    if lease is None:
        return authority, None
    stop = lease.motion is not None or (foreign and lease.commanded)
    ended = LeaseEnd(holder=lease.holder, why=why, renewals=lease.renewals, stop=stop)
    return replace(authority, lease=None), ended


def _grant(
    authority: Authority, request: LeaseRequest, *, operator: str, now: Now, secret: str, text: str
) -> LeaseOutcome:
    lease = Lease(
        holder=operator,
        secret=secret,
        since_ns=now.wall_ns,
        ttl_s=0.0,
        until_s=0.0,
        until_ns=0,
        tolerates_motion=moved_recently(authority, now),
    )
    lease = _timed(lease, request.ttl_s, now)
    return LeaseOutcome(replace(authority, lease=lease), Answer(True, text), lease)


def _timed(lease: Lease, ttl_s: float, now: Now) -> Lease:
    kept = min(max(ttl_s or DEFAULT_TTL_S, SHORTEST_TTL_S), LONGEST_TTL_S)
    return replace(
        lease,
        ttl_s=kept,
        until_s=now.monotonic_s + kept,
        until_ns=now.wall_ns + round(kept * 1e9),
    )


def _refused(authority: Authority, text: str) -> LeaseOutcome:
    return LeaseOutcome(authority, Answer(False, text))


def why_not_holder(authority: Authority, operator: str) -> str:
    """Why a request in an operator's name is not its lease's holder's, and what to do."""
    lease = authority.lease
    if lease is None:
        return "nobody is in control, or the lease has ended: take control first (ACQUIRE)"
    if lease.holder != operator:
        return f"{lease.holder} is in control: wait until it is given back, or ask for it"
    return f"{operator} is in control with another lease (another window or program?): this one is not valid"


def command_sent(
    authority: Authority, request: CommandRequest, now: Now, *, target: tuple[float, ...] | None = None
) -> Authority:
    """The command's unit is on the controller's socket.

    Args:
        target: Where a motion command goes [rad] or [m]; None: not known.
    """
    lease = authority.lease
    if request.command == _C.RESET and authority.stop is not None and authority.stop.id == request.stop_id:
        authority = replace(authority, stop=None)
    if lease is None:
        return authority
    motion = lease.motion
    if request.command in MOTION_COMMANDS:
        if request.command == _C.RESUME and motion is not None:
            target = motion.target
        # From its first motion on, whatever else moves the robot is a surprise.
        lease = replace(lease, commanded=True, tolerates_motion=False)
        motion = Motion(last_s=now.monotonic_s, target=target)
    elif motion is not None:
        motion = replace(motion, held=motion.held or request.command == _C.HOLD, newest=False)
    return replace(authority, lease=replace(lease, motion=motion))


def refused(authority: Authority) -> Authority:
    """The controller refused a unit: a motion that was just commanded, and has not begun, will not."""
    lease = authority.lease
    if lease is None or lease.motion is None or authority.moving:
        return authority
    if lease.motion.seen or not lease.motion.newest:
        return authority
    return replace(authority, lease=replace(lease, motion=None))


def stop(authority: Authority, *, by: str, reason: str, now: Now) -> tuple[Authority, Stop]:
    """Latch a stop under a number of its own, and forget the motion that it ends."""
    number = authority.last_stop_id + 1
    latched = Stop(id=number, by=by, reason=reason or "no reason given", since_ns=now.wall_ns)
    lease = authority.lease
    if lease is not None:
        lease = replace(lease, motion=None)
    return replace(authority, stop=latched, last_stop_id=number, lease=lease), latched


def stop_sent(authority: Authority, stop_id: int, now: Now) -> Authority:
    """The stop's unit is on the controller's socket."""
    if authority.stop is None or authority.stop.id != stop_id:
        return authority
    return replace(authority, stop=replace(authority.stop, sent_s=now.monotonic_s))


def observe(
    authority: Authority, *, moving: bool, pending: bool, arrived: bool, now: Now
) -> tuple[Authority, bool]:
    """Follow the robot's motion.

    Args:
        moving: Whether it moves now.
        arrived: It is where its holder's motion goes.
        pending: A held motion may still be waiting for RESUME: the controller says so, or does not say.

    Returns:
        The state, and whether motion began that nobody commanded.
    """
    began = moving and authority.moving is not True
    authority = replace(authority, moving=moving)
    lease = authority.lease
    if lease is not None and lease.motion is not None:
        if not moving:
            motion = _at_rest(lease.motion, pending=pending, arrived=arrived, now=now)
        else:
            motion = replace(lease.motion, last_s=now.monotonic_s, seen=True)
        return replace(authority, lease=replace(lease, motion=motion)), False
    foreign_s = authority.foreign_s
    goes_on = foreign_s is not None and now.monotonic_s - foreign_s < SETTLE_S
    # A robot that is still slowing down from a stop is neither.
    if moving and (began or goes_on):
        authority = replace(authority, foreign_s=now.monotonic_s)
    return authority, began


def moved_recently(authority: Authority, now: Now) -> bool:
    """Whether the robot was just moved by somebody who did not command it through the gateway."""
    return authority.foreign_s is not None and now.monotonic_s - authority.foreign_s < RECENT_S


def _at_rest(motion: Motion, *, pending: bool, arrived: bool, now: Now) -> Motion | None:
    """What becomes of the holder's motion while the robot does not move; None: it is over."""
    if motion.held and pending:
        return motion
    patience_s = SETTLE_S if motion.seen else START_S if arrived else LATEST_START_S
    return motion if now.monotonic_s - motion.last_s < patience_s else None
