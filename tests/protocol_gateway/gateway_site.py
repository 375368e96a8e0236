"""Site for the gateway's tests: controllers, a gateway, a monitor, an operator; nothing is a mock."""

import asyncio
import contextlib
import os
import pickle
import sys
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from controllers.unit.simulated.service import Settings as SimulatorSettings
from controllers.unit.simulated.service import serve as simulate
from protocol_gateway.gateway import RobotSettings, Settings, serve
from robomesh.errors import RefusedError
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import open_session
from tests.conftest import last_value
from tests.patience import PATIENCE_S

C = schema.CommandRequest.Command
A = schema.LeaseRequest.Action
STATE = schema.ControllerState
REPOSITORY = Path(__file__).resolve().parents[2]
# States a second of a simulated controller: fewer than the 100 of real ones, and cheaper.
RATE_HZ = 40.0
TOPICS = ("joints", "joints/slow", "controller", "lease", "events", "audit", "raw", "program")
LOOK_S = 0.01
# Longer than a busy machine stands still, for whatever is not a test's subject.
LEASE_S = 20.0
PATIENT = {"stale_after_s": 10.0, "reconnect_after_s": 20.0}
# What a robot has without these settings.
PROMPT = {"stale_after_s": 1.0, "reconnect_after_s": 4.0}


async def until(condition, timeout_s=60.0):
    async with asyncio.timeout(timeout_s):
        while not condition():
            await asyncio.sleep(LOOK_S)
    return condition()


async def looks_until(condition):
    """Wait for a condition, and return how many turns of the event loop, one each `LOOK_S`, it took.

    On a machine that stands still, they are delayed with the gateway, which runs in the same loop.
    """
    looks = 0
    while not condition():
        await asyncio.sleep(LOOK_S)
        looks += 1
    return looks


@dataclass
class GatewaySite:
    """A site as a monitor and an operator see it."""

    session: object
    audit: object
    robot: str = "arm"
    seen: dict = field(default_factory=dict)
    secret: str = ""
    id: int = 0
    own: object = None  # the gateway's session
    others: list = field(default_factory=list)  # the same for each further robot

    def key(self, topic):
        return f"robomesh/hall/{self.robot}/{topic}"

    @property
    def controller(self):
        return self.seen["controller"][-1]

    @property
    def joints(self):
        """Return the newest positions; empty: none received yet."""
        states = self.seen.get("joints")
        return [joint.position for joint in states[-1].joints] if states else []

    def events(self, code):
        return [event for event in self.seen["events"] if event.code == code]

    async def event(self, code, number):
        """Wait for an event with this code and return it: topics arrive independently."""
        await until(lambda: self.events(code))
        return self.events(code)[number]

    async def stop(self, **fields):
        return await self.session.ask(self.key("stop"), schema.StopRequest(**fields), timeout_s=PATIENCE_S)

    async def lease(self, action, operator="li", **fields):
        if action in (A.RENEW, A.RELEASE, A.OFFER):
            fields.setdefault("lease", self.secret)
        request = schema.LeaseRequest(action=action, **{"ttl_s": LEASE_S, **fields})
        key = self.key(f"lease/request/{operator}")
        answer = await self.session.ask(key, request, timeout_s=PATIENCE_S)
        self.secret = answer.lease or self.secret
        return answer

    async def command(self, command, operator="li", **fields):
        self.id += 1
        fields = {"lease": self.secret, "id": self.id, **fields}
        request = schema.CommandRequest(command=command, **fields)
        return await self.session.ask(self.key(f"command/{operator}"), request, timeout_s=PATIENCE_S)

    async def units(self, number):
        """Wait until the gateway has published this many more units of the controller."""
        seen = self.seen.setdefault("joints", [])
        more = len(seen) + number
        await until(lambda: len(seen) >= more)

    async def home(self):
        """Acquire control and home, and wait until the motion has demonstrably ended."""
        await self.lease(A.ACQUIRE)
        await self.command(C.HOME)
        await until(lambda: self.controller.homed == STATE.YES)
        await until(lambda: self.controller.activity in (STATE.IDLE, STATE.ACTIVITY_UNKNOWN))
        await self.units(3)
        await self.lease(A.RENEW)


@contextlib.asynccontextmanager
async def kept_control(*sites):
    """Renew the lease of each site's operator while the block runs, also on a slow machine."""

    async def renew():
        while True:
            for site in sites:
                await site.lease(A.RENEW)
            await asyncio.sleep(0.5)

    renewing = asyncio.create_task(renew())
    try:
        yield
    finally:
        renewing.cancel()
        await asyncio.gather(renewing, return_exceptions=True)


@contextlib.asynccontextmanager
async def simulator(**settings):
    """Run a simulated controller; yield its port."""
    said = asyncio.get_running_loop().create_future()
    task = asyncio.create_task(
        simulate(
            SimulatorSettings(**{"robot": "pt600", "rate_hz": RATE_HZ, **settings}), ready=said.set_result
        )
    )
    await asyncio.wait([said, task], return_when=asyncio.FIRST_COMPLETED)
    try:
        yield int((await said).rpartition(":")[2])
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


@contextlib.asynccontextmanager
async def gateway(mesh, folder, *ports, up=True, each=(), **robot):
    """Run a gateway with one robot for each port, and a monitor; wait until the links are up.

    `each`: settings of each robot; then every robot is watched.
    """
    names = ["arm", *(f"arm-{number}" for number in range(2, len(ports) + 1))]
    settings = Settings(
        site="hall",
        audit_folder=folder,
        robots=tuple(
            RobotSettings(
                **{
                    "name": name,
                    "description": "pt600",
                    "host": "127.0.0.1",
                    "port": port,
                    "stop_proven": True,
                    **PATIENT,
                    **robot,
                    **own_settings,
                }
            )
            for name, port, own_settings in zip(names, ports, each or [{}] * len(ports), strict=True)
        ),
    )
    async with open_session(mesh) as own, open_session(mesh) as monitor:
        task = asyncio.create_task(serve(own, settings))
        site = GatewaySite(monitor, folder / "hall" / "arm.jsonl", own=own)
        site.others = [
            GatewaySite(monitor, folder / "hall" / f"{name}.jsonl", name) for name in names[1:] if each
        ]
        watching = [
            asyncio.create_task(watch(monitor, one, topic))
            for one in (site, *site.others)
            for topic in TOPICS
        ]
        try:
            await until(lambda: task.done() or site.seen.get("controller"))
            if up:
                await until(lambda: task.done() or site.controller.link == STATE.UP)
                for other in site.others:
                    await until(lambda other=other: other.seen.get("controller"))
                    await until(lambda other=other: other.controller.link == STATE.UP)
            if task.done():
                await task
            yield site
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)
            for each in watching:
                each.cancel()
            await asyncio.gather(*watching, return_exceptions=True)


_PROCESS = """
import asyncio, pickle, sys
from protocol_gateway.gateway import serve
from robomesh.wire.session import SessionSettings, open_session

async def main(router, settings):
    async with open_session(SessionSettings(connect=(router,))) as session:
        await serve(session, settings)

asyncio.run(main(sys.argv[1], pickle.loads(bytes.fromhex(sys.argv[2]))))
"""


@contextlib.asynccontextmanager
async def gateway_process(mesh, folder, robots):
    """Run a gateway in a process of its own; yield the process, and kill it."""
    settings = pickle.dumps(Settings(site="hall", audit_folder=folder, robots=tuple(robots)))
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-c", _PROCESS, mesh.connect[0], settings.hex()),
        cwd=REPOSITORY,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
    )
    try:
        yield process
    finally:
        with contextlib.suppress(ProcessLookupError):
            process.kill()
        await process.wait()


@contextlib.asynccontextmanager
async def watching(mesh, robot="arm"):
    """Watch and command a robot whose gateway runs elsewhere."""
    async with open_session(mesh) as session:
        site = GatewaySite(session, None, robot)
        tasks = [asyncio.create_task(watch(session, site, topic)) for topic in TOPICS]
        try:
            yield site
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)


def measured(site, name):
    """Return a metric of the gateway, by robot."""
    (value,) = (each.read() for each in site.own.measures if each.name == name)
    return value


async def watch(session, site, topic):
    seen = site.seen.setdefault(topic, [])
    async for sample in session.subscribe(site.key(topic), newest=2000):
        message = sample.message()
        if isinstance(message, schema.EventList):
            seen.extend(message.events)
        elif isinstance(message, schema.AuditList):
            seen.extend(message.entries)
        else:
            seen.append(message)


async def none_left_out(session, joints, robot):
    """Return whether a subscription received all states of the controller, without loss on a slow machine."""
    state = await last_value(session, f"robomesh/hall/{robot}/controller")
    return (joints.lost(f"robomesh/hall/{robot}/joints"), state.counters.units_skipped) == (0, 0)


def moving(site):
    return until(lambda: site.controller.activity == STATE.MOVING)


def resting(site):
    return until(lambda: site.controller.activity == STATE.IDLE)


async def stopped_for(site, code):
    """Wait until the gateway has latched a stop because a motion's fate is unknown, for a cause."""
    await until(lambda: site.controller.HasField("stop"))
    why = site.controller.stop.why
    assert why.code == "stop.fate_unknown", why
    assert code in codes_of(why), why


def codes_of(reason):
    """Return the codes of a reason and its causes."""
    return {reason.code, *(code for each in reason.causes for code in codes_of(each))}


async def refusal(awaitable):
    with pytest.raises(RefusedError) as caught:
        await awaitable
    return str(caught.value)
