"""Answers to inverse-kinematics requests: a pure function."""

from robomesh import reason_codes as codes
from robomesh.contract.messages import reason_message
from robomesh.errors import RefusedError
from robomesh.schemas import robomesh_pb2 as schema
from robots.kinematics.inverse import InverseSolver, Task, solve
from robots.schema.errors import JointCountError, PoseError

_TASKS = {
    schema.InverseRequest.POSE_6D: Task.POSE_6D,
    schema.InverseRequest.POSITION_AND_AXIS_5D: Task.POSITION_AND_AXIS_5D,
}


def inverse_answer(solver: InverseSolver, request: schema.InverseRequest) -> schema.InverseAnswer:
    """Return the solutions, or the reason why there is none.

    Raises:
        RefusedError: If a field of the request is invalid; the text names the field.
    """
    task = _TASKS.get(request.task)
    if task is None:
        raise RefusedError(codes.INVERSE_TASK(task=request.task))
    try:
        result = solve(
            solver,
            list(request.pose),
            task=task,
            near=list(request.near) or None,
            all_solutions=request.all_solutions,
            seed=request.seed,
        )
    except PoseError as error:
        raise RefusedError(codes.INVERSE_POSE(error.reason)) from None
    except JointCountError as error:
        raise RefusedError(codes.INVERSE_NEAR(error.reason)) from None
    answer = schema.InverseAnswer(
        residual_m=result.residual_m,
        residual_rad=result.residual_rad,
        analytic=result.analytic,
    )
    if result.reason is not None:
        answer.reason = result.reason.text
        answer.cause.CopyFrom(reason_message(result.reason))
    for positions in result.solutions.tolist():
        answer.solutions.add(joint_positions=positions)
    return answer
