"""Joints of a Yaskawa that are unproven, and what its pose proves of them."""

from dataclasses import replace

import numpy as np

from controllers.yaskawa import data, signals
from controllers.yaskawa.axes import Axes, YaskawaSettings, with_factors
from controllers.yaskawa.simulated.controller import HsesController
from robots.kinematics.joints import joints_of
from robots.kinematics.model import build_model, link_placements
from robots.kinematics.verification import POSES, Sample, verify
from robots.schema.poses import axis_rotation
from tests.controllers.yaskawa.test_hses_driver import YASKAWA, controller
from tests.protocol_gateway.gateway_site import STATE, gateway, until
from tests.protocol_gateway.test_controller_proofs import ARM, RECORD
from tests.protocol_gateway.wire import wire


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


async def test_unproven_joints_are_shown_and_count_for_no_check(mesh, tmp_path):
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


async def test_unproven_joints_that_cannot_be_are_published_and_marked(mesh, tmp_path):
    """As with a wrong factor in the site file: `robot verify` shows which joint is wrong."""

    def elsewhere(data):
        # Pulses of eight axes, after the type, form, tool and two frames.
        positions = len(data) == 84 and data[32:36] == bytes(4)
        return [data[:55] + b"\x40" + data[56:] if positions else data]

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
