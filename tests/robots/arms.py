"""Arms for the tests of inverse kinematics, and random positions within their limits."""

from functools import cache
from pathlib import Path

import numpy as np

from robots.descriptions.description import load, parse
from robots.kinematics.inverse import InverseSolver, build_solver
from robots.kinematics.joints import violations
from robots.kinematics.model import RobotModel, build_model, tool_placement
from robots.schema.robot_toml import RobotDescription

LIMIT = '<limit lower="-2.5" upper="2.5" velocity="3" effort="1"/>'
LIFT = '<limit lower="0" upper="0.3" velocity="0.2" effort="1"/>'
# A lift of two stages, the second a mimic joint; and a finger that does not move the tool.
TELESCOPE = f"""<robot name="telescope">
<link name="foot"/><link name="column"/><link name="boom"/><link name="stage"/><link name="tip"/>
<link name="hand"/><link name="tool0"/><link name="finger"/>
<joint name="turn" type="revolute"><axis xyz="0 0 1"/>
  <parent link="foot"/><child link="column"/>{LIMIT}</joint>
<joint name="bend" type="revolute"><origin xyz="0 0 0.4" rpy="0 0.1 0"/><axis xyz="0 1 0"/>
  <parent link="column"/><child link="boom"/>{LIMIT}</joint>
<joint name="lift" type="prismatic"><origin xyz="0 0 0.3"/><axis xyz="0 0 1"/>
  <parent link="boom"/><child link="stage"/>{LIFT}</joint>
<joint name="lift_too" type="prismatic"><origin xyz="0.02 0 0.1"/><axis xyz="0 0 1"/>
  <parent link="stage"/><child link="tip"/>{LIFT}<mimic joint="lift" multiplier="0.5" offset="0.01"/></joint>
<joint name="wrist" type="revolute"><origin xyz="0 0.03 0.1"/><axis xyz="0 1 0"/>
  <parent link="tip"/><child link="hand"/>{LIMIT}</joint>
<joint name="roll" type="revolute"><origin xyz="0 0 0.1"/><axis xyz="0 0 1"/>
  <parent link="hand"/><child link="tool0"/>{LIMIT}</joint>
<joint name="grip" type="prismatic"><axis xyz="1 0 0"/>
  <parent link="hand"/><child link="finger"/>{LIFT}</joint>
</robot>"""


def dh_arm(name: str, rows: list[tuple[float, float, float, float]], limits: tuple[float, float]) -> str:
    """Return a robot.toml of rotary joints: theta offset [deg], d [mm], a [mm], alpha [deg] each."""
    return f'name = "{name}"\n' + "".join(
        f"""[[joint]]
name = "j{number}"
theta = {theta}
d = {d}
a = {a}
alpha = {alpha}
limits = [{limits[0]}, {limits[1]}]
max_speed = 100.0
max_acceleration = 400.0
max_jerk = 4000.0
"""
        for number, (theta, d, a, alpha) in enumerate(rows, start=1)
    )


# Like a Puma, but with joint offsets and nearly two turns per joint.
OFFSETS = dh_arm(
    "offsets",
    [
        (30.0, 600.0, 0.0, -90.0),
        (-45.0, 130.0, 430.0, 0.0),
        (70.0, 0.0, -20.0, 90.0),
        (10.0, 430.0, 0.0, -90.0),
        (-80.0, 0.0, 0.0, 90.0),
        (15.0, 60.0, 0.0, 0.0),
    ],
    (-350.0, 350.0),
)
# No two axes intersect or are parallel: no closed form.
CROOKED = dh_arm(
    "crooked",
    [
        (0.0, 300.0, 40.0, -80.0),
        (0.0, 50.0, 350.0, 20.0),
        (0.0, -30.0, 60.0, 75.0),
        (0.0, 320.0, 35.0, -70.0),
        (0.0, 40.0, 30.0, 65.0),
        (0.0, 90.0, 20.0, 10.0),
    ],
    (-170.0, 170.0),
)


def telescope(folder: Path) -> RobotDescription:
    """Write a lift of two stages between two rotary joints to a folder."""
    (folder / "arm.urdf").write_text(TELESCOPE)
    (folder / "robot.toml").write_text('name = "telescope"\nurdf = "arm.urdf"\n[tool]\nlink = "tool0"\n')
    return load(folder)


@cache
def arm(name: str) -> tuple[RobotDescription, RobotModel, InverseSolver]:
    """Return an arm of the library, an example robot, or one of this file."""
    made = {"offsets": OFFSETS, "crooked": CROOKED}
    description = parse(made[name], Path("robot.toml")) if name in made else load(name)
    return description, build_model(description), build_solver(description)


def allowed_positions(model: RobotModel, count: int, seed: int = 4) -> list[np.ndarray]:
    """Return random joint positions within all limits."""
    random, found = np.random.default_rng(seed), []
    while len(found) < count:
        positions = random.uniform(model.joints.lower, model.joints.upper)
        if not violations(model.joints, positions):
            found.append(positions)
    return found


def reached(model: RobotModel, positions: np.ndarray, target: np.ndarray, *, roll: bool) -> float:
    """Return the largest deviation of the tool's pose from a target, with or without the roll."""
    apart = np.abs(tool_placement(model, positions) - target)[:3]
    return float(apart.max() if roll else apart[:, 2:].max())
