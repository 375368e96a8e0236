"""What becomes of the holder's motion, and which motion is not the holder's. No I/O; time is an argument.

    motion of the holder   seen to move   still 0.5 s   at its target   refused   30 s without motion
    --------------------   ------------   -----------   -------------   -------   -------------------
    commanded, not seen    seen           -             over after 2 s  over      over
    seen                   seen           over          -               -         -

A motion command begins it, a stop or the lease's end forgets it; motion seen without one is foreign.
"""

from dataclasses import replace

from bus.schemas.robomesh_pb2 import CommandRequest
from protocol_gateway.authority.rules import MOTION_COMMANDS, Authority, Motion, Now

# Servos and brakes take their time: this long even a robot that is at its target already may begin to move.
START_S = 2.0
# A controller may do much else first: until then motion is that which was commanded, and not foreign.
LATEST_START_S = 30.0
# A refusal that comes later is no answer to a unit, one that comes sooner may be.
ANSWERED_WITHIN_S = 2.0
# A controller that goes from one motion to the next is idle for a moment in between.
SETTLE_S = 0.5
# Of motions told before the first of them was over.
LONGEST_WAY = 64

_C = CommandRequest.Command


def command_sent(
    authority: Authority,
    request: CommandRequest,
    now: Now,
    *,
    way: tuple[tuple[float, ...], ...] = (),
    arrived: bool = False,
    alone: bool = True,
) -> Authority:
    """The command's unit is on the controller's socket.

    Args:
        way: Where a motion command goes [rad] or [m]; empty: not known.
        arrived: The robot is where the motion before it went.
        alone: No other unit was sent within `ANSWERED_WITHIN_S` before it.
    """
    lease = authority.lease
    if request.command == _C.RESET and authority.stop is not None and authority.stop.id == request.stop_id:
        authority = replace(authority, stop=None, stopping_s=None)
    if lease is None:
        return authority
    motion = lease.motion
    if request.command in MOTION_COMMANDS:
        if motion is not None and request.command == _C.RESUME:
            way = motion.way
        elif motion is not None and not arrived:
            # A controller may do one after the other: what was told before it is still its way.
            way = _behind(motion.way, way)
        # From its first motion on, whatever else moves the robot is a surprise.
        lease = replace(lease, commanded=True, tolerates_motion=False)
        motion = Motion(last_s=now.monotonic_s, way=way, alone=alone)
    elif motion is not None:
        motion = replace(motion, held=motion.held or request.command == _C.HOLD, alone=False)
    return replace(authority, lease=replace(lease, motion=motion))


def _behind(
    before: tuple[tuple[float, ...], ...], way: tuple[tuple[float, ...], ...]
) -> tuple[tuple[float, ...], ...]:
    """One way behind another; not known if it gets too long to be followed."""
    both = (*before, *(place for place in way if place not in before[-1:]))
    return both if len(both) <= LONGEST_WAY else ()


def refused(authority: Authority) -> Authority:
    """The controller refused a unit: where that can only be a motion that has not begun, it will not."""
    lease = authority.lease
    if lease is None or lease.motion is None or authority.moving:
        return authority
    if lease.motion.seen or not lease.motion.alone:
        return authority
    return replace(authority, lease=replace(lease, motion=None))


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
            motion = replace(lease.motion, last_s=now.monotonic_s, seen=True)
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
