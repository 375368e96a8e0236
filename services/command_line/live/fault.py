"""`robomesh fault`: faults of a simulated controller, begun and ended on request."""

from controllers.simulated.fault_table import FAULTS
from robomesh.contract.keys import robot_key
from robomesh.schemas.robomesh_pb2 import FaultAnswer, FaultRequest
from services.command_line.terminal import discovery
from services.command_line.terminal.output import print_json, print_line


def run(robot: str, name: str, off: bool, router: str, as_json: bool) -> None:
    """Begin or end a fault; without a name, list all faults."""
    answer = discovery.run(_request(robot, FaultRequest(fault=name, off=off), router))
    if as_json:
        print_json({"active": list(answer.active), "known": list(answer.known)})
    elif name:
        print_line(f"faults now: {', '.join(answer.active) or 'none'}")
    else:
        for known in answer.known:
            mark = "*" if known in answer.active else " "
            print_line(f"{mark} {known:<8} {FAULTS[known].effect if known in FAULTS else ''}".rstrip())


async def _request(name: str, request: FaultRequest, router: str) -> FaultAnswer:
    async with discovery.attached(router) as session:
        robot = await discovery.find(session, name)
        answer = await session.ask(robot_key(*robot, "simulator/fault"), request)
    assert isinstance(answer, FaultAnswer)
    return answer
