"""Motion of a robot of FANUC: gateway and simulated controller over real sockets."""

from dataclasses import replace

import pytest

from tests.controllers.fanuc.fanuc_site import (
    FANUC,
    MOVES,
    controller,
    in_control,
    movable,
    packets,
    positions,
    runs,
)
from tests.controllers.simulated_site import move
from tests.protocol_gateway.gateway_site import A, C, gateway, kept_control, moving, refusal, resting, until
from tests.protocol_gateway.wire import wire

pytestmark = pytest.mark.slow
READS = replace(MOVES, motion=False)


async def test_targets_are_absolute_and_nothing_stays_in_the_controller(mesh, tmp_path, monkeypatch):
    async with (
        controller(monkeypatch) as (ports, server),
        wire(ports.rmi) as first,
        wire(ports.session) as session,
        movable(mesh, tmp_path, ports._replace(rmi=first.port), session=session.port) as site,
    ):
        await until(lambda: site.joints)
        assert not server.received
        await in_control(site)
        assert server.received == ["FRC_Connect"]
        before = positions(server)
        async with kept_control(site):
            await site.command(C.SPEED, speed_percent=50)
            target = await move(site, 0.2)
            await moving(site)
            await resting(site)
            assert positions(server) == pytest.approx(target, abs=1e-6)
            assert not runs(server)
            await site.command(C.MOVE_RELATIVE, joint_positions=[-0.2, 0.1, 0, 0, 0, 0])
            await moving(site)
            await resting(site)
            assert positions(server)[0] == pytest.approx(before[0], abs=1e-5)
            assert positions(server)[1] == pytest.approx(before[1] + 0.1, abs=1e-5)
            assert "homed" in await refusal(site.command(C.HOME))
            assert "no HOLD" in await refusal(site.command(C.HOLD))
            # The core knows that the motion has ended with the next statuses.
            await site.units(30)
            assert not site.controller.HasField("stop")
            await site.lease(A.RELEASE)
        await until(lambda: server.session is None)
        assert packets(first.sent) == [{"Communication": "FRC_Connect"}]
        sent = packets(session.sent)
        motion = ["FRC_Initialize", "FRC_JointMotionJRep", "FRC_Abort"]
        assert [next(iter(each.values())) for each in sent] == [*motion, *motion, "FRC_Disconnect"]
        for each in (sent[1], sent[4]):
            assert (each["SequenceID"], each["TermType"], each["SpeedType"]) == (1, "FINE", "Percent")
            assert each["Speed"] == 50


async def test_a_stop_during_the_initialization_prevents_the_motion(mesh, tmp_path, monkeypatch):
    monkeypatch.setattr("controllers.fanuc.simulated.rmi_server.INITIALIZE_S", 0.5)
    async with controller(monkeypatch) as (ports, server), movable(mesh, tmp_path, ports) as site:
        await in_control(site)
        rest = positions(server)
        await move(site, 2.0)
        await until(lambda: "FRC_Initialize" in server.received)
        assert (await site.stop(by="wang")).sent
        # The controller refuses a command while it is busy with another one: the abort is repeated.
        await until(lambda: server.controller.rmi is not None and not runs(server))
        assert server.received.count("FRC_Abort") > 1
        assert "FRC_JointMotionJRep" not in server.received
        assert positions(server) == pytest.approx(rest)
        await resting(site)


async def test_without_motion_in_the_site_file_rmi_is_never_connected(mesh, tmp_path, monkeypatch):
    async with (
        controller(monkeypatch, demo=True) as (ports, server),
        gateway(mesh, tmp_path, ports.snpx, **FANUC, options=READS) as site,
    ):
        await until(lambda: site.joints)
        assert not (await site.stop(by="wang")).sent
        assert "does not let the gateway move it" in await refusal(site.lease(A.ACQUIRE))
        await site.units(20)
        assert not server.received
        assert server.session is None
