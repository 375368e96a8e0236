"""Stops of old client programs are executed even if the program is rejected or throttled."""

import asyncio
import contextlib

from protocol_gateway.unit_server.rate_limit import Limits
from tests.protocol_gateway.gateway_site import STATE, until
from tests.protocol_gateway.old_client import ME, Program, legacy, legacy_site, program

TIME, STOP = b"1#TIME*1@", b"1#COMMAND*stop@"


async def test_from_a_throttled_client_only_stops_are_executed(mesh, tmp_path):
    settings = legacy(limits=Limits(units_per_s=10.0, burst_s=20.0))
    async with legacy_site(mesh, tmp_path, settings) as site, program(settings) as one:
        number, text = await one.asks(TIME * 250)
        assert number == 9
        assert "10 units/s" in text
        # It exceeds its limits for 10 s or more.
        one.say(b"1#COMMAND*trace@", TIME * 250, STOP)
        await until(lambda: site.events("stop.latched"), timeout_s=30)
        await until(lambda: site.controller.stop.by == "li")
        assert site.controller.trace == STATE.NO
        await until(lambda: site.seen["lease"][-1].holder == "")


async def test_a_throttled_client_recovers(mesh, tmp_path):
    settings = legacy(limits=Limits(units_per_s=200.0, burst_s=0.5))
    async with legacy_site(mesh, tmp_path, settings) as site, program(settings) as one:
        assert (await one.asks(TIME * 110))[0] == 9

        def traced():
            one.say(b"1#COMMAND*trace@")
            return site.controller.trace == STATE.YES

        await until(traced)


async def test_a_stop_after_a_flood_is_executed(mesh, tmp_path):
    settings = legacy(commanders={}, limits=Limits(burst_s=0.1, patience_s=0.0))
    async with legacy_site(mesh, tmp_path, settings) as site, program(settings) as one:
        one.say(TIME * 1500, STOP)
        await until(lambda: site.events("stop.latched"))
        await until(lambda: site.controller.stop.by == f"legacy {ME}")
        await until(lambda: site.controller.legacy_clients.closed == 1)
        await until(lambda: one.ended)


async def test_a_stop_of_a_rejected_client_is_executed(mesh, tmp_path):
    settings = legacy(commanders={}, most=1)
    async with legacy_site(mesh, tmp_path, settings) as site, program(settings):
        await until(lambda: site.controller.legacy_clients.attached == 1)
        async with program(settings) as second:
            second.say(b"2#ABSOLUTE.DEG*1;2;3;4;5&COMMAND*stop@")
            await until(lambda: site.events("stop.latched"))
            await until(lambda: second.ended)
            assert second.bytes == b"1#ERROR*1;too many clients@"


async def test_a_stop_code_of_a_rejected_client_is_executed(mesh, tmp_path):
    codes = {2: "ABSOLUTE.DEG", 5: "STATUS", 102: "COMMAND:stop"}
    simulated, settings = {"codes": codes}, legacy(commanders={}, most=1)
    async with (
        legacy_site(mesh, tmp_path, settings, simulated=simulated, codes=codes) as site,
        program(settings),
    ):
        await until(lambda: site.controller.legacy_clients.attached == 1)
        async with program(settings) as second:
            second.say(b"1#0102@")
            await until(lambda: site.events("stop.latched"))


@contextlib.asynccontextmanager
async def program_from(address, settings):
    one = Program(*await asyncio.open_connection(ME, settings.port, local_addr=(address, 0)))
    try:
        yield one
    finally:
        await one.close()


async def test_readers_leave_a_place_for_the_first_commander(mesh, tmp_path):
    settings = legacy(commanders={"127.0.0.2": "li"}, most=2)
    async with legacy_site(mesh, tmp_path, settings) as site, program(settings) as reader:
        await until(lambda: reader.positions)
        async with program(settings) as second:
            await until(lambda: second.ended)
            assert [error.number for error in second.errors] == [1]
        async with program_from("127.0.0.2", settings) as commander:
            commander.say(b"1#COMMAND*trace@")
            await until(lambda: site.controller.trace == STATE.YES)
