"""Stops without other load, with two processes that burn CPU, and with each flood of `floods.py`.

Part of `command.py`, or alone:

    ./dev run python benchmarks/stops_beside.py [--stops 120] [--floods commands,stops] [--keys] [--json]

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

import argparse
import asyncio
import contextlib
import json
import multiprocessing
import random
import socket
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import zenoh

if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).parents[1])

from benchmarks import floods
from benchmarks.burners import burn
from benchmarks.floods import FLOODS
from benchmarks.latency import process, service, until_connectable
from robomesh.contract.topics import Role
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import SessionSettings, open_session
from services.pki import Folder, authority
from tests.conftest import free_port

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
class Site:
    """A site's address, and the folder of its clients' certificates; None: a mesh without keys."""

    endpoint: str
    keys: Folder | None

    def name(self, person: str) -> str:
        """Return a client's name in its requests."""
        return person if self.keys is None else f"{person}.bench"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--stops", type=int, default=120, help="of each client, robot and load")
    parser.add_argument("--rounds", type=int, default=4, help="how often the loads take turns")
    parser.add_argument("--floods", default="commands,names", help=f"all, or of {', '.join(FLOODS)}")
    parser.add_argument("--keys", action="store_true", help="with certificates, over TLS")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    chosen = tuple(FLOODS) if arguments.floods == "all" else tuple(arguments.floods.split(","))
    if not FLOODS.keys() >= set(chosen):
        parser.error(f"--floods: choose from {', '.join(FLOODS)}")
    result = stops_beside(arguments.stops, chosen, with_keys=arguments.keys, rounds=arguments.rounds)
    if arguments.json:
        print(json.dumps(result))
    else:
        print_table(result)


def print_table(result: dict[str, Any]) -> None:
    """Print one line a client, robot and load."""
    for name, row in result["times_ms"].items():
        cells = "  ".join(
            f"{what} p50 {row[what]['p50']:7.2f} p95 {row[what]['p95']:7.2f} max {row[what]['max']:7.1f}"
            f" ratio {result['to_burners_p95'].get(f'{name} {what}', float('nan')):5.2f}"
            for what in ("wire", "answer")
        )
        print(f"{name:<30} n {row['n']:4d} missing {row['missing']:2d}  {cells}")
    for name, row in result["others_ms"].items():
        print(
            f"others during {name:<16} n {row['n']:4d} unanswered {row['missing']:3d}  "
            f"p50 {row['wire']['p50']:.1f} p95 {row['wire']['p95']:.1f}"
        )
    for name, rate in result["asked_per_s"].items():
        print(f"requests of the flood, {name:<16}: {rate:.0f} a second")


def stops_beside(
    number: int, chosen: tuple[str, ...] = ("commands", "names"), *, with_keys: bool, rounds: int = 4
) -> dict[str, Any]:
    """Send stops during each load.

    Args:
        number: How many of each client, robot and load.
        chosen: Names of floods.
        rounds: How often the loads take turns.
    """
    kinds = [name for name in chosen if not (with_keys and FLOODS[name].keyless)]
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
        values = sorted(pair[index] * 1e3 for pair in times if pair[index] == pair[index])
        row[what] = {
            "p50": values[len(values) // 2] if values else float("nan"),
            "p95": values[min(int(len(values) * 0.95), len(values) - 1)] if values else float("nan"),
            "max": values[-1] if values else float("nan"),
        }
    return row


# -------------------------------------------------------------------------- the site


@contextlib.contextmanager
def site(*, with_keys: bool) -> Iterator[tuple[Site, Any]]:
    """Run a router, a gateway of two robots, and their controllers, which record each stop's arrival [ns]."""
    ports, router = [free_port(), free_port()], free_port()
    arrivals = multiprocessing.RawArray("q", 2 * MOST_STOPS + 2)
    endpoint = f"{'tls' if with_keys else 'tcp'}/127.0.0.1:{router}"
    with tempfile.TemporaryDirectory() as name, contextlib.ExitStack() as stack:
        folder = Path(name)
        keys = Folder(folder / "keys")
        if with_keys:
            authority.prepare(keys, "bench", robots=list(ROBOTS), border="open", routers=[endpoint])
            authority.issue(keys, HONEST, Role.OPERATOR)
            for role, people in FLOODERS.items():
                for person in people:
                    authority.issue(keys, person, role)
        robots = "".join(
            f'[[robot]]\nname = "{robot}"\nmodel = "pt600"\ncontroller = "tcp://127.0.0.1:{port}"\n'
            "stop_proven = true\n"
            for robot, port in zip(ROBOTS, ports, strict=True)
        )
        file = folder / "site.toml"
        file.write_text(
            f'site = "bench"\n[router]\nlisten = ["{endpoint}"]\n'
            + ('[keys]\nfolder = "keys"\n' if with_keys else "")
            + robots
        )
        stack.enter_context(process(controllers, (ports, arrivals)))
        for port in ports:
            until_connectable(port)
        stack.enter_context(service("router", file, endpoint))
        until_connectable(router)
        stack.enter_context(service("gateway", file, endpoint))
        yield Site(endpoint, keys if with_keys else None), arrivals


def controllers(ports: list[int], arrivals: Any) -> None:
    """Run two controllers at rest, each in separate threads."""
    servers = [socket.create_server(("127.0.0.1", port)) for port in ports]
    for index, server in enumerate(servers):
        threading.Thread(target=accept, args=(server, index, arrivals), daemon=True).start()
    threading.Event().wait()


def accept(server: socket.socket, index: int, arrivals: Any) -> None:
    while True:
        client, _ = server.accept()
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        threading.Thread(target=tell, args=(client,), daemon=True).start()
        threading.Thread(target=hear, args=(client, index, arrivals), daemon=True).start()


def tell(client: socket.socket) -> None:
    with contextlib.suppress(OSError):
        while True:
            client.sendall(b"2#ABSOLUTE.DEG*0.00;0.00;0.00;0.00;0.00&STATUS*idle;remote;homed@")
            time.sleep(0.01)


def hear(client: socket.socket, index: int, arrivals: Any) -> None:
    rest = b""
    with contextlib.suppress(OSError):
        while data := client.recv(65536):
            at = time.monotonic_ns()
            *units, rest = (rest + data).split(b"@")
            for _ in (unit for unit in units if b"stop" in unit):
                count = arrivals[index]
                arrivals[2 + index * MOST_STOPS + count] = at
                arrivals[index] = count + 1


# ----------------------------------------------------------------------- the clients


@contextlib.contextmanager
def askers(where: Site) -> Iterator[Callable[[str, int, Any], dict[str, list[tuple[float, float]]]]]:
    """Start a process for each client, which sends stops on request."""
    pipes = {}
    with contextlib.ExitStack() as stack:
        for name, target in (("plain", plain_client), ("ours", our_client)):
            pipes[name], theirs = multiprocessing.Pipe()
            stack.enter_context(process(target, (where, theirs)))
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
                            float("nan") if wire is None else (wire - at) * 1e-9,
                            float("nan") if answered is None else (answered - at) * 1e-9,
                        )
                    )
            return found

        yield ask


def plain_config(where: Site, person: str = HONEST) -> zenoh.Config:
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


def plain_client(where: Site, pipe: Any) -> None:
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


def our_client(where: Site, pipe: Any) -> None:
    """Send stops as the command line does."""
    from robomesh.contract.endpoints import bundle

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


def honest(where: Site, number: int) -> list[tuple[float, float]]:
    """Ask for control in another's name; time [s] each refusal, nan after 2 s without one."""
    key = f"robomesh/bench/{ROBOTS[0]}/lease/request/{where.name(HONEST)}"
    found = []
    with zenoh.open(plain_config(where)) as session:
        for _ in range(number):
            at, took = time.monotonic(), float("nan")
            for reply in session.get(key, payload=b'{"action": "RENEW", "lease": "x"}', timeout=2.0):
                # Zenoh's own timeout error has another encoding.
                if reply.err is None or str(reply.err.encoding).startswith("text/plain"):
                    took = time.monotonic() - at
            found.append((took, took))
            time.sleep(0.02)
    return found


# -------------------------------------------------------------------------- the loads


@contextlib.contextmanager
def beside(load: Load, where: Site, asked: Any) -> Iterator[None]:
    """Run the processes of a load while the block runs; of a flood, one for each source."""
    with contextlib.ExitStack() as stack:
        before = asked[0]
        for index in range(load.sources):
            target, arguments = (
                (burn, ()) if load.name == "burners" else (flood, (load.name, where, index, asked))
            )
            stack.enter_context(process(target, arguments))
        time.sleep(1.0)
        deadline = time.monotonic() + 5.0
        while load.name in FLOODS and asked[0] < before + 1000 and time.monotonic() < deadline:
            time.sleep(0.01)
        yield


def flood(load: str, where: Site, index: int, asked: Any) -> None:
    person = FLOODERS[FLOODS[load].role][index]
    connect = lambda: zenoh.open(plain_config(where, person))  # noqa: E731
    floods.run(FLOODS[load], connect, where.name(person), asked)


if __name__ == "__main__":
    multiprocessing.set_start_method("spawn")
    main()
