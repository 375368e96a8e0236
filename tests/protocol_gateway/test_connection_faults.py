"""Connections that freeze, drop, are refused, or lose their host: state, event, recovery."""

from controllers.simulated.fault_requests import Mesh
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import SessionSettings
from tests.protocol_gateway.faulty_site import faulty_site
from tests.protocol_gateway.gateway_site import (
    LOOK_S,
    STATE,
    gateway,
    looks_until,
    refusal,
    simulator,
    until,
)


async def test_a_frozen_controller_is_silent_within_a_second_and_reconnected(mesh, tmp_path):
    async with faulty_site(mesh, tmp_path) as (site, fault):
        await fault("freeze")
        looks = await looks_until(lambda: site.controller.link == STATE.SILENT)
        # 1 s after the last unit.
        assert looks < 2.0 / LOOK_S
        # Before the first unit of a busy simulator there may be another one.
        await until(lambda: any("sends nothing" in each.text for each in site.events("link.silent")))
        joints = len(site.seen["joints"])
        await until(lambda: site.controller.link == STATE.DOWN)
        assert site.controller.capabilities.stops == schema.Capabilities.NOT_NOW
        assert "sends nothing; connecting again" in (await site.event("link.down", -1)).text
        assert len(site.seen["joints"]) == joints
        await fault("freeze", off=True)
        await until(lambda: site.controller.link == STATE.UP, timeout_s=40.0)


async def test_a_controller_that_drops_connections_is_reconnected(mesh, tmp_path):
    async with faulty_site(mesh, tmp_path) as (site, fault):
        await fault("drop")
        await until(lambda: site.controller.counters.connections >= 3, timeout_s=40.0)
        assert "the controller closed the connection" in (await site.event("link.down", -1)).text
        await fault("drop", off=True)
        await until(lambda: site.controller.link == STATE.UP, timeout_s=40.0)
        before = len(site.seen["joints"])
        await until(lambda: len(site.seen["joints"]) > before + 20)


async def test_a_controller_that_restarts_comes_back_and_is_not_taken_for_homed(mesh, tmp_path):
    async with faulty_site(mesh, tmp_path) as (site, fault):
        await until(lambda: site.controller.homed == STATE.YES)
        await fault("restart")
        await until(lambda: site.events("link.down"))
        await until(lambda: site.controller.link == STATE.UP and site.controller.homed == STATE.NO)
        assert site.controller.controller_time_s < 10.0


async def test_a_controller_that_refuses_connections_is_reported_with_its_text(mesh, tmp_path):
    async with faulty_site(mesh, tmp_path) as (site, fault):
        await fault("refuse")
        await until(lambda: "refused the connection: too many clients" in site.controller.link_text)
        assert site.controller.link == STATE.DOWN
        await until(lambda: site.events("link.down"))
        await fault("refuse", off=True)
        await until(lambda: site.controller.link == STATE.UP, timeout_s=40.0)


async def test_an_unknown_fault_is_refused_with_the_known_ones(mesh, tmp_path):
    async with faulty_site(mesh, tmp_path) as (site, fault):
        assert "'melt' is unknown; there are freeze, " in await refusal(fault("melt"))
        assert "both in seconds" in await refusal(fault("freeze@-1"))
        answer = await fault("split+60")
        assert list(answer.active) == ["split"]
        assert {"freeze", "garbage", "flood", "jump", "local"} < set(answer.known)
        assert list((await fault("split", off=True)).active) == []
        assert site.controller.link == STATE.UP


async def test_a_simulator_serves_without_a_router(mesh, tmp_path):
    nowhere = SessionSettings(connect=("tcp/127.0.0.1:9",))
    own = Mesh(site="hall", robot="arm", session=nowhere)
    async with simulator(mesh=own) as port, gateway(mesh, tmp_path, port) as site:
        assert site.controller.link == STATE.UP
