"""`robomesh robot`, `mesh`, `fk`: what a robot is, asked on the command line."""

import json
import sys
from math import degrees, isfinite
from pathlib import Path
from typing import Any

import typer

from robots.description import load
from robots.errors import DescriptionError, RobotError
from services.command_line.find import print_json
from services.errors import ServiceError


class RequestError(ServiceError):
    """A request line that cannot be answered."""


def check(robot: str, as_json: bool) -> None:
    """Print every problem of a description; exit status 1 when there is one."""
    try:
        description = load(robot)
        problems: tuple[str, ...] = ()
    except DescriptionError as error:
        problems = error.problems
    if as_json:
        print_json({"ok": not problems, "problems": problems})
    else:
        print("\n".join(problems) if problems else f"{description.name}: a right description")
    if problems:
        raise typer.Exit(1)


def show(robot: str, as_json: bool) -> None:
    """Print a robot's joints and derived values."""
    from robots.model import build_model, tool_placement
    from robots.summary import description_summary

    description = load(robot)
    model = build_model(description)
    tool = tool_placement(model, model.joints.home)
    summary = {**description_summary(description), "tool_at_home": tool.tolist()}
    if as_json:
        print_json(summary)
        return
    joints = summary["joints"]
    print(
        f"{summary['title'] or summary['name']}: {len(joints)} joints, "
        f"reach {summary['reach_m'] * 1000:.0f} mm"
    )
    if description.provenance:
        print(description.provenance)
    for joint in joints:
        factor, unit = (degrees(1.0), "°") if joint["type"] == "rotary" else (1000.0, " mm")
        print(
            f"  {joint['name']:<12} {joint['type']:<10} "
            f"{joint['lower'] * factor:8.1f} .. {joint['upper'] * factor:.1f}{unit}, "
            f"up to {joint['max_speed'] * factor:.0f}{unit}/s, home {joint['home'] * factor:.1f}{unit}"
        )
    x, y, z = tool[:3, 3] * 1000
    print(f"  tool at home: {x:.1f} {y:.1f} {z:.1f} mm")


def export(robot: str, folder: Path) -> None:
    """Write URDF and GLB meshes into a folder."""
    from robots.glb import link_meshes
    from robots.urdf import to_urdf

    description = load(robot)
    meshes = link_meshes(description)
    try:
        (folder / "meshes").mkdir(parents=True, exist_ok=True)
        for link, glb in meshes.items():
            (folder / "meshes" / f"{link}.glb").write_bytes(glb)
        urdf = folder / f"{description.name}.urdf"
        urdf.write_text(to_urdf(description), encoding="utf-8")
    except OSError as error:
        raise RequestError(f"{folder}: cannot be written: {error.strerror}") from None
    print(urdf)


def mesh_info(file: Path, as_json: bool) -> None:
    """Print what a mesh file holds."""
    from robots.meshes.read import read_mesh
    from robots.summary import mesh_summary

    summary = mesh_summary(read_mesh(file))
    if as_json:
        print_json(summary)
        return
    print(f"{file.name}: {summary['triangles']} triangles")
    print(f"  from {_triple(summary['min'])} to {_triple(summary['max'])}, in the file's own units")
    print(f"  materials: {', '.join(filter(None, summary['materials'])) or 'none named'}")
    for warning in summary["warnings"]:
        print(f"  warning: {warning}")


def forward(robot: str, requests: str) -> None:
    """Answer each request line with a line: JSON, SI, in the base frame."""
    from robots.model import build_model, link_placements, tool_placement

    if requests != "-":
        raise RequestError(f"{requests!r}: '-' is right, and one JSON request a line on standard input")
    model = build_model(load(robot))
    failed = False
    for line in sys.stdin:
        if not line.strip():
            continue
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


def _joint_positions(line: str) -> list[float]:
    try:
        positions = json.loads(line, parse_constant=_refuse)["joints"]
        found = [float(position) for position in positions]
        if not all(map(isfinite, found)):
            raise ValueError
        return found
    except (ValueError, TypeError, KeyError):
        raise RequestError(
            f'{line.strip()!r} is no request; {{"joints": [0.1, 0.2]}} is right, in rad and m'
        ) from None


def _refuse(constant: str) -> float:
    raise ValueError(constant)


def _triple(values: Any) -> str:
    return "({:.6g}, {:.6g}, {:.6g})".format(*values)
