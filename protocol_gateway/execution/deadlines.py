"""Deadlines of commands: after its sender's timeout, a command is not executed.

not_after                  given in the request, in the gateway's time (`clocks.py`)
the query's `within`       the sender's timeout, from the arrival of the query
both                       the earlier one; a `not_after` that `admission` refuses stays
neither, RUN_PROGRAM       DEFAULT_TIMEOUT_S, because Zenoh does not transmit a query's timeout
neither, another command   `admission.LONGEST_WAIT_S` in the gateway, as for every command

What arrived while the gateway itself did not run (suspended, or its machine overloaded) counts from then.
"""

from math import inf

from protocol_gateway.authority.admission import LONGEST_WAIT_S, deadline_refusal, longest_deadline_s
from protocol_gateway.authority.lease_rules import Now
from robomesh.requests.server import Request
from robomesh.schemas.robomesh_pb2 import CommandRequest

# Default timeout of a robomesh client.
DEFAULT_TIMEOUT_S = 2.0
# The system delivers what it kept for a suspended gateway within this time.
_DELIVERED_S = 1.0


class CommandArrivals:
    """Times of arrival of commands (monotonic)."""

    def __init__(self) -> None:
        self._ran_s = inf
        self._held_up_s = self._delivered_s = -inf

    def note_running(self, now_s: float) -> None:
        """Note that the gateway runs; call it repeatedly."""
        if now_s - self._ran_s > LONGEST_WAIT_S:
            self._held_up_s, self._delivered_s = self._ran_s, now_s + _DELIVERED_S
        self._ran_s = now_s

    def arrived_s(self, now_s: float) -> float:
        """Return the earliest time at which a command that is received now may have arrived."""
        if self._ran_s < inf:
            self.note_running(now_s)
        return self._held_up_s if now_s < self._delivered_s else now_s


def set_deadline(message: CommandRequest, request: Request, now: Now) -> None:
    """Set the command's `not_after` to its sender's deadline."""
    within_s = request.within_s
    if (
        within_s is None
        and message.command == CommandRequest.RUN_PROGRAM
        and not message.HasField("not_after")
    ):
        within_s = DEFAULT_TIMEOUT_S
    if within_s is None or deadline_refusal(message, now) is not None:
        return
    left_s = within_s - (now.monotonic_s - request.received_s)
    until_ns = now.gateway_ns + round(min(left_s, longest_deadline_s(message), 1e6) * 1e9)
    if not message.HasField("not_after") or until_ns < message.not_after.ToNanoseconds():
        message.not_after.FromNanoseconds(until_ns)
