"""Checks of motions before they start: real gateway, real worker process, simulated controllers."""

import asyncio
import contextlib
import os
import signal
from math import radians
from pathlib import Path

import numpy as np
import pytest

from protocol_gateway.execution.clocks import read_clocks
from robomesh.contract.messages import PROTOBUF
from robomesh.errors import RefusedError
from robomesh.schemas import robomesh_pb2 as schema
from robots.descriptions.cells import CellDescription, CellRobot, Fixture
from robots.schema.poses import pose_matrix
from robots.schema.robot_toml import Pose, Units
from services.site_file.tables import fixtures
from services.watch.rules import RULES
from tests.conftest import run
from tests.protocol_gateway.gateway_site import STATE, A, C, gateway, kept_control, refusal, simulator, until
from tests.robots.boxes import bar_arm, one_joint_arm

# The arm reaches out along x at home, and into this post at waist +90 degrees.
POST = fixtures.Fixture(cell="a", name="post", box=(200.0, 200.0, 800.0), pose={"xyz": (0.0, 500.0, 400.0)})
AWAY, INTO_POST = [radians(-60), 0, 0, 0, 0], [radians(90), 0, 0, 0, 0]


def fixture(each):
    shape = fixtures.fixture_shape(each)
    return Fixture(each.name, (shape,), fixtures.fixture_to_site(each))


def base_pose(x_mm=0.0, turn_deg=0.0):
    return pose_matrix(Pose(xyz=(x_mm, 0.0, 0.0), rpy=(0.0, 0.0, turn_deg)), Units())


def one_robot_cell(*fixtures):
    return CellDescription((CellRobot("arm", "pt600", np.eye(4)),), tuple(map(fixture, fixtures)))


OUT = [0, 0, 0, 0, 0]
# The second is a metre in front of the first, and crosses its path at home.
TWO = CellDescription(
    (CellRobot("arm", "pt600", np.eye(4)), CellRobot("arm-2", "pt600", base_pose(1000.0, 90.0)))
)


async def checked(site):
    """Wait until motions can be checked, then home."""
    await until(lambda: not site.controller.check_text, timeout_s=60)
    await site.home()


@contextlib.asynccontextmanager
async def all_checked(arm):
    """Home the robots of a site one after the other, and keep control of all until the end."""
    async with contextlib.AsyncExitStack() as stack:
        for site in (arm, *arm.others):
            await checked(site)
            await stack.enter_async_context(kept_control(site))
        yield arm, *arm.others


async def move(site, target):
    """Repeat a command while this machine is too busy to check it in time."""
    async with asyncio.timeout(60):
        while True:
            try:
                return await site.command(C.MOVE_ABSOLUTE, joint_positions=target)
            except RefusedError as error:
                if "takes longer" not in str(error) and "waited" not in str(error):
                    raise
            await site.lease(A.RENEW)


async def standing(site, target):
    await until(lambda: np.allclose(site.joints, target, atol=1e-3), timeout_s=20)
    await until(lambda: site.controller.activity == STATE.IDLE)


async def test_required_a_collision_is_refused_without_motion(mesh, tmp_path):
    async with (
        simulator() as port,
        gateway(mesh, tmp_path, port, check="require", cell=one_robot_cell(POST)) as site,
    ):
        assert site.controller.check == STATE.REQUIRE
        await checked(site)
        before, units = list(site.joints), site.controller.counters.units_sent
        text = await refusal(move(site, INTO_POST))
        assert "post" in text
        assert "arm/" in text
        entry = await until(lambda: next((each for each in site.seen["audit"] if "post" in each.text), None))
        assert (entry.request, entry.outcome) == ("MOVE_ABSOLUTE", schema.AuditEntry.REFUSED)
        await move(site, AWAY)
        await until(lambda: site.joints[0] < before[0] - 0.1)
        assert site.controller.counters.units_sent <= units + 1
        text = await refusal(move(site, [0, 0, 0, 0, 0]))
        assert "wait until it has stopped" in text


async def test_required_a_motion_below_the_floor_is_refused(mesh, tmp_path):
    async with (
        simulator() as port,
        gateway(mesh, tmp_path, port, check="require", cell=one_robot_cell()) as site,
    ):
        await checked(site)
        text = await refusal(move(site, [0, 0, radians(-60), 0, 0]))
        assert "mm below the floor" in text
        await move(site, AWAY)


async def test_warned_a_collision_is_sent_with_a_warning(mesh, tmp_path, monkeypatch):
    async with (
        simulator() as port,
        gateway(mesh, tmp_path, port, check="warn", cell=one_robot_cell(POST)) as site,
    ):
        assert site.controller.check == STATE.WARN
        await checked(site)
        answer = await move(site, INTO_POST)
        assert answer.accepted
        assert "post" in answer.text
        event = (await until(lambda: site.events("check.failed")))[0]
        assert event.severity == schema.Event.WARNING
        assert "post" in event.text
        await until(lambda: site.joints[0] > 0.1)


async def test_required_motion_waits_for_a_killed_worker(mesh, tmp_path):
    async with (
        simulator() as port,
        gateway(mesh, tmp_path, port, check="require", cell=one_robot_cell(POST)) as site,
    ):
        await checked(site)
        os.kill(worker_of(os.getpid()), signal.SIGKILL)
        (answer,) = await asyncio.gather(move(site, AWAY), return_exceptions=True)
        # On a busy machine another worker may be there in time.
        if isinstance(answer, Exception):
            assert 'check = "require"' in str(answer)
            assert site.controller.counters.units_sent == 1
        async with asyncio.timeout(60):
            while site.joints[0] > -0.1:
                await site.lease(A.RENEW)
                with contextlib.suppress(RefusedError):
                    await move(site, AWAY)
                await asyncio.sleep(0.1)


@pytest.mark.exact_times
async def test_required_motion_waits_for_a_busy_check_until_its_deadline_and_stops_do_not(mesh, tmp_path):
    async with (
        simulator() as port,
        gateway(mesh, tmp_path, port, check="require", cell=one_robot_cell(), check_within_s=4.0) as site,
    ):
        await checked(site)
        worker = worker_of(os.getpid())
        async with kept_control(site):
            os.kill(worker, signal.SIGSTOP)
            first = asyncio.create_task(site.command(C.MOVE_ABSOLUTE, joint_positions=AWAY))
            await asyncio.sleep(1.3)
            assert not first.done()
            os.kill(worker, signal.SIGCONT)
            assert (await first).accepted
            await standing(site, AWAY)

            os.kill(worker, signal.SIGSTOP)
            text = await refusal(site.command(C.MOVE_ABSOLUTE, joint_positions=OUT, not_after=after(1.5)))
            assert "takes longer than 1." in text
            # Without a deadline.
            site.id += 1
            request = schema.CommandRequest(
                command=C.MOVE_ABSOLUTE, joint_positions=OUT, lease=site.secret, id=site.id
            )
            (reply,) = await asyncio.to_thread(raw, site, request)
            # With a deadline it would wait for 4 s.
            assert "longer than 0.8 s" in str(reply.err.payload)

            held = asyncio.create_task(site.command(C.MOVE_ABSOLUTE, joint_positions=OUT))
            await asyncio.sleep(0.1)
            await site.command(C.HOLD)
            await site.stop(reason="look")
            assert not held.done()
            os.kill(worker, signal.SIGCONT)
            await refusal(held)
        assert np.allclose(site.joints, AWAY, atol=1e-3)


def after(seconds):
    not_after = schema.CommandRequest().not_after
    not_after.FromNanoseconds(read_clocks().gateway_ns + round(seconds * 1e9))
    return not_after


def raw(site, request):
    key = site.key("command/li")
    return [*site.session.zenoh_session.get(key, payload=request.SerializeToString(), encoding=PROTOBUF)]


def worker_of(parent):
    """Return the worker process among the children of a process."""
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            ours = f") S {parent} " in (process / "stat").read_text()
            if ours and "checking.worker" in (process / "cmdline").read_text():
                return int(process.name)
    raise AssertionError("no worker process")


async def test_required_a_robot_without_shapes_is_not_moved(mesh, tmp_path):
    urdf = tmp_path / "bare.urdf"
    urdf.write_text(BARE)
    bare = CellDescription((CellRobot("arm", urdf, np.eye(4)),))
    async with (
        simulator(robot=str(urdf)) as port,
        gateway(mesh, tmp_path, port, check="require", cell=bare, description=str(urdf)) as site,
    ):
        await until(lambda: "no link with a shape" in site.controller.check_text, timeout_s=60)
        await site.lease(A.ACQUIRE)
        assert "no link with a shape" in await refusal(site.command(C.HOME))


async def test_required_a_moving_link_without_a_shape_is_refused(mesh, tmp_path):
    model = bar_arm(tmp_path / "half", bare=("elbow",))
    half = CellDescription((CellRobot("arm", model, np.eye(4)),))
    async with (
        simulator(robot=str(model)) as port,
        gateway(mesh, tmp_path, port, check="require", cell=half, description=str(model)) as site,
    ):
        await until(lambda: not site.controller.check_text, timeout_s=60)
        await site.lease(A.ACQUIRE)
        text = await refusal(site.command(C.HOME))
        assert "cannot be checked" in text
        assert "elbow moves and has no shape" in text


def test_with_doubtful_limits_require_refuses_and_warn_reports(mesh, tmp_path):
    urdf = one_joint_arm(tmp_path, 'lower="-180" upper="180" velocity="1"')
    cell = CellDescription((CellRobot("arm", urdf, np.eye(4)),))

    async def main(policy):
        async with (
            simulator(robot=str(urdf)) as port,
            gateway(mesh, tmp_path, port, check=policy, cell=cell, description=str(urdf)) as site,
        ):
            await until(lambda: not site.controller.check_text, timeout_s=60)
            await site.lease(A.ACQUIRE)
            if policy == "require":
                return await refusal(site.command(C.HOME))
            await site.command(C.HOME)
            return (await until(lambda: site.events("check.skipped")))[0].text

    for policy in ("require", "warn"):
        text = run(main(policy), timeout_s=90)
        assert "j1: lower = -180 rad is 28 turns; probably degrees: -3.1416 to 3.1416 rad" in text
        assert "state their limits" in text


async def test_an_unchecked_motion_has_no_warning_about_clearance(mesh, tmp_path):
    urdf = tmp_path / "bare.urdf"
    urdf.write_text(BARE)
    bare = CellDescription((CellRobot("arm", urdf, np.eye(4)),))
    async with (
        simulator(robot=str(urdf)) as port,
        gateway(mesh, tmp_path, port, check="warn", cell=bare, description=str(urdf)) as site,
    ):
        # Also while the check is starting.
        await site.lease(A.ACQUIRE)
        await site.command(C.HOME)
        event = (await until(lambda: site.events("check.skipped")))[0]
        assert event.text.startswith("HOME: not checked: ")
        assert "unchecked" in RULES[event.code].advice
        assert not site.events("check.warning")


BARE = """<robot name="bare"><link name="base"/><link name="tip"/>
<joint name="turn" type="revolute"><parent link="base"/><child link="tip"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""


async def test_robots_are_checked_along_the_paths_of_the_others(mesh, tmp_path):
    async with (
        simulator() as port,
        simulator() as other_port,
        gateway(mesh, tmp_path, port, other_port, check="require", each=[{"cell": TWO}] * 2) as cell_site,
        all_checked(cell_site) as (arm, other),
    ):
        await move(arm, OUT)
        # During the motion, and after it, the other robot must not swing through it.
        text = await refusal(move(other, [radians(90), 0, 0, 0, 0]))
        assert "arm/" in text
        await standing(arm, OUT)
        text = await refusal(move(other, [radians(90), 0, 0, 0, 0]))
        assert "arm/" in text
        assert "arm-2/" in text
        await move(arm, [radians(-90), 0, 0, 0, 0])
        await standing(arm, [radians(-90), 0, 0, 0, 0])
        # Sent concurrently, each allowed alone: the second is refused because of the first's path.
        answers = await asyncio.gather(
            move(arm, OUT),
            move(other, [radians(90), 0, 0, 0, 0]),
            return_exceptions=True,
        )
        refused = [answer for answer in answers if isinstance(answer, RefusedError)]
        assert len(refused) == 1, answers
        assert "arm-2/" in str(refused[0])


async def test_required_an_unserved_robot_of_the_cell_is_refused(mesh, tmp_path):
    async with (
        simulator() as port,
        gateway(mesh, tmp_path, port, check="require", cell=TWO) as site,
    ):
        await until(lambda: not site.controller.check_text, timeout_s=60)
        await site.lease(A.ACQUIRE)
        text = await refusal(site.command(C.HOME))
        assert "the position or the target of arm-2 (this gateway does not serve it)" in text


def test_an_unknown_policy_is_refused(mesh, tmp_path):
    async def main():
        async with gateway(mesh, tmp_path, 9, up=False, check="sometimes"):
            pass

    with pytest.raises(Exception, match="'sometimes': should be 'require', 'warn', 'off'"):
        run(main())
