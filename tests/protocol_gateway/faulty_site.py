"""A robot with a simulated controller that misbehaves on request."""

import contextlib

from controllers.simulated.fault_requests import Mesh
from robomesh.schemas import robomesh_pb2 as schema
from tests.patience import PATIENCE_S
from tests.protocol_gateway.gateway_site import PROMPT, gateway, simulator


@contextlib.asynccontextmanager
async def faulty_site(mesh, folder, *more_ports, demo=True, **robot):
    """Run a gateway site; yield it and the coroutine function `fault(name, off=False)`."""
    own = Mesh(site="hall", robot="arm", session=mesh)
    simulated = simulator(demo=demo, mesh=own)
    async with simulated as port, gateway(mesh, folder, port, *more_ports, **PROMPT | robot) as site:

        async def fault(name, *, off=False):
            request = schema.FaultRequest(fault=name, off=off)
            return await site.session.ask(site.key("simulator/fault"), request, timeout_s=PATIENCE_S)

        yield site, fault
