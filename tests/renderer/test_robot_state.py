"""A robot's state, its age, and the texts of its pictures."""

import math

import pytest
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates

from renderer.pictures.robot_state import Ages, RobotState, age_s, overlay_of
from renderer.scene.appearance import appearance_of
from robomesh.schemas.robomesh_pb2 import ControllerState
from tests.renderer.test_appearance import described

UP, SILENT, DOWN = ControllerState.UP, ControllerState.SILENT, ControllerState.DOWN


def frames(x, *, link="column", robot="arm"):
    message = FrameTransforms()
    transform = message.transforms.add(parent_frame_id="hall", child_frame_id=f"hall/{robot}/{link}")
    transform.translation.x = x
    transform.rotation.w = 1.0
    return message


def with_controller(link, age=None):
    state = RobotState("hall", "arm")
    state.update_controller(ControllerState(link=link, last_unit_age_s=age))
    return state


@pytest.mark.parametrize(
    ("state", "ages", "expected"),
    [
        (RobotState("hall", "arm"), Ages(frames=0.01, joints=0.02, controller=None), 0.02),
        (RobotState("hall", "arm"), Ages(frames=7.0, joints=0.02, controller=None), 7.0),
        (RobotState("hall", "arm"), Ages(frames=None, joints=None, controller=None), math.inf),
        # The gateway reports that its last unit is old.
        (with_controller(SILENT, 4.0), Ages(frames=0.1, joints=0.1, controller=0.5), 4.5),
        (with_controller(DOWN, 40.0), Ages(frames=None, joints=None, controller=0.5), 40.5),
        # Between two controller messages of a connected gateway, the joint states count.
        (with_controller(UP, 0.01), Ages(frames=0.02, joints=0.02, controller=0.9), 0.02),
        # No unit was ever received.
        (with_controller(SILENT), Ages(frames=None, joints=None, controller=0.5), math.inf),
    ],
)
def test_a_picture_has_the_age_of_its_oldest_source(state, ages, expected):
    assert age_s(state, ages) == pytest.approx(expected)


def test_a_state_never_received_live_is_stale():
    assert age_s(with_controller(UP, 0.0), Ages(frames=None, joints=None, controller=0.1)) > 1.0


def test_only_visible_changes_increment_the_version():
    state = RobotState("hall", "arm")
    state.update_frames(frames(0.1), 1, 1)
    first = state.version
    state.update_frames(frames(0.1), 2, 1)
    assert (state.version, state.source_time_ns) == (first, 2)
    for step in range(10):  # each step is below a pixel, all together are not
        state.update_frames(frames(0.1 + step * 1e-5), 3, 1)
    assert state.version > first
    before = state.version
    state.update_controller(ControllerState(link=UP, activity=ControllerState.IDLE))
    state.update_controller(ControllerState(link=UP, activity=ControllerState.IDLE, last_unit_age_s=1.0))
    assert state.version == before + 1


def test_another_robots_frames_are_ignored():
    state = RobotState("hall", "arm")
    message = frames(0.1)
    message.transforms.extend(frames(0.2, robot="arm-2").transforms)
    state.update_frames(message, 1, 1)
    assert list(state.link_placements) == ["column"]


@pytest.mark.parametrize(
    ("age", "says"), [(0.9, ""), (3.2, "STALE 3 s"), (600.0, "STALE 10 min"), (math.inf, "STALE")]
)
def test_the_overlay_shows_values_in_degrees_and_the_age(age, says):
    description, _ = described("pt600")
    state = RobotState("hall", "arm")
    state.update_frames(frames(0.1), 1_000_000_000, 1)
    joints = JointStates()
    joints.joints.add(name="waist", position=math.radians(-30.456))
    state.update_joints(joints)
    overlay = overlay_of(state, appearance_of(description), "free", age=age)
    (row,) = overlay.rows
    assert (row.name, row.value, row.unit) == ("waist", "−30.46", "°")
    assert row.share == pytest.approx((150 - 30.456) / 300)
    assert overlay.stale == says
    assert overlay.marks == ("simulated",)


def test_a_robot_without_data_is_marked():
    description, _ = described("pt600")
    overlay = overlay_of(RobotState("hall", "arm"), appearance_of(description), "free", age=math.inf)
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
def test_the_controllers_state_is_shown_in_words(controller, says):
    description, _ = described("pt600")
    state = RobotState("hall", "arm")
    state.update_controller(controller)
    assert overlay_of(state, appearance_of(description), "free", age=0.1).state == says
