"""Handler of the request `robomesh/<site>/<robot>/simulator/fault`, which begins and ends faults."""

import asyncio
import time
from dataclasses import dataclass

from controllers.simulated.errors import FaultError
from controllers.simulated.faults import Faults
from robomesh import reason_codes as codes
from robomesh.contract.topics import Role
from robomesh.errors import RefusedError
from robomesh.requests.server import Request
from robomesh.schemas.robomesh_pb2 import FaultAnswer, FaultRequest
from robomesh.service.health import Served, present
from robomesh.wire.session import SessionSettings, open_session


@dataclass(frozen=True, kw_only=True)
class Mesh:
    """Robot name and session settings of the simulator on the mesh."""

    site: str
    robot: str
    session: SessionSettings


async def answer_requests(mesh: Mesh, faults: Faults) -> None:
    """Answer requests until cancelled; wait for the router if there is none yet."""

    async def answer(request: Request) -> FaultAnswer:
        message = request.message
        assert isinstance(message, FaultRequest)
        now_s = time.monotonic()
        try:
            if message.off:
                faults.end(message.fault)
            elif message.fault:
                faults.begin(message.fault, now_s)
        except FaultError as error:
            raise RefusedError(codes.INVALID(error.reason)) from None
        return FaultAnswer(active=sorted(faults.active(now_s)), known=list(faults.known))

    served = Served(service=Role.SIMULATOR.value, present_for=((mesh.site, mesh.robot),))
    async with open_session(mesh.session) as session, present(session, served):
        session.answer(mesh.site, mesh.robot, "simulator/fault", answer)
        await asyncio.Event().wait()
