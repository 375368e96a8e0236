"""A robot that is a URDF, in a whole site: commanded, placed, drawn."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from robots.descriptions.description import load
from robots.kinematics.model import build_model, tool_placement
from tests.renderer.bodies import context_or_skip
from tests.site import robomesh, running_site

pytestmark = pytest.mark.processes

LIMIT = '<limit lower="-1.5" upper="1.5" velocity="3" effort="1"/>'
GRIP = '<limit lower="0" upper="0.05" velocity="0.2" effort="1"/>'
RED = '<material name="red"><color rgba="1 0 0 1"/></material>'


def body(size: str, z: float) -> str:
    return f'<visual><origin xyz="0 0 {z}"/><geometry><box size="{size}"/></geometry>{RED}</visual>'


ARM = f"""<robot name="gripper arm">
<link name="foot">{body("0.3 0.3 0.1", 0.05)}</link>
<link name="column">{body("0.1 0.1 0.4", 0.2)}</link>
<link name="boom">{body("0.1 0.1 0.5", 0.25)}</link>
<link name="left">{body("0.02 0.05 0.1", 0.05)}</link>
<link name="right">{body("0.02 0.05 0.1", 0.05)}</link>
<link name="tool0"/>
<joint name="turn" type="continuous"><origin xyz="0 0 0.1"/><axis xyz="0 0 1"/>
  <parent link="foot"/><child link="column"/>{LIMIT}</joint>
<joint name="bend" type="revolute"><origin xyz="0 0 0.4"/><axis xyz="0 1 0"/>
  <parent link="column"/><child link="boom"/>{LIMIT}</joint>
<joint name="grip" type="prismatic"><origin xyz="0 0 0.5"/><axis xyz="1 0 0"/>
  <parent link="boom"/><child link="left"/>{GRIP}</joint>
<joint name="grip_too" type="prismatic"><origin xyz="0 0 0.5"/><axis xyz="-1 0 0"/>
  <parent link="boom"/><child link="right"/>{GRIP}<mimic joint="grip"/></joint>
<joint name="end" type="fixed"><origin xyz="0 0 0.6"/><parent link="boom"/><child link="tool0"/></joint>
</robot>"""


def red_pixels(path: Path) -> np.ndarray:
    picture = cv2.imread(str(path))
    assert picture is not None
    blue, green, red = (picture[..., channel].astype(int) for channel in range(3))
    return (red - green > 40) & (red - blue > 40)


def test_a_urdf_with_a_gripper_is_homed_moved_and_drawn(tmp_path: Path) -> None:
    context_or_skip().release()
    urdf = tmp_path / "arm.urdf"
    urdf.write_text(ARM)
    robots = f'[[robot]]\nname = "arm"\nmodel = "{urdf}"\ncontroller = "simulated"\n'
    with running_site(tmp_path / "site", robots=robots, services=["renderer"]) as site:
        for words in (["home"], ["move", "60", "80", "40"]):
            done = site.command("send", "arm", *words)
            assert done.returncode == 0, done.stderr
            shot = site.command("snapshot", "arm", "front", str(tmp_path / f"{words[0]}.png"))
            assert shot.returncode == 0, shot.stderr
        state = site.command("monitor", "arm", "--count", "1", "--json")
    joints = json.loads(state.stdout)["joints"]
    assert joints == pytest.approx({"turn": np.radians(60), "bend": np.radians(80), "grip": 0.04}, abs=1e-4)
    before, after = red_pixels(tmp_path / "home.png"), red_pixels(tmp_path / "move.png")
    assert before.sum() > 300
    assert after.sum() > 300
    # Upright at home, it is horizontal afterwards.
    assert np.argmax(before.any(axis=1)) < np.argmax(after.any(axis=1)) - 10


def test_forward_kinematics_of_a_urdf_is_the_models(tmp_path: Path) -> None:
    urdf = tmp_path / "arm.urdf"
    urdf.write_text(ARM)
    done = robomesh("fk", "--robot", str(urdf), text='{"joints": [0.5, 1.0, 0.02]}\n')
    answer = json.loads(done.stdout)
    expected = tool_placement(build_model(load(urdf)), [0.5, 1.0, 0.02])
    np.testing.assert_allclose(answer["tool"], expected, atol=1e-12)
    boom = np.array([np.sin(1.0) * np.cos(0.5), np.sin(1.0) * np.sin(0.5), np.cos(1.0)])
    np.testing.assert_allclose(expected[:3, 3], np.array([0, 0, 0.5]) + 0.6 * boom, atol=1e-12)
    assert set(answer["links"]) == {"foot", "column", "boom", "left", "right", "tool0"}
