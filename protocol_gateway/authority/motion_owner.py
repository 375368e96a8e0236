"""What becomes of the holder's motion, and which motion is not the holder's. No I/O; time is an argument.

    motion of the holder   seen to move   still 0.5 s   at its target   refused   30 s without motion
    --------------------   ------------   -----------   -------------   -------   -------------------
    commanded, not seen    seen           -             over after 2 s  over      over
    seen                   seen           over          -               -         -

A motion command begins it, a stop or the lease's end forgets it; motion seen without one is foreign.

A motion that was seen has demonstrably ended when two consecutive controller units report idle, with
positions at its target. The end of a lease then needs no stop; the half second above still decides
whether new motion is the holder's.
"""

from dataclasses import replace

from protocol_gateway.authority.lease_rules import ENDED_AFTER_UNITS, MOTION_COMMANDS, Authority, Motion, Now
from robomesh.schemas.robomesh_pb2 import CommandRequest

# Servos and brakes take their time: this long even a robot that is at its target already may begin to move.
START_S = 2.0
# A controller may do much else first: until then motion is that which was commanded, and not foreign.
LATEST_START_S = 30.0
# A refusal that comes later is no answer to a unit, one that comes sooner may be.
ANSWERED_WITHIN_S = 2.0
# A controller that goes from one motion to the next is idle for a moment in between.
SETTLE_S = 0.5
# Of motions told before the first of them was over.
MOST_WAYPOINTS = 64
# Places nearer to each other [rad] or [m] are not told apart: well above what counts as arrived.
_APART = 0.01

_C = CommandRequest.Command


def command_sent(
    authority: Authority,
    request: CommandRequest,
    now: Now,
    *,
    waypoints: tuple[tuple[float, ...], ...] = (),
    arrived: bool = False,
    isolated: bool = True,
) -> Authority:
    """The command's unit is on the controller's socket.

    Args:
        waypoints: Where a motion command goes [rad] or [m]; empty: not known.
        arrived: The robot is where the motion before it went.
        isolated: No other unit was sent within `ANSWERED_WITHIN_S` before it.
    """
    lease = authority.lease
    if request.command == _C.RESET and authority.stop is not None and authority.stop.id == request.stop_id:
        authority = replace(authority, stop=None, stopping_s=None)
    if lease is None:
        return authority
    motion = lease.motion
    if request.command in MOTION_COMMANDS:
        conclusive = _is_conclusive(authority, request, waypoints)
        if motion is not None and request.command == _C.RESUME:
            waypoints = motion.waypoints
        elif motion is not None and not arrived:
            # A controller may do one after the other: what was told before it is still its way.
            waypoints = _appended(motion.waypoints, waypoints)
        # From its first motion on, whatever else moves the robot is a surprise.
        lease = replace(lease, commanded=True, tolerates_motion=False)
        motion = Motion(last_s=now.monotonic_s, waypoints=waypoints, isolated=isolated, conclusive=conclusive)
    elif motion is not None:
        held = motion.held or request.command == _C.HOLD
        motion = replace(motion, held=held, isolated=False, rests=0 if held else motion.rests)
    return replace(authority, lease=replace(lease, motion=motion))


def _is_conclusive(
    authority: Authority, request: CommandRequest, waypoints: tuple[tuple[float, ...], ...]
) -> bool:
    """Whether the robot cannot rest at a new motion's target before the motion has brought it there."""
    motion = None if authority.lease is None else authority.lease.motion
    if motion is None:
        return authority.moving is False
    if request.command == _C.RESUME:
        return motion.conclusive
    # It may rest at any place of the motions that were commanded before.
    return bool(motion.waypoints and waypoints) and all(
        any(abs(there - here) > _APART for there, here in zip(place, waypoints[-1], strict=True))
        for place in motion.waypoints
    )


def _appended(
    before: tuple[tuple[float, ...], ...], waypoints: tuple[tuple[float, ...], ...]
) -> tuple[tuple[float, ...], ...]:
    """One way behind another; not known if it gets too long to be followed."""
    both = (*before, *(place for place in waypoints if place not in before[-1:]))
    return both if len(both) <= MOST_WAYPOINTS else ()


def refused(authority: Authority) -> Authority:
    """The controller refused a unit: where that can only be a motion that has not begun, it will not."""
    lease = authority.lease
    if lease is None or lease.motion is None or authority.moving:
        return authority
    if lease.motion.seen or not lease.motion.isolated:
        return authority
    return replace(authority, lease=replace(lease, motion=None))


def reported(authority: Authority, *, resting: bool, dated_s: float) -> Authority:
    """Follow one status unit of the controller.

    Args:
        resting: The unit reports idle, and the newest positions are at the target of the holder's motion.
        dated_s: When the unit and the positions were new (monotonic); the older of both.
    """
    lease = authority.lease
    if lease is None or lease.motion is None:
        return authority
    motion = lease.motion
    proves = resting and motion.conclusive and motion.seen and not motion.held and dated_s > motion.last_s
    rests = min(motion.rests + 1, ENDED_AFTER_UNITS) if proves else 0
    if rests == motion.rests:
        return authority
    return replace(authority, lease=replace(lease, motion=replace(motion, rests=rests)))


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
    began = moving and authority.moving is not True and not _just_stopped(authority, now)
    authority = replace(authority, moving=moving)
    lease = authority.lease
    if lease is not None and lease.motion is not None:
        if not moving:
            motion = _at_rest(lease.motion, pending=pending, arrived=arrived, now=now)
        else:
            motion = replace(lease.motion, last_s=now.monotonic_s, seen=True, rests=0)
        return replace(authority, lease=replace(lease, motion=motion)), False
    foreign_s = authority.foreign_s
    goes_on = foreign_s is not None and now.monotonic_s - foreign_s < SETTLE_S
    # A robot that is still slowing down from a stop is neither.
    if moving and (began or goes_on):
        authority = replace(authority, foreign_s=now.monotonic_s)
    return authority, began


def _just_stopped(authority: Authority, now: Now) -> bool:
    """Whether motion that shows now may be one that a stop has ended; if it goes on, `stops` says so."""
    return authority.stopping_s is not None and now.monotonic_s - authority.stopping_s < START_S


def _at_rest(motion: Motion, *, pending: bool, arrived: bool, now: Now) -> Motion | None:
    """What becomes of the holder's motion while the robot does not move; None: it is over."""
    if motion.held and pending:
        return motion
    patience_s = SETTLE_S if motion.seen else START_S if arrived else LATEST_START_S
    return motion if now.monotonic_s - motion.last_s < patience_s else None
