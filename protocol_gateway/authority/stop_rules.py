"""Rules of a latched stop: its number, and when its unit was sent. No I/O; time is an argument."""

from dataclasses import replace

from protocol_gateway.authority.lease_rules import Authority, LatchedStop, Now, note_unseen
from robomesh.reasons import Reason

# A burst of dozens of units would fill the send buffer, which closes the connection.
IN_TRANSIT_S = 0.1
# A stopped motion that was not seen yet is seen by then, or has not begun.
_UNSEEN_S = 0.3


def latch_stop(
    authority: Authority, *, by: str, reason: str | Reason, now: Now, number: int | None = None
) -> tuple[Authority, LatchedStop]:
    """Latch a stop under a new number, and drop the motion that it ends.

    Args:
        number: Number above all previous ones; None: the next one.
    """
    number = authority.last_stop_id + 1 if number is None else number
    latched = LatchedStop(
        id=number,
        by=by,
        reason=str(reason) or "no reason given",
        since_ns=now.wall_ns,
        why=reason if isinstance(reason, Reason) else None,
    )
    authority, lease = note_unseen(authority), authority.lease
    if lease is not None:
        lease = replace(lease, motion=None)
    return replace(authority, stop=latched, last_stop_id=number, lease=lease), latched


def mark_sent(authority: Authority, stop_id: int, sent_s: float, *, first: bool = False) -> Authority:
    """Record the monotonic time at which a stop's unit was put on the controller's socket.

    Args:
        first: First unit on a new connection: the controller may not have received earlier ones.
    """
    if authority.stop is None or authority.stop.id != stop_id:
        return authority
    return replace(
        authority,
        stop=replace(authority.stop, sent_s=sent_s),
        stopping_s=sent_s if first or authority.stopping_s is None else authority.stopping_s,
    )


def in_transit_since(authority: Authority, now: Now) -> float | None:
    """Return the time at which the latched stop's unit was sent (monotonic), if just now."""
    sent_s = None if authority.stop is None else authority.stop.sent_s
    return None if sent_s is None or now.monotonic_s - sent_s >= IN_TRANSIT_S else sent_s


def may_move(authority: Authority, now: Now) -> bool:
    """Return whether the robot moves, or may still move after its stop."""
    stopping_s = authority.stopping_s
    unseen = authority.unseen and stopping_s is not None and now.monotonic_s - stopping_s < _UNSEEN_S
    return bool(authority.moving) or unseen
