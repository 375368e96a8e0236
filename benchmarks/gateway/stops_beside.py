"""Stops without other load, with two processes that burn CPU, and with each flood of `floods.py`.

Part of `command`, or alone:

    ./dev run python -m benchmarks stops_beside [--stops 120] [--floods commands,stops] [--keys] [--json]

A real router and a gateway of two robots are separate processes; this program runs two controllers in one
more process. Two clients send stops to both robots in turn: a plain Zenoh session, written from Zenoh's own
documentation, and then our own client, which asks over both links. The loads take turns, so that other
load on the machine affects all of them. Times run from the request to the stop unit at the controller
(`wire`) and to the answer at the client (`answer`), by this machine's monotonic clock. A request within 0.1 s
of another one's unit shares that unit: its `wire` is 0.

A flood is for the first robot, from one source and from two (`x2`), each a process with one plain Zenoh
session and, with keys, a separate certificate. During each load another plain session asks for control a
hundred times, as an honest operator would (`others`): the number of answers within 2 s, and their delays.

Target: p95 during a flood at most three times the p95 with the CPU burners.
"""

import asyncio
import contextlib
import json
import math
import multiprocessing
import random
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import zenoh
from typer import Option

from benchmarks.gateway.floods import FLOODS, run
from benchmarks.harness.burners import burn
from benchmarks.harness.processes import piped, process, until_connectable
from benchmarks.harness.program import chosen
from benchmarks.harness.sites import Site, robot, running_site
from benchmarks.harness.turns import percentile
from benchmarks.harness.unit_controllers import RestingController
from robomesh.contract.endpoints import bundle
from robomesh.contract.topics import Role
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import SessionSettings, open_session
from services.pki import Folder, site_keys
from tests.ports import free_port

ROBOTS = ("arm", "other")
IN_TRANSIT_NS = 100_000_000
HONEST = "zhao"
FLOODERS = {Role.OPERATOR: ("li", "wang"), Role.MONITOR: ("eve", "mallory")}
STOP_AFTER_S = (0.06, 0.075)  # a robot gets one every 0.12 to 0.15 s; those within 0.1 s share a unit
MOST_STOPS = 100_000
ANSWER_S = 3.0  # a stop without an answer within this time is missing
OTHERS = 100


class Load(NamedTuple):
    """A load of a number of processes."""

    name: str
    sources: int

    def __str__(self) -> str:
        return self.name if self.sources < 2 or self.name == "burners" else f"{self.name} x{self.sources}"


@dataclass(frozen=True)
class Mesh:
    """A site's router, and the folder of its clients' certificates; None: a mesh without keys."""

    endpoint: str
    keys: Folder | None

    def name(self, person: str) -> str:
        """Return a client's name in its requests."""
        return person if self.keys is None else f"{person}.bench"


def measure(
    stops: Annotated[int, Option(help="of each client, robot and load")] = 120,
    rounds: Annotated[int, Option(help="how often the loads take turns")] = 4,
    floods: Annotated[str, Option(help=f"all, or of {', '.join(FLOODS)}")] = "commands,names",
    keys: Annotated[bool, Option("--keys", help="with certificates, over TLS")] = False,
) -> dict[str, Any]:
    names = tuple(FLOODS) if floods == "all" else tuple(chosen("--floods", floods, FLOODS))
    return stops_beside(stops, names, with_keys=keys, rounds=rounds)


def stops_beside(
    number: int, names: tuple[str, ...] = ("commands", "names"), *, with_keys: bool, rounds: int = 4
) -> dict[str, Any]:
    """Send stops during each load.

    Args:
        number: How many of each client, robot and load.
        names: Of floods.
        rounds: How often the loads take turns.
    """
    kinds = [name for name in names if not (with_keys and FLOODS[name].keyless)]
    loads = [
        Load("idle", 0),
        Load("burners", 2),
        *(Load(name, sources) for name in kinds for sources in (1, 2)),
    ]
    found: dict[tuple[str, str, str], list[tuple[float, float]]] = {}
    others: dict[str, list[tuple[float, float]]] = {}
    asked = multiprocessing.RawArray("q", 1)
    asked_in, took_s = Counter[str](), Counter[str]()
    with site(with_keys=with_keys) as (where, arrivals), askers(where) as ask:
        for _ in range(rounds):
            for load in loads:
                began, before = time.monotonic(), asked[0]
                with beside(load, where, asked):
                    for client in ("plain", "ours"):
                        for robot, times in ask(client, -(-number // rounds), arrivals).items():
                            found.setdefault((client, robot, str(load)), []).extend(times)
                    others.setdefault(str(load), []).extend(honest(where, OTHERS // rounds))
                asked_in[str(load)] += asked[0] - before
                took_s[str(load)] += time.monotonic() - began
    rows = {" ".join(key): summary(times) for key, times in found.items()}
    return {
        "keys": with_keys,
        "times_ms": rows,
        "others_ms": {load: summary(times) for load, times in others.items()},
        "to_burners_p95": {
            f"{client} {robot} {load} {what}": rows[f"{client} {robot} {load}"][what]["p95"]
            / rows[f"{client} {robot} burners"][what]["p95"]
            for client, robot, load in found
            for what in ("wire", "answer")
        },
        "asked_per_s": {load: asked_in[load] / took_s[load] for load in map(str, loads[2:])},
    }


def summary(times: list[tuple[float, float]]) -> dict[str, Any]:
    """Return the percentiles [ms] of (to the wire, to the answer) pairs [s]; nan: no arrival."""
    row: dict[str, Any] = {"n": len(times), "missing": sum(any(t != t for t in pair) for pair in times)}
    for index, what in enumerate(("wire", "answer")):
        values = [pair[index] * 1e3 for pair in times if pair[index] == pair[index]]
        row[what] = {
            "p50": percentile(values, 50),
            "p95": percentile(values, 95),
            "max": percentile(values, 100),
        }
    return row


# -------------------------------------------------------------------------- the site


@contextlib.contextmanager
def recording_controllers() -> Iterator[tuple[str, Any]]:
    """Run two controllers in a process; yield their tables and the arrivals of stops at them [ns]."""
    ports = [free_port() for _ in ROBOTS]
    arrivals = multiprocessing.RawArray("q", 2 * MOST_STOPS + 2)
    with process(controllers, ports, arrivals):
        for port in ports:
            until_connectable(port)
        yield "".join(robot(name, port) for name, port in zip(ROBOTS, ports, strict=True)), arrivals


def controllers(ports: list[int], arrivals: Any) -> None:
    """Run two controllers at rest; `arrivals` has the number of stops of each, then their times."""

    def noting(index: int) -> Callable[[int], None]:
        def note(at: int) -> None:
            count = arrivals[index]
            arrivals[2 + index * MOST_STOPS + count] = at
            arrivals[index] = count + 1

        return note

    for index, port in enumerate(ports):
        RestingController(noting(index), port)
    threading.Event().wait()


@contextlib.contextmanager
def site(*, with_keys: bool) -> Iterator[tuple[Mesh, Any]]:
    """Run a router and a gateway of two robots; yield the mesh, and the arrivals of stops."""

    def prepare(site: Site) -> None:
        if with_keys:
            keys = Folder(site.folder / "keys")
            site_keys.prepare(keys, "bench", robots=list(ROBOTS), border="open", routers=[site.endpoint])
            site_keys.issue(keys, HONEST, Role.OPERATOR)
            for role, people in FLOODERS.items():
                for person in people:
                    site_keys.issue(keys, person, role)

    with recording_controllers() as (robots, arrivals):
        scheme, tables = ("tls", f'[keys]\nfolder = "keys"\n{robots}') if with_keys else ("tcp", robots)
        with running_site("gateway", tables=tables, scheme=scheme, prepare=prepare) as running:
            keys = Folder(running.folder / "keys") if with_keys else None
            yield Mesh(running.endpoint, keys), arrivals


# ----------------------------------------------------------------------- the clients


@contextlib.contextmanager
def askers(where: Mesh) -> Iterator[Callable[[str, int, Any], dict[str, list[tuple[float, float]]]]]:
    """Start a process for each client, which sends stops on request."""
    pipes = {}
    with contextlib.ExitStack() as stack:
        for name, target in (("plain", plain_client), ("ours", our_client)):
            pipes[name] = stack.enter_context(piped(target, where))
        for pipe in pipes.values():
            assert pipe.recv() == "ready"

        def ask(client: str, number: int, arrivals: Any) -> dict[str, list[tuple[float, float]]]:
            before = [arrivals[index] for index in range(len(ROBOTS))]
            pipes[client].send(number)
            asked = pipes[client].recv()
            found: dict[str, list[tuple[float, float]]] = {}
            for index, robot in enumerate(ROBOTS):
                first, last = before[index], arrivals[index]
                start = 2 + index * MOST_STOPS
                came = list(arrivals[start + first : start + last])
                found[robot] = []
                for at, answered in asked[robot]:
                    # The first unit after this request, or that of another one just before.
                    wire = next((max(each, at) for each in came if each >= at - IN_TRANSIT_NS), None)
                    found[robot].append(
                        (
                            math.nan if wire is None else (wire - at) * 1e-9,
                            math.nan if answered is None else (answered - at) * 1e-9,
                        )
                    )
            return found

        yield ask


def plain_config(where: Mesh, person: str = HONEST) -> zenoh.Config:
    """Return the configuration that Zenoh's own documentation gives for a client."""
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([where.endpoint]))
    config.insert_json5("scouting/multicast/enabled", "false")
    if where.keys is not None:
        bundle = str(where.keys.person(person))
        for key, value in {
            "root_ca_certificate": bundle,
            "connect_certificate": bundle,
            "connect_private_key": bundle,
            "enable_mtls": True,
            "verify_name_on_connect": False,
        }.items():
            config.insert_json5(f"transport/link/tls/{key}", json.dumps(value))
    return config


def plain_client(where: Mesh, pipe: Any) -> None:
    """Send stops over one plain Zenoh session."""
    with zenoh.open(plain_config(where)) as session:

        def stop(robot: str) -> int | None:
            payload = json.dumps({"by": f"plain {random.random()}"}).encode()
            for reply in session.get(f"robomesh/bench/{robot}/stop", payload=payload, timeout=ANSWER_S):
                if reply.ok is not None:
                    return time.monotonic_ns()
            return None

        while stop(ROBOTS[-1]) is None:
            time.sleep(0.1)
        pipe.send("ready")
        while True:
            number = pipe.recv()
            asked: dict[str, list[tuple[int, int | None]]] = {robot: [] for robot in ROBOTS}
            for _ in range(number):
                for robot in ROBOTS:
                    time.sleep(random.uniform(*STOP_AFTER_S))
                    at = time.monotonic_ns()
                    asked[robot].append((at, stop(robot)))
            pipe.send(asked)


def our_client(where: Mesh, pipe: Any) -> None:
    """Send stops as the command line does."""

    async def main() -> None:
        tls = None if where.keys is None else bundle(where.keys.person(HONEST))
        async with open_session(SessionSettings(connect=(where.endpoint,), tls=tls, wait_s=20.0)) as session:

            async def stop(robot: str) -> int | None:
                request = schema.StopRequest(by=f"ours {random.random()}")
                with contextlib.suppress(Exception):
                    await session.ask(f"robomesh/bench/{robot}/stop", request, timeout_s=ANSWER_S)
                    return time.monotonic_ns()
                return None

            while await stop(ROBOTS[-1]) is None:
                await asyncio.sleep(0.1)
            pipe.send("ready")
            while True:
                number = await asyncio.to_thread(pipe.recv)
                asked: dict[str, list[tuple[int, int | None]]] = {robot: [] for robot in ROBOTS}
                for _ in range(number):
                    for robot in ROBOTS:
                        await asyncio.sleep(random.uniform(*STOP_AFTER_S))
                        at = time.monotonic_ns()
                        asked[robot].append((at, await stop(robot)))
                pipe.send(asked)

    asyncio.run(main())


def honest(where: Mesh, number: int) -> list[tuple[float, float]]:
    """Ask for control in another's name; time [s] each refusal, nan after 2 s without one."""
    key = f"robomesh/bench/{ROBOTS[0]}/lease/request/{where.name(HONEST)}"
    found = []
    with zenoh.open(plain_config(where)) as session:
        for _ in range(number):
            at, took = time.monotonic(), math.nan
            for reply in session.get(key, payload=b'{"action": "RENEW", "lease": "x"}', timeout=2.0):
                # Zenoh's own timeout error has another encoding.
                if reply.err is None or str(reply.err.encoding).startswith("text/plain"):
                    took = time.monotonic() - at
            found.append((took, took))
            time.sleep(0.02)
    return found


# -------------------------------------------------------------------------- the loads


@contextlib.contextmanager
def beside(load: Load, where: Mesh, asked: Any) -> Iterator[None]:
    """Run the processes of a load while the block runs; of a flood, one for each source."""
    with contextlib.ExitStack() as stack:
        before = asked[0]
        for index in range(load.sources):
            flooding = (flood, load.name, where, index, asked)
            stack.enter_context(process(*((burn,) if load.name == "burners" else flooding)))
        time.sleep(1.0)
        deadline = time.monotonic() + 5.0
        while load.name in FLOODS and asked[0] < before + 1000 and time.monotonic() < deadline:
            time.sleep(0.01)
        yield


def flood(load: str, where: Mesh, index: int, asked: Any) -> None:
    person = FLOODERS[FLOODS[load].role][index]
    connect = lambda: zenoh.open(plain_config(where, person))  # noqa: E731
    run(FLOODS[load], connect, where.name(person), asked)
