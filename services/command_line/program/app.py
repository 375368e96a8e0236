"""`robomesh program`: teach programs, looked at without a mesh of services.

Everything heavy is imported by the command that needs it.
"""

from pathlib import Path
from typing import Annotated

import typer

from services.command_line.options import Json, SiteFile

program_app = typer.Typer(help="Teach programs: check, plan, from CAD.", no_args_is_help=True)

_File = Annotated[str, typer.Argument(metavar="FILE", help="The program; - reads standard input.")]
_Robot = Annotated[
    str, typer.Option("--robot", metavar="R", help="A library robot or a description; of --site: its name.")
]
_Start = Annotated[
    str, typer.Option(metavar="'Q ...'", help="Where it begins: degrees, mm of prismatic joints; else home.")
]


@program_app.command("check")
def program_check(
    file: _File,
    robot: _Robot = "pt600",
    site: SiteFile = None,
    start: _Start = "",
    exact: Annotated[bool, typer.Option(help="Links as their meshes, not as hulls: slow.")] = False,
    plot: Annotated[
        Path | None, typer.Option(metavar="OUT.png|svg", help="Draw joints, tool speed, clearance over time.")
    ] = None,
    as_json: Json = False,
) -> None:
    """How long a program takes, and all that is wrong with it; exit status 1 if anything is."""
    from services.command_line.program import commands

    commands.check(file, robot, site, start, exact, plot, as_json)


@program_app.command("plan")
def program_plan(
    file: _File,
    robot: _Robot = "pt600",
    site: SiteFile = None,
    start: _Start = "",
    as_json: Json = False,
) -> None:
    """The steps that a controller is sent: repeats unrolled, lines cut into joint moves."""
    from services.command_line.program import commands

    commands.plan(file, robot, site, start, as_json)


@program_app.command("from-dxf")
def program_from_dxf(
    file: Annotated[Path, typer.Argument(metavar="IN.dxf")],
    layer: Annotated[str, typer.Option(metavar="NAME", help="Every curve of this layer.")] = "",
    handle: Annotated[str, typer.Option(metavar="HEX", help="This one curve.")] = "",
    frame: Annotated[
        str, typer.Option(metavar="'X Y Z R P Y'", help="Of the drawing in the base frame: mm, degrees.")
    ] = "0 0 0 0 0 0",
    tool: Annotated[
        str, typer.Option(metavar="'R P Y'", help="How the tool stands in that frame: degrees.")
    ] = "180 0 0",
    approach: Annotated[float, typer.Option(metavar="MM", help="How far above it comes and goes.")] = 50.0,
    tolerance: Annotated[float, typer.Option(metavar="MM", help="Of a curve's straight parts.")] = 0.1,
    unit: Annotated[
        float, typer.Option(metavar="MM", help="A unit of a drawing that does not say its own.")
    ] = 0.0,
    out: Annotated[Path | None, typer.Option("--out", metavar="OUT", help="Else standard output.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Write over OUT, if it is there.")] = False,
) -> None:
    """A drawing's curves as a program of move_line: the way from CAD to motion."""
    from services.command_line.program import commands

    commands.from_dxf(file, layer, handle, frame, tool, approach, tolerance, unit, out, force)
