"""`robomesh robot`: robot descriptions; all but `verify` without a running mesh.

A command imports the robot model when it runs: numpy and Pinocchio take a second.
"""

from math import degrees
from pathlib import Path
from typing import Annotated, Any

import typer

from robomesh.contract.endpoints import DEFAULT_ROUTER
from services.command_line.terminal.options import Connect, Json, Robot, command_group
from services.command_line.terminal.output import print_json, print_line
from services.errors import ServiceError

app = command_group("robot", "Robot descriptions: check, show, import, export, verify.")

_Robot = Annotated[str, typer.Argument(metavar="ROBOT")]


class ExportFolderError(ServiceError):
    """The folder cannot hold the exported robot."""


@app.command()
def check(robot: _Robot, as_json: Json = False) -> None:
    """Check a description and its meshes: a line a problem; exit status 1 when there is one."""
    from robots.descriptions.description import load
    from robots.descriptions.shape_inspection import inspect_shapes
    from robots.schema.errors import DescriptionError

    name = robot
    problems: list[dict[str, Any]] = []
    warnings: list[dict[str, Any]] = []
    report: dict[str, Any] = {}
    try:
        description = load(robot)
        name = description.name
        found, odd = inspect_shapes(description)
        problems += [{"file": each.file, "path": [], "text": each.text} for each in found]
        warnings = [{"file": each.file, "text": each.text} for each in odd]
        if not problems:
            from robots.bodies.collision_coverage import collision_coverage

            report = collision_coverage(robot)
    except DescriptionError as error:
        if not Path(error.source).is_file():
            raise  # nothing was checked
        problems = [
            {"file": error.source, "path": list(path), "text": text}
            for path, text in zip(error.paths, error.problems, strict=True)
        ]
    if as_json:
        print_json({"ok": not problems, "problems": problems, "warnings": warnings, **report})
    else:
        for problem in problems:
            print_line(f"{problem['file']}: {problem['text']}")
        for warning in warnings:
            print_line(f"{warning['file']}: warning: {warning['text']}")
        for link, way in report.get("stands_out", {}).items():
            print_line(
                f"{name}: {link}: visual geometry extends beyond checked geometry by {way * 1000:.1f} mm"
            )
        for each in report.get("not_checked", []):
            print_line(f"{name}: {' and '.join(each['links'])} are not checked: {each['reason']}")
        for each in report.get("touch_at_home", []):
            print_line(f"{name}: {' and '.join(each['links'])} touch at home as hulls: {each['reason']}")
        for each in report.get("touch_elsewhere", []):
            print_line(f"{name}: {' and '.join(each['links'])} are apart at home; {each['reason']}")
        if not problems:
            print_line(f"{name}: the description is valid")
    if problems:
        raise typer.Exit(1)


@app.command()
def show(
    robot: _Robot,
    as_json: Json = False,
    png: Annotated[
        Path | None, typer.Option(metavar="OUT.png", help="Draw front, left, top and free in one picture.")
    ] = None,
) -> None:
    """Show a robot's D-H table, limits, frames and reach."""
    from robots.descriptions.description import load
    from robots.descriptions.summary import description_summary
    from robots.kinematics.model import build_model, tool_placement

    description = load(robot)
    model = build_model(description)
    tool = tool_placement(model, model.joints.home)
    summary = {**description_summary(description), "tool_at_home": tool.tolist()}
    if png is not None:
        import numpy as np

        from renderer.pictures.four_views import draw_four_views
        from robots.descriptions.glb import link_glbs
        from robots.descriptions.urdf.write import to_urdf
        from services.kinematics.descriptions import describe

        shapes, urdf = link_glbs(description), to_urdf(description)
        message = describe(
            description, urdf=urdf, shapes=shapes, base_to_site=np.eye(4), cell="", simulated=False
        )
        draw_four_views(message, shapes, png)
    if as_json:
        print_json(summary)
        return
    _print_summary(summary, tool[:3, 3].tolist())
    if png is not None:
        print_line(png)


def _print_summary(summary: dict[str, Any], tool: list[float]) -> None:
    joints = summary["joints"]
    print_line(
        f"{summary['title'] or summary['name']}: {len(joints)} joints, "
        f"reach {summary['reach_m'] * 1000:.0f} mm"
    )
    if summary["provenance"]:
        print_line(summary["provenance"])
    wide = max(len(joint["name"]) for joint in joints)
    if summary["dh"] is not None:
        print_line(f"  {'D-H rows':<{wide}} {'a mm':>10} {'alpha °':>10} {'d mm':>10} {'theta °':>10}  link")
        for row in summary["dh"]["rows"]:
            variable = "theta" if row["type"] == "rotary" else "d"
            cells = {
                "a": row["a"] * 1000,
                "alpha": degrees(row["alpha"]),
                "d": row["d"] * 1000,
                "theta": degrees(row["theta"]),
            }
            # The joint's position is added to the value with the star.
            text = " ".join(
                f"{_cell(value)}{'*' if key == variable else ' '}" for key, value in cells.items()
            )
            print_line(f"  {row['joint']:<{wide}} {text}  {row['link']}")
        start = summary["dh"]["start"]
        if any(start["xyz"] + start["rpy"]):
            xyz = ", ".join(f"{1000 * value:.6g}" for value in start["xyz"])
            rpy = ", ".join(f"{degrees(angle):.6g}" for angle in start["rpy"])
            print_line(f"  the first row begins at xyz [{xyz}] mm, rpy [{rpy}]° in the base frame")
        for note in summary["dh"]["notes"]:
            print_line(f"  note: {note}")
    print_line(f"  {'joints':<{wide}} {'type':<10} {'limits':>20} {'home':>9}  most: speed, /s, /s")
    for joint in joints:
        factor, unit = (degrees(1.0), "°") if joint["type"] == "rotary" else (1000.0, " mm")
        limits = f"{joint['lower'] * factor:.1f} .. {joint['upper'] * factor:.1f}{unit}"
        rates = [joint[key] * factor for key in ("max_speed", "max_acceleration", "max_jerk")]
        print_line(
            f"  {joint['name']:<{wide}} {joint['type']:<10} {limits:>20} {joint['home'] * factor:8.1f}{unit}"
            f"  {', '.join(f'{rate:.0f}' for rate in rates)}{unit}"
        )
    for frame in summary["frames"]:
        place = [1000 * row[3] for row in frame["frame_to_link"][:3]]
        print_line(f"  {frame['name']} on {frame['link']} at {' '.join(f'{x:.1f}' for x in place)} mm")
    print_line(f"  tool at home: {' '.join(f'{1000 * x:.1f}' for x in tool)} mm")


def _cell(value: float) -> str:
    return f"{round(value, 3) + 0.0:9.3f}"


@app.command()
def export(robot: _Robot, folder: Annotated[Path, typer.Argument(metavar="FOLDER")]) -> None:
    """Write a robot as URDF with GLB meshes."""
    from robots.descriptions.description import load
    from robots.descriptions.glb import collision_glbs, link_glbs, main_colors
    from robots.descriptions.urdf.write import collision_beside, glb_beside, to_urdf

    description = load(robot)
    urdf = folder / f"{description.name}.urdf"
    others = [path for path in folder.glob("*.urdf") if path != urdf]
    if others or (not urdf.exists() and (folder / "meshes").exists()):
        there = others[0].name if others else "meshes"
        raise ExportFolderError(
            f"{folder}: holds another robot ({there}), whose meshes would be overwritten: choose a new folder"
        )
    shapes = link_glbs(description)
    files = {glb_beside(link): glb for link, glb in shapes.items()}
    files |= {collision_beside(link): glb for link, glb in collision_glbs(description).items()}
    try:
        (folder / "meshes").mkdir(parents=True, exist_ok=True)
        for path, glb in files.items():
            (folder / path).write_bytes(glb)
        text = to_urdf(description, collision_uri=collision_beside, colors=main_colors(shapes))
        urdf.write_text(text, encoding="utf-8")
    except OSError as error:
        raise ExportFolderError(f"{folder}: cannot be written: {error.strerror}") from None
    print_line(urdf)


@app.command("import")
def import_(
    source: Annotated[str, typer.Argument(metavar="FILE", help="A URDF, an OpenHRP .wrl, a robot.toml.")],
    folder: Annotated[Path, typer.Argument(metavar="OUT_FOLDER", help="A new folder.")],
    package: Annotated[
        list[Path] | None, typer.Option(metavar="DIR", help="Where to look for package://; repeatable.")
    ] = None,
    dh: Annotated[bool, typer.Option("--dh", help="As D-H rows, along the chain to the tool.")] = False,
) -> None:
    """Convert a robot file to robot.toml and meshes; exit status 1 when meshes are missing.

    Writes the whole folder, or nothing.
    """
    from robots.descriptions.importing import import_robot
    from robots.descriptions.save_description import write_folder

    robot = import_robot(source, packages=package or [], as_dh=dh)
    for note in robot.notes:
        print_line(f"note: {note}", err=True)
    for name in robot.missing:
        print_line(f"missing: {name}: that shape is left out", err=True)
    print_line(write_folder(robot.values, robot.files, folder.absolute()).path)
    if robot.missing:
        raise typer.Exit(1)


@app.command()
def verify(
    robot: Robot,
    connect: Connect = DEFAULT_ROUTER,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE.json", help="Keep the result, with the model's SHA-256.")
    ] = None,
    base: Annotated[
        str,
        typer.Option(metavar="LINK", help="Link at the controller's base frame; else base, or first."),
    ] = "",
    flange: Annotated[
        str, typer.Option(metavar="LINK", help="Link at its flange; else tool0, or that of the tool.")
    ] = "",
    as_json: Json = False,
) -> None:
    """Compare a running robot's model with the controller's Cartesian position; exit status 1: they differ.

    Move the arm from its own panel; poses are taken while it rests. Ctrl-C ends it; with --out, the same
    command goes on with its poses.
    """
    from services.command_line.robots.verify import verify as verified

    if not verified(robot, connect, out, base=base, flange=flange, as_json=as_json):
        raise typer.Exit(1)
