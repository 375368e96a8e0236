"""Joint states that a Python program receives: by `import robomesh`, and by a bare Zenoh subscriber.

    ./dev run python -m benchmarks client [--rounds 5] [--seconds 2] [--starts 15] [--json]

One process publishes joint states of an arm through a router in another, as fast as it can and then at
1000 Hz. The receivers take turns, each in a new process, and read the positions of each state. "Missed" are
states that were published and not returned: newer ones replaced them, or they were dropped on the way. The
processor time is that of all threads of the receiver. Last, new programs import robomesh and connect.
"""

import asyncio
import math
import statistics
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from multiprocessing.connection import Connection
from typing import Annotated, Any

import zenoh
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from typer import Option

import robomesh
from benchmarks.harness.processes import piped
from benchmarks.harness.turns import in_turns
from robomesh.contract.endpoints import client_config, router_config
from robomesh.publications.publisher import Publisher
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import SessionSettings, open_session
from tests.ports import free_port

JOINTS = ("waist", "shoulder", "elbow", "wrist", "roll")
KEY = "robomesh/bench/arm/joints"
HEADER = struct.Struct("<QQq")
# Name -> rate [Hz]; None: as fast as the publisher can.
LOADS = {"flood": None, "1000 Hz": 1000.0}
BUFFER = 1024
SETTLE_S = 0.3


def measure(
    rounds: int = 5,
    seconds: Annotated[float, Option(help="of each turn")] = 2.0,
    starts: Annotated[int, Option(help="programs started to measure the imports")] = 15,
) -> dict[str, Any]:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with piped(route, endpoint), piped(publish, endpoint) as publisher:
        publisher.recv()

        def received(name: str) -> dict[str, dict[str, float]]:
            return {
                load: turn(RECEIVERS[name], endpoint, publisher, rate, seconds)
                for load, rate in LOADS.items()
            }

        turns = in_turns({name: partial(received, name) for name in RECEIVERS}, rounds)
        return {
            "receivers": {name: summary(rows) for name, rows in turns.items()},
            "start_ms": start_times(endpoint, starts),
        }


def turn(
    receive: Callable[[str, Connection], None],
    endpoint: str,
    publisher: Connection,
    rate_hz: float | None,
    seconds: float,
) -> dict[str, float]:
    """Return the figures of one receiver and load."""
    with piped(receive, endpoint) as receiver:
        receiver.recv()
        begin_ns = time.time_ns() + int(2 * SETTLE_S * 1e9)
        window = begin_ns, begin_ns + int(seconds * 1e9)
        receiver.send(window)
        publisher.send((rate_hz, *window))
        sent = publisher.recv()
        row: dict[str, float] = receiver.recv()
    row["sent_hz"] = sent / seconds
    row["delivered_hz"] = row["delivered"] / seconds
    row["missed"] = 1.0 - row["delivered"] / sent
    return row


def until_closed(pipe: Connection) -> None:
    """Wait until the parent closes its end."""
    with suppress(EOFError):
        pipe.recv()


def route(endpoint: str, pipe: Connection) -> None:
    with zenoh.open(router_config((endpoint,))):
        until_closed(pipe)


# -------------------------------------------------------------------- sending


def publish(endpoint: str, pipe: Connection) -> None:
    """Publish states slowly, and as the parent orders."""

    async def serve() -> None:
        async with open_session(SessionSettings(connect=(endpoint,), wait_s=20.0)) as session:
            session.declare_presence("bench", "arm", "gateway")
            description = session.declare_publisher("bench", "arm", "description")
            joints = [schema.Description.Joint(name=name) for name in JOINTS]
            description.put(schema.Description(name="pt600", joints=joints))
            publisher = session.declare_publisher("bench", "arm", "joints")
            pipe.send("ready")
            with suppress(EOFError):
                await asyncio.to_thread(publish_orders, publisher, pipe)

    asyncio.run(serve())


def publish_orders(publisher: Publisher, pipe: Connection) -> None:
    states = [state(number) for number in range(1000)]
    number = 0
    while True:
        # Between orders just enough that no receiver finds the topic silent.
        while not pipe.poll(0.02):
            publisher.put_bytes(states[0], source_time_ns=time.time_ns())
        rate_hz, begin_ns, end_ns = pipe.recv()
        sent, due_s = 0, time.monotonic()
        while (now_ns := time.time_ns()) < end_ns + SETTLE_S * 1e9:
            publisher.put_bytes(states[number % 1000], source_time_ns=now_ns)
            sent += begin_ns <= now_ns < end_ns
            number += 1
            if rate_hz is not None:
                due_s += 1.0 / rate_hz
                time.sleep(max(0.0, due_s - time.monotonic()))
        pipe.send(sent)


def state(number: int) -> bytes:
    """Return a joint state of a moving arm as the gateway publishes it."""
    message = JointStates()
    message.timestamp.GetCurrentTime()
    for index, name in enumerate(JOINTS):
        message.joints.add(name=name, position=math.sin(number / 60 + index), velocity=math.cos(number / 60))
    return message.SerializeToString()


# ------------------------------------------------------------------ receiving


class Tally:
    """The states that a receiver got in the window that the parent names."""

    def __init__(self, pipe: Connection) -> None:
        self._pipe = pipe
        self._ages_ns: list[int] = []
        self._cpu_s: list[float] = []
        pipe.send("ready")
        self._begin_ns, self._end_ns = pipe.recv()
        self._clock = threading.Thread(target=self._read_cpu)
        self._clock.start()

    def note(self, sent_ns: int) -> bool:
        """Count a state; return whether the window is over."""
        if sent_ns >= self._end_ns:
            return True
        if sent_ns >= self._begin_ns:
            self._ages_ns.append(time.time_ns() - sent_ns)
        return False

    def report(self) -> None:
        self._clock.join()
        ages = sorted(self._ages_ns) or [0]
        self._pipe.send(
            {
                "delivered": len(self._ages_ns),
                "cpu_us": (self._cpu_s[1] - self._cpu_s[0]) / max(1, len(self._ages_ns)) * 1e6,
                "cores": (self._cpu_s[1] - self._cpu_s[0]) / ((self._end_ns - self._begin_ns) * 1e-9),
                "p50_ms": ages[len(ages) // 2] * 1e-6,
                "p99_ms": ages[int(len(ages) * 0.99)] * 1e-6,
            }
        )

    def _read_cpu(self) -> None:
        for at_ns in (self._begin_ns, self._end_ns):
            time.sleep(max(0.0, (at_ns - time.time_ns()) * 1e-9))
            self._cpu_s.append(time.process_time())


def blocking(endpoint: str, pipe: Connection, *, buffer: int = 1) -> None:
    with (
        robomesh.connect(endpoint, timeout_s=20.0) as mesh,
        mesh.robot("arm").joints(buffer=buffer) as states,
    ):
        next(states)
        tally = Tally(pipe)
        for each in states:
            each.positions  # noqa: B018
            if tally.note(each.time_ns):
                break
        tally.report()


def asynchronous(endpoint: str, pipe: Connection, *, buffer: int = 1) -> None:
    async def receive() -> None:
        async with robomesh.connect_async(endpoint, timeout_s=20.0) as mesh:
            states = (await mesh.robot("arm")).joints(buffer=buffer)
            await anext(states)
            tally = await asyncio.to_thread(Tally, pipe)
            async for each in states:
                each.positions  # noqa: B018
                if tally.note(each.time_ns):
                    break
            tally.report()

    asyncio.run(receive())


def sent_ns_of(sample: zenoh.Sample) -> int:
    assert sample.attachment is not None
    sent_ns: int = HEADER.unpack(sample.attachment.to_bytes())[2]
    return sent_ns


def decoded(sample: zenoh.Sample) -> tuple[float, ...]:
    return tuple(joint.position for joint in JointStates.FromString(sample.payload.to_bytes()).joints)


def callback(endpoint: str, pipe: Connection, *, decode: bool = True) -> None:
    with zenoh.open(client_config((endpoint,))) as session:
        tally = Tally(pipe)
        over = threading.Event()

        def take(sample: zenoh.Sample) -> None:
            if decode:
                decoded(sample)
            if tally.note(sent_ns_of(sample)):
                over.set()

        with session.declare_subscriber(KEY, take):
            over.wait()
        tally.report()


def channel(endpoint: str, pipe: Connection, *, handler: str) -> None:
    with (
        zenoh.open(client_config((endpoint,))) as session,
        session.declare_subscriber(KEY, getattr(zenoh.handlers, handler)(BUFFER)) as subscriber,
    ):
        tally = Tally(pipe)
        for sample in subscriber:
            decoded(sample)
            if tally.note(sent_ns_of(sample)):
                break
        tally.report()


RECEIVERS: dict[str, Callable[[str, Connection], None]] = {
    "robomesh Stream": blocking,
    f"robomesh Stream, buffer={BUFFER}": partial(blocking, buffer=BUFFER),
    "robomesh AsyncStream": asynchronous,
    f"robomesh AsyncStream, buffer={BUFFER}": partial(asynchronous, buffer=BUFFER),
    "zenoh callback": callback,
    "zenoh callback, not decoded": partial(callback, decode=False),
    f"zenoh FifoChannel({BUFFER})": partial(channel, handler="FifoChannel"),
    f"zenoh RingChannel({BUFFER})": partial(channel, handler="RingChannel"),
}


# ------------------------------------------------------------------- starting

_START = """
import time
began = time.perf_counter()
{imports}
imported = time.perf_counter()
{connect}
connected = time.perf_counter()
{close}
print(imported - began, connected - imported)
"""
_OPEN = """
config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", '["{router}"]')
mesh = zenoh.open(config)
"""
# Program -> its imports, and how it connects.
_STARTS = {
    "import robomesh": ("import robomesh", ""),
    "import robomesh, connect": ("import robomesh; robomesh.connect", "mesh = robomesh.connect('{router}')"),
    "import zenoh, open": ("import zenoh", _OPEN),
}


def start_times(endpoint: str, times: int) -> dict[str, dict[str, dict[str, float]]]:
    """Return how long new programs take to import and to connect [ms]."""
    rows: dict[str, list[tuple[float, float]]] = {name: [] for name in _STARTS}
    for _ in range(times + 1):  # the first compiles
        for name, (imports, connect) in _STARTS.items():
            opened = connect.format(router=endpoint)
            code = _START.format(imports=imports, connect=opened, close="mesh.close()" if opened else "")
            done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
            imported, connected = done.stdout.split()
            rows[name].append((float(imported) * 1e3, float(connected) * 1e3))
    return {
        name: {
            "import": spread([each[0] for each in measured[1:]]),
            **({"connect": spread([each[1] for each in measured[1:]])} if _STARTS[name][1] else {}),
        }
        for name, measured in rows.items()
    }


# -------------------------------------------------------------------- results


def spread(values: list[float]) -> dict[str, float]:
    return {"median": statistics.median(values), "min": min(values), "max": max(values)}


def summary(rounds: list[dict[str, dict[str, float]]]) -> dict[str, dict[str, dict[str, float]]]:
    """Return median and spread of each figure, by load."""
    return {
        load: {figure: spread([row[load][figure] for row in rounds]) for figure in rounds[0][load]}
        for load in LOADS
    }
