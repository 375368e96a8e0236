"""The line to what is nearest: its colour tells how near, its place is where the points are."""

import numpy as np
import pytest

from renderer.cameras import Camera, pixels
from renderer.clearance_line import RED, Span, draw_span, same_span, span_of
from renderer.overlay import AMBER, FAINT
from renderer.robot_state import Ages, RobotState, span_now
from robomesh.schemas.robomesh_pb2 import Clearance, Description, KinematicState, Vector3

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
    span = span_of(clearance(distance), [DESCRIPTION])
    assert (span.color, span.text) == (color, text)
    assert span.ends.tolist() == [[0.0, 0.0, 0.5], [distance, 0.0, 0.5]]


def test_a_robot_that_has_no_distances_is_red_where_it_touches_only():
    assert span_of(clearance(0.001), [Description()]).color == FAINT
    assert span_of(clearance(0.0), [Description()]).color == RED


def test_of_two_robots_the_larger_distance_counts():
    careful = Description(warning_distance=0.2, stop_distance=0.1)
    assert span_of(clearance(0.15), [DESCRIPTION, careful]).color == AMBER
    assert span_of(clearance(0.09), [DESCRIPTION, careful]).color == RED
    assert span_of(clearance(0.0001), []).color == FAINT


def test_the_line_is_drawn_between_its_points_with_its_length_beside_it():
    span = Span(np.array([[-0.5, 0.0, 0.5], [0.5, 0.0, 0.5]]), "1000 mm", RED)
    picture = np.full((360, 640, 3), BLANK, dtype=np.uint8)
    draw_span(picture, ASIDE, span, labelled=False)
    drawn = (picture != BLANK).any(axis=2)
    start, end = pixels(ASIDE, (640, 360), span.ends)
    rows, columns = np.nonzero(drawn)
    assert columns.min() == pytest.approx(start[0], abs=5)
    assert columns.max() == pytest.approx(end[0], abs=5)
    assert rows.mean() == pytest.approx(start[1], abs=1)
    middle = picture[round(start[1]), 320].astype(int)
    assert np.abs(middle - RED).max() < 60
    labelled = np.full((360, 640, 3), BLANK, dtype=np.uint8)
    draw_span(labelled, ASIDE, span, labelled=True)
    assert (labelled != BLANK).any(axis=2).sum() > drawn.sum() + 200


def test_a_line_beside_or_behind_the_eye_is_not_drawn():
    span = Span(np.array([[0.0, -3.0, 0.5], [0.5, 1.0, 0.5]]), "", RED)
    picture = np.full((360, 640, 3), BLANK, dtype=np.uint8)
    draw_span(picture, ASIDE, span, labelled=True)
    assert (picture == BLANK).all()


def test_two_lines_look_the_same_unless_color_or_place_differ():
    span = span_of(clearance(0.3), [DESCRIPTION])
    assert same_span(span, span_of(clearance(0.3001), [DESCRIPTION]))
    assert not same_span(span, span_of(clearance(0.302), [DESCRIPTION]))
    assert not same_span(span_of(clearance(0.0501), [DESCRIPTION]), span_of(clearance(0.0499), [DESCRIPTION]))
    assert not same_span(span, None)
    assert same_span(None, None)


def test_old_kinematics_draws_no_line():
    state = RobotState("hall", "arm", span=span_of(clearance(0.3), [DESCRIPTION]))
    fresh = Ages(frames=0.1, joints=0.1, controller=None, kinematics=0.1)
    assert span_now(state, fresh) is state.span
    assert span_now(state, Ages(frames=0.1, joints=0.1, controller=None, kinematics=1.1)) is None
    assert span_now(state, Ages(frames=3.0, joints=3.0, controller=None, kinematics=0.1)) is None
    assert span_now(state, Ages(frames=0.1, joints=0.1, controller=None)) is None
    state.take_kinematics(KinematicState(), {})
    assert span_now(state, fresh) is None
