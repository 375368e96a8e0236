"""Stops of one robot: sent, shared, sent again, and not hidden by repeated stops."""

import asyncio
import threading
from dataclasses import replace

import pytest
import zenoh

from protocol_gateway.audit.log import Outcome, read_entries
from protocol_gateway.authority.events import FateUnknown, LinkRestored, MotionObserved, TimePassed
from protocol_gateway.authority.robot_authority import NEW_STOPS_BURST
from protocol_gateway.seam import Mode
from robomesh import reason_codes as codes
from robomesh.errors import NoAnswerError
from robomesh.schemas import robomesh_pb2 as schema
from tests.protocol_gateway.audit_state import state_after
from tests.protocol_gateway.control_bench import control_bench
from tests.protocol_gateway.gateway_site import gateway, measured, simulator
from tests.refusals import refused

C = schema.CommandRequest.Command
A = schema.LeaseRequest.Action
STOP = b"1#COMMAND*stop@"


def press(bench, by="wang"):
    return bench.control.stop(by=by, reason="fire", source="test")


def event_codes(bench):
    return [event.code for event in bench.events]


async def test_a_flood_of_one_operators_stops_is_one_counted_stop(tmp_path, clock):
    async with control_bench(tmp_path) as bench:
        answers = [press(bench) for _ in range(50)]
        assert all(answer == answers[0] for answer in answers)
        assert (answers[0].stop_id, answers[0].sent) == (1, True)
        assert bench.socket == [STOP]
        assert (event_codes(bench), bench.changes) == (["stop.latched"], 1)
        clock.advance(0.11)
        assert press(bench) == answers[0]
        assert bench.socket == [STOP, STOP]
        assert bench.changes == 1
    assert [entry.repeated for entry in read_entries(bench.log.path)] == [0, 49]


async def test_a_flood_under_many_names_latches_few_stops_and_is_counted(tmp_path, clock):
    async with control_bench(tmp_path) as bench:
        numbers = []
        for number in range(1000):
            numbers.append(press(bench, by=f"name-{number}").stop_id)
            clock.advance(0.0025)
        assert numbers[-1] == len(set(numbers)) == bench.changes == 1 + NEW_STOPS_BURST + 2
        assert bench.socket == [STOP] * 25
    entries = list(read_entries(bench.log.path))
    assert sum(1 + entry.repeated for entry in entries) == 1000
    assert len(entries) == numbers[-1] + 1
    assert state_after(entries).stop.id == numbers[-1]


async def test_a_stop_while_a_reset_is_being_written_is_not_cleared_by_it(tmp_path):
    async with control_bench(tmp_path) as bench:
        await bench.lease(A.ACQUIRE)
        press(bench)
        append = bench.log.append

        async def append_beside_a_stop(entry):
            if entry.request == "RESET":
                assert press(bench).stop_id == 2
            return await append(entry)

        bench.log.append = append_beside_a_stop
        with refused(codes.STOP_OTHER):
            await bench.commands((C.RESET, {"stop_id": 1}))
        assert bench.control.authority.stop.id == 2


async def test_a_motion_of_unknown_fate_latches_a_stop(tmp_path, clock):
    async with control_bench(tmp_path) as bench:
        bench.control.handle(FateUnknown(codes.OTHER(detail="it has not started")))
        stop = bench.control.authority.stop
        assert stop.why.code == "stop.fate_unknown"
        assert "it has not started" in stop.reason
        assert bench.socket == [STOP]
        await bench.lease(A.ACQUIRE)
        with refused(codes.STOP_LATCHED, id="1"):
            await bench.commands((C.HOME, {}))


async def test_local_control_stops_the_holder_s_motion_once(tmp_path, clock):
    async with control_bench(tmp_path) as bench:
        await bench.lease(A.ACQUIRE, ttl_s=60)
        remote, bench.status = bench.status, replace(bench.status, mode=Mode.LOCAL)
        bench.control.handle(TimePassed())
        assert not bench.socket
        bench.status = remote
        await bench.commands((C.HOME, {}))
        bench.control.handle(TimePassed())
        assert STOP not in bench.socket
        bench.status = replace(remote, mode=Mode.LOCAL)
        for _ in range(3):
            bench.control.handle(TimePassed())
        assert bench.control.authority.stop.why.code == "stop.went_local"
        assert bench.socket.count(STOP) == 1


async def test_other_operators_stops_share_the_unit_under_new_numbers(tmp_path, clock):
    async with control_bench(tmp_path) as bench:
        press(bench)
        clock.advance(0.06)
        assert press(bench, by="zhao").stop_id == 2
        assert bench.control.stop(by="zhao", reason="fire", source="elsewhere").stop_id == 3
        assert bench.socket == [STOP]
        # Sharing does not change the unit's time.
        clock.advance(0.06)
        assert press(bench).stop_id == 4
        assert bench.socket == [STOP, STOP]


async def test_a_stop_that_was_reset_or_not_sent_is_not_shared(tmp_path, clock):
    async with control_bench(tmp_path) as bench:
        press(bench)
        await bench.lease(A.ACQUIRE)
        await bench.commands((C.RESET, {"stop_id": 1}))
        assert press(bench).stop_id == 2
        assert bench.socket == [STOP, b"1#COMMAND*reset@", STOP]
        clock.advance(1.0)
        bench.broken = True
        assert [press(bench).sent, press(bench).sent] == [False, False]
        bench.broken = False
        bench.control.handle(LinkRestored())
        # It is in transit now, but was not at the request.
        assert (press(bench).sent, bench.control.authority.stop.id) == (True, 5)


async def test_a_repeated_stop_does_not_hide_that_the_robot_moves(tmp_path, clock):
    async with control_bench(tmp_path) as bench:
        for _ in range(5):
            press(bench)
            bench.control.handle(MotionObserved(True))
            clock.advance(0.5)
        assert event_codes(bench).count("stop.disobeyed") == 1
        for _ in range(4):
            press(bench)
            bench.control.handle(MotionObserved(True))
            clock.advance(0.5)
        assert event_codes(bench).count("stop.disobeyed") == 2
        assert bench.socket.count(STOP) == 9 + 2


async def test_a_repeated_stop_does_not_hide_uncommanded_motion(tmp_path, clock):
    async with control_bench(tmp_path) as bench:
        bench.control.handle(MotionObserved(False))
        for _ in range(5):
            press(bench)
            clock.advance(0.5)
        bench.control.handle(MotionObserved(True))
        assert event_codes(bench).count("motion.foreign") == 1


async def test_a_stop_has_its_full_time_after_a_reset_or_reconnection(tmp_path, clock):
    async with control_bench(tmp_path) as bench:
        await bench.lease(A.ACQUIRE)
        press(bench)
        await bench.commands((C.RESET, {"stop_id": 1}))
        clock.advance(3.0)
        press(bench)
        bench.control.handle(MotionObserved(True))
        clock.advance(1.9)
        bench.control.handle(LinkRestored())
        clock.advance(1.9)
        bench.control.handle(MotionObserved(True))
        assert "stop.disobeyed" not in event_codes(bench)
        clock.advance(0.2)
        bench.control.handle(MotionObserved(True))
        assert "stop.disobeyed" in event_codes(bench)


async def test_a_repeated_stop_unit_is_audited_and_latches_nothing(tmp_path, clock):
    async with control_bench(tmp_path) as bench:
        bench.broken = True
        press(bench)
        bench.broken = False
        bench.control.handle(LinkRestored())
        clock.advance(2.1)
        bench.control.handle(MotionObserved(True))
        clock.advance(2.1)
        bench.broken = True
        bench.control.handle(MotionObserved(True))
    entries = list(read_entries(bench.log.path))
    assert [(entry.request, entry.outcome) for entry in entries] == [
        ("STOP", Outcome.FAILED),
        ("STOP_AGAIN", Outcome.ACCEPTED),
        ("STOP_AGAIN", Outcome.ACCEPTED),
        ("STOP_AGAIN", Outcome.FAILED),
    ]
    assert {entry.values["stop_id"] for entry in entries} == {"1"}
    assert "when its link came back" in entries[1].text
    assert "was sent again" in entries[2].text
    assert state_after(entries[1:]).stop is None
    assert state_after(entries).stop.by == "wang"


async def test_a_stop_is_not_reset_while_the_robot_moves(tmp_path):
    async with control_bench(tmp_path) as bench:
        await bench.lease(A.ACQUIRE)
        await bench.commands((C.HOME, {}))
        bench.control.handle(MotionObserved(True))
        press(bench)
        with refused(codes.STOP_MOVING, id="1"):
            await bench.commands((C.RESET, {"stop_id": 1}), first_id=2)
        assert bench.control.authority.stop.id == 1
        bench.control.handle(MotionObserved(False))
        await bench.commands((C.RESET, {"stop_id": 1}), first_id=3)
        assert bench.control.authority.stop is None


@pytest.mark.parametrize("ended", ["stopped", "released"])
async def test_a_stop_is_not_reset_before_the_stopped_motion_could_be_seen(tmp_path, clock, ended):
    async with control_bench(tmp_path) as bench:
        await bench.lease(A.ACQUIRE)
        bench.control.handle(MotionObserved(False))
        await bench.commands((C.HOME, {}))
        bench.control.handle(MotionObserved(False))  # dated before the motion
        if ended == "stopped":
            press(bench)
        else:
            await bench.lease(A.RELEASE, lease=bench.secret)
            await bench.lease(A.ACQUIRE)
        with refused(codes.STOP_MOVING, id="1"):
            await bench.commands((C.RESET, {"stop_id": 1}), first_id=2)
        clock.advance(0.31)
        await bench.commands((C.RESET, {"stop_id": 1}), first_id=3)
        assert bench.control.authority.stop is None


async def test_stops_have_a_separate_connection(mesh, tmp_path):
    held, go_on = set(), threading.Event()

    def block(_):
        held.add(threading.get_ident())
        go_on.wait(20.0)

    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        # In the threads that read other connections, with the priority of a request.
        handler = zenoh.handlers.Callback(block, indirect=False)
        others = ("", "requests")
        subscribers = [site.own.connection(each).declare_subscriber("block", handler) for each in others]
        try:
            while len(held) < len(others):
                site.session.zenoh_session.put("block", b"", priority=zenoh.Priority.REAL_TIME)
                await asyncio.sleep(0.01)
            ask = schema.LeaseRequest(action=A.ACQUIRE)
            with pytest.raises(NoAnswerError):
                await site.session.ask(site.key("lease/request/li"), ask, timeout_s=0.5)
            assert measured(site, "stopped") == {"arm": 0.0}
            assert (await site.stop()).sent
            assert measured(site, "stopped") == {"arm": 1.0}
        finally:
            go_on.set()
        for subscriber in subscribers:
            subscriber.undeclare()
