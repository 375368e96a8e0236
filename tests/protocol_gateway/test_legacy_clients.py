"""Old client programs on the gateway: the states that they read, and their commands. Nothing is a mock."""

import asyncio
import contextlib
from itertools import groupby

from tests.protocol_gateway.gateway_site import (
    LOOK_S,
    STATE,
    A,
    gateway,
    looks_until,
    refusal,
    simulator,
    until,
)
from tests.protocol_gateway.old_client import ME, legacy, legacy_site, program
from tests.serving import serving

PAPER = b"2# COMMAND* trace; home&ABSOLUTE.DEG* 100.00; 30.45; 92.66; - 67.10; - 25.85@"
SAMPLE = [100.00, 30.45, 92.66, -67.10, -25.85]


def degrees(site):
    return [joint.position * 57.29577951308232 for joint in site.seen["joints"][-1].joints]


async def test_old_programs_read_the_same_states_as_the_mesh(mesh, tmp_path):
    settings = legacy(commanders={})
    async with (
        legacy_site(mesh, tmp_path, settings, simulated={"demo": True}) as site,
        program(settings) as one,
        program(settings) as two,
    ):
        await until(lambda: len(one.positions) > 100 and len(two.positions) > 100)
        published = [
            tuple(round(joint.position * 57.29577951308232, 6) for joint in message.joints)
            for message in site.seen["joints"]
        ]
        # On a busy machine either reader may leave some out, also of the equal ones of an arm at rest.
        both = {*published} & {*one.positions}
        assert len(both) > 50

        def changes(positions):
            return [each for each, _ in groupby(each for each in positions if each in both)]

        assert changes(one.positions) == changes(published)
        assert set(one.bytes[:2000].split(b"@")[1:-1]) & set(two.bytes.split(b"@"))
        await until(lambda: site.controller.legacy_clients.attached == 2)


async def test_the_papers_unit_homes_and_moves_the_robot(mesh, tmp_path):
    settings = legacy()
    async with legacy_site(mesh, tmp_path, settings) as site, program(settings) as one:
        one.say(PAPER)
        await until(lambda: site.seen["lease"][-1].holder == "li")
        await until(lambda: "homing" in one.words)

        def is_at_sample():
            one.say(b"1#TIME*1@")
            return [round(value, 2) for value in degrees(site)] == SAMPLE

        await until(is_at_sample, timeout_s=30)
        assert site.controller.homed == STATE.YES
        assert site.controller.trace == STATE.YES
        source = "legacy {}:{}".format(*one.writer.get_extra_info("sockname"))
        done = [(e.request, e.operator, e.source) for e in site.seen["audit"]]
        assert done == [(name, "li", source) for name in ("ACQUIRE", "TRACE_ON", "HOME", "MOVE_ABSOLUTE")]
        assert one.errors == []
        assert site.events("stop.latched") == []


# --------------------------------------------------------------------- authority


async def homed_by_li(site, one):
    """Home a robot with an old program of li, which keeps control."""
    one.say(b"1#COMMAND*home@")

    def is_homed():
        one.say(b"1#TIME*1@")
        return "homed" in one.words and "idle" in one.words

    await until(is_homed, timeout_s=30)


async def test_two_seconds_of_silence_during_motion_stop_the_robot(mesh, tmp_path):
    async with legacy_site(mesh, tmp_path, settings := legacy()) as site, program(settings) as one:
        await homed_by_li(site, one)
        spoke_s = asyncio.get_running_loop().time()
        one.say(b"2#COMMAND*speed=5&ABSOLUTE.DEG*140;0;0;0;0@")
        await until(lambda: "moving" in one.words)
        looks = await looks_until(lambda: site.events("stop.latched"))
        assert asyncio.get_running_loop().time() - spoke_s >= 2.0
        assert looks < 4.0 / LOOK_S
        assert "was not renewed" in (await site.event("stop.latched", 0)).text
        await until(lambda: "stopped" in one.words)
        assert await one.asks(b"1#ABSOLUTE.DEG*0;0;0;0;0@") == (8, one.errors[-1].text)


async def test_units_without_requests_renew_the_lease(mesh, tmp_path):
    async with legacy_site(mesh, tmp_path, settings := legacy()) as site, program(settings) as one:
        one.say(b"1#COMMAND*trace@")
        await until(lambda: site.seen["lease"][-1].holder == "li")
        began_s = asyncio.get_running_loop().time()

        def long_enough():
            one.say(b"1#STATUS*idle@")
            return asyncio.get_running_loop().time() - began_s > 3.5

        await until(long_enough)
        await until(lambda: site.seen["lease"][-1].holder == "li")
        await until(lambda: not site.seen["lease"][-1].holder)


async def test_a_killed_connection_stops_the_motion(mesh, tmp_path):
    async with legacy_site(mesh, tmp_path, settings := legacy()) as site, program(settings) as watcher:
        async with program(settings) as one:
            await homed_by_li(site, one)
            one.say(b"2#COMMAND*speed=5&ABSOLUTE.DEG*140;0;0;0;0@")
            await until(lambda: "moving" in watcher.words)
            one.writer.transport.abort()
            await until(lambda: site.events("stop.latched"))
        assert "has disconnected" in (await site.event("stop.latched", 0)).text
        await until(lambda: "stopped" in watcher.words)
        await until(lambda: not site.seen["lease"][-1].holder)


async def test_operators_of_the_mesh_and_of_old_programs_refuse_each_other(mesh, tmp_path):
    async with legacy_site(mesh, tmp_path, settings := legacy()) as site, program(settings) as one:
        await site.lease(A.ACQUIRE, operator="wang")
        number, text = await one.asks(b"1#COMMAND*home@")
        assert (number, "wang is in control" in text) == (7, True)
        await site.lease(A.RELEASE, operator="wang")
        one.say(b"1#COMMAND*home@")
        await until(lambda: site.seen["lease"][-1].holder == "li")
        assert "li is in control" in await refusal(site.lease(A.ACQUIRE, operator="wang"))
        async with program(settings) as other:
            number, text = await other.asks(b"1#COMMAND*hold@")
            assert (number, "another lease" in text) == (7, True)
        # After a TAKE, its next command is refused with the reason.
        await site.lease(A.TAKE, operator="wang", reason="the shift is over")
        number, text = await one.asks(b"1#COMMAND*home@")
        assert (number, "wang is in control" in text) == (7, True)
        refused = [entry for entry in site.seen["audit"] if entry.source.startswith("legacy") and entry.text]
        assert refused


async def test_a_client_that_may_not_command_can_read_and_stop(mesh, tmp_path):
    settings = legacy(commanders={"10.0.0.9": "li"})
    simulated = {"demo": True}
    async with legacy_site(mesh, tmp_path, settings, simulated=simulated) as site, program(settings) as one:
        await until(lambda: one.positions)
        number, text = await one.asks(b"1#COMMAND*home@")
        assert (number, "commanders" in text) == (7, True)
        # States that it echoes, whole or in part.
        assert (await one.asks(one.last_state))[0] == 7
        assert (await one.asks(b"1#ABSOLUTE.DEG*1;2;3;4;5@"))[0] == 7
        assert (await one.asks(b"1#THERMAL*1@"))[0] == 7
        one.say(b"1#STATUS*idle@", b"1#TIME*1@", b"1#ERROR*9;nothing@")
        await until(lambda: site.controller.legacy_clients.units_refused == 4)
        assert len(one.errors) == 4
        await until(lambda: len([e for e in site.seen["audit"] if e.outcome == e.REFUSED]) >= 1)
        assert site.controller.counters.units_sent == 0
        # A stop is executed together with any other records.
        one.say(b"2#THERMAL*1&COMMAND*sing;stop@")
        await until(lambda: "stopped" in one.words)
        stop = await site.event("stop.latched", 0)
        assert stop.values["by"] == "legacy 127.0.0.1"
        assert site.controller.counters.units_sent == 1


async def test_refusals_have_the_protocols_error_numbers(mesh, tmp_path):
    async with legacy_site(mesh, tmp_path, settings := legacy()) as site, program(settings) as one:
        await until(lambda: one.positions)
        answers = {
            b"2#COMMAND*home@": (2, "the count says 2 records"),
            b"1#COMMAND*speed=fast@": (2, "not a finite number"),
            b"1#COMMAND*sing@": (3, "unknown word sing"),
            b"1#THERMAL*1@": (3, "unknown type THERMAL"),
            b"1#ABSOLUTE.DEG*1;2;3@": (4, "3 values for 5 joints"),
            b"2#COMMAND*home&ABSOLUTE.DEG*1000;0;0;0;0@": (5, "beyond its limit"),
            b"1#COMMAND*speed=0@": (5, "outside 1 to 100 %"),
            b"1#ABSOLUTE.DEG*0;0;0;0;0@": (9, "not homed"),
        }
        for unit, (number, words) in answers.items():
            answer, text = await one.asks(unit)
            assert (answer, words in text) == (number, True), (unit, answer, text)
        # All or nothing: neither the homing nor the trace was executed.
        assert site.controller.counters.units_sent == 0
        # An echoed state moves nothing, either.
        assert (await one.asks(one.last_state))[0] == 7
        assert site.controller.counters.units_sent == 0
        # The gateway refuses before the controller would, so no refusal of the controller is relayed here.
        assert site.controller.counters.refusals == 0


async def test_reset_does_not_clear_a_stop_that_was_just_sent(mesh, tmp_path):
    async with legacy_site(mesh, tmp_path, settings := legacy()) as site, program(settings) as one:
        await until(lambda: one.positions)
        number, text = await one.asks(b"1#COMMAND*stop@1#COMMAND*reset@")
        assert (number, "stop request 1" in text) == (8, True)
        assert (await one.asks(b"1#COMMAND*home@"))[0] == 8

        def reset():
            one.say(b"1#COMMAND*reset@")
            return not site.controller.HasField("stop")

        await until(reset)
        await until(lambda: any(entry.request == "RESET" for entry in site.seen["audit"]))
        assert len([entry for entry in site.seen["audit"] if entry.request == "STOP"]) == 1
        one.say(b"1#COMMAND*home@")
        await until(lambda: "homing" in one.words)


async def test_a_stop_overtakes_queued_units(mesh, tmp_path):
    async with legacy_site(mesh, tmp_path, settings := legacy()) as site, program(settings) as one:
        await until(lambda: one.positions)
        one.say(b"1#COMMAND*home@" * 20 + b"1#COMMAND*stop@")
        await until(lambda: len(one.errors) >= 20)
        assert {error.number for error in one.errors} <= {8, 9}
        assert site.controller.counters.units_sent == 1
        assert site.controller.homed == STATE.NO


async def test_a_read_only_robot_refuses_commands_of_clients(mesh, tmp_path):
    settings = legacy()
    async with legacy_site(mesh, tmp_path, settings, stop_proven=False) as site, program(settings) as one:
        await until(lambda: one.positions)
        number, text = await one.asks(b"1#COMMAND*home@")
        assert (number, "read-only" in text) == (7, True)
        one.say(b"1#COMMAND*stop@")
        await until(lambda: site.events("stop.not_sent"))
        assert site.controller.counters.units_sent == 0


async def test_clients_speak_the_controllers_codes(mesh, tmp_path):
    codes = {2: "ABSOLUTE.DEG", 6: "ERROR", 101: "COMMAND:home", 102: "COMMAND:stop", 104: "COMMAND:reset"}
    simulated, settings = {"codes": codes}, legacy()
    async with (
        legacy_site(mesh, tmp_path, settings, simulated=simulated, codes=codes) as site,
        program(settings) as one,
    ):
        await until(lambda: one.bytes.count(b"@") > 3)
        assert one.bytes.startswith(b"4#2*")
        one.say(b"1#COMMAND*sing@")
        await until(lambda: b"1#6*3;unknown word sing" in one.bytes)
        one.say(b"1#101@")
        await until(lambda: b"homing" in one.bytes)
        one.say(b"1#102@")
        await until(lambda: b"stopped" in one.bytes)
        await until(lambda: site.seen["lease"] and site.seen["lease"][-1].holder == "li")


# -------------------------------------------------------------------------- link


async def test_a_lost_link_closes_only_clients_that_got_states(mesh, tmp_path):
    settings = legacy()
    async with contextlib.AsyncExitStack() as stack:
        first = contextlib.AsyncExitStack()
        port = await first.enter_async_context(simulator())
        site = await stack.enter_async_context(gateway(mesh, tmp_path, port, legacy_clients=settings))
        async with program(settings) as one:
            await until(lambda: one.positions)
            await first.aclose()
            await until(lambda: one.ended)
            assert [error.number for error in one.errors] == [9]
        async with program(settings) as two:
            await until(lambda: site.controller.legacy_clients.attached == 1)
            assert two.bytes == b""
            number, text = await two.asks(b"1#COMMAND*home@")
            assert (number, "link" in text) == (9, True)
            await stack.enter_async_context(simulator(listen=f"{ME}:{port}"))
            await until(lambda: two.positions, timeout_s=20)


async def test_a_controllers_refusal_is_relayed_only_to_the_client_in_control(mesh, tmp_path):
    settings = legacy()

    async def controller(reader, writer):
        async def tell():
            while True:
                writer.write(b"3#ABSOLUTE.DEG*1;2;3;4;5&STATUS*idle;remote;homed&WEATHER*fine@")
                await asyncio.sleep(0.02)

        telling = asyncio.create_task(tell())
        with contextlib.suppress(OSError):
            while await reader.read(4096):
                writer.write(b"1#ERROR*5;not today@")
        telling.cancel()

    async with (
        serving(controller, ME) as port,
        gateway(mesh, tmp_path, port, legacy_clients=settings) as site,
        program(settings) as one,
        program(settings) as two,
    ):
        await until(lambda: one.positions and two.positions)
        assert await one.asks(b"1#COMMAND*trace@") == (5, "not today")
        await until(lambda: site.events("controller.refused"))
        assert b"WEATHER*fine" in two.bytes
        assert two.errors == []


async def test_a_robot_moves_without_the_port_of_old_programs_and_gets_it_when_it_is_free(
    mesh, tmp_path, monkeypatch
):
    monkeypatch.setattr("robomesh.service.health._LISTEN_AGAIN_S", 0.1)
    settings = legacy()
    other = await asyncio.start_server(lambda *_: None, ME, settings.port)
    async with legacy_site(mesh, tmp_path, settings) as site:
        await until(lambda: "legacy_clients of arm" in site.own.problems)
        await site.home()
        other.close()
        await until(lambda: not site.own.problems)
        async with program(settings) as one:
            await until(lambda: one.words)
