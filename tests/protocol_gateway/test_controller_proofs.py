"""Joints and stops that are proven for one model, driver and software, and for no other."""

from dataclasses import replace
from datetime import date

import pytest

from protocol_gateway.configuration.controller_proofs import ControllerProofs, StopProof
from protocol_gateway.seam import COMMANDS, Capabilities, Hold
from robomesh import reason_codes as codes
from robots.descriptions.description import load, parse
from robots.kinematics.joints import joints_of
from robots.kinematics.kinematic_tree import tree_of
from robots.kinematics.verification import joints_sha256
from robots.kinematics.verification_record import VerificationRecord

ARM = load("puma560")
READS = Capabilities(commands=frozenset(), reports_pose=True, joint_mapping="J3 + J2")
MOVES = Capabilities(commands=COMMANDS, reports_pose=True, experimental=True, stop_means="dashboard stop")
TRIAL = StopProof(driver="rtde", means="dashboard stop", software="5.12.4", date=date(2026, 11, 26))
RECORD = VerificationRecord(
    robot="hall/arm",
    time="2026-11-26T12:00:00+00:00",
    agrees=True,
    model="puma560",
    joints_sha256=joints_sha256(tree_of(ARM), "rtde J3 + J2"),
    software="5.12.4",
    joints=joints_of(ARM).names,
    poses=(),
    unmoved=(),
    suspects=(),
)


def proofs(capabilities=READS, **settings):
    given = {"protocol": "rtde", "simulated": False, "verified": RECORD, "stop": False, "experimental": True}
    return ControllerProofs("hall/arm", ARM, capabilities, **given | settings)


@pytest.mark.parametrize(
    ("changes", "software", "code"),
    [
        ({}, "5.12.4", None),
        ({"verified": None}, "5.12.4", codes.JOINTS_NOT_VERIFIED),
        ({"verified": None, "simulated": True}, "", None),
        ({}, "5.13.0", codes.JOINTS_OTHER_SOFTWARE),
        # Not known yet.
        ({}, "", codes.JOINTS_OTHER_SOFTWARE),
        ({"protocol": "hses"}, "5.12.4", codes.JOINTS_OTHER_MODEL),
        ({"verified": RECORD.model_copy(update={"agrees": False})}, "5.12.4", codes.JOINTS_DISAGREE),
        (
            {"verified": RECORD.model_copy(update={"robot": "hall/twin"})},
            "5.12.4",
            codes.JOINTS_OF_OTHER_ROBOT,
        ),
        ({"verified": RECORD.model_copy(update={"software": ""})}, "", None),
        ({"verified": RECORD.model_copy(update={"software": ""})}, "5.13.0", codes.JOINTS_OTHER_SOFTWARE),
    ],
)
def test_joints_are_proven_for_one_robot_model_and_software(changes, software, code):
    why = proofs(**changes).why_joints_unproven(software)
    assert (why and why.code) == (code and code.name)


def test_a_controller_without_a_pose_to_compare_with_has_nothing_to_prove():
    bare = proofs(Capabilities(commands=COMMANDS), verified=None)
    assert (bare.joints_sha256, bare.why_joints_unproven("")) == ("", None)
    undeclared = replace(READS, no_joints=codes.OTHER(detail="undeclared"))
    assert proofs(undeclared, verified=None).why_joints_unproven("") is None


def test_the_hash_is_of_what_places_the_tool_and_of_nothing_else():
    text = (ARM.source.parent / "robot.toml").read_text() if ARM.source.is_file() else ARM.text
    before = joints_sha256(tree_of(parse(text, ARM.source)), "")
    assert joints_sha256(tree_of(parse("# another title\n" + text, ARM.source)), "") == before
    assert joints_sha256(tree_of(load("pt600")), "") != before
    assert joints_sha256(tree_of(ARM), "pulses") != before


@pytest.mark.parametrize(
    ("capabilities", "changes", "software", "code"),
    [
        (MOVES, {"stop": TRIAL}, "5.12.4", None),
        # A stop is sent before the controller has told its software.
        (MOVES, {"stop": TRIAL}, "", None),
        (MOVES, {"stop": TRIAL}, "5.13.0", codes.STOP_OTHER_SOFTWARE),
        (MOVES, {"stop": TRIAL, "experimental": False}, "5.12.4", codes.EXPERIMENTAL),
        (MOVES, {"stop": TRIAL, "protocol": "snpx"}, "5.12.4", codes.STOP_OTHER_MEANS),
        (replace(MOVES, stop_means="stopj"), {"stop": TRIAL}, "5.12.4", codes.STOP_OTHER_MEANS),
        (MOVES, {"stop": True}, "5.12.4", codes.STOP_PROOF_SHORT),
        (MOVES, {"stop": False}, "5.12.4", codes.STOP_NOT_PROVEN),
        (MOVES, {"stop": True, "simulated": True, "experimental": False}, "", None),
        (MOVES, {"stop": False, "simulated": True}, "", codes.STOP_NOT_PROVEN),
        (READS, {"stop": TRIAL}, "5.12.4", codes.READS_ONLY),
        (replace(READS, can_be_moved=True), {"stop": TRIAL}, "5.12.4", codes.MOTION_OFF),
        (Capabilities(commands=frozenset({Hold})), {"stop": True}, "", codes.NO_STOP_CODE),
        (Capabilities(commands=COMMANDS), {"stop": True, "experimental": False}, "", None),
        (Capabilities(commands=COMMANDS), {"stop": TRIAL, "protocol": "unit"}, "", codes.STOP_OTHER_MEANS),
    ],
)
def test_commands_need_a_stop_that_was_tried_with_this_driver_means_and_software(
    capabilities, changes, software, code
):
    why = proofs(capabilities, **changes).why_read_only(software)
    assert (why and why.code) == (code and code.name)


@pytest.mark.parametrize(
    ("stop", "simulated", "software", "waits"),
    [
        (TRIAL, False, "", True),
        (TRIAL, False, "5.12.4", False),
        (TRIAL, True, "", False),
        (True, False, "", False),
        (replace(TRIAL, software=""), False, "", False),
    ],
)
def test_a_motion_waits_until_the_software_is_known_with_which_the_stop_was_tried(
    stop, simulated, software, waits
):
    why = proofs(MOVES, stop=stop, simulated=simulated).why_software_unknown(software)
    assert (why is not None) == waits
