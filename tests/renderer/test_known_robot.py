"""Compositions of a robot's state: trail, contacts, staleness, neighbours."""

import numpy as np
import pytest
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms

from renderer.pictures.composition import RobotSnapshot, compose
from renderer.pictures.requested_views import ViewSpec, standard_view
from renderer.pictures.robot_state import Ages, RobotState, current_contacts, is_stale
from renderer.scene.appearance import appearance_of
from renderer.scene.scene import Finish
from robomesh.schemas.robomesh_pb2 import KinematicState, ViewRequest
from tests.renderer.test_appearance import described

SECOND = 10**9
FRESH = Ages(frames=0.1, joints=0.1, controller=0.1, kinematics=0.1)


def robot(name="arm", *, cell="", replay=False):
    message, _ = described("pt600")
    message.cell = cell
    if replay:
        message.replay.id = "x"
    return RobotState("hall", name, appearance=appearance_of(message))


def frames(x, site_robot="hall/arm"):
    message = FrameTransforms()
    transform = message.transforms.add(parent_frame_id="hall", child_frame_id=f"{site_robot}/tool")
    transform.translation.x, transform.rotation.w = x, 1.0
    return message


def touches(first, second, distance):
    message = KinematicState()
    message.own_clearance.first, message.own_clearance.second = first, second
    message.own_clearance.distance = distance
    return message


def test_the_trail_has_the_tools_positions_of_the_last_seconds():
    state = robot()
    for tick in range(60 * 20):
        state.update_frames(frames(tick / 60), tick * SECOND // 60, 1)
    at = [point[0] for _, point in state.trail]
    assert at == sorted(at)
    assert at[-1] == pytest.approx(20.0, abs=0.05)
    assert at[0] == pytest.approx(14.0, abs=0.05)
    assert 100 <= len(at) <= 240


def test_a_replay_that_jumps_back_begins_a_new_trail():
    state = robot(replay=True)
    for second in (10, 11, 12, 3, 4):
        state.update_frames(frames(second), second * SECOND, 1)
    assert [point[0] for _, point in state.trail] == [3.0, 4.0]


def test_links_in_contact_are_known_while_the_clearance_is_current():
    state = robot()
    before = state.version
    state.update_kinematics(touches("hall/arm/upper_arm", "hall/arm/base", 0.0), {})
    assert state.version > before
    assert current_contacts(state, FRESH) == {"upper_arm", "base"}
    old = Ages(frames=0.1, joints=0.1, controller=0.1, kinematics=5.0)
    assert current_contacts(state, old) == frozenset()
    state.update_kinematics(touches("hall/arm/upper_arm", "hall/arm/base", 0.001), {})
    assert current_contacts(state, FRESH) == frozenset()


def test_a_description_can_set_the_stale_time():
    state = robot()
    assert state.appearance is not None
    ages = Ages(frames=0.4, joints=0.4, controller=0.4)
    assert not is_stale(state, ages)
    state.appearance.description.stale_after_s = 0.3
    assert is_stale(state, ages)


def test_a_replay_is_in_no_cell():
    assert (robot(cell="a").cell, robot(cell="a", replay=True).cell, robot().cell) == ("a", "", "")


def test_a_picture_shows_the_age_of_each_robot_of_the_cell():
    one, other = robot("one", cell="a"), robot("other", cell="a")
    message, _ = described("pt600")
    for link in message.links:
        link.mesh = link.name  # `described` gives no shapes
    one.appearance = other.appearance = appearance_of(message)
    old = Ages(frames=9.0, joints=9.0, controller=9.0)
    spec = standard_view("front", size=(640, 360), fps=30.0)
    picture = compose(spec, one.appearance, RobotSnapshot(one, FRESH), [RobotSnapshot(other, old)])
    assert {part.finish for part in picture.scene.parts} == {Finish.PLAIN}
    assert {part.finish for part in picture.scene.others} == {Finish.STALE}
    assert len(picture.scene.others) == len(picture.scene.parts) > 0


def test_requested_additions_are_shown():
    state = robot()
    state.trail.extend((at, np.full(3, float(at))) for at in range(5))
    show = ViewRequest.Show(trail=True, frames=True, ghost=[0.0] * 5, no_text=True)
    show.path.add(x=0.1)
    show.path.add(x=0.2)
    assert state.appearance is not None
    spec = ViewSpec(name="free-x", of="front", size=(640, 360), fps=30.0)
    plain = compose(spec, state.appearance, RobotSnapshot(state, FRESH), [])
    shown = compose(
        ViewSpec(name="free-x", of="front", size=(640, 360), fps=30.0, show=show),
        state.appearance,
        RobotSnapshot(state, FRESH),
        [],
    )
    assert (len(plain.scene.lines), plain.overlay.title) == (0, "arm")
    assert len(shown.scene.lines) > 2
    assert shown.overlay.title == ""


def test_a_replay_is_marked_in_every_picture():
    state = robot("replay-x", replay=True)
    assert state.appearance is not None
    for view in ("front", "close"):
        spec = standard_view(view, size=(640, 360), fps=30.0)
        assert "replay" in compose(spec, state.appearance, RobotSnapshot(state, FRESH), []).overlay.marks


def test_a_picture_of_little_height_has_no_joint_values():
    state = robot()
    state.positions = {"waist": 0.1}
    assert state.appearance is not None
    rows = [
        len(
            compose(
                standard_view("front", size=size, fps=30.0), state.appearance, RobotSnapshot(state, FRESH), []
            ).overlay.rows
        )
        for size in ((640, 360), (320, 180))
    ]
    assert rows == [1, 0]
