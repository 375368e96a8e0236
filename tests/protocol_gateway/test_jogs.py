"""Jogs: real gateway, real worker process, simulated controller; the poses against Pinocchio and trimesh."""

import asyncio
import contextlib
import re
import time
from math import degrees, radians

import numpy as np
import pinocchio
import pytest

from protocol_gateway.execution import jog_runner
from robomesh.contract.messages import reason_message
from robomesh.errors import RefusedError
from robomesh.schemas import robomesh_pb2 as schema
from robots.descriptions.description import load
from robots.descriptions.urdf.write import to_urdf
from tests.conftest import run
from tests.patience import PATIENCE_S
from tests.protocol_gateway.gateway_site import (
    STATE,
    A,
    C,
    gateway,
    kept_control,
    refusal,
    simulator,
    until,
)
from tests.protocol_gateway.test_checked_motion import POST, one_robot_cell

J = schema.Jog
# Ends of a jog on a machine that is too busy.
SLOW = ("jog.not_alive", "jog.not_held_down", "check.too_slow", "check.queued_too_long")
ACCEPTED = schema.AuditEntry.ACCEPTED
REST = [radians(value) for value in (-40, 90, -90, 10, 0)]


@pytest.fixture(autouse=True)
def patience(monkeypatch):
    """Let a jog outlive a machine that stands still."""
    for name in ("KEEP_ALIVE_S", "FIRST_KEEP_ALIVE_S", "_START_TIMEOUT_S", "_HOLD_TIMEOUT_S"):
        monkeypatch.setattr(jog_runner, name, PATIENCE_S)


@contextlib.asynccontextmanager
async def in_control(site):
    """Home the robot, and move it to a place from which it can go in each direction."""
    await until(lambda: not site.controller.check_text, timeout_s=60)
    await site.home()
    async with kept_control(site):
        await moved_to(site, REST)
        yield


async def moved_to(site, target):
    await site.command(C.MOVE_ABSOLUTE, joint_positions=target)
    await until(lambda: np.allclose(site.joints, target, atol=1e-6))
    # The motion has demonstrably ended a few units later.
    await site.units(5)
    await until(lambda: site.controller.activity == STATE.IDLE)


async def begin(site, frame=J.BASE, axis=J.X, speed=0.05, **fields):
    jog = fields.pop("jog", None) or J(frame=frame, axis=axis, speed=speed)
    return await site.command(C.JOG, jog=jog, **fields)


async def ask(site, sequence, operator="li", **fields):
    request = schema.JogRequest(**{"lease": site.secret, "jog": site.id, "sequence": sequence, **fields})
    return await site.session.ask(site.key(f"jog/{operator}"), request, timeout_s=PATIENCE_S)


async def held_down(site, moved, first=1):
    """Send keep-alives as a held button does; return the last answer and its number."""
    sequence = first
    while True:
        answer = await ask(site, sequence)
        if answer.moved >= moved or answer.text:
            return answer, sequence
        sequence += 1
        await asyncio.sleep(0.03)


async def jogged(site, moved, **fields):
    """Jog so far, and return the number of the last keep-alive; a busy machine may need several tries."""
    while True:
        await begin(site, **fields)
        answer, sequence = await held_down(site, moved)
        if answer.reason.code not in SLOW:
            assert answer.text == ""
            return sequence
        await at_rest(site, sequence)


async def at_rest(site, sequence=0):
    """Release, and wait for the end; return the last answer."""
    while True:
        sequence += 1
        answer = await ask(site, sequence, release=True)
        if not answer.running:
            return answer
        await asyncio.sleep(0.02)


async def jogged_and_released(site, moved, **fields):
    while True:
        answer = await at_rest(site, await jogged(site, moved, **fields))
        if answer.reason.code not in SLOW:
            return answer


def entries(site):
    return [each for each in site.seen["audit"] if each.request.startswith("JOG")]


@contextlib.asynccontextmanager
async def jog_site(mesh, folder, **settings):
    settings = {"check": "warn", **settings}
    async with simulator() as port, gateway(mesh, folder, port, **settings) as site, in_control(site):
        yield site


class Tap:
    """A wire to a controller that remembers where the arm was when each target was sent."""

    def __init__(self, port):
        self._port, self._ends = port, []
        self.at, self.targets = None, []

    async def serve(self, reader, writer):
        other_reader, other_writer = await asyncio.open_connection("127.0.0.1", self._port)
        self._ends += [writer, other_writer]
        await asyncio.gather(
            self._relay(reader, other_writer, self._sent), self._relay(other_reader, writer, self._received)
        )

    async def _relay(self, reader, writer, note):
        rest = b""
        with contextlib.suppress(ConnectionError):
            while data := await reader.read(65536):
                *units, rest = (rest + data).split(b"@")
                for unit in units:
                    found = re.search(rb"ABSOLUTE\.DEG\*([^&]*)", unit)
                    if found:
                        note(np.radians([float(each) for each in found[1].split(b";")]))
                writer.write(data)
        writer.close()

    def _received(self, positions):
        self.at = positions

    def _sent(self, target):
        self.targets.append((self.at, target))

    def close(self):
        for each in self._ends:
            each.close()


@contextlib.asynccontextmanager
async def tapped(port):
    tap = Tap(port)
    server = await asyncio.start_server(tap.serve, "127.0.0.1", 0)
    try:
        yield server.sockets[0].getsockname()[1], tap
    finally:
        server.close()
        tap.close()


def tool_of(positions, model):
    """Return the tool's pose (4, 4) by Pinocchio, from the exported URDF."""
    data = model.createData()
    pinocchio.framesForwardKinematics(model, data, np.array(positions))
    return data.oMf[model.getFrameId("tool")].homogeneous


@pytest.fixture(scope="module")
def elsewhere():
    return pinocchio.buildModelFromXML(to_urdf(load("pt600")))


async def test_a_jog_is_a_line_never_more_than_10_mm_ahead_with_two_audit_entries(mesh, tmp_path, elsewhere):
    async with (
        simulator() as port,
        tapped(port) as (wire, tap),
        gateway(mesh, tmp_path, wire, check="require") as site,
        in_control(site),
    ):
        await site.command(C.SPEED, speed_percent=50)
        tap.targets.clear()
        end = await jogged_and_released(site, 0.06, axis=J.Y, speed=-0.1)
        assert (end.text, end.reason.code, end.rotary) == ("released", "jog.released", False)
        ways = [(tool_of(at, elsewhere), tool_of(to, elsewhere)) for at, to in tap.targets]
        ahead = [np.linalg.norm(to[:3, 3] - at[:3, 3]) for at, to in ways]
        assert len(ahead) > 5
        # A unit's degrees have two decimals, and no joint is farther than 1 m from the tool.
        assert max(ahead) <= 0.01 + len(REST) * np.radians(0.005)
        begin = tool_of(REST, elsewhere)
        for _, to in ways:
            assert abs(to[:3, 3] - begin[:3, 3])[[0, 2]].max() < 1e-3
            assert degrees(np.arccos(min(to[:3, 2] @ begin[:3, 2], 1.0))) < 15.0
        # Nothing is on hold, and the operator's speed is set again.
        await until(lambda: site.controller.activity == STATE.IDLE)
        await until(lambda: site.controller.speed_percent == 50)
        assert not site.controller.HasField("stop")
        assert not site.controller.HasField("jog")
        await until(lambda: entries(site) and entries(site)[-1].request == "JOG_END")
        jog, jog_end = entries(site)[-2:]
        assert (jog.request, jog.values["jog_axis"], jog.values["jog_speed"]) == ("JOG", "Y", "-0.1")
        assert float(jog_end.values["moved_m"]) == pytest.approx(end.moved, abs=1e-6)
        apart = tool_of(site.joints, elsewhere)[:3, 3] - begin[:3, 3]
        last = [each for each in entries(site) if each.request == "JOG_END"]
        total = sum(float(each.values["moved_m"]) for each in last)
        assert np.linalg.norm(apart) == pytest.approx(total, abs=1e-3)
        # No part of the jog has an entry of its own.
        assert sum(each.request == "MOVE_ABSOLUTE" for each in site.seen["audit"]) == 1


async def test_without_a_keep_alive_the_robot_is_held_without_a_latch(mesh, tmp_path, monkeypatch):
    monkeypatch.setattr(jog_runner, "KEEP_ALIVE_S", 0.15)
    monkeypatch.setattr(jog_runner, "FIRST_KEEP_ALIVE_S", 1.0)
    async with jog_site(mesh, tmp_path) as site:
        before = list(site.joints)
        await begin(site)
        await until(lambda: entries(site) and entries(site)[-1].request == "JOG_END")
        assert entries(site)[-1].reason.causes[0].code == "jog.not_held_down"
        assert site.joints == before
        await jogged(site, 0.03)
        end = await ended(site)
        assert end.causes[0].code == "jog.not_alive"
        assert entries(site)[-1].outcome == schema.AuditEntry.FAILED
        assert float(entries(site)[-1].values["moved_m"]) > 0.03
        await until(lambda: not site.controller.HasField("jog"))
        assert not site.controller.HasField("stop")
        assert (await ask(site, 1000)).reason.code == "jog.not_alive"
        await moved_to(site, REST)
        # A gateway that was busy holds, too: the keep-alives that came meanwhile do not count.
        await jogged(site, 0.02)
        time.sleep(0.4)  # noqa: ASYNC251 - the gateway shares this loop
        with contextlib.suppress(RefusedError):
            await ask(site, 2000)
        end = await at_rest(site, 3000)
        assert end.reason.code == "jog.not_alive"


async def test_only_the_holders_new_keep_alives_count(mesh, tmp_path):
    async with jog_site(mesh, tmp_path) as site:
        number = await jogged(site, 0.02)
        for fields, text in (
            ({"operator": "wu"}, "li is in control"),
            ({"lease": "guessed"}, "control"),
            ({"jog": site.id + 1}, "no jog"),
            ({"sequence": number}, "is not new"),
        ):
            values = {"sequence": number + 1, **fields}
            assert text in await refusal(ask(site, values.pop("sequence"), **values))

        def refused():
            return [each for each in site.seen["audit"] if each.request == "JOG_KEEP_ALIVE"]

        await until(lambda: any(each.operator == "wu" for each in refused()))
        assert {each.outcome for each in refused()} == {schema.AuditEntry.REFUSED}
        await at_rest(site, number + 1)


async def test_other_commands_a_stop_and_the_end_of_control_end_a_jog(mesh, tmp_path):
    async with jog_site(mesh, tmp_path) as site:

        async def begin_another():
            with contextlib.suppress(RefusedError):
                await begin(site)

        async def stop():
            stopped = await site.stop(by="wu", reason="too near")
            await until(lambda: site.controller.activity == STATE.STOPPED)
            assert site.controller.stop.id == stopped.stop_id
            await begin_refused(site, "latched")
            await site.command(C.RESET, stop_id=stopped.stop_id)

        assert await ended_by(site, begin_another) == "jog.commanded"
        assert await ended_by(site, lambda: site.command(C.HOLD)) == "jog.commanded"
        # A busy gateway sees the stop only after its RESET, by its number.
        assert await ended_by(site, stop) in ("program.stopped", "program.stopped_by_number")
        await jogged(site, 0.02)
        await site.lease(A.TAKE, operator="wu", reason="night shift")
        assert (await ended(site)).causes[0].code in ("program.stopped", "program.control_ended")
        await until(lambda: site.controller.HasField("stop"))


async def ended_by(site, act):
    """Jog, act, and return why the jog ended; a busy machine may end it before, which is tried again."""
    while True:
        await jogged(site, 0.02)
        await act()
        cause = (await ended(site)).causes[0].code
        await until(lambda: site.controller.activity == STATE.IDLE)
        if cause not in SLOW:
            return cause


async def begin_refused(site, text, **fields):
    assert text in await refusal(begin(site, **fields))


async def ended(site):
    """Wait for the end of the jog that runs; return its reason."""
    count = sum(each.request == "JOG" and each.outcome == ACCEPTED for each in entries(site))
    await until(lambda: sum(each.request == "JOG_END" for each in entries(site)) == count)
    return [each for each in entries(site) if each.request == "JOG_END"][-1].reason


async def test_a_jog_ends_at_a_limit_and_before_an_obstacle(mesh, tmp_path):
    async with jog_site(mesh, tmp_path, check="require", cell=one_robot_cell(POST)) as site:
        # After a jog, the gateway sets the speed that the operator has chosen.
        await site.command(C.SPEED, speed_percent=100)
        near = [radians(-149), *REST[1:]]
        await moved_to(site, near)
        end = await to_its_end(site, jog=J(frame=J.JOINT, joint=1, speed=-0.2))
        assert end.reason.code == "joints.outside"
        assert degrees(site.joints[0]) == pytest.approx(-150, abs=0.2)
        towards = [radians(60), *REST[1:]]
        await moved_to(site, towards)
        end = await to_its_end(site, jog=J(frame=J.JOINT, joint=1, speed=0.3))
        assert "post" in end.text
        assert degrees(site.joints[0]) < 90


async def to_its_end(site, **fields):
    """Jog until the line ends, again and again on a busy machine."""
    while True:
        await until(lambda: site.controller.activity == STATE.IDLE)
        try:
            await begin(site, **fields)
        except RefusedError as error:
            return schema.JogAnswer(
                text=str(error),
                reason=reason_message(error.reason.causes[0] if error.reason.causes else error.reason),
            )
        _, sequence = await held_down(site, 100.0)
        answer = await at_rest(site, sequence)
        if answer.reason.code not in SLOW:
            return answer


async def test_what_cannot_be_jogged_is_refused_in_words(mesh, tmp_path):
    async with jog_site(mesh, tmp_path, jog_speed=0.1) as site:
        before = list(site.joints)
        for jog, code in (
            (J(frame=J.BASE, axis=J.X, speed=float("nan")), "request.invalid"),
            (J(frame=J.BASE, axis=J.X, speed=1e9), "jog.speed"),
            (J(frame=J.BASE, axis=J.X), "jog.speed"),
            (J(frame=J.BASE, axis=J.ROLL, speed=0.6), "jog.speed"),
            (J(frame=J.BASE, speed=0.1), "jog.axis"),
            (J(axis=J.X, speed=0.1), "request.invalid"),
            (J(frame=J.JOINT, joint=6, speed=0.1), "jog.joint"),
            (J(frame=J.JOINT, speed=0.1), "jog.joint"),
            # The roll of a five-joint arm about its tool's axis.
            (J(frame=J.TOOL, axis=J.YAW, speed=0.1), "program.unreachable"),
        ):
            with pytest.raises(RefusedError) as caught:
                await begin(site, jog=jog)
            assert caught.value.reason.code == code
        with pytest.raises(RefusedError) as caught:
            await site.command(C.JOG)
        assert caught.value.reason.code == "jog.missing"
        with pytest.raises(RefusedError) as caught:
            await begin(site, lease="another")
        assert caught.value.reason.code == "lease.other"
        assert site.joints == before


@pytest.mark.parametrize(
    ("settings", "code"),
    [
        ({"jog_speed": 0.0}, "jog.forbidden"),
        ({"stop_proven": False}, None),
        ({"codes": {2: "ABSOLUTE.DEG", 5: "STATUS", 102: "COMMAND:stop"}}, "jog.no_driver"),
    ],
)
def test_a_robot_that_may_not_be_jogged_says_why(mesh, tmp_path, settings, code):
    async def main():
        coded = simulator(demo=True, codes=settings.get("codes", {}))
        async with coded as port, gateway(mesh, tmp_path, port, **settings) as site:
            if code is None:
                assert "read-only" in await refusal(site.lease(A.ACQUIRE))
                return
            await site.lease(A.ACQUIRE)
            with pytest.raises(RefusedError) as caught:
                await begin(site)
            assert caught.value.reason.code == code

    run(main(), timeout_s=60)
