"""A program's check as a message of the mesh."""

import numpy as np

from robomesh.schemas import robomesh_pb2 as schema
from robots.collision import Cell, build_cell
from robots.descriptions.cells import CellDescription, CellRobot
from services.kinematics.worker.check import check_answer
from tests.robots.boxes import block, placed

ARM = CellRobot(name="arm", model="pt600", base_to_site=np.eye(4))
ALONE = build_cell(CellDescription((ARM,)))
BY_A_POST = build_cell(CellDescription((ARM,), (block("post", (0.06, 0.06, 1.0), placed(0.0, 0.45, 0.5)),)))
HOME = ALONE.arms["arm"].joints.home


def asked(program: str, *, path: bool = False, cell: Cell = ALONE) -> schema.CheckAnswer:
    return check_answer(schema.CheckRequest(program=program, path=path), cell, "arm", HOME, others={})


def test_a_path_is_told_on_request_a_column_a_value() -> None:
    path = asked("home\nmove_joints 20 80 -80 0 0\n", path=True).path
    count = len(path.times_s)
    assert count > 20
    assert len(path.joint_positions) == 5 * count
    assert len(path.tool_positions) == 3 * count
    assert len(path.lines) == count
    assert set(path.lines) == {1, 2}
    assert list(path.joint_positions[:5]) == HOME.tolist()
    # There are no obstacles, so no clearance is reported.
    assert len(path.clearances) == 0
    assert not asked("home\n").HasField("path")
    around = asked("home\n", path=True, cell=BY_A_POST).path
    assert len(around.clearances) == len(around.times_s)


def test_a_violation_is_told_with_its_distance_only_where_it_has_one() -> None:
    (wrong,) = asked("speed 0\n").violations
    assert (wrong.kind, wrong.line, wrong.refuses, wrong.HasField("distance")) == ("program", 1, True, False)
    touching = asked("move_joints 90 45 -45 0 0\n", cell=BY_A_POST)
    assert not touching.ok
    touch = next(each for each in touching.violations if each.kind == "collision")
    assert touch.HasField("distance")
    assert (touch.distance, len(touch.points), list(touch.pair)) == (0.0, 2, ["arm/forearm", "post"])
    assert touch.time_s < touch.until_s <= touching.duration_s
