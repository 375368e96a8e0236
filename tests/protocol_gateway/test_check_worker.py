"""Worker processes of the gateway: queueing, uncovered parts of a cell, and errors in a worker."""

import asyncio
import contextlib
import os
import signal
import subprocess
import sys

import numpy as np
import pytest

from protocol_gateway.checking.checker import MOST_PROCESSES, Checker, make_checkers
from protocol_gateway.checking.worker import begin
from protocol_gateway.checking.worker_messages import Checked, CheckMotion
from protocol_gateway.seam.errors import CheckError
from robomesh import reason_codes as codes
from robots.descriptions.cells import CellDescription, CellRobot, Fixture
from robots.kinematics.kinematic_tree import Shape
from robots.schema.robot_toml import JointSettings, StatedModel
from robots.shapes.geometry import Geometry, Material, Part
from tests.robots.boxes import bar_arm, block, one_joint_arm, placed

STANDING = (0.0, 0.0)
BARE = """<robot name="bare"><link name="base"/><link name="tip"/>
<joint name="turn" type="revolute"><parent link="base"/><child link="tip"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""
HALF = BARE.replace(
    '<link name="base"/><link name="tip"/>',
    '<link name="base"><visual><geometry><box size="0.1 0.1 0.1"/></geometry></visual></link>'
    '<link name="tip"><visual><geometry><mesh filename="nowhere.stl"/></geometry></visual></link>',
)


def motion(robot, *targets, others=None, start=STANDING):
    return CheckMotion(robot=robot, start=start, targets=targets or ((0.1, 0.0),), others=others or {})


@contextlib.asynccontextmanager
async def running(checker):
    task = asyncio.create_task(checker.run())
    try:
        yield task
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


async def ready(checker, robot):
    async with asyncio.timeout(60):
        while checker.problem(robot):
            await asyncio.sleep(0.02)


def one_robot_cell(name, model, *fixtures):
    return CellDescription((CellRobot(name, model, placed(0.0)),), fixtures)


def test_robots_of_a_cell_share_a_process_and_single_robots_share_one():
    pairs = [
        CellDescription((CellRobot(f"l{n}", "pt600", placed(0.0)), CellRobot(f"r{n}", "pt600", placed(1.0))))
        for n in range(MOST_PROCESSES + 3)
    ]
    surroundings = {robot.name: pair for pair in pairs for robot in pair.robots}
    surroundings |= {f"a{n}": one_robot_cell(f"a{n}", "pt600") for n in range(100)}
    checkers = make_checkers(surroundings, start_now=["a7"])
    assert checkers.keys() == surroundings.keys()
    assert len(set(checkers.values())) == MOST_PROCESSES + 1
    assert all(checkers[f"l{n}"] is checkers[f"r{n}"] for n in range(len(pairs)))
    assert checkers["l0"] is not checkers["l1"]
    assert len({checkers[f"a{n}"] for n in range(100)}) == 1
    assert checkers["a0"] not in {checkers[f"l{n}"] for n in range(len(pairs))}


@pytest.mark.slow
async def test_a_query_is_not_started_after_its_timeout(tmp_path, monkeypatch):
    checker = Checker({"arm": one_robot_cell("arm", bar_arm(tmp_path))}, start_now=True)
    begun = []
    ask = checker._worker.ask

    async def counted(question, *, timeout_s):
        begun.append(question)
        return await ask(question, timeout_s=timeout_s)

    monkeypatch.setattr(checker._worker, "ask", counted)
    async with running(checker):
        await ready(checker, "arm")
        begun.clear()
        os.kill(checker.pid, signal.SIGSTOP)
        late = await asyncio.gather(
            *(checker.motion(motion("arm"), timeout_s=0.2) for _ in range(20)), return_exceptions=True
        )
        assert all(isinstance(each, CheckError) and "longer than" in str(each) for each in late)
        os.kill(checker.pid, signal.SIGCONT)
        assert isinstance(await checker.motion(motion("arm"), timeout_s=30.0), Checked)
        # The query that hung, and the one that waited.
        assert len(begun) == 2


@pytest.mark.slow
async def test_a_worker_that_is_killed_while_idle_is_prepared_again_before_the_next_motion(tmp_path):
    checker = Checker({"arm": one_robot_cell("arm", bar_arm(tmp_path))}, start_now=True)
    async with running(checker):
        await ready(checker, "arm")
        first = checker.pid
        os.kill(first, signal.SIGKILL)
        async with asyncio.timeout(60):
            while checker.pid in (first, None):
                await asyncio.sleep(0.02)
        await ready(checker, "arm")
        assert isinstance(await checker.motion(motion("arm"), timeout_s=30.0), Checked)


@pytest.mark.slow
async def test_an_unexpected_error_is_reported_and_the_worker_goes_on(tmp_path):
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, np.nan]])
    faces = np.array([[0, 1, 2], [0, 1, 3], [0, 2, 3]])
    shape = Shape(Geometry(parts=(Part("", Material(), corners, np.zeros_like(corners), faces),)), np.eye(4))
    model = bar_arm(tmp_path)
    cells = {
        "bad": one_robot_cell("bad", model, Fixture("odd", (shape,), np.eye(4))),
        "good": one_robot_cell("good", model),
    }
    checker = Checker(cells, start_now=True)
    async with running(checker) as task:
        await ready(checker, "good")
        assert "LinAlgError" in checker.problem("bad").text
        with pytest.raises(CheckError, match="LinAlgError"):
            await checker.motion(motion("bad"), timeout_s=30.0)
        # A robot that is not in the cell: a bug of the caller.
        with pytest.raises(CheckError, match="the check failed: KeyError: 'nobody'"):
            await checker.motion(motion("good", others={"nobody": (STANDING,)}), timeout_s=30.0)
        assert not task.done()


def test_another_robot_without_shapes_or_meshes_is_refused(tmp_path):
    for name, text, words in (
        ("bare", BARE, "no link in bare's description has a shape"),
        ("half", HALF, "half cannot be checked completely: mesh file not found: nowhere.stl"),
    ):
        (tmp_path / f"{name}.urdf").write_text(text)
        robots = (
            CellRobot("arm", bar_arm(tmp_path / "arm"), placed(0.0)),
            CellRobot(name, tmp_path / f"{name}.urdf", placed(5.0)),
        )
        answer = begin({"arm": CellDescription(robots)})
        (uncovered,) = answer(motion("arm", others={name: ((0.0,),)})).uncovered
        assert uncovered.text.startswith(words)


def test_a_moving_link_without_a_shape_is_uncovered(tmp_path):
    whole, half = bar_arm(tmp_path / "whole"), bar_arm(tmp_path / "half", bare=("elbow",))
    for arm, mate in ((half, whole), (whole, half)):
        cell = CellDescription((CellRobot("arm", arm, placed(0.0)), CellRobot("mate", mate, placed(5.0))))
        checked = begin({"arm": cell})(motion("arm", others={"mate": (STANDING,)}))
        robot = "arm" if arm is half else "mate"
        assert checked.uncovered == (codes.LINK_WITHOUT_SHAPE(name=robot, links="elbow"),)
        assert checked.refusals == checked.warnings == ()


def test_a_fixed_link_without_a_shape_is_a_warning(tmp_path):
    arm = CellRobot("arm", bar_arm(tmp_path, bare=("base",)), placed(0.0))
    checked = begin({"arm": CellDescription((arm,))})(motion("arm"))
    assert checked.uncovered == checked.refusals == ()
    assert checked.warnings == (codes.FIXED_WITHOUT_SHAPE(name="arm", links="base"),)


def test_doubtful_limits_of_the_checked_robot_are_uncovered(tmp_path):
    degrees = one_joint_arm(tmp_path / "degrees", 'lower="-180" upper="180" velocity="1"')
    radians = one_joint_arm(tmp_path / "radians", 'lower="-1" upper="1" velocity="1"')
    robots = CellRobot("arm", degrees, placed(0.0)), CellRobot("mate", radians, placed(5.0))
    answer = begin(dict.fromkeys(("arm", "mate"), CellDescription(robots)))

    def uncovered(robot, other):
        return answer(motion(robot, (0.1,), start=(0.0,), others={other: ((0.0,),)})).uncovered

    (reason,) = uncovered("arm", "mate")
    assert (reason.code, uncovered("mate", "arm")) == ("check.limits_doubtful", ())
    assert "j1" in reason.text
    stated = StatedModel(model=str(degrees), joints=(JointSettings(name="j1", limits=(-180.0, 180.0)),))
    cell = CellDescription((CellRobot("arm", stated, placed(0.0)),))
    assert begin({"arm": cell})(motion("arm", (0.1,), start=(0.0,))).uncovered == ()


def test_a_long_program_of_another_robot_is_checked_only_where_near(tmp_path):
    bars = bar_arm(tmp_path / "bars")
    fixture = block("post", (0.1, 0.1, 0.1), placed(0.0, 1.0))

    def cell(apart):
        robots = CellRobot("arm", bars, placed(0.0)), CellRobot("mate", bars, placed(apart))
        return begin({"arm": CellDescription(robots, (fixture,))})

    rng = np.random.default_rng(0)
    way = tuple(map(tuple, rng.uniform(-3.0, 3.0, (101, 2)).tolist()))
    swinging = motion("arm", (1.0, 0.0), others={"mate": way})
    # Both reach 0.78 m: they meet, or pass each other 0.1 m apart.
    assert any("mate/" in each.text for each in cell(1.2)(swinging).refusals)
    assert cell(1.66)(swinging).refusals == ()


@pytest.mark.slow
def test_the_gateway_process_imports_neither_coal_nor_pinocchio():
    code = "import sys, protocol_gateway.gateway; print({'coal', 'pinocchio'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"
