"""What is known of a robot, how old it is, and what a picture says of it."""

import math

import pytest
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates

from renderer.appearance import look_of
from renderer.robot_state import Ages, RobotState, age_s, overlay_of
from robomesh.schemas.robomesh_pb2 import ControllerState
from tests.renderer.test_look import described

UP, SILENT, DOWN = ControllerState.UP, ControllerState.SILENT, ControllerState.DOWN


def frames(x, *, link="column", robot="arm"):
    message = FrameTransforms()
    transform = message.transforms.add(parent_frame_id="hall", child_frame_id=f"hall/{robot}/{link}")
    transform.translation.x = x
    transform.rotation.w = 1.0
    return message


def told(link, age=None):
    state = RobotState("hall", "arm")
    state.take_controller(ControllerState(link=link, last_unit_age_s=age))
    return state


@pytest.mark.parametrize(
    ("state", "ages", "expected"),
    [
        (RobotState("hall", "arm"), Ages(frames=0.01, joints=0.02, controller=None), 0.02),
        (RobotState("hall", "arm"), Ages(frames=7.0, joints=0.02, controller=None), 7.0),
        (RobotState("hall", "arm"), Ages(frames=None, joints=None, controller=None), math.inf),
        # The gateway says that what it sends is old.
        (told(SILENT, 4.0), Ages(frames=0.1, joints=0.1, controller=0.5), 4.5),
        (told(DOWN, 40.0), Ages(frames=None, joints=None, controller=0.5), 40.5),
        # Between two beats of a gateway that is up, the joint states tell.
        (told(UP, 0.01), Ages(frames=0.02, joints=0.02, controller=0.9), 0.02),
        # No unit came at all.
        (told(SILENT), Ages(frames=None, joints=None, controller=0.5), math.inf),
    ],
)
def test_a_picture_is_as_old_as_the_oldest_that_it_is_made_of(state, ages, expected):
    assert age_s(state, ages) == pytest.approx(expected)


def test_what_nobody_saw_fresh_is_never_shown_as_fresh():
    assert age_s(told(UP, 0.0), Ages(frames=None, joints=None, controller=0.1)) > 1.0


def test_only_what_would_change_the_picture_counts_as_a_change():
    state = RobotState("hall", "arm")
    state.take_frames(frames(0.1), 1, 1)
    first = state.version
    state.take_frames(frames(0.1), 2, 1)
    assert (state.version, state.source_time_ns) == (first, 2)
    for step in range(10):  # each step is below a pixel, all together are not
        state.take_frames(frames(0.1 + step * 1e-5), 3, 1)
    assert state.version > first
    before = state.version
    state.take_controller(ControllerState(link=UP, activity=ControllerState.IDLE))
    state.take_controller(ControllerState(link=UP, activity=ControllerState.IDLE, last_unit_age_s=1.0))
    assert state.version == before + 1


def test_another_robots_frames_are_left_alone():
    state = RobotState("hall", "arm")
    message = frames(0.1)
    message.transforms.extend(frames(0.2, robot="arm-2").transforms)
    state.take_frames(message, 1, 1)
    assert list(state.link_placements) == ["column"]


@pytest.mark.parametrize(
    ("age", "says"), [(0.9, ""), (3.2, "STALE 3 s"), (600.0, "STALE 10 min"), (math.inf, "STALE")]
)
def test_the_overlay_tells_values_in_degrees_and_the_age(age, says):
    description, _ = described("pt600")
    state = RobotState("hall", "arm")
    state.take_frames(frames(0.1), 1_000_000_000, 1)
    joints = JointStates()
    joints.joints.add(name="waist", position=math.radians(-30.456))
    state.take_joints(joints)
    overlay = overlay_of(state, look_of(description), "free", age=age)
    (row,) = overlay.rows
    assert (row.name, row.value, row.unit) == ("waist", "−30.46", "°")
    assert row.share == pytest.approx((150 - 30.456) / 300)
    assert overlay.stale == says
    assert overlay.marks == ("simulated",)


def test_a_robot_that_nobody_told_of_says_so():
    description, _ = described("pt600")
    overlay = overlay_of(RobotState("hall", "arm"), look_of(description), "free", age=math.inf)
    assert overlay.stale == "NO DATA, drawn at home"
    assert overlay.rows == ()


@pytest.mark.parametrize(
    ("controller", "says"),
    [
        (ControllerState(link=DOWN), "controller down"),
        (
            ControllerState(
                link=UP,
                activity=ControllerState.MOVING,
                mode=ControllerState.REMOTE,
                homed=ControllerState.YES,
            ),
            "moving, remote",
        ),
        (
            ControllerState(link=UP, activity=ControllerState.ACTIVITY_UNKNOWN, mode=ControllerState.LOCAL),
            "local",
        ),
    ],
)
def test_the_controllers_state_is_told_in_words(controller, says):
    description, _ = described("pt600")
    state = RobotState("hall", "arm")
    state.take_controller(controller)
    assert overlay_of(state, look_of(description), "free", age=0.1).state == says
