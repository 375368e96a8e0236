"""Request handlers of one arm: shapes and forward in-process, inverse and check in worker processes."""

import contextlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from robomesh import reason_codes as codes
from robomesh.contract.quotas import Quota
from robomesh.errors import RefusedError
from robomesh.files.worker import Worker, WorkerError
from robomesh.requests.server import Request
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import Session
from robots.descriptions.cells import CellDescription
from robots.kinematics.joints import FloatArray
from robots.kinematics.model import RobotModel
from robots.schema.errors import RobotError, reason_of
from services.kinematics.cell_state import CellState
from services.kinematics.states import forward_answer
from services.kinematics.worker.messages import CheckQuestion, InverseQuestion, Question, ReplaceCells

_INVERSE_S = 5.0
_CHECK_S = 30.0


@dataclass(frozen=True)
class Workers:
    """One worker process for inverse requests and one for checks.

    Separate, so that the inverse requests of an operator who is typing never wait for a program's check.

    Attributes:
        cells: Settings of both, by robot; a process that starts later gets the newest ones.
    """

    inverse: Worker
    check: Worker
    cells: dict[str, CellDescription]

    async def replace_cells(self, cells: Mapping[str, CellDescription]) -> None:
        """Answer checks from other cells from now on, by robot; inverse requests do not use them."""
        self.cells.update(cells)
        if self.check.pid is not None:
            with contextlib.suppress(WorkerError):  # the next process begins with the new cells
                await self.check.ask(ReplaceCells(dict(cells)), timeout_s=None)

    async def close(self) -> None:
        """Stop both worker processes."""
        await self.inverse.close()
        await self.check.close()


def answer_robot_requests(
    session: Session,
    site: str,
    robot: str,
    *,
    model: RobotModel,
    shapes: Callable[[], Mapping[str, bytes]],
    cell_state: CellState,
    workers: Workers,
    checks: Quota,
) -> None:
    """Register the request handlers of an arm.

    Args:
        shapes: Returns GLB bytes by the last chunk of their key.
        cell_state: Positions of the arms of its cell.
        checks: Check quota of each client, over all arms because one process serves them.
    """

    async def answer_shape(request: Request) -> bytes:
        glbs = shapes()
        if request.chunk not in glbs:
            available = ", ".join(glbs) or "none"
            raise RefusedError(codes.MESH_UNKNOWN(name=request.chunk, robot=robot, meshes=available))
        return glbs[request.chunk]

    async def answer_forward(request: Request) -> schema.ForwardAnswer:
        message = request.message
        assert isinstance(message, schema.ForwardRequest)
        positions = _checked_positions(model, "joint_positions", message.joint_positions, robot)
        return forward_answer(model, positions)

    async def answer_inverse(request: Request) -> schema.InverseAnswer:
        message = request.message
        assert isinstance(message, schema.InverseRequest)
        question = InverseQuestion(robot, message.SerializeToString())
        return schema.InverseAnswer.FromString(await _ask_worker(workers.inverse, question, _INVERSE_S))

    async def answer_check(request: Request) -> schema.CheckAnswer:
        message = request.message
        assert isinstance(message, schema.CheckRequest)
        if message.start:
            start = _checked_positions(model, "start", message.start, robot)
        elif (current := cell_state.positions(robot)) is not None:
            start = current
        else:
            raise RefusedError(codes.CHECK_START_UNKNOWN(robot=robot))
        others, _ = cell_state.others(robot)
        question = CheckQuestion(robot, message.SerializeToString(), start, others)
        with checks.in_progress(request.asker):
            return schema.CheckAnswer.FromString(await _ask_worker(workers.check, question, _CHECK_S))

    session.answer(site, robot, "mesh/*", answer_shape)
    session.answer(site, robot, "kinematics/forward", answer_forward)
    session.answer(site, robot, "kinematics/inverse", answer_inverse)
    session.answer(site, robot, "kinematics/check/*", answer_check)


def _checked_positions(model: RobotModel, field: str, given: Sequence[float], robot: str) -> FloatArray:
    """Return the (n,) joint positions of a request [rad] or [m].

    Raises:
        RefusedError: If there is not one value for each joint.
    """
    if len(given) != len(model.joints):
        raise RefusedError(
            codes.JOINT_COUNT_OF_FIELD(
                field=field,
                count=len(given),
                robot=robot,
                joints=len(model.joints),
                names=", ".join(model.joints.names),
            )
        )
    return np.array(given)


async def _ask_worker(worker: Worker, question: Question, timeout_s: float) -> bytes:
    """Return a worker's serialized answer.

    Raises:
        RefusedError: If the request is invalid, or the worker crashed or timed out.
    """
    try:
        answer: bytes = await worker.ask(question, timeout_s=timeout_s)
        return answer
    except WorkerError as error:
        raise RefusedError(codes.WORKER_GAVE_UP(error.reason)) from None
    except RobotError as error:
        raise RefusedError(codes.INVALID(reason_of(error))) from None
