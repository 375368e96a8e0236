"""`robomesh fk` and `robomesh ik`: kinematics, without a running mesh.

A command imports the robot model when it runs: numpy and Pinocchio take a second.
"""

import sys
from collections.abc import Iterator
from math import isfinite
from typing import Annotated

import typer

from robomesh import bounded_json
from services.command_line.terminal.options import Json, command_group
from services.errors import ServiceError

app = command_group()


class RequestError(ServiceError):
    """A request that is invalid."""


@app.command()
def fk(
    requests: Annotated[str, typer.Argument(metavar="-", help="JSON requests on standard input.")] = "-",
    robot: Annotated[str, typer.Option(metavar="R")] = "pt600",
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, in SI units: always so here.")] = True,
) -> None:
    """Forward kinematics: {"joints": [..]} a line in, {"tool", "links"} a line out.

    Poses are in the base frame.
    """
    from robots.descriptions.description import load
    from robots.kinematics.model import build_model, link_placements, tool_placement
    from robots.schema.errors import RobotError
    from services.command_line.terminal.output import print_json

    if requests != "-":
        raise RequestError(f"{requests!r}: must be '-', with one JSON request a line on standard input")
    model = build_model(load(robot))
    failed = False
    for line in request_lines():
        try:
            positions = _joint_positions(line)
            placements = link_placements(model, positions)
            links = {name: placements[index].tolist() for index, name in enumerate(model.link_names)}
            print_json({"tool": tool_placement(model, positions).tolist(), "links": links})
        except (RobotError, RequestError) as error:
            failed = True
            print_json({"error": str(error)})
    if failed:
        raise typer.Exit(1)


@app.command(context_settings={"ignore_unknown_options": True})
def ik(
    pose: Annotated[
        list[str],
        typer.Argument(
            metavar="X Y Z [ROLL PITCH YAW]",
            help="The tool's pose in the base frame, mm and degrees; - for JSON requests on standard input.",
        ),
    ],
    robot: Annotated[str, typer.Option(metavar="R")] = "pt600",
    task: Annotated[
        str, typer.Option(metavar="6d|5d|3d", help="Match the pose, position and tool axis, or position.")
    ] = "",
    all_: Annotated[bool, typer.Option("--all", help="All solutions; else the nearest to home.")] = False,
    as_json: Json = False,
) -> None:
    """Inverse kinematics of a pose; JSON: {"pose", "task", "near", "all", "seed"} a line in."""
    from services.command_line.robots import inverse

    inverse.inverse(robot, pose, task, all_, as_json)


def request_lines() -> Iterator[str]:
    """Yield the non-empty lines of standard input; a line that is not UTF-8 does not end the input."""
    for line in sys.stdin.buffer:
        if text := line.decode(errors="replace").strip():
            yield text


def _joint_positions(line: str) -> list[float]:
    try:
        positions = bounded_json.loads(line, parse_constant=_reject)["joints"]
        found = [float(position) for position in positions]
        if not all(map(isfinite, found)):
            raise ValueError
        return found
    except (ValueError, TypeError, KeyError, OverflowError, RecursionError):
        raise RequestError(
            f'{line[:200]!r} is no request; write one as in {{"joints": [0.1, 0.2]}}, in rad and m'
        ) from None


def _reject(constant: str) -> float:
    raise ValueError(constant)
