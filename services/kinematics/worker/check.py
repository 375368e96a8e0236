"""Answers to program-check requests: pure functions."""

from collections.abc import Mapping

import numpy as np

from robomesh.contract.messages import reason_message
from robomesh.schemas import robomesh_pb2 as schema
from robots.checks.check import check_program
from robots.collision import Cell
from robots.kinematics.inverse import InverseSolver
from robots.kinematics.joints import FloatArray
from robots.programs.steps import CheckReport, SampledPath


def check_answer(
    request: schema.CheckRequest,
    cell: Cell,
    robot: str,
    start: FloatArray,
    *,
    others: Mapping[str, FloatArray],
    solver: InverseSolver | None = None,
) -> schema.CheckAnswer:
    """Check the program and return the answer.

    Args:
        start: (n,) start positions of the robot [rad] or [m].
        others: (k, n) straight joint path of each other robot of the cell that counts; k = 1 if it rests.
        solver: Inverse solver of this arm; built unless given.

    Raises:
        JointCountError: If an array of positions does not have one value for each joint.
    """
    result = check_program(request.program, cell, robot, start, others=others, solver=solver)
    return answer_of(result, path=request.path)


def answer_of(result: CheckReport, *, path: bool) -> schema.CheckAnswer:
    """Return a check's result as a message.

    Args:
        path: Include the sampled motion.
    """
    answer = schema.CheckAnswer(
        ok=result.ok,
        duration_s=result.duration_s,
        interpolation=result.interpolation.text,
        interpolation_reason=reason_message(result.interpolation),
        notes=[note.text for note in result.notes],
        note_reasons=[reason_message(note) for note in result.notes],
        alone=result.alone,
    )
    for each in result.violations:
        violation = answer.violations.add(
            line=each.line,
            time_s=each.time_s,
            until_s=each.until_s,
            kind=str(each.kind),
            pair=each.pair,
            text=each.text,
            reason=reason_message(each.reason),
            distance=each.distance_m,
            refuses=each.refuses,
        )
        for x, y, z in each.points.tolist():
            violation.points.add(x=x, y=y, z=z)
    if path:
        answer.path.CopyFrom(_path(result.path))
    return answer


def _path(path: SampledPath) -> schema.CheckAnswer.Path:
    has_clearances = np.isfinite(path.clearances).all()
    return schema.CheckAnswer.Path(
        times_s=path.times_s,
        joint_positions=path.joint_positions.ravel(),
        tool_positions=path.tool_positions.ravel(),
        clearances=path.clearances if has_clearances else (),
        lines=path.lines,
    )
