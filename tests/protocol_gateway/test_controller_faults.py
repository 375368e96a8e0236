"""Controllers in local mode, with a fault, that move by themselves or ignore a stop."""

from robomesh.schemas import robomesh_pb2 as schema
from tests.protocol_gateway.faulty_site import faulty_site
from tests.protocol_gateway.gateway_site import STATE, A, C, refusal, until

FAR = [2.4, 0.2, -0.2, 0.1, 0.5]


async def test_jumping_joints_of_an_idle_controller_are_uncommanded_motion(mesh, tmp_path):
    async with faulty_site(mesh, tmp_path, demo=False) as (site, fault):
        await site.home()
        await until(lambda: not site.seen["lease"][-1].motion)
        await until(lambda: site.seen["lease"][-1].holder == "li")
        assert site.controller.activity == STATE.IDLE
        await fault("jump")
        await until(lambda: site.events("motion.foreign"))
        await until(lambda: not site.seen["lease"][-1].holder)


async def test_in_local_mode_motion_is_refused_until_it_is_remote_again(mesh, tmp_path):
    async with faulty_site(mesh, tmp_path, demo=False) as (site, fault):
        await fault("local")
        await until(lambda: site.controller.mode == STATE.LOCAL)
        await until(lambda: site.events("controller.local"))
        await site.lease(A.ACQUIRE)
        assert "local mode: switch it to remote" in await refusal(site.command(C.HOME))
        assert site.controller.counters.units_sent == 0
        await fault("local", off=True)
        await until(lambda: site.controller.mode == STATE.REMOTE)
        await until(lambda: site.events("controller.remote"))
        await site.lease(A.RENEW)
        await site.command(C.HOME)
        await until(lambda: site.controller.homed == STATE.YES)


async def test_a_fault_is_reported_and_cleared_by_reset(mesh, tmp_path):
    async with faulty_site(mesh, tmp_path, demo=False) as (site, fault):
        await site.home()
        await fault("fault")
        await until(lambda: site.controller.activity == STATE.FAULT)
        await until(lambda: "overheated" in site.controller.fault)
        await until(lambda: site.events("controller.fault"))
        assert "overheated" in (await site.event("controller.fault", -1)).text
        await site.lease(A.RENEW)
        assert "overheated" in await refusal(site.command(C.MOVE_ABSOLUTE, joint_positions=FAR))
        await site.command(C.RESET)
        await until(lambda: site.controller.activity == STATE.IDLE)
        assert not site.controller.fault
        await site.command(C.MOVE_ABSOLUTE, joint_positions=FAR)


async def test_an_ignored_stop_is_a_critical_event_and_is_repeated(mesh, tmp_path):
    async with faulty_site(mesh, tmp_path) as (site, fault):
        await until(lambda: site.controller.activity == STATE.MOVING)
        await fault("deaf")
        await site.stop(by="wang")
        await until(lambda: site.events("stop.disobeyed"))
        assert (await site.event("stop.disobeyed", 0)).severity == schema.Event.CRITICAL
        assert site.controller.activity == STATE.MOVING
        await fault("deaf", off=True)
        # The gateway repeated the stop.
        await until(lambda: site.controller.activity == STATE.STOPPED)
