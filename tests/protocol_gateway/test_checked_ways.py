"""Checks against the commanded paths of a cell's other robots."""

import asyncio
import contextlib
from dataclasses import replace
from math import radians

import pytest

from protocol_gateway.authority.decisions import CheckVerdict
from protocol_gateway.checking.cell_occupancy import CellOccupancy
from protocol_gateway.checking.policy import Policy
from protocol_gateway.execution.motion_checks import MotionChecks
from protocol_gateway.seam import Activity, Mode, StatusReceived
from robomesh import reason_codes as codes
from robomesh.errors import RefusedError
from robomesh.schemas import robomesh_pb2 as schema
from robots.descriptions.description import load
from robots.kinematics.joints import joints_of
from tests.protocol_gateway.control_bench import control_bench
from tests.protocol_gateway.gateway_site import A, C, gateway, simulator, until
from tests.protocol_gateway.test_checked_motion import OUT, TWO, all_checked, move, standing
from tests.protocol_gateway.test_program_runs import RUN, ended, start, states
from tests.refusals import refused

JOINTS = joints_of(load("pt600"))
READY = StatusReceived(activity=Activity.IDLE, mode=Mode.REMOTE, homed=True)
HERE, FAR, NEAR = (0.0,) * 5, (1.0, 0.0, 0.0, 0.0, 0.0), (0.1, 0.0, 0.0, 0.0, 0.0)


def checks(bench, cell_occupancy, name="arm"):
    """Return the checks of one of two robots of a cell."""
    return MotionChecks(
        name,
        Policy.OFF,
        cell=("arm", "arm-2"),
        checker=None,
        planner=None,
        cell_occupancy=cell_occupancy,
        joints=JOINTS,
        robot_authority=bench.robot_authority,
        controller=bench.controller,
    )


def occupied_path(bench):
    """Return the path that the cell's other robots are checked against."""
    cell_occupancy = CellOccupancy()
    checks(bench, cell_occupancy)
    return cell_occupancy.others("arm-2", ("arm", "arm-2"))["arm"].path


@pytest.mark.parametrize(
    ("second", "path"),
    [
        ((C.MOVE_ABSOLUTE, {"joint_positions": NEAR}), (HERE, FAR, NEAR)),
        ((C.MOVE_RELATIVE, {"joint_positions": NEAR}), (HERE, FAR, (1.1, 0.0, 0.0, 0.0, 0.0))),
    ],
)
async def test_a_unit_of_two_motions_occupies_both_paths(tmp_path, second, path):
    async with control_bench(tmp_path) as bench:
        await bench.lease(A.ACQUIRE)
        bench.status = READY
        await bench.commands((C.MOVE_ABSOLUTE, {"joint_positions": FAR}), second)
        path_of_commands = occupied_path(bench)
        assert [tuple(round(value, 9) for value in each) for each in path_of_commands] == list(path)


async def test_a_check_holds_until_another_robot_is_commanded_to_a_target_that_it_did_not_know(tmp_path):
    async with control_bench(tmp_path) as bench:
        await bench.lease(A.ACQUIRE)
        bench.status = READY
        await bench.commands((C.MOVE_ABSOLUTE, {"joint_positions": FAR}))
        cell_occupancy = CellOccupancy()
        checks(bench, cell_occupancy)
        other = checks(bench, cell_occupancy, "arm-2")
        assert other.why_changed(CheckVerdict(others={"arm": (HERE, FAR)})) is None
        assert other.why_changed(CheckVerdict(others={"arm": (HERE,)})).code == "robot.other_moved"


async def test_resume_and_another_motion_are_two_units(tmp_path):
    async with control_bench(tmp_path) as bench:
        await bench.lease(A.ACQUIRE)
        bench.status = READY
        await bench.commands((C.MOVE_ABSOLUTE, {"joint_positions": FAR}))
        bench.status = replace(READY, activity=Activity.HOLDING)
        with refused(codes.COMMAND_TWO_UNITS):
            await bench.commands((C.RESUME, {}), (C.MOVE_ABSOLUTE, {"joint_positions": NEAR}), first_id=2)
        assert len(bench.socket) == 1


async def test_an_unchecked_robot_is_an_obstacle_for_the_others(mesh, tmp_path):
    policies = [{"cell": TWO, "check": "require"}, {"cell": TWO, "check": "off"}]
    async with (
        simulator() as port,
        simulator() as other_port,
        gateway(mesh, tmp_path, port, other_port, each=policies) as cell_site,
        all_checked(cell_site) as (arm, other),
    ):
        await move(arm, [radians(-90), 0, 0, 0, 0])
        await standing(arm, [radians(-90), 0, 0, 0, 0])
        accepted = []

        async def asked(robot, target):
            with contextlib.suppress(RefusedError):
                await move(robot, target)
                accepted.append(robot)

        await asyncio.gather(asked(other, [radians(90), 0, 0, 0, 0]), asked(arm, OUT))
        # If both are accepted, the checked one was first, and its path was free.
        assert accepted in ([other], [arm], [arm, other])


async def test_a_stop_ends_a_waiting_program_even_if_reset_immediately(mesh, tmp_path):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        await site.home()
        await start(site, "wait 2\nmove_joints -60 90 -90 0 0\n")
        await until(lambda: states(site)[-1].outcome == RUN.RUNNING)
        for _ in range(3):
            stop = await site.stop(by="wang")
            site.id += 1
            request = schema.CommandRequest(
                command=C.RESET, lease=site.secret, id=site.id, stop_id=stop.stop_id
            )
            # After the answer to the stop, within one poll of the program.
            await site.session.ask(site.key("command/li"), request)
        state = await ended(site, RUN.ENDED)
        assert state.text.startswith("stopped")


async def test_a_program_is_planned_from_the_robots_positions(mesh, tmp_path):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        await site.home()
        await site.command(C.SPEED, speed_percent=5)
        await site.command(C.MOVE_ABSOLUTE, joint_positions=[radians(-60), 1.57, -1.57, 0, 0])
        await until(lambda: site.joints[0] < -0.02)
        with refused(codes.ROBOT_MOVES_HOME):
            await start(site, "move_joints -20 90 -90 0 0\n")
