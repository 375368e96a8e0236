"""Requests about one arm: its meshes, forward at once, inverse and check from processes of their own."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from robomesh import reason_codes as codes
from robomesh.errors import RefusedError
from robomesh.quotas import Quota
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.server import Request
from robomesh.session import Session
from robomesh.worker import Worker, WorkerError
from robots.errors import RobotError
from robots.joints import FloatArray
from robots.model import RobotModel
from services.kinematics.cell_state import Place
from services.kinematics.states import forward_answer
from services.kinematics.worker_messages import CheckQuestion, InverseQuestion, Question

_INVERSE_S = 5.0
_CHECK_S = 30.0


@dataclass(frozen=True)
class Workers:
    """Two processes, because an answer while somebody types must not wait for a program's check."""

    inverse: Worker
    check: Worker

    async def close(self) -> None:
        """End both."""
        await self.inverse.close()
        await self.check.close()


def answer_about(
    session: Session,
    site: str,
    robot: str,
    *,
    model: RobotModel,
    meshes: Mapping[str, bytes],
    place: Place,
    workers: Workers,
    checks: Quota,
) -> None:
    """Answer what is asked about an arm from now on.

    Args:
        meshes: GLB bytes by the last part of their key.
        place: Of its cell.
        checks: Each asker's, of all arms together: one process answers them.
    """

    async def answer_mesh(request: Request) -> bytes:
        if request.chunk not in meshes:
            have = ", ".join(meshes) or "none"
            raise RefusedError(codes.MESH_UNKNOWN(name=request.chunk, robot=robot, meshes=have))
        return meshes[request.chunk]

    async def answer_forward(request: Request) -> schema.ForwardAnswer:
        asked = request.message
        assert isinstance(asked, schema.ForwardRequest)
        return forward_answer(model, _positions(model, "joint_positions", asked.joint_positions, robot))

    async def answer_inverse(request: Request) -> schema.InverseAnswer:
        asked = request.message
        assert isinstance(asked, schema.InverseRequest)
        question = InverseQuestion(robot, asked.SerializeToString())
        return schema.InverseAnswer.FromString(await _asked(workers.inverse, question, _INVERSE_S))

    async def answer_check(request: Request) -> schema.CheckAnswer:
        asked = request.message
        assert isinstance(asked, schema.CheckRequest)
        if asked.start:
            start = _positions(model, "start", asked.start, robot)
        elif (here := place.positions(robot)) is not None:
            start = here
        else:
            raise RefusedError(codes.CHECK_START_UNKNOWN(robot=robot))
        others, _ = place.others(robot)
        question = CheckQuestion(robot, asked.SerializeToString(), start, others)
        with checks.one(request.asker):
            return schema.CheckAnswer.FromString(await _asked(workers.check, question, _CHECK_S))

    session.answer(site, robot, "mesh/*", answer_mesh)
    session.answer(site, robot, "kinematics/forward", answer_forward)
    session.answer(site, robot, "kinematics/inverse", answer_inverse)
    session.answer(site, robot, "kinematics/check/*", answer_check)


def _positions(model: RobotModel, field: str, given: Sequence[float], robot: str) -> FloatArray:
    """(n,) joint positions of a request [rad] or [m].

    Raises:
        RefusedError: If there is not one a joint.
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


async def _asked(worker: Worker, question: Question, timeout_s: float) -> bytes:
    """A worker's answer, as its bytes.

    Raises:
        RefusedError: With its reason, or what became of it.
    """
    try:
        answer: bytes = await worker.ask(question, timeout_s=timeout_s)
        return answer
    except WorkerError as error:
        raise RefusedError(codes.WORKER_GAVE_UP(detail=error)) from None
    except RobotError as error:
        raise RefusedError(codes.INVALID(detail=error)) from None
