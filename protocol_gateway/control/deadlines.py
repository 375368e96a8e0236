"""Until when the asker of a command waits: what is past that is not begun.

not_after                  the request says it, by the gateway's clock
the question's `within`    the asker's time-out, counted from when the question came
both                       the earlier one
neither, RUN_PROGRAM       DEFAULT_TIMEOUT_S, for Zenoh does not tell the gateway an asker's time-out
neither, another command   `admission.LONGEST_WAIT_S` in the gateway, as for every command
"""

from robomesh.schemas.robomesh_pb2 import CommandRequest
from robomesh.server import Request

# The default time-out of a robomesh client.
DEFAULT_TIMEOUT_S = 2.0


def set_deadline(message: CommandRequest, request: Request) -> None:
    """Set the command's `not_after` to the time until which its asker waits."""
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
