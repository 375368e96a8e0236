"""What a jog may send, and what its end sends: rules, driver and audit log are real, the socket is a list."""

from dataclasses import replace

from protocol_gateway.authority.audit_entry import Outcome
from protocol_gateway.authority.decisions import CheckVerdict, PlannedProgram
from protocol_gateway.authority.events import JogEnding, JogHeld, JogPartReady
from protocol_gateway.seam import Activity
from robomesh import reason_codes as codes
from robomesh.schemas import robomesh_pb2 as schema
from tests.protocol_gateway.control_bench import control_bench

A, C = schema.LeaseRequest.Action, schema.CommandRequest.Command
JOG = PlannedProgram(name="base x +", targets=(), is_jog=True)


async def begun(bench, program=JOG, first_id=1):
    bench.status = replace(bench.status, homed=True)
    await bench.lease(A.ACQUIRE)
    return await attempt(bench, program, first_id)


async def attempt(bench, program, number):
    command = C.JOG if program.is_jog else C.RUN_PROGRAM
    request = schema.CommandRequest(lease=bench.secret, id=number, command=command)
    return await bench.control.attempt([request], operator="li", source="test", program=program)


def part(bench, percent=10.0, operator="li", secret=None):
    return bench.control.handle(
        JogPartReady(
            operator=operator,
            secret=bench.secret if secret is None else secret,
            target=(0.01, 0.0, 0.0, 0.0, 0.0),
            percent=percent,
            check_verdict=CheckVerdict(),
        )
    )


async def test_a_part_is_one_unit_with_its_speed_and_only_the_holders_is_sent(tmp_path):
    async with control_bench(tmp_path) as bench:
        assert (await begun(bench)).accepted
        assert bench.socket == []
        assert part(bench, secret="guessed").code == "command.control_ended"
        assert part(bench, operator="wu").code == "command.control_ended"
        assert part(bench) is None
        assert bench.socket == [b"2#COMMAND*speed=10.00&ABSOLUTE.DEG*0.572957795;0.00;0.00;0.00;0.00@"]
        # The parts have no entries of their own.
        assert [name for name, _ in bench.entries()] == ["ACQUIRE", "JOG"]


async def test_the_end_holds_once_and_gives_the_rest_up_only_on_hold_without_a_stop(tmp_path):
    async with control_bench(tmp_path) as bench:
        await begun(bench)
        bench.control.handle(JogEnding(codes.JOG_RELEASED()))
        # Nothing had moved.
        assert bench.socket == []
        assert part(bench).code == "command.held"

    async with control_bench(tmp_path / "2") as bench:
        await begun(bench)
        assert part(bench) is None
        for _ in range(2):
            bench.control.handle(JogEnding(codes.JOG_RELEASED()))
        assert bench.socket[1:] == [b"1#COMMAND*hold@"]
        bench.control.handle(JogHeld(50.0))
        assert bench.socket[2:] == [b"1#COMMAND*speed=50.00@"]
        bench.status = replace(bench.status, activity=Activity.HOLDING)
        bench.control.stop(by="wu", reason="", source="test")
        bench.control.handle(JogHeld(20.0))
        assert bench.socket[3:] == [b"1#COMMAND*stop@"]

    async with control_bench(tmp_path / "3") as bench:
        await begun(bench)
        assert part(bench) is None
        bench.control.handle(JogEnding(codes.JOG_RELEASED()))
        bench.status = replace(bench.status, activity=Activity.HOLDING)
        bench.control.handle(JogHeld(50.0))
        assert bench.socket[2:] == [b"2#COMMAND*reset&COMMAND*speed=50.00@"]
        # Nothing is left that the end of control would have to stop.
        await bench.lease(A.RELEASE, lease=bench.secret)
        assert len(bench.socket) == 3


async def test_no_jog_begins_beside_a_program_or_another_jog(tmp_path):
    async with control_bench(tmp_path) as bench:
        program = PlannedProgram(name="weld", targets=())
        assert (await begun(bench, program)).accepted
        assert (await attempt(bench, JOG, 2)).reason.code == "command.program_runs"

    async with control_bench(tmp_path / "2") as bench:
        await begun(bench)
        assert part(bench) is None
        assert (await attempt(bench, JOG, 2)).reason.code == "jog.runs"
        # It ended the first one.
        assert bench.socket[1:] == [b"1#COMMAND*hold@"]
        assert part(bench).code == "command.held"


async def test_the_end_of_control_stops_a_jog(tmp_path):
    async with control_bench(tmp_path) as bench:
        await begun(bench)
        assert part(bench) is None
        await bench.lease(A.RELEASE, lease=bench.secret)
        assert bench.socket[1:] == [b"1#COMMAND*stop@"]
        assert bench.control.authority.stop is not None


async def test_no_command_moves_the_robot_on_after_the_end_of_a_jog(tmp_path):
    async with control_bench(tmp_path) as bench:
        await begun(bench)
        assert part(bench) is None
        for number, activity in ((2, Activity.MOVING), (3, Activity.HOLDING)):
            bench.status = replace(bench.status, activity=activity)
            resume = schema.CommandRequest(lease=bench.secret, id=number, command=C.RESUME)
            answer = await bench.control.attempt([resume], operator="li", source="test")
            assert answer.reason.code == "jog.runs"
        assert bench.socket[1:] == [b"1#COMMAND*hold@"]


async def test_a_hold_ends_a_jog_and_is_not_sent_again_to_an_arm_that_may_rest_by_then(tmp_path):
    async with control_bench(tmp_path) as bench:
        await begun(bench)
        assert part(bench) is None
        for number in (2, 3):
            hold = schema.CommandRequest(lease=bench.secret, id=number, command=C.HOLD)
            assert (await bench.control.attempt([hold], operator="li", source="test")).accepted
        assert bench.socket[1:] == [b"1#COMMAND*hold@"]
        assert bench.entries()[2:] == [("HOLD", Outcome.ACCEPTED)] * 2


async def test_the_end_of_its_line_holds_no_arm_that_rests(tmp_path):
    async with control_bench(tmp_path) as bench:
        await begun(bench)
        assert part(bench) is None
        bench.control.handle(JogEnding(codes.JOG_NOT_MOVING(), hold=False))
        assert len(bench.socket) == 1
        assert part(bench).code == "command.held"


async def test_a_hold_that_cannot_be_sent_latches_a_stop(tmp_path):
    async with control_bench(tmp_path) as bench:
        await begun(bench)
        assert part(bench) is None
        bench.broken = True
        bench.control.handle(JogEnding(codes.JOG_RELEASED()))
        assert bench.control.authority.stop is not None
