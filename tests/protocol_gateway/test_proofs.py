"""Joints and stops that are proven for one model, driver and software, and for no other."""

from dataclasses import replace
from datetime import date

import numpy as np
import pytest

from controllers.yaskawa import data, signals
from controllers.yaskawa.axes import Axes, YaskawaSettings
from controllers.yaskawa.simulated.controller import HsesController
from controllers.yaskawa.simulated.service import with_factors
from protocol_gateway.proofs import Proofs, StopProof
from protocol_gateway.seam import COMMANDS, Capabilities, Hold
from robomesh import reason_codes as codes
from robots.description import load, parse
from robots.joints import joints_of
from robots.kinematic_tree import tree_of
from robots.model import build_model, link_placements
from robots.poses import axis_rotation
from robots.verification import POSES, Sample, joints_sha256, verify
from robots.verification_record import VerificationRecord
from tests.conftest import run
from tests.controllers.yaskawa.test_hses_driver import YASKAWA, controller
from tests.protocol_gateway.gateway_site import STATE, gateway, until
from tests.protocol_gateway.wire import wire

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
    return Proofs("hall/arm", ARM, capabilities, **given | settings)


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
    why = proofs(**changes).joints_unproven(software)
    assert (why and why.code) == (code and code.name)


def test_a_controller_without_a_pose_to_compare_with_has_nothing_to_prove():
    bare = proofs(Capabilities(commands=COMMANDS), verified=None)
    assert (bare.joints_sha256, bare.joints_unproven("")) == ("", None)
    undeclared = replace(READS, no_joints=codes.OTHER(detail="undeclared"))
    assert proofs(undeclared, verified=None).joints_unproven("") is None


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
    why = proofs(capabilities, **changes).read_only(software)
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
    why = proofs(MOVES, stop=stop, simulated=simulated).software_unknown(software)
    assert (why is not None) == waits


def hses_samples(axes, joints):
    """Return what the driver reports of a simulated controller in ten poses, by the bytes of its answers."""
    simulated = HsesController(ARM, axes, tour=None)
    for positions in joints:
        simulated.positions = lambda _, positions=positions: positions
        pulses, pose = simulated.position(0.0), signals.of_pose(simulated.pose(0.0))
        values = [value for signal, value in pose.values if signal.name.startswith("tool.pose")]
        tool = np.eye(4)
        tool[:3, :3] = axis_rotation(np.array(values[3:]), float(np.linalg.norm(values[3:])))
        tool[:3, 3] = values[:3]
        yield Sample(
            positions=np.array(axes.positions(pulses.axes)), tool_to_base=tool, tool_to_flange=np.eye(4)
        )


def test_the_pose_of_a_yaskawa_shows_whether_its_declared_pulses_are_right():
    """Both come from one controller; a factor of the wrong sign is found, and named."""
    joints, model = joints_of(ARM), build_model(ARM)
    tool = model.link_names[-1]

    def placement(positions):
        return link_placements(model, positions)[model.link_names.index(tool)]

    poses = np.random.default_rng(5).uniform(-0.7, 0.7, (POSES, 6)) + joints.home
    right = Axes(with_factors(None, 6), joints.types)
    found = verify(placement, joints, list(hses_samples(right, poses)))
    assert found.agrees, found
    wrong = Axes(YaskawaSettings(pulses_per_degree=(1000, 1000, -1000, 1000, 1000, 1000)), joints.types)
    samples = [
        replace(each, positions=np.array(wrong.positions(right.pulses(each.positions))))
        for each in hses_samples(right, poses)
    ]
    found = verify(placement, joints, samples)
    assert not found.agrees
    assert f"{joints.names[2]} turns the other way" in found.suspects
    assert data.DataType.ROBOT == 17


def test_unproven_joints_are_shown_and_count_for_no_check(mesh, tmp_path):
    async def main():
        async with controller(demo=True) as port:
            async with gateway(mesh, tmp_path, port, **YASKAWA) as site:
                await until(lambda: site.controller.software)
                assert site.controller.joints_unproven
                assert "robomesh robot verify hall/arm --out FILE" in site.controller.link_text
                await site.units(10)
                assert site.controller.software.startswith("SIM1.00")
                assert len(site.events("controller.software")) == 1
                sha256, software = site.controller.joints_sha256, site.controller.software
            record = RECORD.model_copy(update={"joints_sha256": sha256, "software": software})
            async with gateway(mesh, tmp_path, port, verified=record, **YASKAWA) as site:
                await until(lambda: site.controller.software and not site.controller.joints_unproven)
                assert site.controller.link == STATE.UP
                assert "unproven" not in site.controller.link_text
            older = record.model_copy(update={"software": "SIM0.99"})
            async with gateway(mesh, tmp_path, port, verified=older, **YASKAWA) as site:
                await until(lambda: "SIM0.99" in site.controller.link_text and site.controller.software)
                assert site.controller.joints_unproven

    run(main())


def test_unproven_joints_that_cannot_be_are_published_and_marked(mesh, tmp_path):
    """As with a wrong factor in the site file: `robot verify` shows which joint is wrong."""

    def elsewhere(data):
        # Pulses of eight axes, after the type, form, tool and two frames.
        positions = len(data) == 84 and data[32:36] == bytes(4)
        return [data[:55] + b"\x40" + data[56:] if positions else data]

    async def main():
        async with (
            controller() as port,
            wire(port, datagrams=True) as relay,
            gateway(mesh, tmp_path, relay.port, **YASKAWA) as site,
        ):
            await until(lambda: site.controller.joints_unproven and site.joints)
            assert "cannot be right" not in site.controller.link_text
            relay.answers = elsewhere
            await until(lambda: abs(site.joints[0]) > 1000.0)
            await until(lambda: "its joints cannot be right (joint waist at" in site.controller.link_text)
            assert site.controller.link == STATE.UP
            assert site.controller.joints_unproven
            assert [each.code for each in site.controller.link_reasons][1:3] == [
                "joints.not_verified",
                "joints.invalid",
            ]
            relay.answers = lambda data: [data]
            await until(lambda: "cannot be right" not in site.controller.link_text)

    run(main())
