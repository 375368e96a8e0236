"""Floor in the kinematics service: in a robot's description, and the event of an arm that is below it."""

import numpy as np
import pytest

from renderer.scene.appearance import floor_of
from robomesh.schemas import robomesh_pb2 as schema
from robots.collision import build_cell
from robots.descriptions.cells import CellDescription, CellRobot, Floor
from services.kinematics.descriptions import add_surroundings
from services.kinematics.floor import floor_event
from services.watch.rules import RULES
from tests.robots.boxes import placed

ROBOT = CellRobot("arm", "pt600", placed(0.0, 0.0, 0.4))


@pytest.mark.parametrize(
    ("floor", "height"), [(Floor(), 0.4), (Floor(0.0), 0.0), (Floor(-0.25, 0.05, 0.01), -0.25), (None, None)]
)
def test_a_description_holds_the_floor_or_its_absence(floor, height):
    message = schema.Description(base_to_site=ROBOT.base_to_site.ravel().tolist())
    assert floor_of(message) == 0.4  # a message of an older sender: the height of the robot's base
    add_surroundings(message, ROBOT, CellDescription((ROBOT,), floor=floor), ())
    sent = schema.Description.FromString(message.SerializeToString())
    assert sent.HasField("floor")
    assert floor_of(sent) == height
    if floor is not None:
        assert (sent.floor.warning_distance, sent.floor.stop_distance) == (floor.warning_m, floor.stop_m)


def test_an_arm_that_is_below_the_floor_is_listed_with_the_line_to_write():
    cell = build_cell(CellDescription((ROBOT,)))
    home = cell.arms["arm"].joints.home
    low = np.radians([0.0, 0.0, -60.0, 0.0, 0.0])
    assert floor_event(cell, "arm", {"at home": home}) is None
    event = floor_event(cell, "arm", {"at home": home, "where it is now": low})
    assert "at home" not in event.text
    assert event.text.startswith("where it is now arm/")
    assert event.reason.code == "check.floor_advice"
    assert (event.reason.values["height_mm"], event.reason.values["below_mm"]) == ("400", "360")
    assert "floor = false" in event.text
    assert event.code in RULES
    # With that line the arm is not listed.
    for floor in (Floor(0.36), None):
        cell = build_cell(CellDescription((ROBOT,), floor=floor))
        assert floor_event(cell, "arm", {"at home": home, "where it is now": low}) is None
