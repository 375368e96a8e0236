"""The gateway under load: units parsed a second, robots in one process, clients that do not read.

    ./dev run python -m benchmarks gateway [--parse] [--robots 1,10,100] [--legacy] [--seconds 10] [--json]

Without an option, all three sections run. Router, gateway, controllers and monitor are separate processes
on this machine. Latencies use its monotonic clock, from just before a unit is written to its
controller's socket until a monitor's subscriber has the message. CPU is user and system time of all the
gateway's threads. The peer is a bare Zenoh put with the same size and rate, measured right after.

Target: 150,000 five-joint units a second on one core; 100 robots x 100 Hz, nothing lost, p99 under 20 ms,
at most 60 us of CPU a unit; one of 64 clients that never reads costs the others at most 20 % of p99.
"""

import contextlib
import multiprocessing
import random
import threading
import time
from collections.abc import Callable, Iterator
from typing import Annotated, Any

import zenoh
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from typer import Option

from benchmarks.gateway.legacy_clients import serve_old_programs
from benchmarks.harness.processes import cpu_s, process, rss_mib, until
from benchmarks.harness.sites import robot, running_site
from benchmarks.harness.turns import summary
from benchmarks.harness.unit_controllers import RATE_HZ, number_in, paced, running_controllers
from controllers.unit.driver import UnitDriver
from robomesh.contract.endpoints import client_config
from robomesh.contract.header import unpack
from robots.kinematics.joints import JointType

Seen = tuple[str, bytes, bytes, int]  # key, payload, attachment, monotonic ns


def measure(
    parse: Annotated[bool, Option("--parse", help="units parsed a second")] = False,
    robots: Annotated[str, Option(metavar="N,N", help="robots in one gateway")] = "",
    legacy: Annotated[bool, Option("--legacy", help="64 legacy clients, one of which does not read")] = False,
    seconds: Annotated[float, Option(help="of each measurement")] = 10.0,
) -> dict[str, Any]:
    everything = not (parse or robots or legacy)
    result: dict[str, Any] = {}
    if parse or everything:
        result["parse"] = parsed()
    if counts := robots or ("1,10,50,100,200" if everything else ""):
        result["robots"] = [carry(int(count), seconds) for count in counts.split(",")]
    if legacy or everything:
        result["legacy"] = serve_old_programs()
    return result


# ------------------------------------------------------------------------- parsing


def parsed() -> dict[str, dict[str, float]]:
    """Parse bytes to events on one core; return the best of five runs over 20,000 units."""
    chance = random.Random(1)

    def values(separator: str = ";") -> str:
        return separator.join(f"{chance.uniform(-180, 180):.2f}" for _ in range(5))

    forms: dict[str, tuple[Callable[[int], str], dict[int, str]]] = {
        "names": (lambda k: f"1#ABSOLUTE.DEG*{values()}@", {}),
        "codes": (lambda k: f"1#2*{values()}@", {2: "ABSOLUTE.DEG"}),
        "as the paper prints it": (lambda k: f"1#ABSOLUTE.DEG* {values('; ').replace('-', '- ')}@", {}),
        "with velocities, status and time": (
            lambda k: (
                f"4#ABSOLUTE.DEG*{values()}&VELOCITY.DEG*{values()}"
                f"&STATUS*moving;remote;homed&TIME*{k / 100:.2f}@"
            ),
            {},
        ),
    }
    result = {}
    for name, (form, codes) in forms.items():
        units = [form(k).encode() for k in range(20_000)]
        whole = b"".join(units)
        for cut, pieces in (
            ("4 KiB pieces", [whole[at : at + 4096] for at in range(0, len(whole), 4096)]),
            ("a unit a piece", units),
        ):
            seconds = min(parsed_s(pieces, codes, len(units)) for _ in range(5))
            result[f"{name}, {cut}"] = {"units_s": len(units) / seconds, "us": seconds / len(units) * 1e6}
    return result


def parsed_s(pieces: list[bytes], codes: dict[int, str], units: int) -> float:
    driver = UnitDriver([JointType.ROTARY] * 5, codes)
    begun = time.process_time()
    read = 0
    for piece in pieces:
        read += driver.read(piece).units
    took = time.process_time() - begun
    assert read == units
    return took


# -------------------------------------------------------------------------- robots


def carry(robots: int, seconds: float) -> dict[str, Any]:
    """Measure a number of robots in one gateway, then the same number of bare publishers."""
    units = int(seconds * RATE_HZ)
    sent = robots * units
    written, put = multiprocessing.RawArray("q", sent), multiprocessing.RawArray("q", sent)
    go, bare_cpu = multiprocessing.Event(), multiprocessing.Value("d")
    with (
        running_controllers(robots, written, units, go) as ports,
        running_site("gateway", tables=robots_at(ports)) as site,
    ):
        endpoint, gateway = site.endpoint, site.processes["gateway"]
        with monitor(endpoint, "robomesh/bench/*/joints") as seen:
            until(lambda: len({key for key, *_ in list(seen)}) == robots)
            begun_s, begun_cpu_s = time.monotonic(), cpu_s(gateway.pid)
            go.set()
            time.sleep(seconds)
            lasted_s, took_s = time.monotonic() - begun_s, cpu_s(gateway.pid) - begun_cpu_s
            memory = rss_mib(gateway.pid)
            time.sleep(2.0)
            rows = [place for key, payload, _, at in seen if (place := decoded(key, payload, at))]
            gaps = lost_numbers(seen)
            size = max(len(payload) for _, payload, *_ in seen)
        with (
            monitor(endpoint, "bare/*") as bare,
            process(bare_puts, endpoint, robots, put, units, size, bare_cpu),
        ):
            until(lambda: bool(bare_cpu.value))
    latencies = summary([at - written[robot * units + k - 1] for robot, k, at in rows])
    puts = summary([at - put[int.from_bytes(data[:8], "little")] for _, data, _, at in bare])
    cpu_us, bare_cpu_us = took_s / (lasted_s * RATE_HZ * robots) * 1e6, bare_cpu.value / sent * 1e6
    return {
        "robots": robots,
        "sent": sent,
        "received": len(rows),
        "lost": sent - len(rows),
        "lost_on_the_mesh": gaps,
        "unit": latencies,
        "cpu_us": cpu_us,
        "cpu_share": took_s / lasted_s,
        "rss_mib": memory,
        "bare": puts,
        "bare_lost": sent - len(bare),
        "bare_cpu_us": bare_cpu_us,
        "ratio_p50": latencies["p50"] / puts["p50"],
        "ratio_cpu": cpu_us / bare_cpu_us,
    }


def robots_at(ports: list[int]) -> str:
    return "".join(robot(f"arm-{number}", port) for number, port in enumerate(ports))


def decoded(key: str, payload: bytes, at: int) -> tuple[int, int, int] | None:
    """Return the robot, the unit's number and its arrival; None for a unit from before the measurement."""
    k = number_in(JointStates.FromString(payload).joints)
    return (int(key.split("/")[2].removeprefix("arm-")), k, at) if k else None


def lost_numbers(seen: list[Seen]) -> int:
    """Count the gaps in the sequences of all publishers."""
    numbers: dict[str, list[int]] = {}
    for key, _, attachment, _ in seen:
        numbers.setdefault(key, []).append(unpack(attachment).sequence)
    return sum(max(each) - min(each) + 1 - len(each) for each in numbers.values())


@contextlib.contextmanager
def monitor(endpoint: str, key_expr: str) -> Iterator[list[Seen]]:
    """Receive every message on a key with its arrival time; decode none during the measurement."""
    seen: list[Seen] = []
    with zenoh.open(client_config((endpoint,))) as session:
        subscriber = session.declare_subscriber(key_expr, zenoh.handlers.RingChannel(100_000))

        def take() -> None:
            for sample in subscriber:
                at = time.monotonic_ns()
                seen.append(
                    (str(sample.key_expr), sample.payload.to_bytes(), sample.attachment.to_bytes(), at)
                )

        taking = threading.Thread(target=take)
        taking.start()
        try:
            yield seen
        finally:
            subscriber.undeclare()
            taking.join(10)


def bare_puts(endpoint: str, robots: int, put: Any, units: int, size: int, cpu: Any) -> None:
    """Measure plain Zenoh: as many publishers and bytes, with the same rate, priority and router."""
    with zenoh.open(client_config((endpoint,))) as session:
        publishers = [
            session.declare_publisher(
                f"bare/{robot}",
                priority=zenoh.Priority.REAL_TIME,
                congestion_control=zenoh.CongestionControl.DROP,
            )
            for robot in range(robots)
        ]
        time.sleep(1.0)
        begun_s = time.process_time()
        filling = bytes(size - 8)
        for k, robot in paced(robots, units):
            place = robot * units + k - 1
            put[place] = time.monotonic_ns()
            publishers[robot].put(place.to_bytes(8, "little") + filling, attachment=bytes(24))
        took_s = time.process_time() - begun_s
        time.sleep(2.0)
        cpu.value = took_s
