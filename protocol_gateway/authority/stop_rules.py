"""Rules of a latched stop: its number, and when its unit was sent. No I/O; time is an argument."""

from dataclasses import replace

from protocol_gateway.authority.lease_rules import Authority, LatchedStop, Now
from robomesh.reasons import Reason

# A burst of dozens of units would fill the send buffer, which closes the connection.
IN_TRANSIT_S = 0.1


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
    lease = authority.lease
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
