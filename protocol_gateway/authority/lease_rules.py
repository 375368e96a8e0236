"""Who may move a robot: lease, once-only commands, latched stop. No I/O; time is an argument.

Two states that do not know each other, the lease's and the stop's:

    lease    ACQUIRE  RENEW   an end of it                    motion command  motion over  link lost
    -------  -------  ------  ------------------------------  --------------  -----------  -----------------
    free     held     no      -                               no              -            -
    held     no*      held    free                            moving          -            held
    moving   no*      moving  free, and the robot is stopped  moving          held         held, and stopped

    ends of a lease: its RELEASE, its time is over, another's TAKE, the offered one's ACCEPT (not while
    moving), its holder's session is gone, motion that nobody commanded

    stop                 STOP      RESET of this stop   RESET of another   motion command
    -------------------  --------  -------------------  -----------------  --------------
    clear                latched   no                   no                 yes
    latched, it moves    latched   no                   no                 no
    latched, it stands   latched   clear                no                 no

"no" is a refusal in words, * but the holder's own ACQUIRE renews. OFFER and ACCEPT pass a lease that
does not move on to another operator; TAKE gives a reason, which everybody is told; ASK changes
nothing, but everybody sees for half a minute who would like to have control. Every stop has a number
of its own, so a RESET never clears a stop that its sender has not seen; nor one that is not heeded
yet, for what moves on would be nobody's motion. "moving" covers motion that is held (HOLD): it would
go on with anybody's RESUME. A link that is lost, or silent, while the holder's motion runs is a stop:
nobody sees any more where the arm goes. Motion that nobody commanded stops the robot too, where motion
had been commanded under the lease: it may be that motion, begun far too late.
"""

import hmac
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from protocol_gateway.foreign_text import one_line
from robomesh import reason_codes as codes
from robomesh.reasons import Reason
from robomesh.schemas.robomesh_pb2 import CommandRequest, LeaseRequest

DEFAULT_TTL_S = 2.0
SHORTEST_TTL_S = 0.5
LONGEST_TTL_S = 5.0

# A robot that was moved by others this short a while ago may go on: no surprise to the next operator.
RECENT_S = 10.0
# Who asked for control is shown so long, and so many at most.
ASKED_FOR_S = 30.0
MOST_ASKERS = 20

# One unit may have been on its way when the motion was commanded, or be the pause between two motions.
ENDED_AFTER_UNITS = 2

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
        waypoints: Everywhere that it goes, in order, its target last [rad] or [m]; empty: not known.
        isolated: No other unit was sent shortly before it, or since: a refusal is an answer to it.
        conclusive: Rest at its target proves that it has ended: the robot does not rest there before.
        rests: Consecutive controller units that reported rest at its target, after it was seen to move.
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
        """Where it ends [rad] or [m]; None: not known."""
        return self.waypoints[-1] if self.waypoints else None

    @property
    def ended(self) -> bool:
        """Whether it has demonstrably ended: control that ends now needs no stop."""
        return self.rests >= ENDED_AFTER_UNITS


class Answer(NamedTuple):
    """The outcome of a request, for its sender.

    Attributes:
        reason: Why it is refused, or what was done.
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
        what: Stands before the reason: "Not sent".
    """
    return Answer(False, f"{what}: {reason}." if what else reason.text, reason)


def not_sent(reason: Reason) -> Answer:
    """Return the answer to a command that is not sent."""
    return refused(reason, what="Not sent")


class Content(NamedTuple):
    """A command and its values: what makes two requests the same command, whenever they are sent.

    Attributes:
        joint_positions: [rad] or [m].
    """

    command: CommandRequest.Command
    joint_positions: tuple[float, ...] = ()
    speed_percent: float | None = None
    stop_id: int = 0
    program: str = ""
    program_name: str = ""

    def in_words(self) -> str:
        """Return it for people, on one line."""
        words = [CommandRequest.Command.Name(self.command), *(f"{each:.6g}" for each in self.joint_positions)]
        if self.speed_percent is not None:
            words.append(f"{self.speed_percent:g} %")
        if self.stop_id:
            words.append(f"of stop {self.stop_id}")
        return one_line(" ".join([*words, self.program_name]).strip())


@dataclass(frozen=True, kw_only=True)
class Lease:
    """Control of a robot by one operator, for a time.

    Attributes:
        until_s: End, monotonic; `until_ns` is the same moment on the wall clock.
        session: Of its holder's program or page; when that is gone, so is the lease. Empty: not told.
        last_id: Highest command id so far; `last_content` is what it was used for, `last_answer` what it got.
        commanded: Motion was commanded under it.
        tolerates_motion: The robot moved by itself when the lease began, so that is no surprise.
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
    why: Reason
    renewals: int
    stop: bool


@dataclass(frozen=True, kw_only=True)
class Asker:
    """Somebody who would like to have control."""

    operator: str
    reason: str
    since_ns: int
    until_s: float


@dataclass(frozen=True, kw_only=True)
class Authority:
    """The whole state.

    Attributes:
        moving: What was last seen; None before anything was.
        ended: Why the last lease that is over ended; None: there was none.
        asked_by: Who asks its holder for control, oldest first.
        stopping_s: When the first of the stops since the last RESET was sent (monotonic): whoever presses
            again must not hide that the robot does not heed them.
    """

    lease: Lease | None = None
    ended: Reason | None = None
    asked_by: tuple[Asker, ...] = ()
    stop: Stop | None = None
    last_stop_id: int = 0
    stopping_s: float | None = None
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
    """Answer ACQUIRE, RENEW, RELEASE, OFFER, ACCEPT, TAKE, ASK.

    Args:
        operator: Who asks, as the router vouches for it.
        secret: Fresh; becomes the lease's if one is granted.
    """
    lease = authority.lease
    action = LeaseRequest.Action
    mine = lease is not None and holds(authority, operator, request.lease)
    reason = request.reason.strip()
    match request.action:
        case action.ACQUIRE if lease is None:
            return _grant(
                authority, request, operator=operator, now=now, secret=secret, said=codes.LEASE_TAKEN()
            )
        case action.ACQUIRE | action.RENEW if mine and lease is not None:
            renewed = replace(
                _with_expiry(lease, request.ttl_s, now),
                renewals=lease.renewals + 1,
                session=request.session or lease.session,
            )
            return LeaseOutcome(replace(authority, lease=renewed), done(codes.LEASE_RENEWED()), renewed)
        case action.RELEASE if mine and lease is not None:
            why = (
                codes.ENDED_RELEASED_WHY(name=operator, reason=reason)
                if reason
                else codes.ENDED_RELEASED(name=operator)
            )
            free, ended = end_lease(authority, why)
            return LeaseOutcome(free, done(codes.LEASE_RELEASED()), ended=ended)
        case action.OFFER if mine and lease is not None:
            offered = replace(lease, offered_to="" if request.to == operator else request.to)
            said = (
                codes.LEASE_OFFERED(name=offered.offered_to)
                if offered.offered_to
                else codes.LEASE_OFFER_WITHDRAWN()
            )
            return LeaseOutcome(replace(authority, lease=offered), done(said), offered)
        case action.ACCEPT if lease is not None and lease.offered_to == operator:
            if _may_run(lease.motion):
                return LeaseOutcome(authority, refused(codes.LEASE_MOVING(holder=lease.holder)))
            free, ended = end_lease(authority, codes.ENDED_HANDED_OVER(name=operator))
            said = codes.LEASE_TAKEN_FROM(name=lease.holder)
            granted = _grant(free, request, operator=operator, now=now, secret=secret, said=said)
            return granted._replace(ended=ended)
        case action.TAKE if lease is None or mine or reason:
            free, ended = end_lease(authority, codes.ENDED_TAKEN(name=operator, reason=reason))
            said = codes.LEASE_TAKEN()
            granted = _grant(free, request, operator=operator, now=now, secret=secret, said=said)
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
    """Whether the operator holds the lease, and this is its secret."""
    lease = authority.lease
    # Compared in constant time: how long a refusal takes must not spell the secret.
    return (
        lease is not None
        and hmac.compare_digest(lease.secret.encode(), secret.encode())
        and lease.holder == operator
    )


def expire(authority: Authority, now: Now) -> tuple[Authority, LeaseEnd | None]:
    """End the lease when its time is over, and forget who asked for it too long ago."""
    if authority.asked_by and now.monotonic_s >= authority.asked_by[0].until_s:
        authority = replace(authority, asked_by=_current_askers(authority, now))
    lease = authority.lease
    if lease is None or now.monotonic_s < lease.until_s:
        return authority, None
    return end_lease(authority, codes.ENDED_EXPIRED(name=lease.holder, seconds=lease.ttl_s))


def end_session(authority: Authority, session: str) -> tuple[Authority, LeaseEnd | None]:
    """A session is gone: end its lease, and nobody else's."""
    lease = authority.lease
    if lease is None or not session or lease.session != session:
        return authority, None
    return end_lease(authority, codes.ENDED_SESSION(name=lease.holder))


def end_lease(
    authority: Authority, why: Reason, *, foreign: bool = False
) -> tuple[Authority, LeaseEnd | None]:
    """End the lease, if there is one; says whether its holder's motion has to be stopped.

    Args:
        foreign: Because of motion that nobody is known to have commanded.
    """
    lease = authority.lease
    if lease is None:
        return authority, None
    stop = _may_run(lease.motion) or (foreign and lease.commanded)
    ended = LeaseEnd(holder=lease.holder, why=why, renewals=lease.renewals, stop=stop)
    return replace(authority, lease=None, ended=why), ended


def _may_run(motion: Motion | None) -> bool:
    return motion is not None and not motion.ended


def _grant(
    authority: Authority, request: LeaseRequest, *, operator: str, now: Now, secret: str, said: Reason
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
    # Who waited for it and got it waits no more; the others still do.
    asked_by = tuple(each for each in _current_askers(authority, now) if each.operator != operator)
    return LeaseOutcome(replace(authority, lease=lease, asked_by=asked_by), done(said), lease)


def _add_asker(authority: Authority, operator: str, reason: str, now: Now) -> Authority:
    """Somebody asks for control, for the first time or again."""
    others = [each for each in _current_askers(authority, now) if each.operator != operator]
    asker = Asker(
        operator=operator, reason=reason, since_ns=now.wall_ns, until_s=now.monotonic_s + ASKED_FOR_S
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
        until_ns=now.wall_ns + round(kept * 1e9),
    )


def why_not_holder(authority: Authority, operator: str) -> Reason:
    """Return why a request in an operator's name is not its lease's holder's."""
    lease = authority.lease
    if lease is None:
        return codes.LEASE_NONE()
    if lease.holder != operator:
        return codes.LEASE_HELD(holder=lease.holder)
    return codes.LEASE_OTHER(name=operator)


def stop(
    authority: Authority, *, by: str, reason: str, now: Now, number: int | None = None
) -> tuple[Authority, Stop]:
    """Latch a stop under a number of its own, and forget the motion that it ends.

    Args:
        number: Above all before it; None: the next one.
    """
    number = authority.last_stop_id + 1 if number is None else number
    latched = Stop(id=number, by=by, reason=reason or "no reason given", since_ns=now.wall_ns)
    lease = authority.lease
    if lease is not None:
        lease = replace(lease, motion=None)
    return replace(authority, stop=latched, last_stop_id=number, lease=lease), latched


def stop_sent(authority: Authority, stop_id: int, sent_s: float, *, first: bool = False) -> Authority:
    """The stop's unit is on the controller's socket, since a monotonic time.

    Args:
        first: It is the first one on a new connection: the controller may not have had those before.
    """
    if authority.stop is None or authority.stop.id != stop_id:
        return authority
    return replace(
        authority,
        stop=replace(authority.stop, sent_s=sent_s),
        stopping_s=sent_s if first or authority.stopping_s is None else authority.stopping_s,
    )


def moved_recently(authority: Authority, now: Now) -> bool:
    """Whether the robot was just moved by somebody who did not command it through the gateway."""
    return authority.foreign_s is not None and now.monotonic_s - authority.foreign_s < RECENT_S
