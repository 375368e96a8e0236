"""`robomesh program`: check, plan and make teach programs, without a running mesh.

A command imports the robot model and the planner when it runs: with numpy and coal they take a second.
"""

import sys
from collections.abc import Iterable, Sequence
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from services.command_line.terminal.options import Json, SiteFile, command_group
from services.command_line.terminal.output import print_json, print_line, print_text
from services.errors import ServiceError

if TYPE_CHECKING:
    from robots.collision import Cell
    from robots.kinematics.joints import FloatArray, Joints
    from robots.programs.steps import CheckReport, Step, Violation

app = command_group("program", "Teach programs: check, plan, from CAD.")

_File = Annotated[str, typer.Argument(metavar="FILE", help="The program; - reads standard input.")]
_Robot = Annotated[
    str,
    typer.Option(
        "--robot", metavar="R", help="A library robot or a description; with --site its name there."
    ),
]
_Start = Annotated[
    str, typer.Option(metavar="'Q ...'", help="Start position: degrees, mm of prismatic joints; else home.")
]


class ProgramFileError(ServiceError):
    """A program file or an option value that cannot be used."""


@app.command()
def check(
    file: _File,
    robot: _Robot = "pt600",
    site: SiteFile = None,
    start: _Start = "",
    exact: Annotated[bool, typer.Option(help="Check meshes instead of convex hulls: slow.")] = False,
    plot: Annotated[
        Path | None, typer.Option(metavar="OUT.png|svg", help="Plot joints, tool speed, clearance over time.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Show a program's duration and all its violations; exit status 1 if there is one."""
    from robots.checks.check import check_program

    text = program_text(file)
    cell, name = _cell(robot, site, exact=exact)
    joints = cell.arms[name].joints
    others = {other: arm.joints.home for other, arm in cell.arms.items() if other != name}
    result = check_program(text, cell, name, _start(start, joints), others=others)
    notes = [note.text for note in result.notes]
    if others:
        notes.append(f"at home, for this check: {', '.join(others)}")
    if plot is not None:
        from robots.checks.plot import plot_check

        plot_check(result, joints, plot, title=f"{Path(file).name} on {name}")
    if as_json:
        print_json(_result_json(result, notes))
    else:
        _print_result(file, result, notes)
    if not result.ok:
        raise typer.Exit(1)


@app.command()
def plan(
    file: _File,
    robot: _Robot = "pt600",
    site: SiteFile = None,
    start: _Start = "",
    as_json: Json = False,
) -> None:
    """List the steps that a controller receives: repeats unrolled, lines as joint moves.

    Prints a program of joint moves, or JSON; exit status 1 when the plan ends early.
    """
    from robots.kinematics.inverse import build_solver
    from robots.programs.plan import plan_program
    from robots.programs.text import parse_program
    from robots.programs.write import steps_text
    from robots.schema.errors import ProgramError

    cell, name = _cell(robot, site, exact=False)
    arm = cell.arms[name]
    try:
        program = parse_program(program_text(file), arm.joints)
    except ProgramError as error:
        for line, text in error.problems:
            print_line(f"{file}: line {line}: {text}", err=True)
        raise typer.Exit(1) from None
    found = plan_program(program, arm, build_solver(arm.description), _start(start, arm.joints))
    if as_json:
        print_json({"ok": not found.violations, "steps": [_step_json(step) for step in found.steps]})
    else:
        print_text(steps_text(found.steps, arm.joints))
    for violation in found.violations:
        print_line(f"{file}: line {violation.line}: {violation.text}", err=True)
    if found.violations:
        raise typer.Exit(1)


@app.command("from-dxf")
def from_dxf(
    file: Annotated[Path, typer.Argument(metavar="IN.dxf")],
    layer: Annotated[
        str, typer.Option(metavar="NAME", help="Curves of this layer; else of the only one.")
    ] = "",
    handle: Annotated[str, typer.Option(metavar="HEX", help="The curve or block with this handle.")] = "",
    frame: Annotated[
        str, typer.Option(metavar="'X Y Z R P Y'", help="Drawing in the base frame: mm, degrees.")
    ] = "0 0 0 0 0 0",
    tool: Annotated[
        str, typer.Option(metavar="'R P Y'", help="Tool orientation in the drawing's frame: degrees.")
    ] = "180 0 0",
    approach: Annotated[
        float, typer.Option(metavar="MM", help="Height above the curve for approach and retreat.")
    ] = 50.0,
    tolerance: Annotated[
        float, typer.Option(metavar="MM", help="Largest deviation of a curve's straight segments.")
    ] = 0.1,
    unit: Annotated[
        float, typer.Option(metavar="MM", help="Unit of a drawing that does not name its own.")
    ] = 0.0,
    out: Annotated[Path | None, typer.Option("--out", metavar="OUT", help="Else standard output.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite OUT.")] = False,
) -> None:
    """Convert a drawing's curves to a program of move_line."""
    from robots.programs.dxf import DxfPath, program_from_dxf

    path = DxfPath(
        layer=layer,
        handle=handle,
        frame=tuple(_numbers("--frame", frame, "x y z roll pitch yaw")),
        tool=tuple(_numbers("--tool", tool, "roll pitch yaw")),
        approach_mm=_between("--approach", approach, 0.0, 10_000.0),
        tolerance_mm=_between("--tolerance", tolerance, 0.001, 100.0),
        unit_mm=_between("--unit", unit, 0.0, 1e6),
    )
    text = program_from_dxf(file, path)
    if out is None:
        print_text(text)
        return
    try:
        with out.open("w" if force else "x", encoding="utf-8") as opened:
            opened.write(text)
    except FileExistsError:
        raise ProgramFileError(f"{out}: exists already; --force overwrites it") from None
    except OSError as error:
        raise ProgramFileError(f"{out}: cannot be written: {error.strerror}") from None
    print_line(out)


# ------------------------------------------------------------------------------ input


def program_text(file: str) -> str:
    """Return a program's text; - reads standard input.

    Raises:
        ProgramFileError: If it cannot be read, is too long or is not UTF-8 text.
    """
    from robots.programs import MOST_BYTES

    try:
        if file == "-":
            data = sys.stdin.buffer.read(MOST_BYTES + 1)
        else:
            with Path(file).open("rb") as opened:
                data = opened.read(MOST_BYTES + 1)
        if len(data) > MOST_BYTES:
            raise ProgramFileError(
                f"{file}: has more than {MOST_BYTES} bytes, the most that a teach program may have"
            )
        return data.decode("utf-8")
    except OSError as error:
        raise ProgramFileError(f"{file}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise ProgramFileError(f"{file}: is not UTF-8 text: byte {error.start}") from None


def _cell(robot: str, site: Path | None, *, exact: bool) -> tuple["Cell", str]:
    """Return the cell to check in, and the robot's name in it."""
    import numpy as np

    from robots.collision import build_cell
    from robots.descriptions.cells import CellDescription, CellRobot
    from robots.descriptions.description import load
    from services.cells.descriptions import cells_of
    from services.site_file import site as site_file

    if site is None:
        name = load(robot).name
        description = CellDescription(robots=(CellRobot(name=name, model=robot, base_to_site=np.eye(4)),))
        return build_cell(description, exact=exact), name
    cells = cells_of(site_file.load(site))
    if robot not in cells:
        there = ", ".join(cells) or "none"
        raise ProgramFileError(f"--robot {robot}: {site} has no such robot; its robots: {there}")
    return build_cell(cells[robot], exact=exact), robot


def _start(text: str, joints: "Joints") -> "FloatArray":
    """Return the start position: (n,) [rad] or [m]."""
    import numpy as np

    from robots.programs.text import joint_scales

    if not text:
        return joints.home.copy()
    return np.array(_numbers("--start", text, " ".join(joints.names))) * joint_scales(joints)


def _numbers(option: str, text: str, names: str) -> list[float]:
    words = text.replace(",", " ").split()
    try:
        found = [float(word) for word in words]
    except ValueError:
        found = []
    count = len(names.split())
    if len(found) != count or not all(isfinite(each) and abs(each) <= 1e5 for each in found):
        raise ProgramFileError(
            f"{option} {text!r}: must be {count} number{'s' if count > 1 else ''} from -100000 to 100000 "
            f"({names})"
        )
    return found


def _between(option: str, value: float, lowest: float, highest: float) -> float:
    if not lowest <= value <= highest:
        raise ProgramFileError(f"{option} {value:g}: must be {lowest:g} to {highest:g} mm")
    return value


# ------------------------------------------------------------------------------ output


def _result_json(result: "CheckReport", notes: list[str]) -> dict[str, Any]:
    return {
        "ok": result.ok,
        "duration_s": result.duration_s,
        "violations": [_violation_json(each) for each in result.violations],
        "interpolation": result.interpolation.text,
        "notes": notes,
        "alone": result.alone,
    }


def _violation_json(violation: "Violation") -> dict[str, Any]:
    return {
        "line": violation.line,
        "time_s": violation.time_s,
        "until_s": violation.until_s,
        "kind": str(violation.kind),
        "pair": list(violation.pair),
        "points": violation.points.tolist(),
        "distance_m": violation.distance_m,
        "text": violation.text,
        "refuses": violation.refuses,
    }


def _step_json(step: "Step") -> dict[str, Any]:
    values: dict[str, Any] = {"line": step.line, "kind": str(step.kind)}
    if step.target is not None:
        values["joints"] = step.target.tolist()
    for key in ("percent", "seconds", "on"):
        if (value := getattr(step, key)) is not None:
            values[key] = value
    return values


def _print_result(file: str, result: "CheckReport", notes: list[str]) -> None:
    from robots.programs.steps import ViolationKind
    from robots.programs.write import number

    errors = [each for each in result.violations if each.kind is ViolationKind.PROGRAM]
    for each in errors:
        print_line(f"{file}: line {each.line}: {each.text}")
    for group in _groups(each for each in result.violations if each.kind is not ViolationKind.PROGRAM):
        print_line(f"{file}: {_group_text(group)}")
    for note in notes:
        print_line(f"note: {note}")
    if errors:
        print_line(f"{file}: {len(errors)} error{'' if len(errors) == 1 else 's'} in the text")
        return
    count = len(result.violations)
    fine = "nothing wrong, but only the arm itself was checked" if result.alone else "nothing wrong"
    found = f"{count} violation{'' if count == 1 else 's'}" if count else fine
    print_line(f"{file}: {number(round(result.duration_s, 2))} s, {found}")
    print_line(f"assumed of the controller: {result.interpolation}")


def _groups(violations: Iterable["Violation"]) -> list[list["Violation"]]:
    """Group violations of one kind and pair on neighbouring lines: they have one cause."""
    groups: list[list[Violation]] = []
    newest: dict[tuple[Any, ...], list[Violation]] = {}
    for each in violations:
        # A violation without a pair is identified by its text.
        key = (each.kind, each.pair or each.text, each.refuses)
        group = newest.get(key)
        if group is None or abs(each.line - group[-1].line) > 1:
            groups.append(group := [])
            newest[key] = group
        group.append(each)
    return groups


def _group_text(group: Sequence["Violation"]) -> str:
    """Describe a group: lines, times, and its worst violation."""
    lowest, highest = min(each.line for each in group), max(each.line for each in group)
    begin, until = group[0].time_s, max(each.until_s for each in group)
    where = f"lines {lowest} to {highest}" if highest > lowest else f"line {lowest}"
    when = f"{begin:.2f} to {until:.2f} s" if until > begin else f"{begin:.2f} s"
    worst = min(group, key=lambda each: 0.0 if each.distance_m is None else each.distance_m)
    often = (
        f" ({len(group)} times{', this is the nearest' if worst.distance_m else ''})"
        if len(group) > 1
        else ""
    )
    warning = "" if worst.refuses else " (a warning)"
    # The text of a violation at the start (line 0) says so.
    placed = f"{where}, {when}: " if highest else ""
    return f"{placed}{worst.kind}: {worst.text}{often}{warning}"
