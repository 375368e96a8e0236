"""Requests without a lease, sent as fast as the mesh takes them."""

import asyncio

from protocol_gateway.audit.log import read_entries
from robomesh.contract.keys import Key
from robomesh.requests.requests import ask_all
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import open_session
from tests.protocol_gateway.gateway_site import STATE, A, C, gateway, simulator, until

FAR = [2.4, 0.2, -0.2, 0.1, 0.5]
ASKED = 1000  # gateway, controller and stranger are one process here


async def test_in_a_flood_of_requests_a_stop_works_and_all_are_counted(mesh, tmp_path):
    async with (
        simulator() as port,
        gateway(mesh, tmp_path, port) as site,
        open_session(mesh) as stranger,
    ):
        await site.home()
        await site.command(C.MOVE_ABSOLUTE, joint_positions=FAR)
        await site.lease(A.RENEW)
        guess = schema.CommandRequest(lease="guess", id=1, command=C.HOME)
        flood = [
            asyncio.create_task(
                ask_all(
                    stranger.zenoh_session,
                    Key("hall", "arm", "command/eve"),
                    guess.SerializeToString(),
                    timeout_s=30.0,
                )
            )
            for _ in range(ASKED)
        ]
        await asyncio.wait(flood, return_when=asyncio.FIRST_COMPLETED)
        assert (await site.stop(by="wang")).sent
        await until(lambda: site.controller.activity == STATE.STOPPED)
        answers = await asyncio.gather(*flood)
        assert all(error is not None for [(_, _, error)] in answers)

        def entries():
            return [e for e in read_entries(site.audit) if e.operator == "eve" or e.request == "REQUESTS"]

        await until(lambda: sum(1 + entry.repeated for entry in entries()) == ASKED)
        assert len(entries()) < 100
