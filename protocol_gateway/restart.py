"""What a gateway must remember across its own restart: the stop that was latched. It is in the audit log."""

from collections.abc import Iterable
from dataclasses import replace

from protocol_gateway.audit import Entry, Outcome
from protocol_gateway.authority import Authority, Stop


def remembered(entries: Iterable[Entry]) -> Authority:
    """The authority that a log leaves behind: nobody in control, the last stop latched if none reset it.

    Args:
        entries: The robot's log, oldest first.
    """
    authority, cleared = Authority(), None
    for entry in entries:
        told = entry.values.get("stop_id", "")
        number = int(told) if told.isdecimal() else 0
        if entry.request == "STOP" and number:
            latched = Stop(
                id=number, by=entry.operator, reason=entry.values.get("reason", ""), since_ns=entry.time_ns
            )
            authority = replace(authority, stop=latched, last_stop_id=max(number, authority.last_stop_id))
        elif entry.request == "RESET" and entry.outcome is Outcome.ACCEPTED:
            cleared = authority.stop if authority.stop and authority.stop.id == number else None
            authority = replace(authority, stop=None if cleared else authority.stop)
        elif entry.request == "RESET" and entry.outcome is Outcome.FAILED:
            # It was written down before it was sent, and then it was not sent.
            authority, cleared = replace(authority, stop=authority.stop or cleared), None
    return authority
