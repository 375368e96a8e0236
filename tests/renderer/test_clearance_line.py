"""The line to the nearest body: colour by distance, position, label."""

import numpy as np
import pytest

from renderer.pictures.clearance_line import RED, ClearanceLine, draw_clearance_line, line_of, same_line
from renderer.pictures.overlay import AMBER, FAINT
from renderer.pictures.robot_state import Ages, RobotState, current_clearance_line
from renderer.scene.cameras import Camera, pixels
from robomesh.schemas.robomesh_pb2 import Clearance, Description, KinematicState, Vector3
from robots.descriptions.cells import FLOOR

DESCRIPTION = Description(warning_distance=0.05, stop_distance=0.01)
ASIDE = Camera(np.array([0.0, -3.0, 0.5]), np.array([0.0, 0.0, 0.5]), np.array([0.0, 0.0, 1.0]))
BLANK = (200, 205, 210)


def clearance(distance):
    return Clearance(distance=distance, first_point=Vector3(z=0.5), second_point=Vector3(x=distance, z=0.5))


@pytest.mark.parametrize(
    ("distance", "color", "text"),
    [
        (0.3, FAINT, "300 mm"),
        (0.05, FAINT, "50 mm"),
        (0.049, AMBER, "49 mm"),
        (0.0099, RED, "10 mm"),
        (0.0, RED, "0 mm"),
    ],
)
def test_the_line_is_grey_amber_within_the_warning_distance_and_red_within_the_stop_distance(
    distance, color, text
):
    clearance_line = line_of(clearance(distance), [DESCRIPTION])
    assert (clearance_line.color, clearance_line.text) == (color, text)
    assert clearance_line.ends.tolist() == [[0.0, 0.0, 0.5], [distance, 0.0, 0.5]]


def test_without_distances_the_line_is_red_only_in_contact():
    assert line_of(clearance(0.001), [Description()]).color == FAINT
    assert line_of(clearance(0.0), [Description()]).color == RED


def test_the_larger_distance_of_two_robots_counts():
    careful = Description(warning_distance=0.2, stop_distance=0.1)
    assert line_of(clearance(0.15), [DESCRIPTION, careful]).color == AMBER
    assert line_of(clearance(0.09), [DESCRIPTION, careful]).color == RED
    assert line_of(clearance(0.0001), []).color == FAINT


def test_the_floor_has_its_own_distances():
    site = Description(warning_distance=0.2, stop_distance=0.1)
    site.floor.warning_distance, site.floor.stop_distance = 0.05, 0.01
    above = clearance(0.09)
    above.first, above.second = "arm/wrist", f"site/{FLOOR}"
    assert line_of(above, [site]).color == FAINT
    above.second = "arm/column"
    assert line_of(above, [site]).color == RED


def test_the_line_is_drawn_between_its_points_with_its_length():
    clearance_line = ClearanceLine(np.array([[-0.5, 0.0, 0.5], [0.5, 0.0, 0.5]]), "1000 mm", RED)
    picture = np.full((360, 640, 3), BLANK, dtype=np.uint8)
    draw_clearance_line(picture, ASIDE, clearance_line, labelled=False)
    drawn = (picture != BLANK).any(axis=2)
    start, end = pixels(ASIDE, (640, 360), clearance_line.ends)
    rows, columns = np.nonzero(drawn)
    assert columns.min() == pytest.approx(start[0], abs=5)
    assert columns.max() == pytest.approx(end[0], abs=5)
    assert rows.mean() == pytest.approx(start[1], abs=1)
    middle = picture[round(start[1]), 320].astype(int)
    assert np.abs(middle - RED).max() < 60
    labelled = np.full((360, 640, 3), BLANK, dtype=np.uint8)
    draw_clearance_line(labelled, ASIDE, clearance_line, labelled=True)
    assert (labelled != BLANK).any(axis=2).sum() > drawn.sum() + 200


def test_a_line_that_reaches_behind_the_eye_is_not_drawn():
    clearance_line = ClearanceLine(np.array([[0.0, -3.0, 0.5], [0.5, 1.0, 0.5]]), "", RED)
    picture = np.full((360, 640, 3), BLANK, dtype=np.uint8)
    draw_clearance_line(picture, ASIDE, clearance_line, labelled=True)
    assert (picture == BLANK).all()


def test_two_lines_look_the_same_unless_color_or_position_differ():
    clearance_line = line_of(clearance(0.3), [DESCRIPTION])
    assert same_line(clearance_line, line_of(clearance(0.3001), [DESCRIPTION]))
    assert not same_line(clearance_line, line_of(clearance(0.302), [DESCRIPTION]))
    assert not same_line(line_of(clearance(0.0501), [DESCRIPTION]), line_of(clearance(0.0499), [DESCRIPTION]))
    assert not same_line(clearance_line, None)
    assert same_line(None, None)


def test_old_kinematics_draws_no_line():
    state = RobotState("hall", "arm", clearance_line=line_of(clearance(0.3), [DESCRIPTION]))
    fresh = Ages(frames=0.1, joints=0.1, controller=None, kinematics=0.1)
    assert current_clearance_line(state, fresh) is state.clearance_line
    assert (
        current_clearance_line(state, Ages(frames=0.1, joints=0.1, controller=None, kinematics=1.1)) is None
    )
    assert (
        current_clearance_line(state, Ages(frames=3.0, joints=3.0, controller=None, kinematics=0.1)) is None
    )
    assert current_clearance_line(state, Ages(frames=0.1, joints=0.1, controller=None)) is None
    state.update_kinematics(KinematicState(), {})
    assert current_clearance_line(state, fresh) is None
