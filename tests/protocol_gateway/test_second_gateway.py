"""A second gateway of the same site for the same robot, with the same rights."""

import asyncio

from protocol_gateway.audit.log import read_entries
from protocol_gateway.authority.audit_entry import Outcome
from robomesh.errors import RefusedError
from robomesh.schemas import robomesh_pb2 as schema
from tests.conftest import run
from tests.protocol_gateway.gateway_site import STATE, A, C, gateway, moving, simulator, until


async def twice(site):
    """Wait until both gateways refuse control; the request lacks a reason, so that none grants it before."""
    request = schema.LeaseRequest(action=A.TAKE)
    while True:
        answers = await site.session.ask_all(site.key("lease/request/wang"), request)
        if len([each for each in answers if "also serves robot arm" in (each.error or "")]) == 2:
            return
        await asyncio.sleep(0.02)


async def test_two_gateways_of_one_robot_begin_no_motion_and_both_stop(mesh, tmp_path):
    async with simulator() as port, gateway(mesh, tmp_path / "first", port) as site:
        site.own.declare_presence("hall", "arm", "gateway")  # the service does the same at its start
        await site.home()
        await site.command(C.SPEED, speed_percent=2)
        await site.command(C.MOVE_ABSOLUTE, joint_positions=[1, 0, 0, 0, 0])
        await moving(site)
        begun = len([each for each in read_entries(site.audit) if each.request == "MOVE_ABSOLUTE"])
        async with gateway(mesh, tmp_path / "second", port) as second:
            second.own.declare_presence("hall", "arm", "gateway")
            await twice(site)
            renewal = schema.LeaseRequest(action=A.RENEW, lease=site.secret, ttl_s=5)
            await site.session.ask_all(site.key("lease/request/li"), renewal)
            away = schema.CommandRequest(lease=site.secret, id=99, command=C.MOVE_ABSOLUTE)
            away.joint_positions.extend([-1, 0, 0, 0, 0])
            answers = await site.session.ask_all(site.key("command/li"), away)
            refusals = sorted(each.error for each in answers)
            assert refusals[0].startswith("Not sent: another gateway")
            assert refusals[1].startswith("Not sent: no operator is in control")
            answers = await site.session.ask_all(site.key("stop"), schema.StopRequest(by="wang"))
            assert [each.message.sent for each in answers] == [True, True]
            await until(lambda: site.controller.activity == STATE.STOPPED)
        for log in (site.audit, second.audit):
            done = [each for each in read_entries(log) if each.outcome is Outcome.ACCEPTED]
            moves = [each for each in done if each.request == "MOVE_ABSOLUTE"]
            assert len(moves) == (begun if log is site.audit else 0)
            assert "STOP" in {each.request for each in done}


def test_a_gateway_whose_twin_has_ended_gives_control_again(mesh, tmp_path):
    async def main():
        async with simulator() as port, gateway(mesh, tmp_path / "first", port) as site:
            site.own.declare_presence("hall", "arm", "gateway")
            async with gateway(mesh, tmp_path / "second", port) as second:
                second.own.declare_presence("hall", "arm", "gateway")
                await twice(site)
            await until(lambda: site.controller.link == STATE.UP)
            async with asyncio.timeout(30.0):
                while True:
                    try:
                        await site.home()
                        return
                    except RefusedError as error:
                        if error.code != "gateway.twice":
                            raise

    run(main())
