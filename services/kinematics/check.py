"""A program's check as an answer of the mesh: pure functions."""

from collections.abc import Mapping

import numpy as np

from robomesh.messages import reason_message
from robomesh.schemas import robomesh_pb2 as schema
from robots.collision import Cell
from robots.inverse import InverseSolver
from robots.joints import FloatArray
from robots.programs.check import check_program
from robots.programs.steps import CheckResult, SampledPath


def check_answer(
    request: schema.CheckRequest,
    cell: Cell,
    robot: str,
    start: FloatArray,
    *,
    others: Mapping[str, FloatArray],
    solver: InverseSolver | None = None,
) -> schema.CheckAnswer:
    """What a check of the program finds.

    Args:
        start: (n,) where the robot begins [rad] or [m].
        others: (k, n) straight joint path of each other robot of the cell that counts; k = 1: it stands.
        solver: Of this arm; built unless given.

    Raises:
        JointCountError: If some positions do not have one value a joint.
    """
    result = check_program(request.program, cell, robot, start, others=others, solver=solver)
    return answer_of(result, path=request.path)


def answer_of(result: CheckResult, *, path: bool) -> schema.CheckAnswer:
    """A result as a message.

    Args:
        path: Tell the sampled motion too.
    """
    answer = schema.CheckAnswer(
        ok=result.ok,
        duration_s=result.duration_s,
        interpolation=result.interpolation,
        notes=result.notes,
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
    around = np.isfinite(path.clearances).all()
    return schema.CheckAnswer.Path(
        times_s=path.times_s,
        joint_positions=path.joint_positions.ravel(),
        tool_positions=path.tool_positions.ravel(),
        clearances=path.clearances if around else (),
        lines=path.lines,
    )
