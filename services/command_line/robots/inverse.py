"""`robomesh ik`: joint positions that bring the tool to a pose."""

from collections.abc import Sequence
from math import degrees, isfinite, radians
from typing import Any

import numpy as np
import typer

from robomesh import bounded_json
from robots.descriptions.description import load
from robots.kinematics.inverse import InverseResult, InverseSolver, Task, build_solver, natural_task, solve
from robots.kinematics.joints import JointType
from robots.schema.errors import RobotError
from robots.schema.poses import rpy_rotation
from services.command_line.robots.kinematics import RequestError, request_lines
from services.command_line.terminal.output import print_json, print_line

_KEYS = {"pose", "task", "near", "all", "seed"}
_EXAMPLE = '{"pose": [[1, 0, 0, 0.3], ...], "task": "6d", "near": [...], "all": false, "seed": 0}'
_NUMBERS = "X Y Z in mm, and with ROLL PITCH YAW in degrees the tool's pose; or - for JSON requests"


def inverse(robot: str, words: Sequence[str], task: str, all_solutions: bool, as_json: bool) -> None:
    """Solve a pose in degrees and millimetres, or JSON lines in SI; exit status 1 without a solution."""
    asked = None if not task else _task(task)
    numbers = None if list(words) == ["-"] else _numbers(words)
    solver = build_solver(load(robot))
    if numbers is None:
        _answer_lines(solver, asked, all_solutions)
        return
    pose = np.eye(4)
    pose[:3, 3] = np.array(numbers[:3]) / 1000.0
    if len(numbers) == 6:
        pose[:3, :3] = rpy_rotation(*(radians(angle) for angle in numbers[3:]))
        asked = asked or natural_task(solver.chain.joints)
    elif asked not in (None, Task.POSITION_3D):
        raise RequestError(f"--task {asked} takes six numbers: X Y Z in mm, ROLL PITCH YAW in degrees")
    result = solve(solver, pose, task=asked or Task.POSITION_3D, all_solutions=all_solutions)
    if as_json:
        print_json(_values(result))
    else:
        _print_result(solver, result)
    if not len(result.solutions):
        raise typer.Exit(1)


def _numbers(words: Sequence[str]) -> list[float]:
    numbers = []
    for word in words:
        try:
            numbers.append(float(word))
        except ValueError:
            raise RequestError(f"{word!r} is no number; {_NUMBERS}") from None
        if not isfinite(numbers[-1]):
            raise RequestError(f"{word!r} is not a finite number")
    if len(numbers) not in (3, 6):
        raise RequestError(f"{len(numbers)} numbers; must be 3 or 6: {_NUMBERS}")
    return numbers


def _task(word: Any) -> Task:
    try:
        return Task(word)
    except ValueError:
        raise RequestError(f"task {word!r}: must be one of {', '.join(Task)}") from None


def _print_result(solver: InverseSolver, result: InverseResult) -> None:
    missed = f"{result.residual_m * 1000:.4f} mm and {degrees(result.residual_rad):.4f}°"
    if not len(result.solutions):
        print_line(f"no solution: {result.reason}")
        return
    how = "in closed form" if result.analytic else "found by search"
    count = len(result.solutions)
    print_line(f"{count} solution{'s' if count > 1 else ''} {how}, the tool within {missed}")
    joints = solver.chain.joints
    wide = [max(9, len(name)) for name in joints.names]
    print_line("  ".join(f"{name:>{width}}" for name, width in zip(joints.names, wide, strict=True)))
    for positions in result.solutions.tolist():
        cells = [
            f"{degrees(value):.2f}°" if kind is JointType.ROTARY else f"{value * 1000:.2f} mm"
            for value, kind in zip(positions, joints.types, strict=True)
        ]
        print_line("  ".join(f"{cell:>{width}}" for cell, width in zip(cells, wide, strict=True)))


def _answer_lines(solver: InverseSolver, task: Task | None, all_solutions: bool) -> None:
    failed = False
    for line in request_lines():
        try:
            result = _answer(solver, line, task, all_solutions)
        except (RobotError, RequestError) as error:
            failed = True
            print_json({"error": str(error)})
            continue
        failed = failed or not len(result.solutions)
        print_json(_values(result))
    if failed:
        raise typer.Exit(1)


def _values(result: InverseResult) -> dict[str, Any]:
    return {
        "solutions": result.solutions.tolist(),
        "residual_m": result.residual_m,
        "residual_rad": result.residual_rad,
        "reason": str(result.reason or ""),
        "analytic": result.analytic,
    }


def _is_number(value: object) -> bool:
    return type(value) is float or (type(value) is int and abs(value) < 2**64)


def _answer(solver: InverseSolver, line: str, task: Task | None, all_solutions: bool) -> InverseResult:
    try:
        request: dict[str, Any] = bounded_json.loads(line)
        unknown = sorted(set(request) - _KEYS) if isinstance(request, dict) else None
    except (ValueError, RecursionError):
        unknown = None
    if unknown is None or "pose" not in request:
        raise RequestError(f"{line[:200]!r} is no request; write one as in {_EXAMPLE}, in rad and m")
    if unknown:
        raise RequestError(f"{unknown[0]!r}: must be one of {', '.join(sorted(_KEYS))}")
    seed, near, every = request.get("seed", 0), request.get("near"), request.get("all", all_solutions)
    if type(seed) is not int or not 0 <= seed < 2**64:
        raise RequestError(f"seed {seed!r}: must be a whole number from 0 to {2**64 - 1}")
    if type(every) is not bool:
        raise RequestError(f"all {every!r}: must be true or false")
    if near is not None and not (isinstance(near, list) and all(map(_is_number, near))):
        raise RequestError(f"near {str(near)[:200]}: must be a number for each joint, in rad and m")
    asked = _task(request["task"]) if "task" in request else task or natural_task(solver.chain.joints)
    return solve(solver, request["pose"], task=asked, near=near, all_solutions=every, seed=seed)
