"""The gateway with each kind of controller: processor time of a state, and the delay of a stop.

    ./dev run python benchmarks/controllers.py [--protocols unit,rtde] [--robots 1,10] [--seconds 10]
                                               [--stops 100] [--json]

Router, gateway, and the simulated controllers, all in one process, are separate processes on this machine.
States: the joints that a monitor receives while the controllers' demos run; the gateway's processor time has
its child processes (the reader of OPC UA).

Stops: of each protocol with a stop, asked every 0.15 s by an operator over the mesh, until its bytes are on
the controller's connection, while all questions are asked at the declared rate; without load, and beside two
processes that compute. The peer in the same seconds is a bare Zenoh question to a process that only answers,
over the same router: what is left is the gateway's part.

Target: the gateway's part of a stop takes at most 5 ms (p99) beside the computing processes.
"""

import argparse
import asyncio
import contextlib
import json
import multiprocessing
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil
import zenoh

if __name__ == "__main__":
    sys.path.insert(1, str(Path(__file__).parents[1]))

from latency import free_port, process, service, summary, until_connectable
from plant import until

import robomesh
from benchmarks.burners import burning
from robomesh.contract.endpoints import client_config
from robomesh.schemas import robomesh_pb2 as schema

_PULSES = [1000.0] * 6
_STOP_EACH_S = 0.15  # those within 0.1 s are one
_MOST_STOPS = 10_000
_LATE_S = 2.0
_SETTLE_S = 3.0


@dataclass(frozen=True, kw_only=True)
class Kind:
    """A protocol.

    Attributes:
        lines: Of the site file, for a robot: `ports` are those of `serve`, in its order.
        model: Name of the robot.
        serve: Runs a simulated controller; calls `ready` with its ports.
        stop: Place of the port on which the stop is sent, and bytes in it; None: it only reads.
    """

    lines: Callable[[Sequence[int]], str]
    model: str
    serve: Callable[[Callable[[Sequence[int]], None]], Any]
    stop: tuple[int, bytes] | None = None
    datagrams: bool = False


async def _unit(ready: Callable[[Sequence[int]], None]) -> None:
    from controllers.unit.simulated.service import Settings, serve

    await serve(Settings(robot="pt600", demo=True), ready=lambda line: ready([_port(line)]))


def _port(line: str) -> int:
    return int(line.rpartition(":")[2])


async def _rtde(ready: Callable[[Sequence[int]], None]) -> None:
    from controllers.universal_robots.simulated.service import UrSettings, serve_rtde

    await serve_rtde(UrSettings(demo=True), ready=lambda ports: ready([ports.rtde, ports.primary]))


async def _rtde_motion(ready: Callable[[Sequence[int]], None]) -> None:
    from controllers.universal_robots.simulated.service import UrSettings, serve_rtde

    await serve_rtde(
        UrSettings(), ready=lambda each: ready([each.rtde, each.primary, each.scripts[0], each.dashboard])
    )


async def _hses(ready: Callable[[Sequence[int]], None]) -> None:
    from controllers.yaskawa.simulated.service import HsesSettings, serve_hses

    await serve_hses(HsesSettings(demo=True), ready=lambda port: ready([port]))


async def _hses_at_rest(ready: Callable[[Sequence[int]], None]) -> None:
    from controllers.yaskawa.simulated.service import HsesSettings, serve_hses

    await serve_hses(HsesSettings(), ready=lambda port: ready([port]))


async def _snpx(ready: Callable[[Sequence[int]], None]) -> None:
    from controllers.fanuc.simulated.service import SnpxSettings, serve_snpx

    await serve_snpx(SnpxSettings(demo=True), ready=lambda ports: ready([ports.snpx]))


async def _rmi(ready: Callable[[Sequence[int]], None]) -> None:
    from controllers.fanuc.simulated.service import SnpxSettings, serve_snpx

    await serve_snpx(SnpxSettings(rmi="127.0.0.1:0"), ready=ready)


async def _opcua(ready: Callable[[Sequence[int]], None]) -> None:
    from controllers.opcua.simulated.service import OpcUaSimulatorSettings, serve_opcua

    settings = OpcUaSimulatorSettings(demo=True, listen=f"127.0.0.1:{free_port()}")
    await serve_opcua(settings, ready=lambda port: ready([port]))


KINDS = {
    "unit": Kind(
        lines=lambda ports: f'controller = "tcp://127.0.0.1:{ports[0]}"\nstop_proven = true\n',
        model="pt600",
        serve=_unit,
        stop=(0, b"stop"),
    ),
    "rtde": Kind(
        lines=lambda ports: (
            f'protocol = "rtde"\ncontroller = "tcp://127.0.0.1:{ports[0]}"\n'
            f"ports = {{ primary = {ports[1]} }}\n"
        ),
        model="puma560",
        serve=_rtde,
    ),
    "rtde-500": Kind(
        lines=lambda ports: KINDS["rtde"].lines(ports) + "universal_robots = { rate = 500 }\n",
        model="puma560",
        serve=_rtde,
    ),
    "rtde-motion": Kind(
        lines=lambda ports: (
            f'protocol = "rtde"\ncontroller = "tcp://127.0.0.1:{ports[0]}"\n'
            f"ports = {{ primary = {ports[1]}, scripts = {ports[2]}, dashboard = {ports[3]} }}\n"
            "experimental = true\nuniversal_robots = { motion = true }\n"
            'stop_proven = { driver = "rtde", means = "dashboard stop and the program\'s stopj", '
            'software = "5.21.0.0", date = 2026-11-26 }\n'
        ),
        model="puma560",
        serve=_rtde_motion,
        stop=(3, b"stop"),
    ),
    "hses": Kind(
        lines=lambda ports: (
            f'protocol = "hses"\ncontroller = "udp://127.0.0.1:{ports[0]}"\n'
            f"yaskawa = {{ pulses_per_degree = {_PULSES} }}\n"
        ),
        model="puma560",
        serve=_hses,
    ),
    "hses-motion": Kind(
        lines=lambda ports: (
            f'protocol = "hses"\ncontroller = "udp://127.0.0.1:{ports[0]}"\nexperimental = true\n'
            'stop_proven = { driver = "hses", means = "HOLD, kept until RESET", '
            'software = "SIM1.00.00A, model PUMA560", date = 2026-11-26 }\n'
            f"yaskawa = {{ motion = true, pulses_per_degree = {_PULSES} }}\n"
        ),
        model="puma560",
        serve=_hses_at_rest,
        stop=(0, b"\x83\x00"),
        datagrams=True,
    ),
    "snpx": Kind(
        lines=lambda ports: (
            f'protocol = "snpx"\ncontroller = "tcp://127.0.0.1:{ports[0]}"\n'
            'fanuc = { assignments = "own", j23 = 1 }\n'
        ),
        model="puma560",
        serve=_snpx,
    ),
    "rmi-motion": Kind(
        lines=lambda ports: (
            f'protocol = "snpx"\ncontroller = "tcp://127.0.0.1:{ports[0]}"\nexperimental = true\n'
            f"ports = {{ rmi = {ports[1]}, rmi_session = {ports[2]} }}\n"
            'stop_proven = { driver = "snpx", means = "FRC_Abort of RMI", '
            'software = "V0.00P/00 simulated", date = 2026-11-26 }\n'
            'fanuc = { assignments = "own", j23 = 1, motion = true }\n'
        ),
        model="puma560",
        serve=_rmi,
        stop=(2, b"FRC_Abort"),
    ),
    "opcua": Kind(
        lines=lambda ports: (
            f'protocol = "opcua"\ncontroller = "tcp://127.0.0.1:{ports[0]}"\n'
            'opcua = { security = "none" }\n'
        ),
        model="puma560",
        serve=_opcua,
    ),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--protocols", default=",".join(KINDS), help="separated by commas")
    parser.add_argument("--robots", default="1,10", help="numbers of robots, separated by commas")
    parser.add_argument("--seconds", type=float, default=10.0, help="of each measurement of states")
    parser.add_argument("--stops", type=int, default=200, help="of each protocol and load; 0: none")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    kinds = [name for name in arguments.protocols.split(",") if name]
    if unknown := sorted({*kinds} - KINDS.keys()):
        parser.error(f"--protocols {unknown[0]}: must be one or more of {', '.join(KINDS)}")
    result: dict[str, Any] = {"cores": os.cpu_count(), "states": [], "stops": []}
    for name in kinds:
        if not name.endswith("-motion"):
            for robots in map(int, arguments.robots.split(",")):
                result["states"].append(states(name, robots, arguments.seconds))
        if KINDS[name].stop is not None and arguments.stops:
            result["stops"] += stops(name, arguments.stops)
    if arguments.json:
        print(json.dumps(result))
        return
    for row in result["states"]:
        print(
            f"{row['protocol']:<12} {row['robots']:4d} robots  {row['states_a_second']:8.1f} states/s  "
            f"{row['cpu_us_a_state']:7.1f} us of CPU a state  {row['cpu_percent']:6.2f} % of a core"
        )
    for row in result["stops"]:
        cells = "  ".join(
            f"{what} p50 {row[what]['p50']:6.2f} p99 {row[what]['p99']:6.2f} ms" for what in ("wire", "bare")
        )
        print(f"stop {row['protocol']:<12} {row['load']:<8} n {row['wire']['n']:4d}  {cells}")


# -------------------------------------------------------------------------------- states


def states(name: str, robots: int, seconds: float) -> dict[str, Any]:
    """Return the processor time of the gateway for a state that a monitor receives."""
    received = 0

    def count(_: zenoh.Sample) -> None:
        nonlocal received
        received += 1

    with (
        running(name, robots) as (endpoint, gateway, _),
        zenoh.open(client_config((endpoint,))) as session,
    ):
        subscriber = session.declare_subscriber("robomesh/bench/*/joints", count)
        until(lambda: received > 0)
        time.sleep(_SETTLE_S)
        begun_s, before, cpu_s = time.monotonic(), received, cpu_of(gateway.pid)
        time.sleep(seconds)
        took_s, states, cpu_s = time.monotonic() - begun_s, received - before, cpu_of(gateway.pid) - cpu_s
        subscriber.undeclare()
    return {
        "protocol": name,
        "robots": robots,
        "states_a_second": round(states / took_s, 1),
        "cpu_us_a_state": round(cpu_s / max(states, 1) * 1e6, 1),
        "cpu_percent": round(100 * cpu_s / took_s, 2),
    }


def cpu_of(process_id: int) -> float:
    """Return the processor time of a process and its children [s]."""
    found = 0.0
    parent = psutil.Process(process_id)
    for each in (parent, *parent.children(recursive=True)):
        with contextlib.suppress(psutil.NoSuchProcess):
            times = each.cpu_times()
            found += times.user + times.system
    return found


# --------------------------------------------------------------------------------- stops


def stops(name: str, number: int) -> list[dict[str, Any]]:
    """Return the delays of stops, without load and during computations of other processes."""
    rows = []
    with (
        running(name, 1) as (endpoint, _, arrivals),
        process(answer_bare, (endpoint,)),
        zenoh.open(client_config((endpoint,))) as session,
        robomesh.connect(endpoint, timeout_s=20.0) as mesh,
    ):
        until(lambda: asked(session, "robomesh/bench/arm-0/stop", _stop_request()) is not None)
        until(lambda: asked(session, "bare", b"") is not None)
        for load in ("idle", "burners"):
            with burning(2 if load == "burners" else 0):
                time.sleep(1.0)
                # The session of RMI, on which its stop goes, is open only while somebody is in control.
                with mesh.robot("bench/arm-0").control("bench") as arm:
                    time.sleep(0.5)
                    rows.append({"protocol": name, "load": load, **delays(session, arrivals, number, arm)})
    return rows


def delays(session: Any, arrivals: Any, number: int, arm: robomesh.Arm) -> dict[str, Any]:
    """Ask for stops and bare answers in turn, in control."""
    wire, bare = [], []
    for _ in range(number):
        begun_s, count, begun_ns = time.monotonic(), arrivals[0], time.monotonic_ns()
        asked(session, "robomesh/bench/arm-0/stop", _stop_request())
        while arrivals[0] == count and time.monotonic() - begun_s < _LATE_S:
            time.sleep(0.0005)
        if arrivals[0] > count:
            wire.append(arrivals[1 + count] - begun_ns)
        begun_ns = time.monotonic_ns()
        if asked(session, "bare", b"") is not None:
            bare.append(time.monotonic_ns() - begun_ns)
        arm.renew()
        time.sleep(max(0.0, begun_s + _STOP_EACH_S - time.monotonic()))
    return {"wire": summary(wire), "bare": summary(bare)}


def asked(session: Any, key: str, payload: bytes) -> bytes | None:
    """Ask over the mesh; return the answer."""
    for reply in session.get(key, payload=payload, timeout=_LATE_S, priority=zenoh.Priority.REAL_TIME):
        if reply.ok is not None:
            return bytes(reply.ok.payload.to_bytes())
    return None


def _stop_request() -> bytes:
    return schema.StopRequest(by="bench").SerializeToString()


def answer_bare(endpoint: str) -> None:
    """Answer questions immediately."""
    with zenoh.open(client_config((endpoint,))) as session:
        answering = session.declare_queryable("bare", lambda query: query.reply("bare", b""))
        time.sleep(3600)
        answering.undeclare()


# ---------------------------------------------------------------------------------- site


@contextlib.contextmanager
def running(name: str, robots: int) -> Iterator[tuple[str, Any, Any]]:
    """Run a site; yield its router, the gateway's process, and the times of stops [ns] after their count."""
    kind = KINDS[name]
    arrivals = multiprocessing.RawArray("q", _MOST_STOPS + 1)
    ports = multiprocessing.Array("i", 8 * robots)
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
        stack.enter_context(process(controllers, (name, robots, ports, arrivals)))
        until(lambda: all(ports[8 * number] for number in range(robots)))
        file = Path(folder) / "site.toml"
        tables = [
            f'[[robot]]\nname = "arm-{number}"\nmodel = "{kind.model}"\n'
            + kind.lines(ports[8 * number : 8 * number + 8])
            for number in range(robots)
        ]
        file.write_text(
            f'site = "bench"\n[router]\nlisten = ["{endpoint}"]\n[audit]\nfolder = "{folder}/audit"\n'
            + "".join(tables)
        )
        stack.enter_context(service("router", file, endpoint))
        until_connectable(int(endpoint.rpartition(":")[2]))
        yield endpoint, stack.enter_context(service("gateway", file, endpoint)), arrivals


def controllers(name: str, robots: int, ports: Any, arrivals: Any) -> None:
    """Run simulated controllers, each behind wires that record when a stop passes."""
    from tests.protocol_gateway.wire import Wire

    kind = KINDS[name]

    class Recorded(list[bytes]):
        """The bytes of the port on which stops are sent: only their times are kept."""

        def append(self, data: bytes) -> None:
            assert kind.stop is not None
            if kind.stop[1] in data and arrivals[0] < _MOST_STOPS:
                arrivals[1 + arrivals[0]] = time.monotonic_ns()
                arrivals[0] += 1

    async def serve(number: int) -> None:
        loop = asyncio.get_running_loop()
        found: asyncio.Future[Sequence[int]] = loop.create_future()
        serving = loop.create_task(kind.serve(found.set_result))
        own = [*(await found)]
        if kind.stop is not None:
            place, _ = kind.stop
            wire = Wire(own[place], datagrams=kind.datagrams)
            wire.sent = Recorded()
            await wire.open()
            own[place] = wire.port
        # The first one last: then all are there.
        for place, port in reversed([*enumerate(own)]):
            ports[8 * number + place] = port
        await serving

    async def run() -> None:
        await asyncio.gather(*(serve(number) for number in range(robots)))

    asyncio.run(run())


if __name__ == "__main__":
    multiprocessing.set_start_method("spawn")
    main()
