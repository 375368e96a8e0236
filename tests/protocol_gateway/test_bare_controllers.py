"""Controllers that tell little, or nothing that is known, or have no proven stop."""

from tests.conftest import run
from tests.protocol_gateway.bare import bare_controller, repeated
from tests.protocol_gateway.hall import STATE, A, C, gateway, refusal, simulator, until


def test_a_controller_that_tells_only_positions_is_commanded_only_if_the_site_file_accepts_that(
    mesh, tmp_path
):
    async def main():
        async with (
            bare_controller() as (port, say, heard),
            repeated(say, lambda: "1#ABSOLUTE.DEG*1;90;-90;0;0@"),
        ):
            async with gateway(mesh, tmp_path, port) as plant:
                await plant.lease(A.ACQUIRE, ttl_s=5)
                assert 'accept_unknown = ["mode"]' in await refusal(plant.command(C.HOME))
                await plant.command(C.HOLD)
                assert plant.controller.homed == STATE.UNKNOWN
            async with gateway(mesh, tmp_path, port, accept_unknown=frozenset({"mode"})) as plant:
                await plant.lease(A.ACQUIRE, ttl_s=5)
                where = [0, 1.5, -1.5, 0, 0]
                text = await refusal(plant.command(C.MOVE_ABSOLUTE, joint_positions=where))
                assert 'accept_unknown = ["homed"]' in text
                await plant.command(C.HOME)
            both = frozenset({"mode", "homed"})
            async with gateway(mesh, tmp_path, port, accept_unknown=both) as plant:
                await plant.lease(A.ACQUIRE, ttl_s=5)
                assert "stop 1 is latched" in await refusal(plant.command(C.HOME))
                await plant.command(C.RESET, stop_id=1)
                await plant.command(C.MOVE_ABSOLUTE, joint_positions=where)
                await until(lambda: b"ABSOLUTE.DEG*0.00;85.94" in heard)

    run(main())


def test_records_of_unknown_types_come_out_raw(mesh, tmp_path):
    async def main():
        async with bare_controller() as (port, say, _), gateway(mesh, tmp_path, port, up=False) as plant:
            await until(lambda: plant.controller.link == STATE.SILENT)
            say("2#TEMPERATURE*41.5;ok&4711*1@")
            await until(lambda: len(plant.seen["raw"]) >= 2)
            first, second = plant.seen["raw"]
            assert (first.type, list(first.items)) == ("TEMPERATURE", ["41.5", "ok"])
            assert (second.type, list(second.items)) == ("4711", ["1"])

    run(main())


def test_a_controller_without_a_proven_stop_is_read_only(mesh, tmp_path):
    async def main():
        async with simulator(demo=True) as port, gateway(mesh, tmp_path, port, stop_proven=False) as plant:
            assert plant.controller.read_only
            assert "read-only: its stop is not proven: try the stop unit" in plant.controller.link_text
            assert "then write stop_proven = true" in await refusal(plant.lease(A.ACQUIRE))
            assert "then write stop_proven = true" in (await plant.event("robot.read_only", 0)).text
            stop = await plant.stop()
            assert not stop.sent
            assert "stop it at its own panel" in stop.text
            # Nothing is latched that nobody could ever clear, and nobody reads "stopped".
            assert not plant.controller.HasField("stop")
            assert plant.controller.counters.units_sent == 0

    run(main())


def test_a_controller_of_codes_without_one_for_stop_is_read_only_whatever_is_said_to_be_proven(
    mesh, tmp_path
):
    codes = {2: "ABSOLUTE.DEG", 101: "COMMAND:home"}

    async def main():
        coded = simulator(demo=True, codes=codes)
        async with coded as port, gateway(mesh, tmp_path, port, codes=codes) as plant:
            assert plant.controller.read_only
            assert 'add the code of "COMMAND:stop"' in await refusal(plant.lease(A.ACQUIRE))
            assert not (await plant.stop()).sent
            assert plant.controller.counters.units_sent == 0

    run(main())


def test_positions_that_come_no_more_are_not_taken_for_where_the_robot_is(mesh, tmp_path):
    async def main():
        positions = "ABSOLUTE.DEG*1;2;3;4;5&"

        def state():
            return f"{2 if positions else 1}#{positions}STATUS*idle;remote;homed@"

        async with (
            bare_controller() as (port, say, _),
            repeated(say, state),
            gateway(mesh, tmp_path, port) as plant,
        ):
            await plant.lease(A.ACQUIRE, ttl_s=5)
            positions = ""
            await until(lambda: plant.events("joints.gone"))
            await until(lambda: "joint positions have not come for 1 s" in plant.controller.link_text)
            assert plant.controller.link == STATE.UP
            text = await refusal(plant.command(C.MOVE_RELATIVE, joint_positions=[0.1] * 5))
            assert "where the robot is now is not known" in text
            positions = "ABSOLUTE.DEG*1;2;3;4;5&"
            await until(lambda: "positions" not in plant.controller.link_text)
            await plant.lease(A.RENEW, ttl_s=5)
            await plant.command(C.MOVE_RELATIVE, joint_positions=[0.1] * 5)

    run(main())
