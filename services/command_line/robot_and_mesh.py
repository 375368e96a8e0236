"""`robomesh robot` and `robomesh mesh`: descriptions and mesh files, without a mesh of services.

Everything heavy is imported by the command that needs it.
"""

from pathlib import Path
from typing import Annotated

import typer

from services.command_line.options import Json

robot_app = typer.Typer(help="Robot descriptions: check, show, import, export.", no_args_is_help=True)
mesh_app = typer.Typer(help="Mesh files: what is in one; one format to another.", no_args_is_help=True)


@robot_app.command("check")
def robot_check(robot: Annotated[str, typer.Argument(metavar="ROBOT")], as_json: Json = False) -> None:
    """Whether a description is right; a line a problem."""
    from services.command_line.robot import commands

    commands.check(robot, as_json)


@robot_app.command("show")
def robot_show(
    robot: Annotated[str, typer.Argument(metavar="ROBOT")],
    as_json: Json = False,
    png: Annotated[
        Path | None, typer.Option(metavar="OUT.png", help="Draw front, left, top and free, all in one.")
    ] = None,
) -> None:
    """A robot's D-H table, limits, frames and reach."""
    from services.command_line.robot import commands

    commands.show(robot, as_json, png)


@robot_app.command("import")
def robot_import(
    source: Annotated[str, typer.Argument(metavar="FILE", help="A URDF, an OpenHRP .wrl, a robot.toml.")],
    folder: Annotated[Path, typer.Argument(metavar="OUT_FOLDER", help="A new one.")],
    package: Annotated[
        list[Path] | None, typer.Option(metavar="DIR", help="Where package:// is looked for; more than once.")
    ] = None,
    dh: Annotated[bool, typer.Option("--dh", help="As D-H rows, along the chain to the tool.")] = False,
) -> None:
    """Write a robot from elsewhere as robot.toml and meshes; exit status 1 when some are missing."""
    from services.command_line.robot import commands

    commands.import_(source, folder, package or [], dh)


@robot_app.command("export")
def robot_export(
    robot: Annotated[str, typer.Argument(metavar="ROBOT")],
    folder: Annotated[Path, typer.Argument(metavar="FOLDER")],
) -> None:
    """Write a robot as URDF with GLB meshes."""
    from services.command_line.robot import commands

    commands.export(robot, folder)


@mesh_app.command("info")
def mesh_info(
    file: Annotated[Path, typer.Argument(metavar="FILE")],
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, in the file's own units.")] = False,
) -> None:
    """Triangles, bounds and materials of a mesh file, in its own units and axes."""
    from services.command_line.mesh import commands

    commands.info(file, as_json)


@mesh_app.command("convert")
def mesh_convert(
    source: Annotated[Path, typer.Argument(metavar="IN")],
    target: Annotated[Path, typer.Argument(metavar="OUT", help=".glb, .stl, .obj, .ply, .wrl or .3ds")],
    scale: Annotated[
        float | None,
        typer.Option(
            metavar="NUMBER", help="Times each length. For .glb, metres a unit; guessed unless given."
        ),
    ] = None,
    up: Annotated[str | None, typer.Option(metavar="y|z", help="IN's upward axis; y is turned to z.")] = None,
) -> None:
    """The same mesh in another format; says what that cannot hold."""
    from services.command_line.mesh import commands

    commands.convert(source, target, scale, up)
