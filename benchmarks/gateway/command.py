"""Command latency: dead man's stop, two operators who race for control, stops during a flood of requests.

A real router and gateway run as separate processes. A controller inside this program records the time of
each stop unit. All times use this machine's monotonic clock, so all processes must run here.

    ./dev run python -m benchmarks command [--dead-man 100] [--race 10000] [--stops 300]
        [--beside 120] [--json]

dead man   an operator's process commands a long motion and is killed with -9. In one case the mesh sees
           its session close; in the other only the expiry of the lease stops the robot.
           Target: always within the lease's time + 50 ms.
race       two operators with separate sessions ask for control at the same moment, again and again.
           Target: never two holders.
`beside`   stops to both robots of a gateway during CPU load and floods, without and with keys
           (`stops_beside`). Target: p95 during a flood at most three times the p95 during CPU load.
stops      one session sends requests of all kinds as fast as the mesh takes them, with 10,000 in flight;
           another session asks for stops. Target: p99 on the controller's socket under 20 ms.
"""

import asyncio
import contextlib
import multiprocessing
import os
import random
import signal
import threading
import time
from typing import Any

import zenoh

from benchmarks.gateway.stops_beside import stops_beside
from benchmarks.harness.processes import piped, process
from benchmarks.harness.sites import robot, running_site
from benchmarks.harness.turns import summary
from benchmarks.harness.unit_controllers import RestingController
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


class Stops:
    """A controller at rest, and when each stop arrived at it [ns]."""

    def __init__(self) -> None:
        self.times: list[int] = []
        self._came = threading.Condition()
        self.port = RestingController(self._note).port

    def _note(self, at: int) -> None:
        with self._came:
            self.times.append(at)
            self._came.notify_all()

    def wait_for_stop(self, number: int, timeout_s: float) -> int | None:
        """Return when the stop with that number arrived [ns]; None after a timeout."""
        with self._came:
            self._came.wait_for(lambda: len(self.times) > number, timeout_s)
            return self.times[number] if len(self.times) > number else None


# ----------------------------------------------------------------------- dead man


def kill_operators(endpoint: str, controller: Stops, times: int, *, with_session: bool) -> dict[str, Any]:
    """Kill operators during a motion and return the delay until each stop reached the controller's socket."""
    delays, missing = [], 0
    for _ in range(times):
        before = len(controller.times)
        with piped(operate, endpoint, with_session) as operator:
            pid = operator.recv()
            time.sleep(random.uniform(0.0, TTL_S))
            os.kill(pid, signal.SIGKILL)
            killed = time.monotonic_ns()
            stopped = controller.wait_for_stop(before, 5.0)
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
            ready.send(os.getpid())
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


async def race_for_control(endpoint: str, rounds: int) -> dict[str, Any]:
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
                return answer.lease  # type: ignore[attr-defined]
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


async def ask_for_stops(endpoint: str, controller: Stops, number: int) -> dict[str, Any]:
    """Return the sorted delays from the request for a stop until its unit reaches the controller."""
    delays = []
    async with open_session(SessionSettings(connect=(endpoint,), wait_s=20.0)) as session:
        for _ in range(number):
            before = len(controller.times)
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


def stops_under_flood(endpoint: str, controller: Stops, number: int) -> dict[str, Any]:
    """Measure stops without load, then stops during the flood."""
    quiet = asyncio.run(ask_for_stops(endpoint, controller, number))
    counts = multiprocessing.RawArray("q", 2)
    over = multiprocessing.Event()
    with process(flood, endpoint, counts, over):
        while counts[0] < FLOOD:
            time.sleep(0.01)
        began, before = time.monotonic(), tuple(counts)
        flooded = asyncio.run(ask_for_stops(endpoint, controller, number))
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


def measure(dead_man: int = 100, race: int = 10_000, stops: int = 300, beside: int = 120) -> dict[str, Any]:
    controller = Stops()
    with running_site("gateway", tables=robot("arm", controller.port)) as site:
        endpoint = site.endpoint
        asyncio.run(reset(endpoint))
        result = {
            "dead_man_with_session_ms": kill_operators(endpoint, controller, dead_man, with_session=True),
            "dead_man_by_lease_ms": kill_operators(endpoint, controller, dead_man, with_session=False),
            "race": asyncio.run(race_for_control(endpoint, race)),
            "stops_ms": stops_under_flood(endpoint, controller, stops) if stops else None,
        }
    if beside:
        for keys in (False, True):
            name = f"stops_beside_{'keys' if keys else 'no_keys'}"
            result[name] = stops_beside(beside, with_keys=keys)
    return result
