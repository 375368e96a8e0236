"""Requirements that every driver meets, tried with its simulated controller. CONTRIBUTING.md lists them."""

import asyncio
import contextlib

import pytest

from protocol_gateway.gateway import RobotSettings
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import open_session
from tests.conftest import run
from tests.controllers.conformance import SUBJECTS
from tests.ports import free_port
from tests.protocol_gateway.gateway_site import STATE, A, C, gateway, gateway_process, refusal, until
from tests.protocol_gateway.wire import wire

every_driver = pytest.mark.parametrize("subject", SUBJECTS, ids=str)
quick_drivers = pytest.mark.parametrize("subject", [each for each in SUBJECTS if not each.slow], ids=str)
QUICK = {"stale_after_s": 1.5, "reconnect_after_s": 3.0}
# A driver that may move a robot reads with the code of the one that only reads.
FAULTS = [
    pytest.param(subject, fault, marks=[pytest.mark.long] * subject.name.endswith("-motion"))
    for subject in SUBJECTS
    for fault in subject.faults
]


@contextlib.asynccontextmanager
async def driven(mesh, folder, subject, *, up=True, controller=None, **settings):
    """Run a gateway before a simulated controller, with a wire to each of its ports; yield site and wires."""
    async with contextlib.AsyncExitStack() as stack:
        ports = await stack.enter_async_context(subject.start(**controller or {}))
        names = ("", *subject.ports)
        wires = {
            name: await stack.enter_async_context(wire(port, datagrams=subject.datagrams))
            for name, port in zip(names, ports, strict=True)
        }
        others = {name: wires[name].port for name in subject.ports}
        robot = {**subject.settings, "ports": others, **settings}
        site = await stack.enter_async_context(gateway(mesh, folder, wires[""].port, up=up, **robot))
        yield site, wires


def positions(site):
    return [tuple(joint.position for joint in state.joints) for state in site.seen["joints"]]


@every_driver
async def test_a_driver_sends_only_what_it_declares_whatever_is_asked_for(mesh, tmp_path, subject):
    bare = {} if subject.reads else {"stop_proven": False}
    async with driven(mesh, tmp_path, subject, controller={"demo": True}, **bare) as (site, wires):
        await site.units(20)
        await until(lambda: len(set(positions(site))) > 1)
        assert site.controller.read_only
        assert site.controller.capabilities.stops == schema.Capabilities.NONE
        assert not site.controller.capabilities.commands
        await refusal(site.lease(A.ACQUIRE))
        for command in (C.HOME, C.HOLD, C.RESUME, C.RESET, C.SPEED, C.MOVE_ABSOLUTE, C.RUN_PROGRAM):
            assert "Not sent" in await refusal(site.command(command))
        answer = await site.stop(by="wang")
        assert (answer.sent, "its own panel" in answer.text) == (False, True)
        await site.units(20)
        # What is counted as sent is all that was sent.
        await until(
            lambda: (
                site.controller.counters.units_sent
                >= sum(subject.declared[name](relay.sent) for name, relay in wires.items())
            )
        )


@every_driver
async def test_a_link_that_swallows_everything_is_silent_then_down_and_comes_back(mesh, tmp_path, subject):
    """A half-open connection, a frozen controller, a pulled cable: the sockets stay open."""
    async with driven(mesh, tmp_path, subject, controller={"demo": True}, **QUICK) as (site, wires):
        await site.units(5)
        for each in wires.values():
            each.swallows = True
        await until(lambda: site.controller.link == STATE.SILENT)
        seen = len(site.seen["joints"])
        await until(lambda: site.controller.link != STATE.SILENT)
        assert site.controller.link == STATE.DOWN
        # Nothing is published that was not received.
        assert len(site.seen["joints"]) == seen
        for each in wires.values():
            each.swallows = False
        await until(lambda: site.controller.link == STATE.UP)
        await site.units(5)


@every_driver
async def test_a_cut_link_is_down_and_a_restarted_controller_is_shown_from_its_new_time(
    mesh, tmp_path, subject
):
    async with (
        driven(mesh, tmp_path, subject, **QUICK) as (site, wires),
        subject.start() as later,
    ):
        await site.units(5)
        for each in wires.values():
            each.cut()
        await until(lambda: site.controller.link == STATE.DOWN)
        for each, port in zip(wires.values(), later, strict=True):
            await each.lead_to(port) if each.port else None
        await until(lambda: site.controller.link == STATE.UP)
        await site.units(5)
        # The controller's clock begins again; the stamps go on.
        stamps = [each.timestamp.ToNanoseconds() for each in site.seen["joints"]]
        assert stamps == sorted(stamps)
        if subject.reports_time:
            assert site.controller.HasField("controller_time_s")


@quick_drivers
async def test_a_port_without_a_controller_is_down_and_says_why(mesh, tmp_path, subject):
    others = {name: free_port() for name in subject.ports}
    robot = {**subject.settings, "ports": others}
    async with gateway(mesh, tmp_path, free_port(), up=False, **robot) as site:
        await until(lambda: site.controller.link == STATE.DOWN and "refused" in site.controller.link_text)
        assert not site.seen["joints"]


@pytest.mark.parametrize(("subject", "fault"), FAULTS, ids=str)
def test_a_disturbed_protocol_gives_no_joints_but_those_of_the_arm(mesh, tmp_path, subject, fault):
    async def main():
        slow = {"stale_after_s": 5.0, "reconnect_after_s": 10.0}
        faulty = {"faults": (fault,)}
        async with driven(mesh, tmp_path, subject, up=False, controller=faulty, **slow) as (site, wires):
            if fault == "joints":
                # Another arm than the site file's: an axis too many is said, and is none of the joints.
                await until(lambda: any("axis" in each.text or "joint" in each.text for each in events(site)))
            else:
                await site.units(6)
            assert len(set(positions(site))) <= 1
            for name, relay in wires.items():
                subject.declared[name](relay.sent)

    def events(site):
        return site.seen["events"]

    run(main())


@quick_drivers
async def test_a_second_client_of_the_controller_changes_nothing(mesh, tmp_path, subject):
    async with contextlib.AsyncExitStack() as stack:
        ports = await stack.enter_async_context(subject.start())
        ours, theirs = [
            [await stack.enter_async_context(wire(port, datagrams=subject.datagrams)) for port in ports]
            for _ in range(2)
        ]
        each = [
            {"ports": dict(zip(subject.ports, [relay.port for relay in of[1:]], strict=True))}
            for of in (ours, theirs)
        ]
        site = await stack.enter_async_context(
            gateway(mesh, tmp_path, ours[0].port, theirs[0].port, each=each, **subject.settings)
        )
        await site.units(5)
        await site.others[0].units(5)
        for relay in theirs:
            relay.cut()
        await until(lambda: site.others[0].controller.link == STATE.DOWN)
        await site.units(5)
        assert site.controller.link == STATE.UP
        assert len(set(positions(site))) == 1
        assert not site.events("link.down")


@pytest.mark.processes
async def test_a_killed_gateway_leaves_every_controller_as_it_was_and_reads_again(mesh, tmp_path):
    """The controllers notice nothing but a lost client, and one that comes back."""
    subjects = [each for each in SUBJECTS if not each.slow]

    def robot(subject, port, *others):
        given = {
            "description": "pt600",
            **subject.settings,
            "ports": dict(zip(subject.ports, others, strict=True)),
        }
        return RobotSettings(name=subject.name, host="127.0.0.1", port=port, **given)

    async with contextlib.AsyncExitStack() as stack, open_session(mesh) as monitor:
        robots = [robot(each, *await stack.enter_async_context(each.start())) for each in subjects]

        async def is_shown(name):
            async for sample in monitor.subscribe(f"robomesh/hall/{name}/joints"):
                if sample.live:
                    return

        for _ in range(2):
            async with gateway_process(mesh, tmp_path, robots):
                await asyncio.gather(*(is_shown(each.name) for each in subjects))
