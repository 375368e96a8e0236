"""`robomesh fault`: faults of a simulated controller, begun and ended on request."""

from typing import Annotated

import typer

from controllers.simulated.fault_table import FAULTS
from robomesh.contract.endpoints import DEFAULT_ROUTER
from robomesh.contract.keys import robot_key
from robomesh.schemas.robomesh_pb2 import FaultAnswer, FaultRequest
from services.command_line.terminal import discovery
from services.command_line.terminal.options import Connect, Json, Robot, command_group
from services.command_line.terminal.output import print_json, print_line

app = command_group()


@app.command()
def fault(
    robot: Robot,
    name: Annotated[
        str,
        typer.Argument(metavar="[NAME[@BEGIN][+LENGTH]]", help="The fault; without it, list all faults."),
    ] = "",
    off: Annotated[bool, typer.Option("--off", help="End the fault.")] = False,
    connect: Connect = DEFAULT_ROUTER,
    as_json: Json = False,
) -> None:
    """Make a simulated controller misbehave: freeze, flood, jump, ..."""
    answer = discovery.run(_request(robot, FaultRequest(fault=name, off=off), connect))
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
