"""State machine of control over a robot: lease and latched stop. No I/O; time is an argument.

Lease and stop are independent states:

    lease    ACQUIRE  RENEW   an end of it                    motion command  motion over  link lost
    -------  -------  ------  ------------------------------  --------------  -----------  -----------------
    free     held     no      -                               no              -            -
    held     no*      held    free                            moving          -            held
    moving   no*      moving  free, and the robot is stopped  moving          held         held, and stopped

    end of a lease: RELEASE, expiry, another operator's TAKE, ACCEPT after an OFFER (not while moving), end of
    the holder's session, motion without a command

    stop                   STOP      RESET of this stop   RESET of another   motion command
    ---------------------  --------  -------------------  -----------------  --------------
    clear                  latched   no                   no                 yes
    latched, robot moves   latched   no                   no                 no
    latched, robot rests   latched   clear                no                 no

"no" is a refusal with a reason; * the holder's own ACQUIRE renews. OFFER and ACCEPT hand a lease over while
its motion does not run. TAKE needs a reason, which is published. ASK changes nothing, but its operator is
published for half a minute. Every stop has its own number, so that a RESET never clears a stop that its
sender has not seen. RESET is refused while the robot moves, because the motion would have no owner
afterwards. "moving" includes held motion (HOLD), which any RESUME would continue. A link that is lost or
silent while the holder's motion runs causes a stop, because the arm's position is unknown then. Motion
without a command also stops the robot if motion was commanded under the lease: it may be that motion, started
far too late.
"""

import hmac
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

from robomesh import reason_codes as codes
from robomesh.contract.enum_names import enum_name
from robomesh.reasons import Reason
from robomesh.schemas.robomesh_pb2 import CommandRequest, LeaseRequest
from robomesh.texts import one_line

DEFAULT_TTL_S = 2.0
SHORTEST_TTL_S = 0.5
LONGEST_TTL_S = 5.0

# A lease tolerates uncommanded motion if the robot already moved without a command this recently.
RECENT_S = 10.0
# A request for control is shown for this long.
ASKED_FOR_S = 30.0
MOST_ASKERS = 20

# One unit is not enough: it may have been in transit when the motion was commanded, or show a pause.
ENDED_AFTER_UNITS = 2

_C = CommandRequest.Command
MOTION_COMMANDS = frozenset({_C.HOME, _C.RESUME, _C.MOVE_ABSOLUTE, _C.MOVE_RELATIVE, _C.RUN_PROGRAM, _C.JOG})


class Now(NamedTuple):
    """The gateway's clocks at one moment (`clocks.py`).

    Attributes:
        monotonic_s: For durations; any origin.
        wall_ns: For times that people read, ns since the Unix epoch. A person or NTP may set it.
        gateway_ns: For deadlines that others send, about ns since the Unix epoch. It never steps.
    """

    monotonic_s: float
    wall_ns: int
    gateway_ns: int


@dataclass(frozen=True, kw_only=True)
class Motion:
    """The holder's motion, from the command that began it.

    Attributes:
        last_s: Time of its command, or of the last observed movement (monotonic).
        seen: The robot was observed to move.
        held: HOLD was sent; RESUME continues the motion.
        waypoints: Positions on its path in order, the target last [rad] or [m]; empty: unknown.
        isolated: No other unit was sent shortly before it, or since: a refusal is an answer to it.
        conclusive: Rest at the target proves the end, because the robot cannot rest there before.
        rests: Consecutive controller units that reported rest at the target after the robot moved.
    """

    last_s: float
    seen: bool = False
    held: bool = False
    waypoints: tuple[tuple[float, ...], ...] = ()
    isolated: bool = True
    conclusive: bool = False
    rests: int = 0

    @property
    def target(self) -> tuple[float, ...] | None:
        """End of the path [rad] or [m]; None: unknown."""
        return self.waypoints[-1] if self.waypoints else None

    @property
    def ended(self) -> bool:
        """True if the motion has demonstrably ended, so that the end of the lease needs no stop."""
        return self.rests >= ENDED_AFTER_UNITS


class Answer(NamedTuple):
    """Outcome of a request, for its sender.

    Attributes:
        reason: Reason of a refusal, or what was done.
    """

    accepted: bool
    text: str
    reason: Reason | None = None


def done(reason: Reason) -> Answer:
    """Return the answer to a request that is accepted."""
    return Answer(True, reason.text, reason)


def refused(reason: Reason, *, what: str = "") -> Answer:
    """Return the answer to a request that is refused.

    Args:
        what: Text before the reason: "Not sent".
    """
    return Answer(False, f"{what}: {reason}." if what else reason.text, reason)


def not_sent(reason: Reason) -> Answer:
    """Return the answer to a command that is not sent."""
    return refused(reason, what="Not sent")


class Content(NamedTuple):
    """A command with its values: equal contents are the same command, whenever they are sent.

    Attributes:
        joint_positions: [rad] or [m].
        jog: Frame, axis, joint and speed [m/s] or [rad/s]; None: no jog.
        recover: Recovery, reason, and whether a person at the robot has looked.
    """

    command: CommandRequest.Command
    joint_positions: tuple[float, ...] = ()
    speed_percent: float | None = None
    stop_id: int = 0
    program: str = ""
    program_name: str = ""
    jog: tuple[int, int, int, float] | None = None
    recover: tuple[int, str, bool] = (0, "", False)

    def description(self) -> str:
        """Return a readable line."""
        words = [
            enum_name(CommandRequest.Command, self.command),
            *(f"{each:.6g}" for each in self.joint_positions),
        ]
        if self.speed_percent is not None:
            words.append(f"{self.speed_percent:g} %")
        if self.stop_id:
            words.append(f"of stop {self.stop_id}")
        return one_line(" ".join([*words, self.program_name]).strip())


@dataclass(frozen=True, kw_only=True)
class Lease:
    """Control of a robot by one operator, for a limited time.

    Attributes:
        until_s: Expiry, monotonic; `until_ns` is the same time on the wall clock.
        session: Session of the holder's program or page; the lease ends with it. Empty: not given.
        last_id: Highest command id so far, with its content in `last_content` and answer in `last_answer`.
        commanded: Motion was commanded under the lease.
        tolerates_motion: The robot moved without a command when the lease began, so that does not end it.
    """

    holder: str
    secret: str = field(repr=False)
    since_ns: int
    ttl_s: float
    until_s: float
    until_ns: int
    session: str = ""
    last_id: int = 0
    last_content: Content | None = field(default=None, repr=False)
    last_answer: Answer | None = None
    offered_to: str = ""
    renewals: int = 0
    motion: Motion | None = None
    commanded: bool = False
    tolerates_motion: bool = False


@dataclass(frozen=True, kw_only=True)
class LatchedStop:
    """A latched stop.

    Attributes:
        sent_s: Time at which its unit reached the controller's socket (monotonic).
        why: The reason with its code, if the gateway stopped the robot; not kept over a restart.
    """

    id: int
    by: str
    reason: str
    since_ns: int
    sent_s: float | None = None
    why: Reason | None = None

    def kept(self) -> dict[str, Any]:
        """Return the values that a restart keeps: not the time of sending, whose clock a reboot resets."""
        return {"id": self.id, "by": self.by, "reason": self.reason, "since_ns": self.since_ns}


@dataclass(frozen=True, kw_only=True)
class LeaseEnd:
    """End of a lease. `stop`: the robot must be stopped, because the holder's motion may run."""

    holder: str
    why: Reason
    renewals: int
    stop: bool


@dataclass(frozen=True, kw_only=True)
class Asker:
    """Operator who requests control from the holder."""

    operator: str
    reason: str
    since_ns: int
    until_s: float


@dataclass(frozen=True, kw_only=True)
class Authority:
    """State of control over one robot.

    Attributes:
        moving: The robot moved at the last observation; None: not observed yet.
        ended: Reason for the end of the previous lease; None: there was none.
        asked_by: Operators who request control from the holder, oldest first.
        speed_percent: Speed last set by the gateway since the link came up, or `first_speed_percent` of the
            driver; None: unknown.
        reset_s: Time of the last RESET that no status has followed (monotonic).
        stopping_s: Time at which the first stop since the last RESET was sent (monotonic). A repeated stop
            does not change it, because it must not hide that the robot ignores its stop.
        unseen: A motion was stopped since the last RESET before the robot was seen to begin it.
    """

    lease: Lease | None = None
    ended: Reason | None = None
    asked_by: tuple[Asker, ...] = ()
    stop: LatchedStop | None = None
    last_stop_id: int = 0
    stopping_s: float | None = None
    unseen: bool = False
    speed_percent: float | None = None
    reset_s: float | None = None
    moving: bool | None = None
    # Time at which motion without a command was last observed (monotonic).
    uncommanded_s: float | None = None

    @property
    def motion(self) -> Motion | None:
        """The holder's motion; None: it has none, or there is no holder."""
        return None if self.lease is None else self.lease.motion


class LeaseOutcome(NamedTuple):
    """Outcome of a lease request; `granted`: the lease for the sender, with its secret."""

    authority: Authority
    answer: Answer
    granted: Lease | None = None
    ended: LeaseEnd | None = None


_RELEASED_FOR = {
    LeaseRequest.HIDDEN: codes.ENDED_HIDDEN,
    LeaseRequest.NO_RIGHT: codes.ENDED_NO_RIGHT,
    LeaseRequest.SIGNED_OUT: codes.ENDED_SIGNED_OUT,
}


def _release_reason(request: LeaseRequest, operator: str) -> Reason:
    """Return why a lease ends that its holder's client releases."""
    if request.cause in _RELEASED_FOR:
        return _RELEASED_FOR[request.cause](name=operator)
    reason = request.reason.strip()
    if reason:
        return codes.ENDED_RELEASED_WHY(name=operator, reason=reason)
    return codes.ENDED_RELEASED(name=operator)


def request_lease(
    authority: Authority, request: LeaseRequest, *, operator: str, now: Now, secret: str
) -> LeaseOutcome:
    """Evaluate ACQUIRE, RENEW, RELEASE, OFFER, ACCEPT, TAKE, ASK.

    Args:
        operator: Sender of the request, as authenticated by the router.
        secret: New secret for the lease, if one is granted.
    """
    lease = authority.lease
    action = LeaseRequest.Action
    mine = lease is not None and holds(authority, operator, request.lease)
    reason = request.reason.strip()
    match request.action:
        case action.ACQUIRE if lease is None:
            return _grant(
                authority, request, operator=operator, now=now, secret=secret, answer=codes.LEASE_TAKEN()
            )
        case action.ACQUIRE | action.RENEW if mine and lease is not None:
            renewed = replace(
                _with_expiry(lease, request.ttl_s, now),
                renewals=lease.renewals + 1,
                session=request.session or lease.session,
            )
            return LeaseOutcome(replace(authority, lease=renewed), done(codes.LEASE_RENEWED()), renewed)
        case action.RELEASE if mine and lease is not None:
            free, ended = end_lease(authority, _release_reason(request, operator))
            return LeaseOutcome(free, done(codes.LEASE_RELEASED()), ended=ended)
        case action.OFFER if mine and lease is not None:
            offered = replace(lease, offered_to="" if request.to == operator else request.to)
            answer = (
                codes.LEASE_OFFERED(name=offered.offered_to)
                if offered.offered_to
                else codes.LEASE_OFFER_WITHDRAWN()
            )
            return LeaseOutcome(replace(authority, lease=offered), done(answer), offered)
        case action.ACCEPT if lease is not None and lease.offered_to == operator:
            if _may_run(lease.motion):
                return LeaseOutcome(authority, refused(codes.LEASE_MOVING(holder=lease.holder)))
            free, ended = end_lease(authority, codes.ENDED_HANDED_OVER(name=operator))
            answer = codes.LEASE_TAKEN_FROM(name=lease.holder)
            granted = _grant(free, request, operator=operator, now=now, secret=secret, answer=answer)
            return granted._replace(ended=ended)
        case action.TAKE if lease is None or mine or reason:
            free, ended = end_lease(authority, codes.ENDED_TAKEN(name=operator, reason=reason))
            answer = codes.LEASE_TAKEN()
            granted = _grant(free, request, operator=operator, now=now, secret=secret, answer=answer)
            return granted._replace(ended=ended)
        case action.ASK if lease is not None and lease.holder != operator:
            return LeaseOutcome(
                _add_asker(authority, operator, reason, now),
                done(codes.LEASE_ASKED(holder=lease.holder, name=operator)),
            )
        case action.ASK:
            refusal = codes.LEASE_OWN(name=operator) if lease else codes.LEASE_FREE()
        case action.ACCEPT:
            refusal = codes.LEASE_NOT_OFFERED(name=operator)
        case action.TAKE:
            refusal = codes.LEASE_NO_REASON()
        case _:
            refusal = why_not_holder(authority, operator)
    return LeaseOutcome(authority, refused(refusal))


def holds(authority: Authority, operator: str, secret: str) -> bool:
    """Return whether the operator holds the lease with this secret."""
    lease = authority.lease
    # Compared in constant time, because the time of a refusal must not reveal the secret.
    return (
        lease is not None
        and hmac.compare_digest(lease.secret.encode(), secret.encode())
        and lease.holder == operator
    )


def expire(authority: Authority, now: Now) -> tuple[Authority, LeaseEnd | None]:
    """End the lease if it has expired, and drop expired requests for control."""
    if authority.asked_by and now.monotonic_s >= authority.asked_by[0].until_s:
        authority = replace(authority, asked_by=_current_askers(authority, now))
    lease = authority.lease
    if lease is None or now.monotonic_s < lease.until_s:
        return authority, None
    return end_lease(authority, codes.ENDED_EXPIRED(name=lease.holder, seconds=lease.ttl_s))


def end_session(authority: Authority, session: str) -> tuple[Authority, LeaseEnd | None]:
    """End the lease if its holder's session has ended."""
    lease = authority.lease
    if lease is None or not session or lease.session != session:
        return authority, None
    return end_lease(authority, codes.ENDED_SESSION(name=lease.holder))


def end_lease(
    authority: Authority, why: Reason, *, uncommanded: bool = False
) -> tuple[Authority, LeaseEnd | None]:
    """End the lease, if there is one; return its end, which says whether to stop the robot.

    Args:
        uncommanded: The lease ends because of motion without a command.
    """
    lease = authority.lease
    if lease is None:
        return authority, None
    stop = _may_run(lease.motion) or (uncommanded and lease.commanded)
    ended = LeaseEnd(holder=lease.holder, why=why, renewals=lease.renewals, stop=stop)
    authority = note_unseen(authority) if stop else authority
    return replace(authority, lease=None, ended=why), ended


def note_unseen(authority: Authority) -> Authority:
    """Note, before a motion of the holder is stopped, whether the robot has not been seen to begin it."""
    motion = authority.motion
    seen = motion is None or motion.seen or authority.moving
    return authority if seen else replace(authority, unseen=True)


def _may_run(motion: Motion | None) -> bool:
    return motion is not None and not motion.ended


def _grant(
    authority: Authority, request: LeaseRequest, *, operator: str, now: Now, secret: str, answer: Reason
) -> LeaseOutcome:
    lease = Lease(
        holder=operator,
        secret=secret,
        since_ns=now.wall_ns,
        ttl_s=0.0,
        until_s=0.0,
        until_ns=0,
        session=request.session,
        tolerates_motion=moved_recently(authority, now),
    )
    lease = _with_expiry(lease, request.ttl_s, now)
    # The new holder no longer requests control; the others still do.
    asked_by = tuple(each for each in _current_askers(authority, now) if each.operator != operator)
    return LeaseOutcome(replace(authority, lease=lease, asked_by=asked_by), done(answer), lease)


def _add_asker(authority: Authority, operator: str, reason: str, now: Now) -> Authority:
    """Add an operator's request for control, or renew it."""
    others = [each for each in _current_askers(authority, now) if each.operator != operator]
    asker = Asker(
        operator=operator, reason=reason, since_ns=now.gateway_ns, until_s=now.monotonic_s + ASKED_FOR_S
    )
    return replace(authority, asked_by=(*others, asker)[-MOST_ASKERS:])


def _current_askers(authority: Authority, now: Now) -> tuple[Asker, ...]:
    return tuple(each for each in authority.asked_by if now.monotonic_s < each.until_s)


def _with_expiry(lease: Lease, ttl_s: float, now: Now) -> Lease:
    kept = min(max(ttl_s or DEFAULT_TTL_S, SHORTEST_TTL_S), LONGEST_TTL_S)
    return replace(
        lease,
        ttl_s=kept,
        until_s=now.monotonic_s + kept,
        until_ns=now.gateway_ns + round(kept * 1e9),
    )


def why_not_holder(authority: Authority, operator: str) -> Reason:
    """Return why a request does not come from the lease's holder."""
    lease = authority.lease
    if lease is None:
        return codes.LEASE_NONE()
    if lease.holder != operator:
        return codes.LEASE_HELD(holder=lease.holder)
    return codes.LEASE_OTHER(name=operator)


def moved_recently(authority: Authority, now: Now) -> bool:
    """Return whether the robot recently moved without a command of the gateway."""
    return authority.uncommanded_s is not None and now.monotonic_s - authority.uncommanded_s < RECENT_S
