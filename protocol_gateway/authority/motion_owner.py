"""Tracking of the holder's motion, and detection of uncommanded motion. No I/O; time is an argument.

    motion of the holder   robot moves   rests 0.5 s   at its target   refused   30 s without motion
    --------------------   -----------   -----------   -------------   -------   -------------------
    commanded, not seen    seen          -             over after 2 s  over      over
    seen                   seen          over          -               -         -

A motion command begins the motion; a stop or the lease's end drops it. Other motion is uncommanded.

A seen motion has demonstrably ended when two consecutive controller units report idle, with positions at
its target. The end of a lease then needs no stop. The half second above still decides whether new motion
is the holder's.
"""

from dataclasses import replace

from protocol_gateway.authority.lease_rules import ENDED_AFTER_UNITS, MOTION_COMMANDS, Authority, Motion, Now
from robomesh.schemas.robomesh_pb2 import CommandRequest

# Servos and brakes need time: even a robot that is already at its target may begin to move for this long.
START_S = 2.0
# A controller may start late: until then, motion counts as the commanded one, not as uncommanded.
LATEST_START_S = 30.0
# A refusal within this time may answer a unit; a later one does not.
ANSWERED_WITHIN_S = 2.0
# A controller is idle for a moment between two motions.
SETTLE_S = 0.5
# Most waypoints of motions that are queued in the controller.
MOST_WAYPOINTS = 64
# Positions nearer than this [rad] or [m] count as the same: well above the tolerance of `has_arrived`.
_APART = 0.01

_C = CommandRequest.Command


def record_command(
    authority: Authority,
    request: CommandRequest,
    now: Now,
    *,
    waypoints: tuple[tuple[float, ...], ...] = (),
    arrived: bool = False,
    isolated: bool = True,
    replaces: bool = False,
) -> Authority:
    """Record a command after its unit was put on the controller's socket.

    Args:
        waypoints: Path of a motion command [rad] or [m]; empty: unknown.
        arrived: The robot is at the target of the previous motion.
        isolated: No other unit was sent within `ANSWERED_WITHIN_S` before.
        replaces: The controller does not queue the motion: only the last target is still on its path.
    """
    lease = authority.lease
    if request.command == _C.RESET and authority.stop is not None and authority.stop.id == request.stop_id:
        authority = replace(authority, stop=None, stopping_s=None, unseen=False)
    if request.command == _C.RESET:
        authority = replace(authority, reset_s=now.monotonic_s)
    if request.command == _C.SPEED:
        authority = replace(authority, speed_percent=request.speed_percent)
    if lease is None:
        return authority
    motion = lease.motion
    if request.command in MOTION_COMMANDS:
        conclusive = _is_conclusive(authority, request, waypoints)
        if motion is not None and request.command == _C.RESUME:
            waypoints = motion.waypoints
        elif motion is not None and not arrived:
            # A controller may queue motions: earlier targets are still on its path.
            before = motion.waypoints[-1:] if replaces else motion.waypoints
            waypoints = _appended(before, waypoints)
        # After the first commanded motion, uncommanded motion is no longer tolerated.
        lease = replace(lease, commanded=True, tolerates_motion=False)
        motion = Motion(last_s=now.monotonic_s, waypoints=waypoints, isolated=isolated, conclusive=conclusive)
    elif motion is not None:
        held = motion.held or request.command == _C.HOLD
        motion = replace(motion, held=held, isolated=False, rests=0 if held else motion.rests)
    return replace(authority, lease=replace(lease, motion=motion))


def _is_conclusive(
    authority: Authority, request: CommandRequest, waypoints: tuple[tuple[float, ...], ...]
) -> bool:
    """Return whether rest at the new motion's target proves that the motion has ended."""
    motion = authority.motion
    if motion is None:
        return authority.moving is False
    if request.command == _C.RESUME:
        return motion.conclusive
    # The robot may rest at any waypoint of the previous motions.
    return bool(motion.waypoints and waypoints) and all(
        any(abs(there - here) > _APART for there, here in zip(place, waypoints[-1], strict=True))
        for place in motion.waypoints
    )


def _appended(
    before: tuple[tuple[float, ...], ...], waypoints: tuple[tuple[float, ...], ...]
) -> tuple[tuple[float, ...], ...]:
    """Append waypoints to those of the previous motion; empty (unknown) if there are too many."""
    both = (*before, *(place for place in waypoints if place not in before[-1:]))
    return both if len(both) <= MOST_WAYPOINTS else ()


def drop_held(authority: Authority) -> Authority:
    """Drop a motion that was on hold at rest, after its RESET."""
    lease = authority.lease
    return authority if lease is None else replace(authority, lease=replace(lease, motion=None))


def drop_refused(authority: Authority) -> Authority:
    """Drop a motion that has not begun, if the controller's refusal can only be for it."""
    lease = authority.lease
    if lease is None or lease.motion is None or authority.moving:
        return authority
    if lease.motion.seen or not lease.motion.isolated:
        return authority
    return replace(authority, lease=replace(lease, motion=None))


def follow_status(authority: Authority, *, resting: bool, dated_s: float) -> Authority:
    """Follow one status unit of the controller.

    Args:
        resting: The unit reports idle, and the newest positions are at the target of the holder's motion.
        dated_s: The older time stamp of the unit and the positions (monotonic).
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


def follow_motion(
    authority: Authority, *, moving: bool, pending: bool, arrived: bool, now: Now
) -> tuple[Authority, bool]:
    """Follow the robot's motion.

    Args:
        moving: The robot moves now.
        arrived: The robot is at the target of its holder's motion.
        pending: A held motion may still wait for RESUME: the controller reports it, or reports nothing.

    Returns:
        The state, and whether motion without a command began.
    """
    began = moving and authority.moving is not True and not _just_stopped(authority, now)
    if authority.moving is not moving:
        authority = replace(authority, moving=moving)
    lease = authority.lease
    if lease is not None and lease.motion is not None:
        if not moving:
            motion = _at_rest(lease.motion, pending=pending, arrived=arrived, now=now)
        else:
            motion = replace(lease.motion, last_s=now.monotonic_s, seen=True, rests=0)
        return replace(authority, lease=replace(lease, motion=motion)), False
    uncommanded_s = authority.uncommanded_s
    goes_on = uncommanded_s is not None and now.monotonic_s - uncommanded_s < SETTLE_S
    # Motion of a robot that is still slowing down after a stop is not uncommanded.
    if moving and (began or goes_on):
        authority = replace(authority, uncommanded_s=now.monotonic_s)
    return authority, began


def _just_stopped(authority: Authority, now: Now) -> bool:
    """Return whether motion may be the rest of a stopped one; if it goes on, `RobotAuthority` reports it."""
    return authority.stopping_s is not None and now.monotonic_s - authority.stopping_s < START_S


def _at_rest(motion: Motion, *, pending: bool, arrived: bool, now: Now) -> Motion | None:
    """Return the holder's motion while the robot does not move; None: it is over."""
    if motion.held and pending:
        return motion
    patience_s = SETTLE_S if motion.seen else START_S if arrived else LATEST_START_S
    return motion if now.monotonic_s - motion.last_s < patience_s else None
