"""Programs run by the gateway: real gateway, real worker process, simulated controller."""

import asyncio
import contextlib
import json
import os
import signal
from hashlib import sha256
from math import radians

import psutil
import pytest
from google.protobuf.timestamp_pb2 import Timestamp

from protocol_gateway.authority.lease_rules import Now
from protocol_gateway.checking.checker import Checker
from protocol_gateway.execution.deadlines import set_deadline
from protocol_gateway.seam.errors import CheckError
from robomesh import reason_codes as codes
from robomesh.contract.activity import activity_words
from robomesh.errors import RefusedError
from robomesh.requests.server import Request
from robomesh.schemas import robomesh_pb2 as schema
from tests.conftest import last_value
from tests.protocol_gateway.gateway_site import STATE, A, C, gateway, refusal, simulator, until
from tests.protocol_gateway.test_checked_motion import POST, checked, one_robot_cell, standing

RUN, REFUSED = schema.ProgramState, schema.AuditEntry.REFUSED
GOOD = """home
speed 100
move_joints -40 90 -90 0 0   # away from the post
wait 0.1
trace on
repeat 2
  move_joints -30 90 -90 0 0
  move_joints -40 90 -90 0 0
end
"""
LAST = [radians(-40), radians(90), radians(-90), 0, 0]
LONG = "move_joints -140 90 -90 0 0\nmove_joints 0 90 -90 0 0\n"


async def start(site, text, **fields):
    """Run a program, and repeat it if a busy machine plans it too slowly; renews the lease."""
    while True:
        try:
            return await start_once(site, text, **fields)
        except RefusedError as error:
            if error.reason.code != "program.plan_too_slow":
                raise


async def start_once(site, text, **fields):
    await in_control(site)
    site.id += 1
    request = schema.CommandRequest(
        command=C.RUN_PROGRAM, lease=site.secret, id=site.id, program=text, program_name="weld", **fields
    )
    asked = asyncio.ensure_future(site.session.ask(site.key("command/li"), request, timeout_s=60))
    while not asked.done():
        # The checking process may still have to start.
        await in_control(site)
        await asyncio.wait([asked], timeout=0.5)
    return asked.result()


def states(site):
    return site.seen["program"]


async def ended(site, outcome, timeout_s=60):
    async with asyncio.timeout(timeout_s):
        while not states(site) or states(site)[-1].outcome != outcome:
            await site.lease(A.RENEW)
            await asyncio.sleep(0.1)
    return states(site)[-1]


async def test_a_step_with_a_late_check_is_checked_again(mesh, tmp_path, monkeypatch):
    late, motion = iter([True, True]), Checker.motion

    async def slow(self, question, *, timeout_s):
        if next(late, False):
            raise CheckError(codes.CHECK_TOO_SLOW(seconds=0.8, slowest=0.9))
        return await motion(self, question, timeout_s=timeout_s)

    async with (
        simulator() as port,
        gateway(mesh, tmp_path, port, check="require", cell=one_robot_cell(POST)) as site,
    ):
        await until(lambda: not site.controller.check_text, timeout_s=60)
        monkeypatch.setattr(Checker, "motion", slow)
        await start(site, "home\n")
        await ended(site, RUN.DONE)
        steps = [each for each in site.seen["audit"] if each.source == "program"]
        refused = [each.reason for each in steps if each.outcome == REFUSED]
        assert {each.code for each in refused} == {"check.required"}
        assert [each.causes[0].code for each in refused][:2] == ["check.too_slow"] * 2


@pytest.mark.parametrize("check", ["off", "require"])
async def test_a_program_runs_to_its_end_and_publishes_its_steps(mesh, tmp_path, check):
    async with (
        simulator() as port,
        gateway(mesh, tmp_path, port, check=check, cell=one_robot_cell(POST)) as site,
    ):
        await until(lambda: not site.controller.check_text, timeout_s=60)
        await site.lease(A.ACQUIRE)
        answer = await start(site, GOOD)
        assert answer.text == "RUN_PROGRAM: it runs"
        done = await ended(site, RUN.DONE)
        assert (done.name, done.operator, done.text) == ("weld", "li", "")
        assert done.steps == done.step == 10
        assert done.duration_s > 1.0
        await standing(site, LAST)
        seen = {(state.line, state.statement) for state in states(site)}
        assert {(1, "home"), (3, "move_joints -40 90 -90 0 0")} <= seen
        assert site.controller.trace == STATE.YES
        entries = [(each.request, each.source) for each in site.seen["audit"]]
        run_at = entries.index(("RUN_PROGRAM", "mesh"))
        source = await last_value(site.session, site.key("program/source"))
        assert (source.text, source.name, source.operator) == (GOOD, "weld", "li")
        audited = site.seen["audit"][run_at].values["program_sha256"]
        assert sha256(source.text.encode()).hexdigest() == audited
        # Renewals have no entry: the next ones are the program's.
        assert [request for request, _ in entries[run_at + 1 : run_at + 5]] == [
            *("SPEED", "HOME", "SPEED", "MOVE_ABSOLUTE"),
        ]
        await until(lambda: any(each.request == "PROGRAM_END" for each in site.seen["audit"]))
        assert await site.event("program.done", 0)


async def test_required_a_colliding_program_is_refused_with_its_line(mesh, tmp_path):
    async with (
        simulator() as port,
        gateway(mesh, tmp_path, port, check="require", cell=one_robot_cell(POST)) as site,
    ):
        await checked(site)
        units, before = site.controller.counters.units_sent, list(site.joints)
        text = await refusal(start(site, "move_joints -40 90 -90 0 0\nmove_joints 90 0 0 0 0\n"))
        assert "post" in text
        assert "line 2" in text
        text = await refusal(start(site, "move_joints 0 0 0 0 0\nmove_joint 0 0 0 0 0\n"))
        assert "line 2" in text
        assert "move_joint" in text
        text = await refusal(start(site, "# nothing\n"))
        assert "no statement that does anything" in text
        await asyncio.sleep(1.1)
        assert site.controller.counters.units_sent == units
        assert list(site.joints) == pytest.approx(before)
        assert states(site)[-1].outcome == RUN.OUTCOME_UNSPECIFIED


async def test_a_stop_ends_a_program_for_good(mesh, tmp_path):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        await site.home()
        await start(site, LONG)
        await until(lambda: site.joints[0] < -0.2)
        await site.stop(by="wang", reason="somebody is in there")
        state = await ended(site, RUN.ENDED)
        assert state.text == "stopped by wang: somebody is in there"
        assert state.line == 1
        await until(lambda: site.controller.activity == STATE.STOPPED)
        await asyncio.sleep(0.5)
        await site.command(C.RESET, stop_id=site.controller.stop.id)
        await site.lease(A.RENEW)
        where = list(site.joints)
        await asyncio.sleep(1.0)
        assert list(site.joints) == pytest.approx(where, abs=1e-3)


async def test_a_program_that_could_not_start_is_refused(mesh, tmp_path):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        await site.lease(A.ACQUIRE)
        text = await refusal(start(site, "speed 50\nmove_joints -40 90 -90 0 0\n"))
        assert "not homed" in text
        assert site.controller.counters.units_sent == 0


async def test_a_program_ends_with_the_lease_even_while_it_waits(mesh, tmp_path):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        await site.home()
        await start(site, "wait 600\nmove_joints -140 90 -90 0 0\n")
        await until(lambda: states(site)[-1].outcome == RUN.RUNNING)
        text = await refusal(site.command(C.MOVE_ABSOLUTE, joint_positions=LAST))
        assert "program weld is running: stop it, or wait until it has ended" in text
        # The check holds only at its speed.
        assert "program weld is running" in await refusal(site.command(C.SPEED, speed_percent=100))
        await site.lease(A.RELEASE)
        await until(lambda: states(site)[-1].outcome == RUN.ENDED)
        assert states(site)[-1].text.startswith("control ended: ")


async def test_a_held_program_continues_with_resume(mesh, tmp_path):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        await site.home()
        await start(site, "move_joints -60 90 -90 0 0\nmove_joints -40 90 -90 0 0\n")
        await until(lambda: site.joints[0] < -0.1)
        await site.command(C.HOLD)
        await until(lambda: site.controller.activity == STATE.HOLDING)
        held = len(states(site))
        await until(lambda: len(states(site)) >= held + 3)
        await site.lease(A.RENEW)
        assert states(site)[-1].outcome == RUN.RUNNING
        # No time passes during the hold: a part of the first motion is left, and the whole second.
        assert states(site)[-1].left_s == states(site)[held].left_s > 0.5
        assert site.controller.program.held
        await site.command(C.RESUME)
        done = await ended(site, RUN.DONE)
        assert done.left_s < 0.5
        await until(lambda: not site.controller.HasField("program"))
        await standing(site, LAST)


async def test_an_arm_at_rest_whose_program_waits_is_published_as_running(mesh, tmp_path):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        await site.home()
        await start(site, "wait 30\nmove_joints -40 90 -90 0 0\n")
        await until(
            lambda: site.controller.HasField("program") and site.controller.program.HasField("wait_s")
        )
        assert (site.controller.activity, site.controller.program.wait_s) == (STATE.IDLE, 30.0)
        assert activity_words(site.controller) == "running, waits 30 s"
        await until(lambda: states(site)[-1].statement == "wait 30")
        left_s = states(site)[-1].left_s
        assert 0 < left_s <= states(site)[-1].duration_s
        await until(lambda: states(site)[-1].left_s < left_s - 0.5)
        await site.stop(by="li")
        await ended(site, RUN.ENDED)
        await until(lambda: not site.controller.HasField("program"))


async def test_a_program_held_between_two_motions_waits(mesh, tmp_path):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        await site.home()
        await start(site, "wait 1\nmove_joints -40 90 -90 0 0\n")
        await until(lambda: states(site)[-1].outcome == RUN.RUNNING)
        await site.command(C.HOLD)
        await until(lambda: site.controller.activity == STATE.HOLDING)
        await asyncio.sleep(1.5)
        await site.lease(A.RENEW)
        assert states(site)[-1].outcome == RUN.RUNNING
        await site.command(C.RESUME)
        await ended(site, RUN.DONE)
        await standing(site, LAST)


async def test_a_held_program_ends_with_reset(mesh, tmp_path):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        await site.home()
        await start(site, "wait 1\nmove_joints -40 90 -90 0 0\n")
        await until(lambda: states(site)[-1].outcome == RUN.RUNNING)
        await site.command(C.HOLD)
        await until(lambda: site.controller.activity == STATE.HOLDING)
        where = list(site.joints)
        await site.command(C.RESET)
        state = await ended(site, RUN.ENDED)
        assert state.text == "cancelled by RESET"
        await until(lambda: site.controller.activity == STATE.IDLE)
        await site.lease(A.RENEW)
        await asyncio.sleep(1.5)
        assert list(site.joints) == pytest.approx(where, abs=1e-3)


@contextlib.contextmanager
def slow_check():
    """Suspend the planning processes, so that the test decides how long a check takes."""
    workers = [each.pid for each in psutil.Process().children()]
    for each in workers:
        os.kill(each, signal.SIGSTOP)
    try:
        yield
    finally:
        for each in workers:
            os.kill(each, signal.SIGCONT)


async def planned(site):
    """Wait until the planning process runs and has planned something."""
    assert "no statement that does anything" in await refusal(start(site, "# nothing\n"))


async def in_control(site):
    """Renew the lease, or acquire it again if it expired on a busy machine."""
    try:
        return await site.lease(A.RENEW)
    except RefusedError:
        return await site.lease(A.ACQUIRE)


def gave_up(site):
    """Return whether a program was not run because of its sender's timeout."""
    return any(each.reason.code == "program.asker_gave_up" for each in not_run(site))


def not_run(site):
    return [each for each in site.seen["audit"] if each.request == "RUN_PROGRAM" and each.outcome == REFUSED]


async def plain_run(site, timeout_s, **fields):
    """Request a program as a plain Zenoh client, in JSON, with a timeout; return the answers."""
    site.id += 1
    payload = json.dumps(
        {"lease": site.secret, "id": site.id, "command": "RUN_PROGRAM", "program": "home\n", **fields}
    )
    get, key = site.session.zenoh_session.get, site.key("command/li")
    return await asyncio.to_thread(lambda: list(get(key, payload=payload, timeout=timeout_s)))


@pytest.mark.parametrize("has_timeout", [True, False])
async def test_a_program_is_not_run_after_its_senders_timeout(mesh, tmp_path, has_timeout):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        lease = await site.lease(A.ACQUIRE)
        await planned(site)
        lease = await in_control(site)
        with slow_check():
            if has_timeout:
                until_ns = lease.now.ToNanoseconds() + 1_000_000_000
                not_after = Timestamp(seconds=until_ns // 10**9, nanos=until_ns % 10**9)
                words = await refusal(start(site, "home\n", not_after=not_after))
                assert words.startswith(
                    "Not run: its check did not finish before its sender's deadline: allow more time"
                )
            else:
                # Without an answer, Zenoh may return an error; the gateway's answer comes later.
                replies = await plain_run(site, 0.5)
                assert not [each for each in replies if each.ok is not None]
                await until(lambda: gave_up(site))
        await in_control(site)
        # The planning process is idle when this is planned.
        await planned(site)
        assert gave_up(site)
        assert site.controller.counters.units_sent == 0
        assert states(site)[-1].outcome == RUN.OUTCOME_UNSPECIFIED
        # A sender that waits gets an answer.
        await start(site, "home\n")
        await ended(site, RUN.DONE)


def test_the_earlier_deadline_counts():
    second = 10**9
    now = Now(7.5, 0, 100 * second + second // 2)

    def dated(not_after_s=None, within_s=None, kind=C.RUN_PROGRAM):
        command = schema.CommandRequest(command=kind)
        if not_after_s is not None:
            command.not_after.FromNanoseconds(round(not_after_s * second))
        set_deadline(command, Request(None, command, "li", received_s=7.0, within_s=within_s), now)
        return command.not_after.ToNanoseconds() / second if command.HasField("not_after") else None

    assert dated() == 102.0
    assert dated(kind=C.HOME) is None
    assert dated(within_s=60.0) == 160.0
    assert dated(within_s=60.0, not_after_s=130.0) == 130.0
    assert dated(within_s=3.0, not_after_s=130.0) == 103.0
    assert dated(not_after_s=130.0) == 130.0
    # A `not_after` that is refused stays; the sender's timeout needs no clock of another machine.
    assert dated(within_s=3.0, not_after_s=200.0) == 200.0
    assert dated(within_s=3.0, not_after_s=99.0) == 99.0
    assert dated(within_s=1e300) == 165.5
    assert dated(within_s=1e300, kind=C.HOME) == 105.5
    assert dated(within_s=1e300, kind=C.HOLD) > 1e6


async def test_a_hold_cancels_a_program_during_its_check(mesh, tmp_path):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        await site.lease(A.ACQUIRE)
        await planned(site)
        with slow_check():
            asked = asyncio.create_task(refusal(start(site, "home\n")))
            await until(lambda: site.id == 2)
            await site.lease(A.RENEW)
            await asyncio.sleep(0.3)  # the gateway has it by then; otherwise HOLD finds nothing to cancel
            answer = await site.command(C.HOLD)
            assert answer.text == "HOLD: nothing is started any more, and nothing is on hold"
            assert await asked == "Not run: HOLD arrived during its check: not started."
        await in_control(site)
        await planned(site)
        assert site.controller.counters.units_sent == 0
        assert site.controller.activity == STATE.IDLE
        # The next motion is not blocked; the robot is not homed.
        await start(site, "home\n")
        await ended(site, RUN.DONE)


async def test_a_stop_cancels_a_program_during_its_check(mesh, tmp_path):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        await site.lease(A.ACQUIRE)
        await planned(site)
        with slow_check():
            asked = asyncio.create_task(refusal(start(site, "home\n")))
            await until(lambda: site.id == 2)
            await asyncio.sleep(0.3)
            await site.stop(by="wang", reason="fire")
            assert "wang" in await asked


async def test_a_held_homing_continues_with_resume(mesh, tmp_path):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        await site.lease(A.ACQUIRE)
        await site.command(C.HOME)
        await until(lambda: site.controller.activity == STATE.HOMING)
        await site.command(C.HOLD)
        await until(lambda: site.controller.activity == STATE.HOLDING)
        await site.lease(A.RENEW)
        await site.command(C.RESUME)
        async with asyncio.timeout(50):
            while site.controller.homed != STATE.YES:
                await site.lease(A.RENEW)
                await asyncio.sleep(0.2)


async def test_a_repeated_request_does_not_run_a_program_twice(mesh, tmp_path):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        await site.home()
        await start(site, "move_joints -20 90 -90 0 0\n")
        site.id -= 1
        again = await start(site, "move_joints -20 90 -90 0 0\n")
        assert again.accepted
        await ended(site, RUN.DONE)
        asked = [each for each in site.seen["audit"] if each.request == "RUN_PROGRAM"]
        # A busy machine may have planned it too slowly before.
        assert len([each for each in asked if each.outcome != REFUSED]) == 1


async def test_a_programs_warning_is_in_the_answer(mesh, tmp_path):
    async with (
        simulator() as port,
        gateway(mesh, tmp_path, port, check="warn", cell=one_robot_cell(POST)) as site,
    ):
        await checked(site)
        answer = await start(site, "move_joints 90 45 -45 0 0\n")
        assert answer.accepted
        assert answer.text.startswith("RUN_PROGRAM: it runs; mind: line 1: ")
        assert "post" in answer.text
