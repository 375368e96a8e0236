"""The gateway's worker process: answers the queries of `worker_messages` with the checks of `robots`."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from protocol_gateway.checking.worker_messages import (
    Cells,
    Checked,
    CheckMotion,
    CheckProgram,
    Extended,
    ExtendJog,
    Positions,
    Prepare,
    Prepared,
    ReplaceCells,
)
from robomesh import reason_codes as codes
from robomesh.files.worker import answer_all
from robomesh.reasons import Reason
from robots.checks.check import check_plan, check_program
from robots.checks.jog import next_part
from robots.collision import Cell, build_cell, missing_shapes, pending, unshaped, unshaped_moving
from robots.kinematics.inverse import InverseSolver, build_solver
from robots.kinematics.joints import FloatArray, doubtful_limits
from robots.programs.steps import CheckReport, Step, StepKind, Violation, ViolationKind

# A program with these violations is not planned to its end, so it must not run.
_UNREADABLE = (ViolationKind.PROGRAM, ViolationKind.UNREACHABLE)


def begin(cells: Cells) -> Callable[[Any], Any]:
    """Return the function that answers queries; robots of one cell share a prepared cell."""
    ready: dict[tuple[str, ...], Cell] = {}
    solvers: dict[str, InverseSolver] = {}

    def cell_of(robot: str) -> Cell:
        names = tuple(each.name for each in cells[robot].robots)
        if names not in ready:
            # Processing of links takes up to minutes, in other processes.
            cell = build_cell(cells[robot], wait=False)
            if pending(cell):
                return cell
            ready[names] = cell
        return ready[names]

    def extended(question: ExtendJog, cell: Cell) -> Extended:
        robot = question.robot
        if robot not in solvers:
            solvers[robot] = build_solver(cell.arms[robot].description)
        part = next_part(
            cell,
            robot,
            solvers[robot],
            question.jog,
            origin=np.array(question.origin),
            measured=np.array(question.measured),
            last=np.array(question.last),
            commanded=question.commanded,
            others=_paths(question.others),
            collisions=question.collisions,
            more=question.more,
        )
        uncovered, warnings = _coverage(cell, robot) if question.collisions else ([], [])
        return Extended(
            target=None if part.target is None else tuple(part.target.tolist()),
            commanded=part.commanded,
            moved=part.moved,
            percent=part.percent,
            end=part.end,
            uncovered=tuple(uncovered),
            warnings=(*(_reason(each) for each in part.violations), *warnings),
        )

    def answer(
        question: ReplaceCells | Prepare | CheckMotion | CheckProgram | ExtendJog,
    ) -> Prepared | Checked | Extended | None:
        if isinstance(question, ReplaceCells):
            cells.update(question.cells)
            ready.clear()
            return None
        cell = cell_of(question.robot)
        match question:
            case ExtendJog():
                return extended(question, cell)
            case Prepare(robot):
                return Prepared(pending=bool(pending(cell)), problem=_uncheckable(cell, robot))
            case CheckMotion():
                steps = [
                    Step(line=0, kind=StepKind.MOVE, target=np.array(target)) for target in question.targets
                ]
                start, others = np.array(question.start), _paths(question.others)
                result = check_plan(cell, question.robot, start, steps, others=others, far=False)
                return _checked(cell, question.robot, result)
            case CheckProgram():
                start, others = np.array(question.start), _paths(question.others)
                result = check_program(question.text, cell, question.robot, start, others=others, far=False)
                return _checked(cell, question.robot, result)

    return answer


def _uncheckable(cell: Cell, robot: str) -> Reason | None:
    """Return why a robot's motions cannot be checked; None: they can."""
    links = cell.arms[robot].model.link_names
    if len(unshaped(cell, robot)) == len(links):
        return codes.CHECK_IMPOSSIBLE(codes.CHECK_NOTHING())
    return None


def _coverage(cell: Cell, robot: str) -> tuple[list[Reason], list[Reason]]:
    """Return what checks of a robot's motions do not cover: limits and moving parts, and fixed parts."""
    uncovered, warnings = [], []
    if reason := doubtful_limits(robot, cell.arms[robot].joints):
        uncovered.append(reason)
    for name, arm in cell.arms.items():
        bare, missing = unshaped(cell, name), missing_shapes(cell, name)
        moving = unshaped_moving(cell, name)
        if len(bare) == len(arm.model.link_names):
            uncovered.append(codes.NO_SHAPES(name=name))
        elif missing:
            uncovered.append(codes.MESH_MISSING(name=name, files=", ".join(missing)))
        elif moving:
            uncovered.append(codes.LINK_WITHOUT_SHAPE(name=name, links=", ".join(moving)))
        elif bare:
            warnings.append(codes.FIXED_WITHOUT_SHAPE(name=name, links=", ".join(bare)))
    return uncovered, warnings


def _paths(others: Mapping[str, tuple[Positions, ...]]) -> dict[str, FloatArray]:
    return {name: np.array(path) for name, path in others.items()}


def _checked(cell: Cell, robot: str, result: CheckReport) -> Checked:
    uncovered, warnings = _coverage(cell, robot)
    return Checked(
        refusals=tuple(_reason(each) for each in result.violations if each.refuses),
        uncovered=tuple(uncovered),
        warnings=(*(_reason(each) for each in result.violations if not each.refuses), *warnings),
        readable=not any(each.kind in _UNREADABLE for each in result.violations),
        steps=result.steps,
        durations_s=result.durations_s,
    )


def _reason(violation: Violation) -> Reason:
    if not violation.line:
        return violation.reason
    return codes.PROGRAM_LINE(violation.reason, line=violation.line)


if __name__ == "__main__":
    answer_all(begin)
