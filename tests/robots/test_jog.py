"""Parts of a jog, against Pinocchio on the exported URDF."""

from math import degrees, radians

import numpy as np
import pinocchio
import pytest

from robots.checks.jog import next_part
from robots.collision import build_cell
from robots.descriptions.cells import CellDescription, CellRobot
from robots.descriptions.description import load
from robots.descriptions.urdf.write import to_urdf
from robots.kinematics.inverse import build_solver
from robots.programs.jog_steps import AHEAD_M, AHEAD_RAD, Jog
from robots.programs.statements import StepFrame

pytestmark = pytest.mark.slow

STARTS = {"pt600": [-40, 90, -90, 10, 0], "puma560": [0, -45, 170, 0, 30, 0]}
SITE = np.array([[0.0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])


@pytest.fixture(scope="module", params=STARTS)
def arm(request):
    name = request.param
    cell = build_cell(CellDescription(robots=(CellRobot("arm", name, base_to_site=SITE),)))
    model = pinocchio.buildModelFromXML(to_urdf(load(name)))
    return cell, build_solver(cell.arms["arm"].description), model, np.radians(STARTS[name])


def tool_of(model, positions):
    data = model.createData()
    pinocchio.framesForwardKinematics(model, data, positions)
    return data.oMf[model.getFrameId("tool")].homogeneous


def jogged(arm, jog, parts=40, start=None):
    """Return the joint targets of a jog with the arm always at its last target, and the last part."""
    cell, solver, _, home = arm
    origin = at = home if start is None else start
    targets, commanded = [], 0.0
    for _ in range(parts):
        part = next_part(
            cell,
            "arm",
            solver,
            jog,
            origin=origin,
            measured=at,
            last=at,
            commanded=commanded,
            others={},
        )
        if part.target is None:
            break
        targets.append(part.target)
        at, commanded = part.target, part.commanded
    return targets, part


@pytest.mark.parametrize(
    ("frame", "axis", "sign"), [(StepFrame.BASE, 0, 1), (StepFrame.SITE, 1, -1), (StepFrame.TOOL, 2, -1)]
)
def test_parts_are_one_straight_line_of_at_most_10_mm(arm, frame, axis, sign):
    model, start = arm[2], arm[3]
    targets, _ = jogged(arm, Jog(frame=frame, axis=axis, speed=0.1 * sign), parts=10)
    assert len(targets) >= 5
    begin = tool_of(model, start)
    axes = {StepFrame.BASE: np.eye(3), StepFrame.SITE: SITE[:3, :3].T, StepFrame.TOOL: begin[:3, :3]}[frame]
    before = begin
    for target in targets:
        tool = tool_of(model, target)
        assert np.linalg.norm(tool[:3, 3] - before[:3, 3]) <= AHEAD_M + 1e-6
        way = tool[:3, 3] - begin[:3, 3]
        along = way @ axes[:, axis] * sign
        assert along > 0
        assert np.linalg.norm(way - along * sign * axes[:, axis]) < 1e-4
        if len(start) == 6:
            assert np.allclose(tool[:3, :3], begin[:3, :3], atol=1e-3)
        before = tool


def test_a_turn_keeps_the_tools_place_and_goes_on_beyond_half_a_turn(arm):
    model, start = arm[2], arm[3]
    if len(start) == 5:
        pytest.skip("with five joints the tool cannot turn about its own axis on the spot")
    targets, part = jogged(arm, Jog(frame=StepFrame.TOOL, axis=5, speed=0.3), parts=150)
    begin = tool_of(model, start)
    for one, target in zip([start, *targets], targets, strict=False):
        tool = tool_of(model, target)
        assert np.linalg.norm(tool[:3, 3] - begin[:3, 3]) < 1e-3
        turn = pinocchio.log3(tool_of(model, one)[:3, :3].T @ tool[:3, :3])
        assert np.linalg.norm(turn) <= AHEAD_RAD + 1e-3
        assert turn[2] > 0
    assert degrees(part.commanded) > 190


def test_the_tool_keeps_to_its_speed(arm):
    _, _, model, start = arm
    joints = arm[0].arms["arm"].joints
    for jog, most in (
        (Jog(frame=StepFrame.BASE, axis=1, speed=0.25), 0.25),
        (Jog(frame=StepFrame.BASE, axis=1, speed=0.25, tool_speed=0.05), 0.05),
        (Jog(frame=None, axis=0, speed=0.5), 0.25),
    ):
        cell, solver = arm[:2]
        part = next_part(
            cell, "arm", solver, jog, origin=start, measured=start, last=start, commanded=0.0, others={}
        )
        way = part.target - start
        # The fastest that the controller moves on this way: the first joint at its share of its speed.
        seconds = (np.abs(way) / joints.max_speed).max() / (part.percent / 100)
        travel = np.linalg.norm(tool_of(model, part.target)[:3, 3] - tool_of(model, start)[:3, 3])
        assert travel / seconds <= most
        assert part.percent <= 25


def test_a_jog_ends_where_a_line_of_the_tool_cannot_go_on(arm):
    ends = {}
    for axis, sign in ((0, 1), (1, -1), (2, -1)):
        _, part = jogged(arm, Jog(frame=StepFrame.BASE, axis=axis, speed=0.1 * sign), parts=300)
        assert part.target is None
        ends[axis] = part.end.code
    near_an_end = ("nearly_singular", "line_at_limit", "line_bent", "line_ends", "below_floor", "touches")
    assert {each.partition(".")[2] for each in ends.values()} <= set(near_an_end)
    upper = arm[0].arms["arm"].joints.upper[0]
    near = np.array([upper - radians(5), *arm[3][1:]])
    targets, part = jogged(arm, Jog(frame=None, axis=0, speed=0.2), start=near)
    assert part.end.code == "joints.outside"
    assert upper - radians(0.2) < targets[-1][0] <= upper
