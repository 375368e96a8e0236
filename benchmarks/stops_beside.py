"""Stops during other load: without load, with two processes that burn CPU, with two that flood `command/*`.

Part of `command.py`, or alone:

    ./dev run python benchmarks/stops_beside.py [--stops 120] [--keys] [--json]

A real router and a gateway of two robots are separate processes; this program runs two controllers in one
more process. Two clients send stops to both robots in turn: a plain Zenoh session, written from Zenoh's own
documentation, and then our own client, which asks over both links. The loads take turns, so that other
load on the machine affects all of them. Times run from the request to the stop unit at the controller
(`wire`) and to the answer at the client (`answer`), by this machine's monotonic clock.

The flood: each process asks `command/<name>` of the first robot with `{}` as fast as Zenoh takes it, without
waiting for answers, over one plain Zenoh session; `names`: under a hundred names in turn, which only a mesh
without keys permits. During each load another plain session asks for control a hundred times, as an honest
operator would (`others`): the number of answers within 2 s, and their delays.

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
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from typing import Any

import zenoh

if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).parents[1])

from benchmarks.latency import process, service, until_connectable
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.session import SessionSettings, open_session
from robomesh.topics import Role
from services.pki import Folder, authority
from tests.conftest import free_port

ROBOTS = ("arm", "other")
LOADS = ("idle", "burners", "flood", "names")
STOP_AFTER_S = (0.06, 0.075)  # a robot gets one every 0.12 to 0.15 s; those within 0.1 s share a unit
MOST_STOPS = 100_000
OTHERS = 100


@dataclass(frozen=True)
class Site:
    """A site's address and the credentials that its clients use."""

    endpoint: str
    operator: str
    bundle: Path | None


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--stops", type=int, default=120, help="of each client, robot and load")
    parser.add_argument("--rounds", type=int, default=4, help="how often the loads take turns")
    parser.add_argument("--keys", action="store_true", help="with certificates, over TLS")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    result = stops_beside(arguments.stops, with_keys=arguments.keys, rounds=arguments.rounds)
    if arguments.json:
        print(json.dumps(result))
    else:
        print_table(result)


def print_table(result: dict[str, Any]) -> None:
    """Print one line a client, robot and load."""
    for name, row in result["times_ms"].items():
        cells = "  ".join(
            f"{what} p50 {row[what]['p50']:7.2f} p95 {row[what]['p95']:7.2f} max {row[what]['max']:7.1f}"
            for what in ("wire", "answer")
        )
        print(f"{name:<22} n {row['n']:4d} missing {row['missing']:2d}  {cells}")
    for name, row in result["others_ms"].items():
        print(
            f"others during {name:<8} n {row['n']:4d} unanswered {row['missing']:3d}  "
            f"p50 {row['wire']['p50']:.1f} p95 {row['wire']['p95']:.1f}"
        )
    for name, ratio in result["to_burners_p95"].items():
        print(f"p95 divided by the p95 with the burners, {name:<24}: {ratio:.2f}")
    print(f"requests of the flood: {result['asked_per_s']:.0f} a second")


def stops_beside(number: int, *, with_keys: bool, rounds: int = 4) -> dict[str, Any]:
    """Send stops during each load.

    Args:
        number: How many of each client, robot and load.
        rounds: How often the loads take turns.
    """
    loads = [load for load in LOADS if not (with_keys and load == "names")]
    found: dict[tuple[str, str, str], list[tuple[float, float]]] = {}
    others: dict[str, list[tuple[float, float]]] = {}
    asked = multiprocessing.RawArray("q", 1)
    flooded_s = 0.0
    with site(with_keys=with_keys) as (where, arrivals), askers(where) as ask:
        for _ in range(rounds):
            for load in loads:
                began = time.monotonic()
                with beside(load, where, asked):
                    for client in ("plain", "ours"):
                        for robot, times in ask(client, -(-number // rounds), arrivals).items():
                            found.setdefault((client, robot, load), []).extend(times)
                    others.setdefault(load, []).extend(honest(where, OTHERS // rounds))
                if load in ("flood", "names"):
                    flooded_s += time.monotonic() - began
    rows = {" ".join(key): summary(times) for key, times in sorted(found.items())}
    ratios = {
        f"{client} {robot} {load} {what}": rows[f"{client} {robot} {load}"][what]["p95"]
        / rows[f"{client} {robot} burners"][what]["p95"]
        for client in ("plain", "ours")
        for robot in ROBOTS
        for load in loads[2:]
        for what in ("wire", "answer")
    }
    return {
        "keys": with_keys,
        "times_ms": rows,
        "others_ms": {load: summary(times) for load, times in others.items()},
        "to_burners_p95": ratios,
        "asked_per_s": asked[0] / flooded_s,
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
            authority.issue(keys, "zhao", Role.OPERATOR)
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
        person = keys.person("zhao") if with_keys else None
        yield Site(endpoint, "zhao.bench" if with_keys else "zhao", person), arrivals


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
                    # The first unit after this request and before the next one.
                    wire = next((each for each in came if each >= at), None)
                    found[robot].append(
                        (
                            float("nan") if wire is None else (wire - at) * 1e-9,
                            float("nan") if answered is None else (answered - at) * 1e-9,
                        )
                    )
            return found

        yield ask


def plain_config(where: Site) -> zenoh.Config:
    """Return the configuration that Zenoh's own documentation gives for a client."""
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([where.endpoint]))
    config.insert_json5("scouting/multicast/enabled", "false")
    if where.bundle is not None:
        for key, value in {
            "root_ca_certificate": str(where.bundle),
            "connect_certificate": str(where.bundle),
            "connect_private_key": str(where.bundle),
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
            for reply in session.get(f"robomesh/bench/{robot}/stop", payload=payload, timeout=10.0):
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
    from robomesh.endpoints import bundle

    async def main() -> None:
        tls = None if where.bundle is None else bundle(where.bundle)
        async with open_session(SessionSettings(connect=(where.endpoint,), tls=tls, wait_s=20.0)) as session:

            async def stop(robot: str) -> int | None:
                request = schema.StopRequest(by=f"ours {random.random()}")
                with contextlib.suppress(Exception):
                    await session.ask(f"robomesh/bench/{robot}/stop", request, timeout_s=10.0)
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
    name = "li" if where.bundle is None else where.operator
    key = f"robomesh/bench/{ROBOTS[0]}/lease/request/{name}"
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
def beside(load: str, where: Site, asked: Any) -> Iterator[None]:
    """Run two processes of a load while the block runs."""
    with contextlib.ExitStack() as stack:
        before = asked[0]
        for index in range(0 if load == "idle" else 2):
            target, arguments = (burn, ()) if load == "burners" else (flood, (where, load, index, asked))
            stack.enter_context(process(target, arguments))
        time.sleep(1.0)
        while load in ("flood", "names") and asked[0] < before + 2000:
            time.sleep(0.01)
        yield


def burn() -> None:
    while True:
        sum(range(1000))


def flood(where: Site, load: str, index: int, asked: Any) -> None:
    """Ask as fast as Zenoh takes it, and read no answer."""
    names = [where.operator] if load == "flood" else [f"eve{index}-{number}" for number in range(100)]
    turns = cycle(f"robomesh/bench/{ROBOTS[0]}/command/{name}" for name in names)
    with zenoh.open(plain_config(where)) as session:
        while True:
            asked[0] += 1
            session.get(next(turns), payload=b"{}", timeout=10.0)


if __name__ == "__main__":
    multiprocessing.set_start_method("spawn")
    main()
