"""Command latency: dead man's stop, two operators who race for control, stops during a flood of requests.

A real router and gateway run as separate processes. A controller inside this program records the time of
each stop unit. All times use this machine's monotonic clock, so all processes must run here.

    ./dev run python benchmarks/command.py [--dead-man 100] [--race 10000] [--stops 300]
        [--beside 120] [--json]

dead man   an operator's process commands a long motion and is killed with -9. In one case the mesh sees
           its session close; in the other only the expiry of the lease stops the robot.
           Target: always within the lease's time + 50 ms.
race       two operators with separate sessions ask for control at the same moment, again and again.
           Target: never two holders.
`beside`   stops to both robots of a gateway during CPU load and floods, without and with keys
           (`stops_beside.py`). Target: p95 during a flood at most three times the p95 during CPU load.
stops      one session sends requests of all kinds as fast as the mesh takes them, with 10,000 in flight;
           another session asks for stops. Target: p99 on the controller's socket under 20 ms.
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
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import zenoh

if __name__ == "__main__":
    # Import from the root: a program in this folder has the same name as a package.
    sys.path[0] = str(Path(__file__).parents[1])

from benchmarks.latency import free_port, process, service, summary, until_connectable
from benchmarks.stops_beside import stops_beside
from robomesh.contract.messages import PROTOBUF
from robomesh.errors import NoAnswerError, RefusedError, RobomeshError
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import Session, SessionSettings, open_session

TTL_S = 0.5
OWED_S = 0.05
FLOOD = 10_000
_LEASE = schema.LeaseRequest
_COMMAND = schema.CommandRequest
KEY = "robomesh/bench/arm"
STOP_UNIT = b"COMMAND*stop@"


class Controller:
    """A controller at rest, homed and remote, that records when each stop arrived [ns]."""

    def __init__(self) -> None:
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port = self._server.getsockname()[1]
        self.stops: list[int] = []
        self.came = threading.Condition()
        self.moving = False
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        while True:
            client, _ = self._server.accept()
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            threading.Thread(target=self._tell, args=(client,), daemon=True).start()
            threading.Thread(target=self._hear, args=(client,), daemon=True).start()

    def _tell(self, client: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while True:
                activity = "moving" if self.moving else "idle"
                client.sendall(
                    f"2#ABSOLUTE.DEG*0.00;0.00;0.00;0.00;0.00&STATUS*{activity};remote;homed@".encode()
                )
                time.sleep(0.01)

    def _hear(self, client: socket.socket) -> None:
        rest = b""
        with contextlib.suppress(OSError):
            while data := client.recv(65536):
                at = time.monotonic_ns()
                *units, rest = (rest + data).split(b"@")
                for unit in units:
                    if b"stop" in unit:
                        self.moving = False
                        with self.came:
                            self.stops.append(at)
                            self.came.notify_all()
                    elif b"ABSOLUTE" in unit:
                        self.moving = True

    def wait_for_stop(self, number: int, timeout_s: float) -> int | None:
        """Return when the stop with that number arrived [ns]; None after a timeout."""
        with self.came:
            self.came.wait_for(lambda: len(self.stops) > number, timeout_s)
            return self.stops[number] if len(self.stops) > number else None


# ----------------------------------------------------------------------- dead man


def dead_man(endpoint: str, controller: Controller, times: int, *, with_session: bool) -> dict[str, Any]:
    """Kill operators during a motion and return the delay until each stop reached the controller's socket."""
    delays, missing = [], 0
    for _ in range(times):
        before = len(controller.stops)
        ours, theirs = multiprocessing.Pipe()
        operator = multiprocessing.Process(target=operate, args=(endpoint, with_session, theirs), daemon=True)
        operator.start()
        ours.recv()
        time.sleep(random.uniform(0.0, TTL_S))
        operator.kill()
        killed = time.monotonic_ns()
        stopped = controller.wait_for_stop(before, 5.0)
        operator.join()
        if stopped is None:
            missing += 1
        else:
            delays.append(stopped - killed)
        asyncio.run(reset(endpoint))
    in_time = sum(delay <= (TTL_S + OWED_S) * 1e9 for delay in delays)
    return {
        "killed": times,
        "stopped": len(delays),
        "in_time": in_time,
        "missing": missing,
        **summary(delays),
    }


def operate(endpoint: str, with_session: bool, ready: Any) -> None:
    """Command a motion and renew the lease until the parent kills this process."""

    async def main() -> None:
        async with open_session(SessionSettings(connect=(endpoint,), wait_s=20.0)) as session:
            if with_session:
                session.declare_presence("bench", "arm", "operator")
            own = session.identity if with_session else ""
            lease = await acquire(session, "li", session_id=own)
            await session.ask(
                f"{KEY}/command/li",
                _COMMAND(
                    lease=lease, id=1, command=_COMMAND.MOVE_ABSOLUTE, joint_positions=[1.0] + [0.0] * 4
                ),
            )
            ready.send("moves")
            while True:
                await session.ask(
                    f"{KEY}/lease/request/li", _LEASE(action=_LEASE.RENEW, lease=lease, ttl_s=TTL_S)
                )
                await asyncio.sleep(TTL_S / 4)

    asyncio.run(main())


async def acquire(session: Session, operator: str, *, session_id: str = "", ttl_s: float = TTL_S) -> str:
    """Return the secret of a lease as soon as the gateway runs and grants one."""
    deadline = time.monotonic() + 10.0
    while True:
        try:
            answer = await session.ask(
                f"{KEY}/lease/request/{operator}",
                _LEASE(action=_LEASE.ACQUIRE, ttl_s=ttl_s, session=session_id),
            )
            secret: str = answer.lease  # type: ignore[attr-defined]
            return secret
        except (RefusedError, NoAnswerError):
            if time.monotonic() > deadline:
                raise
            await asyncio.sleep(0.02)


async def reset(endpoint: str) -> None:
    """Clear the latched stop and release control."""
    async with open_session(SessionSettings(connect=(endpoint,), wait_s=20.0)) as session:
        lease = await acquire(session, "wang", ttl_s=5.0)
        for number in range(1, 100):
            state = await session.last(f"{KEY}/controller")
            assert isinstance(state, schema.ControllerState)
            if not state.HasField("stop") and state.activity == schema.ControllerState.IDLE:
                break
            with contextlib.suppress(RefusedError):
                await session.ask(
                    f"{KEY}/command/wang",
                    _COMMAND(lease=lease, id=number, command=_COMMAND.RESET, stop_id=state.stop.id),
                )
            await asyncio.sleep(0.02)
        await session.ask(f"{KEY}/lease/request/wang", _LEASE(action=_LEASE.RELEASE, lease=lease))


# --------------------------------------------------------------------------- race


async def race(endpoint: str, rounds: int) -> dict[str, Any]:
    """Let two operators ask at the same time; count the grants to each and the grants to both."""
    settings = SessionSettings(connect=(endpoint,), wait_s=20.0)
    won = {"li": 0, "wang": 0}
    both = nobody = 0
    began = time.monotonic()
    async with open_session(settings) as first, open_session(settings) as second:
        sessions = {"li": first, "wang": second}

        async def ask(name: str) -> str:
            try:
                answer = await sessions[name].ask(
                    f"{KEY}/lease/request/{name}", _LEASE(action=_LEASE.ACQUIRE, ttl_s=5.0), timeout_s=10.0
                )
                return answer.lease  # type: ignore[attr-defined, no-any-return]
            except RefusedError:
                return ""

        for _ in range(rounds):
            names = random.sample(sorted(sessions), 2)
            secrets = dict(zip(names, await asyncio.gather(*map(ask, names)), strict=True))
            holders = [name for name, secret in secrets.items() if secret]
            both += len(holders) > 1
            nobody += not holders
            for name in holders:
                won[name] += 1
                await sessions[name].ask(
                    f"{KEY}/lease/request/{name}", _LEASE(action=_LEASE.RELEASE, lease=secrets[name])
                )
    return {
        "rounds": rounds,
        "two_holders": both,
        "nobody": nobody,
        "won": won,
        "s": time.monotonic() - began,
    }


# -------------------------------------------------------------------------- stops


async def stops(endpoint: str, controller: Controller, number: int) -> dict[str, Any]:
    """Return the sorted delays from the request for a stop until its unit reaches the controller."""
    delays = []
    async with open_session(SessionSettings(connect=(endpoint,), wait_s=20.0)) as session:
        for _ in range(number):
            before = len(controller.stops)
            asked = time.monotonic_ns()
            answer = asyncio.create_task(
                session.ask(f"{KEY}/stop", schema.StopRequest(by="zhao"), timeout_s=10.0)
            )
            await asyncio.sleep(0)
            came = await asyncio.to_thread(controller.wait_for_stop, before, 10.0)
            if came is not None:
                delays.append(came - asked)
            with contextlib.suppress(RobomeshError):
                await answer
            # Stops closer than 0.1 s share a unit.
            await asyncio.sleep(random.uniform(0.11, 0.15))
    return {"asked": number, "missing": number - len(delays), **summary(delays)}


def flood(endpoint: str, counts: Any, over: Any) -> None:
    """Send requests of all kinds, with ten thousand in flight, until the measurement ends."""
    made = [
        ("command/eve", _COMMAND(lease="guess", id=1, command=_COMMAND.HOME).SerializeToString()),
        ("lease/request/eve", _LEASE(action=_LEASE.RENEW, lease="guess").SerializeToString()),
        ("lease/request/eve", _LEASE(action=_LEASE.TAKE).SerializeToString()),
        ("command/eve", b"\xff" * 40),
        (
            "command/eve",
            _COMMAND(command=_COMMAND.MOVE_ABSOLUTE, joint_positions=[9.0] * 5).SerializeToString(),
        ),
    ]
    waiting = threading.Semaphore(FLOOD)

    async def main() -> None:
        async with open_session(SessionSettings(connect=(endpoint,), wait_s=20.0)) as session:
            await asyncio.to_thread(pour, session)

    def answered(_: zenoh.Reply) -> None:
        counts[1] += 1

    def pour(session: Session) -> None:
        while not over.is_set():
            for name, payload in made:
                waiting.acquire()
                counts[0] += 1
                session.zenoh_session.get(
                    f"{KEY}/{name}",
                    zenoh.handlers.Callback(answered, waiting.release),
                    payload=payload,
                    encoding=PROTOBUF,
                    congestion_control=zenoh.CongestionControl.DROP,
                    priority=zenoh.Priority.REAL_TIME,
                    timeout=10.0,
                )

    asyncio.run(main())


def stops_under_flood(endpoint: str, controller: Controller, number: int) -> dict[str, Any]:
    """Measure stops without load, then stops during the flood."""
    quiet = asyncio.run(stops(endpoint, controller, number))
    counts = multiprocessing.RawArray("q", 2)
    over = multiprocessing.Event()
    with process(flood, (endpoint, counts, over)):
        while counts[0] < FLOOD:
            time.sleep(0.01)
        began, before = time.monotonic(), tuple(counts)
        flooded = asyncio.run(stops(endpoint, controller, number))
        passed = time.monotonic() - began
        rates = [(now - then) / passed for now, then in zip(counts, before, strict=True)]
        over.set()
    return {
        "quiet": quiet,
        "flooded": flooded,
        "ratio_p50": flooded["p50"] / quiet["p50"],
        "asked_per_s": rates[0],
        "answered_per_s": rates[1],
        "asked": counts[0],
    }


@contextlib.contextmanager
def bench_site() -> Iterator[tuple[str, Controller]]:
    """Start a router, a gateway of one robot, and its controller."""
    controller, router = Controller(), free_port()
    with tempfile.TemporaryDirectory() as folder:
        site = Path(folder) / "site.toml"
        endpoint = f"tcp/127.0.0.1:{router}"
        site.write_text(
            f'site = "bench"\n[router]\nlisten = ["{endpoint}"]\n[[robot]]\nname = "arm"\nmodel = "pt600"\n'
            f'controller = "tcp://127.0.0.1:{controller.port}"\nstop_proven = true\n'
        )
        with service("router", site, endpoint):
            until_connectable(router)
            with service("gateway", site, endpoint):
                asyncio.run(reset(endpoint))
                yield endpoint, controller


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--dead-man", type=int, default=100)
    parser.add_argument("--race", type=int, default=10_000)
    parser.add_argument("--stops", type=int, default=300)
    parser.add_argument("--beside", type=int, default=120)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    with bench_site() as (endpoint, controller):
        result = {
            "dead_man_with_session_ms": dead_man(endpoint, controller, arguments.dead_man, with_session=True),
            "dead_man_by_lease_ms": dead_man(endpoint, controller, arguments.dead_man, with_session=False),
            "race": asyncio.run(race(endpoint, arguments.race)),
            "stops_ms": stops_under_flood(endpoint, controller, arguments.stops) if arguments.stops else None,
        }
    if arguments.beside:
        result |= {
            f"stops_beside_{'keys' if keys else 'no_keys'}": stops_beside(arguments.beside, with_keys=keys)
            for keys in (False, True)
        }
    if arguments.json:
        print(json.dumps(result))
    else:
        for name, row in result.items():
            print(f"{name}: {row}")


if __name__ == "__main__":
    multiprocessing.set_start_method("spawn")
    main()
