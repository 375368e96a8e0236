"""Legacy clients at one robot of the gateway: the cost of one client that never reads to the others."""

import multiprocessing
import selectors
import socket
import statistics
import time
from typing import Any

import zenoh

from benchmarks.harness.processes import process, until, until_connectable
from benchmarks.harness.sites import robot, running_site
from benchmarks.harness.turns import summary
from benchmarks.harness.unit_controllers import RATE_HZ, number_of, running_controllers
from robomesh.contract.endpoints import client_config
from robomesh.schemas.robomesh_pb2 import ControllerState
from tests.ports import free_port

READERS = 63
PAIRS = 10
# The client falls behind once two socket buffers are full; 5 s later the gateway would close it.
FILLING_S, MEASURED_S = 1.5, 3.0
# Long units, so that the buffers fill up soon.
UNIT_BYTES = 300


def serve_old_programs() -> dict[str, Any]:
    """Measure the readers' delays, in turn with one more reader and with a client that never reads."""
    seconds = 1.5 * PAIRS * 2 * (FILLING_S + MEASURED_S)
    units = int(seconds * RATE_HZ)
    written = multiprocessing.RawArray("q", units)
    received = multiprocessing.RawArray("q", units * READERS)
    go, attached = multiprocessing.Event(), multiprocessing.Event()
    port = free_port()
    listening = f'legacy_clients = {{ listen = "127.0.0.1:{port}", most = 64 }}\n'
    turns: list[tuple[bool, int, int]] = []
    with (
        running_controllers(1, written, units, go, unit_bytes=UNIT_BYTES) as (controller,),
        running_site("gateway", tables=robot("arm-0", controller) + listening) as site,
    ):
        until_connectable(port)
        with process(read_all, port, received, units, attached):
            until(attached.is_set)
            go.set()
            for turn in range(2 * PAIRS):
                # The order alternates from pair to pair, so that drift affects both equally.
                silent = turn % 4 in (1, 2)
                with process(attend, port, silent):
                    time.sleep(FILLING_S)
                    begun = time.monotonic_ns()
                    time.sleep(MEASURED_S)
                    turns.append((silent, begun, time.monotonic_ns()))
            counts = last_counts(site.endpoint)
            time.sleep(1.0)
    delays: dict[bool, list[list[int]]] = {False: [], True: []}
    lost = sent = 0
    for silent, begun, end in turns:
        in_turn = [k for k in range(units) if begun <= written[k] < end]
        came = [(received[reader * units + k], written[k]) for reader in range(READERS) for k in in_turn]
        delays[silent].append([at - put for at, put in came if at])
        sent, lost = sent + len(came), lost + sum(not at for at, _ in came)
    p99 = {silent: [summary(each)["p99"] for each in runs] for silent, runs in delays.items()}
    ratios = [with_one / without for with_one, without in zip(p99[True], p99[False], strict=True)]
    return {
        "readers": READERS,
        "sent": sent,
        "lost": lost,
        "p99_ms": {
            "all read": statistics.median(p99[False]),
            "one does not": statistics.median(p99[True]),
        },
        "ratio_p99": statistics.median(p99[True]) / statistics.median(p99[False]),
        "ratios": ratios,
        "states_skipped": counts.states_skipped,
    }


def attend(port: int, silent: bool) -> None:
    with socket.socket() as client:
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
        client.connect(("127.0.0.1", port))
        while silent or client.recv(4096):
            time.sleep(0.005)


def read_all(port: int, received: Any, units: int, attached: Any) -> None:
    """Run all readers in one small process and record when each unit arrived."""
    with selectors.DefaultSelector() as selector:
        rests = [b""] * READERS
        for reader in range(READERS):
            selector.register(socket.create_connection(("127.0.0.1", port)), selectors.EVENT_READ, reader)
        attached.set()
        while True:
            for key, _ in selector.select():
                assert isinstance(key.fileobj, socket.socket)
                data = key.fileobj.recv(65_536)
                at = time.monotonic_ns()
                if not data:
                    return
                *whole, rests[key.data] = (rests[key.data] + data).split(b"@")
                for unit in whole:
                    if b"ABSOLUTE" in unit and (k := number_of(unit)):
                        received[key.data * units + k - 1] = at


def last_counts(endpoint: str) -> Any:
    """Return what the gateway last counted of its legacy clients."""
    with zenoh.open(client_config((endpoint,))) as session:
        for reply in session.get("robomesh/bench/arm-0/controller"):
            return ControllerState.FromString(reply.ok.payload.to_bytes()).legacy_clients
    raise AssertionError("the gateway publishes no state")
