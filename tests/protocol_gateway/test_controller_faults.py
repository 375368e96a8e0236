"""Controllers in local mode, with a fault, that move by themselves or ignore a stop."""

from robomesh.schemas import robomesh_pb2 as schema
from tests.conftest import run
from tests.protocol_gateway.faulty import faulty
from tests.protocol_gateway.hall import STATE, A, C, refusal, until

FAR = [2.4, 0.2, -0.2, 0.1, 0.5]


def test_joints_that_leap_although_their_controller_says_that_it_rests_are_foreign_motion(mesh, tmp_path):
    async def main():
        async with faulty(mesh, tmp_path, demo=False) as (plant, fault):
            await plant.home()
            await until(lambda: not plant.seen["lease"][-1].motion)
            await until(lambda: plant.seen["lease"][-1].holder == "li")
            assert plant.controller.activity == STATE.IDLE
            await fault("jump")
            await until(lambda: plant.events("motion.foreign"))
            await until(lambda: not plant.seen["lease"][-1].holder)

    run(main())


def test_in_local_mode_motion_is_refused_until_it_is_remote_again(mesh, tmp_path):
    async def main():
        async with faulty(mesh, tmp_path, demo=False) as (plant, fault):
            await fault("local")
            await until(lambda: plant.controller.mode == STATE.LOCAL)
            await until(lambda: plant.events("controller.local"))
            await plant.lease(A.ACQUIRE, ttl_s=5)
            assert "local mode: switch it to remote" in await refusal(plant.command(C.HOME))
            assert plant.controller.counters.units_sent == 0
            await fault("local", off=True)
            await until(lambda: plant.controller.mode == STATE.REMOTE)
            await until(lambda: plant.events("controller.remote"))
            await plant.lease(A.RENEW, ttl_s=5)
            await plant.command(C.HOME)
            await until(lambda: plant.controller.homed == STATE.YES)

    run(main())


def test_a_controller_with_a_fault_tells_it_and_moves_again_after_its_reset(mesh, tmp_path):
    async def main():
        async with faulty(mesh, tmp_path, demo=False) as (plant, fault):
            await plant.home()
            await fault("fault")
            await until(lambda: plant.controller.activity == STATE.FAULT)
            await until(lambda: "overheated" in plant.controller.fault)
            await until(lambda: plant.events("controller.fault"))
            assert "overheated" in (await plant.event("controller.fault", -1)).text
            await plant.lease(A.RENEW, ttl_s=5)
            assert "overheated" in await refusal(plant.command(C.MOVE_ABSOLUTE, joint_positions=FAR))
            await plant.command(C.RESET)
            await until(lambda: plant.controller.activity == STATE.IDLE)
            assert not plant.controller.fault
            await plant.command(C.MOVE_ABSOLUTE, joint_positions=FAR)

    run(main())


def test_a_controller_that_ignores_a_stop_is_a_critical_event_and_heeds_it_when_it_can_again(mesh, tmp_path):
    async def main():
        async with faulty(mesh, tmp_path) as (plant, fault):
            await until(lambda: plant.controller.activity == STATE.MOVING)
            await fault("deaf")
            await plant.stop(by="wang")
            await until(lambda: plant.events("stop.disobeyed"))
            assert (await plant.event("stop.disobeyed", 0)).severity == schema.Event.CRITICAL
            assert plant.controller.activity == STATE.MOVING
            await fault("deaf", off=True)
            # The gateway has gone on sending it.
            await until(lambda: plant.controller.activity == STATE.STOPPED)

    run(main())
