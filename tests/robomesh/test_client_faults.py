"""`import robomesh` beside faulty programs: invalid messages, closed connections, interrupted exits."""

import asyncio
import contextlib
import signal
import subprocess
import sys
import threading
import time

import pytest
import zenoh

import robomesh
from robomesh.client.event_loop import EventLoopThread
from robomesh.client.robot.commands import numbers, program_text
from robomesh.contract.endpoints import client_config
from robomesh.contract.header import Header, pack
from robomesh.schemas import robomesh_pb2 as schema
from tests.recordings import joints

WAIT_S = 60.0
JOINTS = "robomesh/site/arm/joints"


class Publisher:
    """A program that publishes what it likes."""

    def __init__(self, session, key, number=1):
        self._session, self._key, self._number = session, key, number

    def put(self, message, sequence):
        header = Header(self._number, sequence, time.time_ns())
        data = message if isinstance(message, bytes) else message.SerializeToString()
        self._session.put(self._key, data, attachment=pack(header))


@pytest.fixture
def plain(router):
    with zenoh.open(client_config((router,))) as session:
        yield session


@pytest.fixture
def mesh(router):
    with robomesh.connect(router, timeout_s=20.0) as connected:
        yield connected


@pytest.fixture
def robot(mesh, plain):
    """An arm with a description."""
    types = schema.Description.Joint(name="waist", type=schema.Description.Joint.ROTARY)
    description = schema.Description(joints=[types]).SerializeToString()
    key = "robomesh/site/arm/description"

    def describe(query):
        with query:
            query.reply(key, description, attachment=pack(Header(1, 1, time.time_ns())))

    with (
        plain.liveliness().declare_token("robomesh/site/arm/alive/gateway/1"),
        plain.declare_queryable(key, describe),
    ):
        while not mesh.robots():
            pass
        yield mesh.robot("arm")


def received(stream, publisher, message, first=1):
    """Return the stream's first value after publications that repeat until it arrives."""
    found = []

    def read():
        while not found:
            with contextlib.suppress(robomesh.StaleError):
                found.append(next(stream))

    reader = threading.Thread(target=read)
    reader.start()
    sequence = first
    while reader.is_alive():
        publisher.put(message, sequence)
        sequence += 1
        reader.join(0.05)
    return found[0]


@pytest.mark.parametrize("buffer", [0, -1, 1.5, 10**30, "2"])
def test_an_invalid_buffer_is_refused(robot, buffer):
    with pytest.raises(ValueError, match="buffer="):
        robot.joints(buffer=buffer)
    with pytest.raises(ValueError, match="on_stale="):
        robot.joints(on_stale="ignore")


def test_states_that_grew_stale_in_the_buffer_are_counted_as_skipped(robot, plain):
    publisher = Publisher(plain, JOINTS)
    with robot.joints(buffer=1000) as states:
        first = received(states, publisher, joints(waist=0))
        for sequence in range(1000, 1100):
            publisher.put(joints(waist=1), sequence)
        time.sleep(1.5)  # longer than the limit of stale states
        state = received(states, publisher, joints(waist=2), first=1100)
        assert state["waist"] == 2
        assert state.skipped == state.sequence - first.sequence - 1
        assert states.skipped == state.skipped


def test_an_invalid_message_hides_no_state_and_no_loss(robot, plain):
    publisher, other = Publisher(plain, JOINTS), Publisher(plain, JOINTS, number=2)
    with robot.joints() as states:
        first = received(states, publisher, joints(waist=0))
        for sequence in range(5):
            other.put(b"\xff\xff", sequence)
        state = received(states, publisher, joints(waist=2), first=1000)
        assert state.skipped == state.sequence - first.sequence - 1


def test_an_invalid_event_ends_no_stream_of_events(robot, mesh, plain):
    odd = schema.Event(code="odd")
    odd.timestamp.seconds = 1 << 62
    newer = schema.Event(code="newer", severity=99)  # of a program that knows more severities
    for stream in (robot.events(history=False), mesh.events(history=False)):
        with stream:
            Publisher(plain, "robomesh/site/arm/events/of/two").put(odd, 1)
            Publisher(plain, "robomesh/site/arm/events/gateway").put(odd, 1)
            event = received(stream, Publisher(plain, "robomesh/site/arm/events/watch"), newer)
            assert (event.code, event.severity) == ("newer", "99")


def test_a_closed_stream_ends_without_an_error(robot):
    states = robot.joints()
    states.close()
    time.sleep(2.5)  # longer than the limit of the first state
    assert list(states) == []


def test_calls_of_other_threads_end_with_a_clear_error_when_the_mesh_is_closed(router, robot):
    mesh = robomesh.connect(router, timeout_s=20.0)
    same, errors, called = mesh.robot("arm"), [], threading.Semaphore(0)

    def call():
        try:
            while True:
                same.last("controller")
                same.description()
                called.release()
        except Exception as error:
            errors.append(error)

    callers = [threading.Thread(target=call) for _ in range(4)]
    for caller in callers:
        caller.start()
    for _ in range(2):
        assert called.acquire(timeout=WAIT_S)
    mesh.close()
    for caller in callers:
        caller.join(WAIT_S)
    assert [type(error) for error in errors] == [robomesh.SessionError] * 4
    with pytest.raises(robomesh.SessionError, match="the connection is closed"):
        same.last("controller")


def test_a_mesh_that_several_threads_close_is_closed(router):
    for _ in range(5):
        mesh = robomesh.connect(router, timeout_s=20.0)
        streams = [mesh.events() for _ in range(5)]
        closers = [threading.Thread(target=mesh.close) for _ in range(8)]
        for closer in closers:
            closer.start()
        for closer in closers:
            closer.join(WAIT_S)
        assert [list(stream) for stream in streams] == [[]] * 5


def test_an_interrupted_call_of_a_function_that_blocks_leaves_no_traceback(monkeypatch):
    loop, begun, release = EventLoopThread(), threading.Event(), threading.Event()
    threads, faults = [], []
    monkeypatch.setattr(threading, "excepthook", faults.append)

    def block():
        threads.append(threading.current_thread())
        begun.set()
        release.wait(WAIT_S)

    def interrupt():
        if begun.is_set():
            raise KeyboardInterrupt

    try:
        with pytest.raises(KeyboardInterrupt):
            loop.run(asyncio.to_thread(block), waiting=interrupt)
    finally:
        release.set()
        loop.close()
    threads[0].join(WAIT_S)
    assert faults == []


SCRIPT = """
import faulthandler, os, signal, sys, threading, time
import robomesh

faulthandler.dump_traceback_later(40.0, exit=True)
signal.signal(signal.SIGINT, signal.default_int_handler)
mesh = robomesh.connect(sys.argv[1], timeout_s=20.0)
streams = [mesh.events(history=False) for _ in range(20)]
for stream in streams:
    next(stream)

def interrupt():
    threading.main_thread().join()
    for _ in range(30):
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.01)

threading.Thread(target=interrupt).start()
"""


@pytest.mark.slow
def test_ctrl_c_while_python_exits_does_not_abort_the_process(router, plain):
    arguments = [sys.executable, "-c", SCRIPT, router]
    publisher = Publisher(plain, "robomesh/site/arm/events/watch")
    with subprocess.Popen(arguments, stderr=subprocess.PIPE, text=True) as script:
        sequence, deadline = 0, time.monotonic() + WAIT_S
        while script.poll() is None:
            assert time.monotonic() < deadline
            sequence += 1
            publisher.put(schema.Event(code="again"), sequence)
            time.sleep(0.001)
        faults = script.stderr.read()
    assert script.returncode in (0, -signal.SIGINT), faults


@pytest.mark.parametrize(
    "values", ["12345", b"\0\0\0\0\0", {0: 1, 1: 1}, {1.0, 2.0}, [[0.0]], ["a"], [10**400], None]
)
def test_what_is_no_sequence_of_numbers_is_no_position(values):
    with pytest.raises(robomesh.MessageError, match="not a sequence of numbers"):
        numbers(values)


def test_a_program_that_is_no_text_or_endless_is_refused(tmp_path):
    (tmp_path / "long").write_bytes(b"home\n" * 300_000)
    for program in ("home \ud800", "home\n" * 300_000, tmp_path / "long", tmp_path / "a\0b", tmp_path):
        with pytest.raises(robomesh.MessageError):
            program_text(program)


def test_no_reason_prevents_a_stop(robot, plain):
    requests = []

    def stop(query):
        with query:
            requests.append(schema.StopRequest.FromString(query.payload.to_bytes()))
            query.reply(str(query.key_expr), schema.StopAnswer(stop_id=1, sent=True).SerializeToString())

    with plain.declare_queryable("robomesh/site/arm/stop", stop):
        for reason in ("\ud800", "x" * 10_000_000, ValueError("no"), "two\nlines"):
            assert robot.stop(reason).sent
    assert all(request.reason for request in requests)
