"""Controllers that report little, or only unknown records, or have no proven stop."""

from robomesh.schemas import robomesh_pb2 as schema
from tests.protocol_gateway.gateway_site import (
    PROMPT,
    STATE,
    A,
    C,
    gateway,
    measured,
    refusal,
    simulator,
    until,
)
from tests.protocol_gateway.scripted_controller import repeated, scripted_controller


async def test_a_controller_with_positions_only_is_commanded_if_the_site_file_accepts_it(mesh, tmp_path):
    async with (
        scripted_controller() as (port, say, heard),
        repeated(say, lambda: "1#ABSOLUTE.DEG*1;90;-90;0;0@"),
    ):
        async with gateway(mesh, tmp_path, port) as site:
            await site.lease(A.ACQUIRE)
            assert 'accept_unknown = ["mode"]' in await refusal(site.command(C.HOME))
            await site.command(C.HOLD)
            assert site.controller.homed == STATE.UNKNOWN
        async with gateway(mesh, tmp_path, port, accept_unknown=frozenset({"mode"})) as site:
            await site.lease(A.ACQUIRE)
            where = [0, 1.5, -1.5, 0, 0]
            text = await refusal(site.command(C.MOVE_ABSOLUTE, joint_positions=where))
            assert 'accept_unknown = ["homed"]' in text
            await site.command(C.HOME)
        both = frozenset({"mode", "homed"})
        async with gateway(mesh, tmp_path, port, accept_unknown=both) as site:
            await site.lease(A.ACQUIRE)
            assert "stop 1 is latched" in await refusal(site.command(C.HOME))
            await site.command(C.RESET, stop_id=1)
            await site.command(C.MOVE_ABSOLUTE, joint_positions=where)
            await until(lambda: b"ABSOLUTE.DEG*0.00;85.94" in heard)


async def test_records_of_unknown_types_are_published_raw(mesh, tmp_path):
    async with (
        scripted_controller() as (port, say, _),
        gateway(mesh, tmp_path, port, up=False, **PROMPT) as site,
    ):
        await until(lambda: site.controller.link == STATE.SILENT)
        say("2#TEMPERATURE*41.5;ok&4711*1@")
        await until(lambda: len(site.seen["raw"]) >= 2)
        first, second = site.seen["raw"]
        assert (first.type, list(first.items)) == ("TEMPERATURE", ["41.5", "ok"])
        assert (second.type, list(second.items)) == ("4711", ["1"])


async def test_a_controller_without_a_proven_stop_is_read_only(mesh, tmp_path):
    async with simulator(demo=True) as port, gateway(mesh, tmp_path, port, stop_proven=False) as site:
        assert site.controller.read_only
        assert "read-only: its stop is not proven: test the stop unit" in site.controller.link_text
        assert "then set stop_proven = true" in await refusal(site.lease(A.ACQUIRE))
        assert "then set stop_proven = true" in (await site.event("robot.read_only", 0)).text
        stop = await site.stop()
        assert not stop.sent
        assert "stop it at its own panel" in stop.text
        # No stop is latched, because it could never be reset, and none is shown.
        assert not site.controller.HasField("stop")
        assert site.controller.counters.units_sent == 0
        assert site.controller.capabilities.stops == schema.Capabilities.NONE
        assert not site.controller.capabilities.commands


async def test_a_controller_without_a_code_for_stop_is_read_only(mesh, tmp_path):
    codes = {2: "ABSOLUTE.DEG", 101: "COMMAND:home"}
    coded = simulator(demo=True, codes=codes)
    async with coded as port, gateway(mesh, tmp_path, port, codes=codes) as site:
        assert site.controller.read_only
        assert 'add the code of "COMMAND:stop"' in await refusal(site.lease(A.ACQUIRE))
        assert not (await site.stop()).sent
        assert site.controller.counters.units_sent == 0


async def test_stale_positions_are_not_used(mesh, tmp_path):
    positions = "ABSOLUTE.DEG*1;2;3;4;5&"

    def state():
        return f"{2 if positions else 1}#{positions}STATUS*idle;remote;homed@"

    async with (
        scripted_controller() as (port, say, _),
        repeated(say, state),
        gateway(mesh, tmp_path, port, **PROMPT) as site,
    ):
        await site.lease(A.ACQUIRE)
        await until(lambda: measured(site, "joints_stale") == {"arm": 0.0})
        positions = ""
        await until(lambda: site.events("joints.gone"))
        assert measured(site, "joints_stale") == {"arm": 1.0}
        await until(lambda: "no joint positions for 1 s" in site.controller.link_text)
        assert site.controller.link == STATE.UP
        text = await refusal(site.command(C.MOVE_RELATIVE, joint_positions=[0.1] * 5))
        assert "the robot's position is unknown" in text
        positions = "ABSOLUTE.DEG*1;2;3;4;5&"
        await until(lambda: "positions" not in site.controller.link_text)
        await site.lease(A.RENEW)
        await site.command(C.MOVE_RELATIVE, joint_positions=[0.1] * 5)
