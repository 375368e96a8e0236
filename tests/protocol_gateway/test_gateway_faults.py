"""The gateway when something is wrong: dead links, frozen controllers, bare ones, full disks, no router."""

import asyncio
import contextlib
import os
import signal
import sys
import time
from pathlib import Path

import pytest
import zenoh

from bus.endpoints import router_config
from bus.schemas import robomesh_pb2 as schema
from bus.session import SessionSettings
from protocol_gateway.audit import read_entries, verify
from protocol_gateway.robot import Robot
from tests.conftest import free_port, run
from tests.protocol_gateway.hall import STATE, A, C, gateway, refusal, simulator, until

FAR = [2.4, 0.2, -0.2, 0.1, 0.5]
HOUSE = Path(__file__).resolve().parents[2]

SIMULATOR = """
import asyncio
from services.simulator.simulator import Settings, serve
asyncio.run(serve(Settings(robot="pt600", demo=True), ready=lambda line: print(line, flush=True)))
"""


@contextlib.asynccontextmanager
async def simulator_process():
    """A simulated controller as a process of its own, with its port."""
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        "-c",
        SIMULATOR,
        cwd=HOUSE,
        env={**os.environ, "PYTHONPATH": str(HOUSE)},
        stdout=asyncio.subprocess.PIPE,
    )
    try:
        line = await process.stdout.readline()
        yield process, int(line.rpartition(b":")[2])
    finally:
        process.send_signal(signal.SIGCONT)
        process.kill()
        await process.wait()


@contextlib.asynccontextmanager
async def bare_controller():
    """A controller that says what a test tells it to: (port, say, heard)."""
    writers, heard = [], bytearray()

    async def serve(reader, writer):
        writers.append(writer)
        while data := await reader.read(100):
            heard.extend(data)

    def say(text):
        for writer in writers:
            writer.write(text.encode())

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    try:
        yield server.sockets[0].getsockname()[1], say, heard
    finally:
        server.close()
        for writer in writers:
            writer.transport.abort()


@contextlib.asynccontextmanager
async def repeated(say, text):
    """Something said 100 times a second; `text` is asked for each time."""

    async def keep_saying():
        while True:
            say(text())
            await asyncio.sleep(0.01)

    task = asyncio.create_task(keep_saying())
    try:
        yield
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


@contextlib.contextmanager
def full_disk(path):
    """The open audit log's file is a full device for a while: its writes really fail."""
    (number,) = [int(fd.name) for fd in Path("/proc/self/fd").iterdir() if _target(fd) == path]
    kept, full = os.dup(number), os.open("/dev/full", os.O_RDWR)
    os.dup2(full, number)
    os.close(full)
    try:
        yield
    finally:
        os.dup2(kept, number)
        os.close(kept)


def _target(fd):
    with contextlib.suppress(OSError):
        return fd.readlink()
    return None


def test_a_frozen_controller_falls_silent_and_old_states_are_not_dated_anew(mesh, tmp_path):
    async def main():
        async with simulator_process() as (process, port), gateway(mesh, tmp_path, port) as plant:
            process.send_signal(signal.SIGSTOP)
            await until(lambda: plant.controller.link == STATE.SILENT)
            count, last = len(plant.seen["joints"]), plant.seen["joints"][-1]
            await plant.lease(A.ACQUIRE)
            assert "silent" in await refusal(plant.command(C.HOME))
            await until(lambda: plant.controller.last_unit_age_s > 2.0)
            assert len(plant.seen["joints"]) == count
            assert plant.seen["joints"][-1].timestamp == last.timestamp
            process.send_signal(signal.SIGCONT)
            await until(lambda: plant.controller.link == STATE.UP)

    run(main())


def test_a_stop_while_the_link_is_down_is_latched_and_sent_when_it_is_back(mesh, tmp_path):
    async def main():
        async with simulator() as port, gateway(mesh, tmp_path, port) as plant:
            pass
        async with gateway(mesh, tmp_path, port, up=False) as plant:
            await until(lambda: plant.controller.link_text.startswith("cannot connect"))
            assert plant.controller.mode == STATE.MODE_UNKNOWN
            stop = await plant.stop(reason="try")
            assert not stop.sent
            assert "connection refused; it is sent as soon as the link is back" in stop.text
            await plant.lease(A.ACQUIRE)
            assert "the link to the controller is down" in await refusal(plant.command(C.TRACE_ON))
            assert plant.controller.stop.sent is False
            async with simulator(listen=f"127.0.0.1:{port}"):
                await until(lambda: plant.controller.activity == STATE.STOPPED)
                assert plant.controller.stop.sent is True

    run(main())


def test_without_its_router_the_gateway_still_stops_a_motion_whose_operator_is_gone(tmp_path):
    async def main():
        endpoint = f"tcp/127.0.0.1:{free_port()}"
        mesh = SessionSettings(connect=(endpoint,), wait_s=5.0)
        router = zenoh.open(router_config((endpoint,)))
        async with simulator() as port, gateway(mesh, tmp_path, port) as plant:
            await plant.home()
            await plant.lease(A.RENEW, ttl_s=1)
            await plant.command(C.MOVE_ABSOLUTE, joint_positions=FAR)
            await asyncio.to_thread(router.close)
            await until(lambda: [e.request for e in read_entries(plant.audit)][-2:] == ["STOP", "EXPIRE"])
            router = await asyncio.to_thread(zenoh.open, router_config((endpoint,)))
            await until(lambda: plant.controller.activity == STATE.STOPPED, timeout_s=15.0)
            await asyncio.to_thread(router.close)

    run(main())


def test_one_robots_dead_controller_does_not_hurt_another(mesh, tmp_path):
    async def main():
        async with simulator(demo=True) as alive, gateway(mesh, tmp_path, alive, free_port()) as plant:
            other = await plant.session.last("robomesh/hall/arm-2/controller")
            assert other.link == STATE.DOWN
            await until(lambda: len(plant.seen["joints"]) > 100)
            assert plant.controller.counters.connections == 1

    run(main())


def test_a_failure_at_one_robot_is_said_and_neither_ends_it_nor_another(mesh, tmp_path, monkeypatch):
    async def main():
        failing = True
        observe = Robot._observe

        def sometimes(robot):
            if failing and robot._settings.name == "arm":
                raise ZeroDivisionError
            observe(robot)

        async with (
            simulator(demo=True) as one,
            simulator(demo=True) as two,
            gateway(mesh, tmp_path, one, two) as plant,
        ):
            monkeypatch.setattr(Robot, "_observe", sometimes)
            await until(lambda: plant.events("gateway.failed"))
            other = plant.session.subscribe("robomesh/hall/arm-2/joints")
            for _ in range(20):
                await anext(other)
            failing = False
            states = len(plant.seen["controller"])
            await until(lambda: len(plant.seen["controller"]) > states)
            await plant.lease(A.ACQUIRE)

    run(main())


def test_garbage_between_units_is_said_a_few_times_and_counted_always(mesh, tmp_path):
    async def main():
        noisy = simulator(demo=True, faults=("garbage",))
        async with noisy as port, gateway(mesh, tmp_path, port) as plant:
            await until(lambda: plant.controller.counters.units_malformed > 25)
            told = plant.events("unit.malformed")
            assert 5 <= len(told) < plant.controller.counters.units_malformed
            assert told[0].values["offset"]
            assert len(plant.seen["joints"]) > 20

    run(main())


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


def test_motion_that_nobody_commanded_is_said_and_ends_the_lease(mesh, tmp_path):
    async def main():
        waist = 0.0
        async with contextlib.AsyncExitStack() as stack:
            port, say, _ = await stack.enter_async_context(bare_controller())
            await stack.enter_async_context(repeated(say, lambda: f"1#ABSOLUTE.DEG*{waist};90;-90;0;0@"))
            plant = await stack.enter_async_context(gateway(mesh, tmp_path, port))
            await plant.lease(A.ACQUIRE, ttl_s=5)
            await asyncio.sleep(0.3)
            assert plant.seen["lease"][-1].holder == "li"
            waist = 5.0
            await until(lambda: plant.events("motion.foreign"))
            await until(lambda: not plant.seen["lease"][-1].holder)
            assert not plant.events("stop.latched")

    run(main())


def test_records_of_unknown_types_come_out_raw(mesh, tmp_path):
    async def main():
        async with bare_controller() as (port, say, _), gateway(mesh, tmp_path, port, up=False) as plant:
            await until(lambda: plant.controller.link == STATE.SILENT)
            say("2#TEMPERATURE*41.5;ok&4711*1@")
            await until(lambda: len(plant.seen["raw"]) == 2)
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
            assert "then write stop_proven = true" in plant.events("robot.read_only")[0].text
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


def test_on_a_full_disk_a_stop_works_and_a_motion_is_refused_and_the_stop_is_written_later(mesh, tmp_path):
    async def main():
        async with simulator() as port, gateway(mesh, tmp_path, port) as plant:
            await plant.home()
            with full_disk(plant.audit):
                text = await refusal(plant.command(C.HOME))
                assert "No space left on device" in text
                stop = await plant.stop(by="wang")
                assert stop.sent
                await until(lambda: plant.controller.activity == STATE.STOPPED)
                await plant.lease(A.RENEW)
                await until(lambda: plant.events("audit.failed"))
            await until(lambda: [entry.request for entry in read_entries(plant.audit)][-1] == "STOP")
            await plant.lease(A.RENEW)
            await plant.command(C.RESET, stop_id=stop.stop_id)
        assert verify(plant.audit).ok
        assert [e.request for e in read_entries(plant.audit)] == [
            "ACQUIRE",
            "HOME",
            "STOP",
            "RESET",
            "REVOKE",
        ]

    run(main())


@pytest.mark.parametrize("ttl_s", [0.5, 1.0])
def test_the_dead_mans_stop_comes_with_the_leases_end_and_not_before(mesh, tmp_path, ttl_s):
    async def main():
        async with bare_controller() as (port, say, heard):
            status = "2#ABSOLUTE.DEG*1;90;-90;0;0&STATUS*moving;remote;homed@"
            async with repeated(say, lambda: status), gateway(mesh, tmp_path, port) as plant:
                await plant.lease(A.ACQUIRE, ttl_s=ttl_s)
                await plant.command(C.MOVE_ABSOLUTE, joint_positions=[0, 1.5, -1.5, 0, 0])
                renewed = await plant.lease(A.RENEW, ttl_s=ttl_s)
                until_s = renewed.until.ToNanoseconds() * 1e-9
                await until(lambda: b"stop" in heard)
                assert time.time() > until_s - 0.005

    run(main())


def test_a_robot_that_moves_on_after_its_stop_is_a_critical_event(mesh, tmp_path):
    async def main():
        async with bare_controller() as (port, say, heard):
            status = "2#ABSOLUTE.DEG*1;90;-90;0;0&STATUS*moving;remote;homed@"
            async with repeated(say, lambda: status), gateway(mesh, tmp_path, port) as plant:
                await plant.stop()
                await until(lambda: plant.events("stop.disobeyed"))
                assert plant.events("stop.disobeyed")[0].severity == schema.Event.CRITICAL
                await until(lambda: heard.count(b"stop") == 2)

    run(main())


@contextlib.asynccontextmanager
async def slow_starter(after_s):
    """A controller that begins to move so long after it was sent a target: (port, heard)."""
    waist, begins = 0.0, None

    def state():
        nonlocal waist, begins
        if begins is None and b"ABSOLUTE" in heard:
            begins = time.monotonic() + after_s
        moves = begins is not None and time.monotonic() >= begins
        waist += 0.1 if moves else 0.0
        return f"2#ABSOLUTE.DEG*{waist:.2f};0;0;0;0&STATUS*{'moving' if moves else 'idle'};remote;homed@"

    async with bare_controller() as (port, say, heard), repeated(say, state):
        yield port, heard


def test_a_motion_that_begins_late_stays_under_its_lease_and_is_stopped_with_it(mesh, tmp_path):
    async def main():
        async with slow_starter(2.6) as (port, heard), gateway(mesh, tmp_path, port) as plant:
            await plant.lease(A.ACQUIRE, ttl_s=5)
            await plant.command(C.MOVE_ABSOLUTE, joint_positions=[1.0, 0, 0, 0, 0])
            await until(lambda: plant.controller.activity == STATE.MOVING)
            assert plant.seen["lease"][-1].motion
            assert not plant.events("motion.foreign")
            await plant.lease(A.RELEASE)
            await until(lambda: b"stop" in heard)

    run(main())


def test_a_lease_that_ends_before_its_motion_has_begun_stops_the_robot(mesh, tmp_path):
    async def main():
        async with slow_starter(60.0) as (port, heard), gateway(mesh, tmp_path, port) as plant:
            await plant.lease(A.ACQUIRE, ttl_s=5)
            await plant.command(C.MOVE_ABSOLUTE, joint_positions=[1.0, 0, 0, 0, 0])
            await asyncio.sleep(2.2)
            await plant.lease(A.RELEASE)
            await until(lambda: b"stop" in heard)

    run(main())


def test_a_motion_that_the_controller_refuses_is_over_at_once(mesh, tmp_path):
    async def main():
        async with (
            bare_controller() as (port, say, heard),
            repeated(say, lambda: "2#ABSOLUTE.DEG*0;0;0;0;0&STATUS*idle;remote;homed@"),
            gateway(mesh, tmp_path, port) as plant,
        ):
            await plant.lease(A.ACQUIRE, ttl_s=5)
            await plant.command(C.MOVE_ABSOLUTE, joint_positions=[1.0, 0, 0, 0, 0])
            await until(lambda: plant.seen["lease"][-1].motion)
            say("1#ERROR*5;no@")
            await until(lambda: not plant.seen["lease"][-1].motion)
            await plant.lease(A.RELEASE)
            await until(lambda: not plant.seen["lease"][-1].holder)
            assert b"stop" not in heard

    run(main())


def test_a_command_that_waited_for_a_slow_disk_is_not_sent_after_its_sender_has_given_up(
    mesh, tmp_path, monkeypatch
):
    async def main():
        async with simulator(demo=True) as port, gateway(mesh, tmp_path, port) as plant:
            await plant.lease(A.ACQUIRE, ttl_s=5)
            fsync = os.fsync

            def slow(file):
                time.sleep(3.0)
                fsync(file)

            monkeypatch.setattr(os, "fsync", slow)
            asked = [plant.command(C.TRACE_ON), plant.command(C.SPEED, speed_percent=10)]
            first, second = await asyncio.gather(*(refusal(each) for each in asked))
            assert first.startswith("Not sent: the audit log's disk takes longer than 1 s, and what is not")
            assert second.startswith("Not sent: it waited 1.0 s in the gateway")
            await until(lambda: plant.events("audit.failed"))
            monkeypatch.setattr(os, "fsync", fsync)
            await until(lambda: plant.seen["audit"][-1].request == "SPEED")
            await plant.lease(A.RENEW, ttl_s=5)
            await plant.command(C.TRACE_OFF)
            await until(lambda: plant.controller.counters.units_sent == 1)
        outcomes = [(each.request, each.outcome) for each in read_entries(plant.audit)]
        assert outcomes[1:5] == [
            ("TRACE_ON", "ACCEPTED"),
            ("TRACE_ON", "FAILED"),
            ("SPEED", "REFUSED"),
            ("TRACE_OFF", "ACCEPTED"),
        ]

    run(main())


def test_after_a_reset_the_old_stop_is_overlooked_for_a_moment_but_not_a_new_fault(mesh, tmp_path):
    async def main():
        activity = "stopped"

        def state():
            return f"2#ABSOLUTE.DEG*0;0;0;0;0&STATUS*{activity};remote;homed@"

        async with (
            bare_controller() as (port, say, _),
            repeated(say, state),
            gateway(mesh, tmp_path, port) as plant,
        ):
            await plant.lease(A.ACQUIRE, ttl_s=5)
            await plant.command(C.RESET)
            await plant.command(C.HOME)
            await plant.command(C.RESET)
            activity = "fault"
            await until(lambda: plant.controller.activity == STATE.FAULT)
            assert "has a fault" in await refusal(plant.command(C.HOME))

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


def test_a_status_that_came_again_and_again_and_comes_no_more_is_not_known(mesh, tmp_path):
    async def main():
        status = "&STATUS*idle;remote;homed"

        def state():
            return f"{2 if status else 1}#ABSOLUTE.DEG*1;2;3;4;5{status}@"

        async with (
            bare_controller() as (port, say, _),
            repeated(say, state),
            gateway(mesh, tmp_path, port) as plant,
        ):
            await until(lambda: plant.controller.mode == STATE.REMOTE)
            await asyncio.sleep(0.1)
            status = ""
            await until(lambda: plant.events("status.gone"))
            await until(lambda: plant.controller.mode == STATE.MODE_UNKNOWN)
            assert plant.controller.homed == STATE.UNKNOWN
            await plant.lease(A.ACQUIRE, ttl_s=5)
            assert "does not tell whether" in await refusal(plant.command(C.HOME))

    run(main())
