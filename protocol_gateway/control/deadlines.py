"""Deadlines of commands: after its sender's timeout, a command is not executed.

not_after                  given in the request, on the gateway's clock
the query's `within`       the sender's timeout, from the arrival of the query
both                       the earlier one
neither, RUN_PROGRAM       DEFAULT_TIMEOUT_S, because Zenoh does not transmit a query's timeout
neither, another command   `admission.LONGEST_WAIT_S` in the gateway, as for every command
"""

from robomesh.schemas.robomesh_pb2 import CommandRequest
from robomesh.server import Request

# Default timeout of a robomesh client.
DEFAULT_TIMEOUT_S = 2.0


def set_deadline(message: CommandRequest, request: Request) -> None:
    """Set the command's `not_after` to its sender's deadline."""
    within_s = request.within_s
    if (
        within_s is None
        and message.command == CommandRequest.RUN_PROGRAM
        and not message.HasField("not_after")
    ):
        within_s = DEFAULT_TIMEOUT_S
    if within_s is None:
        return
    until_ns = request.received_ns + round(min(within_s, 1e6) * 1e9)
    if not message.HasField("not_after") or until_ns < message.not_after.ToNanoseconds():
        message.not_after.FromNanoseconds(until_ns)
