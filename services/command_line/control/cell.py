"""`robomesh cell`: what stands in a robot's cell, and changes of it."""

import math
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from robomesh.contract.endpoints import DEFAULT_ROUTER
from robomesh.contract.keys import check_chunk, robot_key
from robomesh.contract.messages import to_json
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import Session
from services.command_line.terminal import discovery
from services.command_line.terminal.options import Connect, Json, Robot, command_group
from services.command_line.terminal.output import print_line, print_text
from services.errors import ServiceError

app = command_group("cell", "Fixtures and the floor of a robot's cell: show, set, move, undo.")

_Engineer = Annotated[str, typer.Option(help="The engineer's name; else yours.")]
_Yes = Annotated[bool, typer.Option("--yes", help="Change it without asking.")]
_Try = Annotated[bool, typer.Option("--dry-run", help="Only say what would change.")]
_Reason = Annotated[str, typer.Option(help="The reason, for the audit log.")]
_Change = Callable[[schema.CellState], schema.CellContent]
_TIMEOUT_S = 10.0
# The gateway waits for kinematics and for its own checks.
_CHANGE_TIMEOUT_S = 120.0


class CellError(ServiceError):
    """The robot has no such fixture, or a file is not a cell's content."""


@app.command()
def show(robot: Robot, connect: Connect = DEFAULT_ROUTER, as_json: Json = False) -> None:
    """Print the fixtures and the floor in the form of a site file, for `cell set`."""

    async def ask() -> schema.CellState:
        async with discovery.attached(connect) as session:
            return await _state(session, await discovery.find(session, robot))

    state = discovery.run(ask())
    if as_json:
        print_line(to_json(state))
        return
    print_text(_text(state))


@app.command("set")
def set_(
    robot: Robot,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="As `cell show` prints it.")],
    connect: Connect = DEFAULT_ROUTER,
    yes: _Yes = False,
    dry_run: _Try = False,
    reason: _Reason = "",
    engineer: _Engineer = "",
    as_json: Json = False,
) -> None:
    """Replace all fixtures and the floor by those of a file.

    Exit status 1: nothing was changed, because you did not confirm it.
    """
    _changed(lambda state: _content(file, state), robot, connect, yes, dry_run, reason, engineer, as_json)


@app.command()
def move(
    robot: Robot,
    fixture: Annotated[str, typer.Argument(metavar="FIXTURE")],
    xyz: Annotated[
        tuple[float, float, float] | None,
        typer.Option(metavar="X Y Z", help="Place of its middle in the site's frame, mm."),
    ] = None,
    rpy: Annotated[
        tuple[float, float, float] | None,
        typer.Option(metavar="R P Y", help="Roll, pitch and yaw about the site's x, y and z, degrees."),
    ] = None,
    connect: Connect = DEFAULT_ROUTER,
    yes: _Yes = False,
    dry_run: _Try = False,
    reason: _Reason = "",
    engineer: _Engineer = "",
    as_json: Json = False,
) -> None:
    """Move a fixture to another place.

    Exit status 1: nothing was changed, because you did not confirm it.
    """

    def moved(state: schema.CellState) -> schema.CellContent:
        content = schema.CellContent()
        content.CopyFrom(state.content)
        found = next((each for each in content.fixtures if each.name == fixture), None)
        if found is None:
            names = ", ".join(each.name for each in content.fixtures) or "none"
            raise CellError(f"{robot} has no fixture {fixture!r} in its cell; there are: {names}")
        if xyz is not None:
            found.xyz.x, found.xyz.y, found.xyz.z = (each / 1000.0 for each in xyz)
        if rpy is not None:
            found.rpy.x, found.rpy.y, found.rpy.z = map(math.radians, rpy)
        return content

    if xyz is None and rpy is None:
        raise CellError("a new place is needed: --xyz X Y Z in mm, or --rpy R P Y in degrees")
    _changed(moved, robot, connect, yes, dry_run, reason, engineer, as_json)


@app.command()
def undo(
    robot: Robot,
    connect: Connect = DEFAULT_ROUTER,
    yes: _Yes = False,
    dry_run: _Try = False,
    reason: _Reason = "",
    engineer: _Engineer = "",
    as_json: Json = False,
) -> None:
    """Restore the fixtures and the floor before the last change.

    Exit status 1: nothing was changed, because you did not confirm it.
    """

    def previous(state: schema.CellState) -> schema.CellContent:
        if not state.HasField("previous"):
            raise CellError(f"{robot}: there is no earlier content of its cell")
        return state.previous

    _changed(previous, robot, connect, yes, dry_run, reason, engineer, as_json)


def _changed(
    change: _Change,
    robot: str,
    connect: str,
    yes: bool,
    dry_run: bool,
    reason: str,
    engineer: str,
    as_json: bool,
) -> None:
    """Ask for a change, after a person has confirmed it; print the answer."""

    async def ask() -> schema.CellAnswer | None:
        async with discovery.attached(connect) as session:
            found = await discovery.find(session, robot)
            state = await _state(session, found)
            by = check_chunk(engineer or discovery.own_name())
            key = robot_key(found.site, found.name, f"cell/request/{by}")
            request = schema.CellRequest(
                based_on=state.version, content=change(state), dry_run=True, reason=reason
            )
            if dry_run or not yes:
                answer = await session.ask(key, request, timeout_s=_CHANGE_TIMEOUT_S)
                assert isinstance(answer, schema.CellAnswer)
                if dry_run:
                    return answer
                _print(answer, err=as_json)
                if not typer.confirm(f"Change the cell of {found} and its site file?", err=True):
                    return None
            request.dry_run = False
            answer = await session.ask(key, request, timeout_s=_CHANGE_TIMEOUT_S)
            assert isinstance(answer, schema.CellAnswer)
            return answer

    answer = discovery.run(ask())
    if answer is None:
        print_line("nothing was changed", err=as_json)
        raise typer.Exit(1)
    if as_json:
        print_line(to_json(answer))
        return
    if dry_run or yes:
        _print(answer)
    print_line("nothing was changed: --dry-run" if dry_run else f"changed: version {answer.version[:12]}")


async def _state(session: Session, robot: discovery.RobotAddress) -> schema.CellState:
    state = await session.last(robot_key(robot.site, robot.name, "cell"), timeout_s=_TIMEOUT_S)
    if not isinstance(state, schema.CellState):
        raise CellError(f"{robot}: its gateway does not publish its cell: it is older, or has no site file")
    return state


def _print(answer: schema.CellAnswer, *, err: bool = False) -> None:
    from services.cells.content import summary

    for each in answer.changes:
        print_line(summary([each]), err=err)


def _text(state: schema.CellState) -> str:
    from robots.descriptions.description_text import inline_text
    from services.cells.content import fixtures_of, floor_of
    from services.cells.text import fixture_text, floor_value

    floor = floor_value(floor_of(state.content))
    first = "# floor: the height of the lowest base" if floor is None else f"floor = {inline_text(floor)}"
    tables = [fixture_text(each) for each in fixtures_of(state.content, state.cell)]
    return "\n".join([f"{first}\n", *tables])


def _content(file: Path, state: schema.CellState) -> schema.CellContent:
    """Return the content that a file describes.

    Raises:
        CellError: With the file and what is wrong in it.
    """
    from pydantic import ValidationError

    from protocol_gateway.seam.table import problem_text
    from robots.schema.bounded_toml import read_toml
    from services.cells.content import content_of
    from services.site_file.tables.fixtures import Fixture
    from services.site_file.tables.robot import Robot as SiteRobot

    try:
        values = read_toml(file)
        unknown = sorted(values.keys() - {"floor", "fixture"})
        if unknown:
            raise CellError(f"{file}: {unknown[0]}: a cell has floor and [[fixture]], and nothing else")
        rows: Any = values.get("fixture", [])
        if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
            raise CellError(f"{file}: fixture: write [[fixture]], with two brackets")
        fixtures = [Fixture.model_validate({"cell": state.cell, **row}) for row in rows]
        for fixture in fixtures:
            if fixture.cell != state.cell:
                raise CellError(f"{file}: fixture {fixture.name}: cell = {fixture.cell!r}: is {state.cell!r}")
        floor = {"floor": values["floor"]} if "floor" in values else {}
        checked = SiteRobot.model_validate({"name": "any", "model": "any", **floor})
    except (OSError, UnicodeDecodeError) as error:
        raise CellError(f"{file}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
    except tomllib.TOMLDecodeError as error:
        raise CellError(f"{file}: not TOML: {error}") from None
    except ValidationError as error:
        problem = error.errors(include_url=False)[0]
        where = ".".join(map(str, problem["loc"]))
        raise CellError(f"{file}: {where}: {problem_text(problem)}") from None
    return content_of(fixtures, checked.floor)
