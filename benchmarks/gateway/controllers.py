"""The gateway with each kind of controller: processor time of a state, and the delay of a stop.

    ./dev run python -m benchmarks controllers [--protocols unit,rtde] [--robots 1,10] [--seconds 10]
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

import asyncio
import contextlib
import multiprocessing
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import zenoh
from typer import Option

import robomesh
from benchmarks.harness.burners import burning
from benchmarks.harness.processes import cpu_s, process, until
from benchmarks.harness.program import chosen
from benchmarks.harness.sites import Site, running_site
from benchmarks.harness.turns import summary
from robomesh.contract.endpoints import client_config
from robomesh.schemas import robomesh_pb2 as schema
from tests.ports import free_port

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


def measure(
    protocols: Annotated[str, Option(help="separated by commas")] = ",".join(KINDS),
    robots: Annotated[str, Option(help="numbers of robots, separated by commas")] = "1,10",
    seconds: Annotated[float, Option(help="of each measurement of states")] = 10.0,
    stops: Annotated[int, Option(help="of each protocol and load; 0: none")] = 200,
) -> dict[str, Any]:
    result: dict[str, Any] = {"states": [], "stops": []}
    for name in chosen("--protocols", protocols, KINDS):
        if not name.endswith("-motion"):
            result["states"] += [states(name, int(count), seconds) for count in robots.split(",")]
        if KINDS[name].stop is not None and stops:
            result["stops"] += stops_of(name, stops)
    return result


# -------------------------------------------------------------------------------- states


def states(name: str, robots: int, seconds: float) -> dict[str, Any]:
    """Return the processor time of the gateway for a state that a monitor receives."""
    received = 0

    def count(_: zenoh.Sample) -> None:
        nonlocal received
        received += 1

    with (
        running(name, robots) as (site, _),
        zenoh.open(client_config((site.endpoint,))) as session,
    ):
        gateway = site.processes["gateway"].pid
        subscriber = session.declare_subscriber("robomesh/bench/*/joints", count)
        until(lambda: received > 0)
        time.sleep(_SETTLE_S)
        begun_s, before, used_s = time.monotonic(), received, cpu_s(gateway, children=True)
        time.sleep(seconds)
        took_s, states = time.monotonic() - begun_s, received - before
        used_s = cpu_s(gateway, children=True) - used_s
        subscriber.undeclare()
    return {
        "protocol": name,
        "robots": robots,
        "states_a_second": round(states / took_s, 1),
        "cpu_us_a_state": round(used_s / max(states, 1) * 1e6, 1),
        "cpu_percent": round(100 * used_s / took_s, 2),
    }


# --------------------------------------------------------------------------------- stops


def stops_of(name: str, number: int) -> list[dict[str, Any]]:
    """Return the delays of stops, without load and during computations of other processes."""
    rows = []
    with (
        running(name, 1) as (site, arrivals),
        process(answer_bare, site.endpoint),
        zenoh.open(client_config((site.endpoint,))) as session,
        robomesh.connect(site.endpoint, timeout_s=20.0) as mesh,
    ):
        until(lambda: asked(session, "robomesh/bench/arm-0/stop", _stop_request()) is not None)
        until(lambda: asked(session, "bare", b"") is not None)
        for load in ("idle", "burners"):
            with burning(2 if load == "burners" else 0):
                time.sleep(1.0)
                # The session of RMI, on which its stop goes, is open only while an operator is in control.
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
def running(name: str, robots: int) -> Iterator[tuple[Site, Any]]:
    """Run a site; yield it, and the times of stops [ns] after their count."""
    kind = KINDS[name]
    arrivals = multiprocessing.RawArray("q", _MOST_STOPS + 1)
    ports = multiprocessing.Array("i", 8 * robots)
    with process(controllers, name, robots, ports, arrivals):
        until(lambda: all(ports[8 * number] for number in range(robots)))
        tables = "".join(
            f'[[robot]]\nname = "arm-{number}"\nmodel = "{kind.model}"\n'
            + kind.lines(ports[8 * number : 8 * number + 8])
            for number in range(robots)
        )
        with running_site("gateway", tables=tables) as site:
            yield site, arrivals


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
