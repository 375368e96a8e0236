"""The kinematic model compared with a second implementation of the D-H product, from the file's numbers."""

import tomllib
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as Xml

import numpy as np
import pytest

from robots.descriptions.description import library_names, load, parse
from robots.kinematics.model import (
    build_model,
    frame_placements,
    link_placements,
    manipulability,
    tool_jacobian,
    tool_placement,
)
from robots.schema.errors import JointCountError
from tests.robots.arms import allowed_positions, telescope

SLIDER = """
name = "slider"
[[joint]]
name = "slide"
type = "prismatic"
a = 10.0
alpha = 30.0
d = 50.0
theta = 20.0
limits = [-100.0, 200.0]
max_speed = 100.0
max_acceleration = 400.0
max_jerk = 4000.0
"""
TWO = (
    SLIDER
    + """
[[joint]]
name = "turn"
a = 70.0
alpha = -40.0
d = 5.0
theta = 15.0
limits = [-90.0, 90.0]
max_speed = 100.0
max_acceleration = 400.0
max_jerk = 4000.0
[tool]
xyz = [1.0, 2.0, 3.0]
rpy = [10.0, 20.0, 30.0]
[[frame]]
name = "camera"
link = "slide"
xyz = [7.0, 0.0, 0.0]
rpy = [0.0, 90.0, 0.0]
"""
)


def rotation(axis: str, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    matrix = np.eye(4)
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    matrix[i, i] = matrix[j, j] = c
    matrix[i, j], matrix[j, i] = -s, s
    return matrix


def translation(x: float, y: float, z: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, 3] = (x, y, z)
    return matrix


def dh_product(values: dict[str, Any], positions: np.ndarray) -> tuple[list[np.ndarray], np.ndarray]:
    """Return every link's placement and the tool's, computed only from the file's values."""
    placement = np.eye(4)
    links = [placement]
    for row, position in zip(values["joint"], positions, strict=True):
        theta, d = np.radians(row.get("theta", 0.0)), row["d"] / 1000
        if row.get("type") == "prismatic":
            d += position
        else:
            theta += position
        placement = placement @ rotation("z", theta) @ translation(0, 0, d)
        placement = placement @ translation(row["a"] / 1000, 0, 0) @ rotation("x", np.radians(row["alpha"]))
        links.append(placement)
    tool = values.get("tool", {"xyz": [0, 0, 0], "rpy": [0, 0, 0]})
    roll, pitch, yaw = np.radians(tool["rpy"])
    x, y, z = np.divide(tool["xyz"], 1000)
    tool_to_link = translation(x, y, z) @ rotation("z", yaw) @ rotation("y", pitch) @ rotation("x", roll)
    return links, placement @ tool_to_link


def texts() -> list[tuple[str, str]]:
    return [(name, load(name).text) for name in library_names()] + [("slider", SLIDER), ("two", TWO)]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "text"), texts())
def test_placements_equal_the_dh_product_at_1000_random_positions(name: str, text: str) -> None:
    source = load(name).source if name in library_names() else Path("robot.toml")
    model = build_model(parse(text, source))
    generator, values = np.random.default_rng(7), tomllib.loads(text)
    random = generator.uniform(model.joints.lower, model.joints.upper, (1000, len(model.joints)))
    links, tools = zip(*(dh_product(values, positions) for positions in random), strict=True)
    found = [link_placements(model, positions) for positions in random]
    np.testing.assert_allclose(found, links, atol=1e-12, rtol=0)
    found = [tool_placement(model, positions) for positions in random]
    np.testing.assert_allclose(found, tools, atol=1e-12, rtol=0)


@pytest.mark.parametrize(
    ("robot", "expected"), [("pt500", (-0.0234, 0.1328, 0.7190)), ("pt600", (-0.0281, 0.1594, 0.8528))]
)
def test_papers_sample_frame_has_the_papers_tool_placement(
    robot: str, expected: tuple[float, float, float]
) -> None:
    model = build_model(load(robot))
    positions = np.radians([100.00, 30.45, 92.66, -67.10, -25.85])
    np.testing.assert_allclose(tool_placement(model, positions)[:3, 3], expected, atol=5e-5)


def test_puma560_has_the_published_rows() -> None:
    published = Path(__file__).with_name("files") / "puma560" / "kinematics.xml"
    description = load("puma560")
    rows = Xml.parse(published).getroot().findall(".//revolute")
    assert len(rows) == len(description.joints)
    for row, joint in zip(rows, description.joints, strict=True):
        numbers = {key: float(row.findtext(key) or "nan") for key in ("min", "max")}
        dh = {key: float(row.findtext(f"dh/{key}") or "nan") for key in ("d", "theta", "a", "alpha")}
        assert joint.limits == (numbers["min"], numbers["max"])
        assert (joint.theta, joint.alpha) == (dh["theta"], dh["alpha"])
        assert (joint.d / 1000, joint.a / 1000) == pytest.approx((dh["d"], dh["a"]))


@pytest.mark.parametrize(("name", "text"), texts())
def test_jacobian_is_the_derivative_of_the_tools_placement(name: str, text: str) -> None:
    source = load(name).source if name in library_names() else Path("robot.toml")
    model = build_model(parse(text, source))
    positions = model.joints.home + 0.1
    jacobian = tool_jacobian(model, positions)
    assert jacobian.shape == (6, len(model.joints))
    step = 1e-6
    placement = tool_placement(model, positions)
    for index in range(len(positions)):
        moved = positions.copy()
        moved[index] += step
        moved_placement = tool_placement(model, moved)
        np.testing.assert_allclose(
            jacobian[:3, index], (moved_placement[:3, 3] - placement[:3, 3]) / step, atol=1e-5
        )
        turn = (moved_placement[:3, :3] @ placement[:3, :3].T - np.eye(3)) / step
        angular = [turn[2, 1], turn[0, 2], turn[1, 0]]
        np.testing.assert_allclose(jacobian[3:, index], angular, atol=1e-5)


def test_jacobian_includes_mimic_joints_and_excludes_joints_beyond_the_tool(tmp_path: Path) -> None:
    model = build_model(telescope(tmp_path))
    step = 1e-6
    for positions in allowed_positions(model, 10):
        jacobian = tool_jacobian(model, positions)
        for index in range(len(positions)):
            sides = []
            for side in (-step, step):
                moved = positions.copy()
                moved[index] += side
                sides.append(tool_placement(model, moved))
            linear = (sides[1] - sides[0])[:3, 3] / (2 * step)
            turn = (sides[1][:3, :3] @ sides[0][:3, :3].T - np.eye(3)) / (2 * step)
            angular = [turn[2, 1], turn[0, 2], turn[1, 0]]
            np.testing.assert_allclose(jacobian[:, index], [*linear, *angular], atol=3e-6)
        # The second stage moves half as far as the first, along the same line.
        lift = model.joints.names.index("lift")
        assert np.linalg.norm(jacobian[:3, lift]) == pytest.approx(1.5)
        assert not jacobian[:, model.joints.names.index("grip")].any()


@pytest.mark.parametrize("name", ["pt500", "puma560"])
def test_manipulability_is_the_root_of_the_jacobians_gram_determinant(name: str) -> None:
    model = build_model(load(name))
    for positions in allowed_positions(model, 20):
        jacobian = tool_jacobian(model, positions)
        gram = jacobian @ jacobian.T if len(positions) >= 6 else jacobian.T @ jacobian
        expected = np.sqrt(max(np.linalg.det(gram), 0.0))
        assert manipulability(model, positions) == pytest.approx(expected, abs=1e-9)


def test_named_frames_move_with_their_link() -> None:
    model = build_model(parse(TWO, Path("robot.toml")))
    assert model.frame_names == ("tool", "camera")
    positions = np.array([0.03, 0.4])
    camera_to_link = translation(0.007, 0, 0) @ rotation("y", np.pi / 2)
    expected = link_placements(model, positions)[1] @ camera_to_link
    np.testing.assert_allclose(frame_placements(model, positions)["camera"], expected, atol=1e-12)


def test_manipulability_vanishes_where_the_arm_is_stretched() -> None:
    model = build_model(load("puma560"))
    assert manipulability(model, model.joints.home) > 1e-3
    stretched_wrist = model.joints.home.copy()
    stretched_wrist[4] = 0.0
    assert manipulability(model, stretched_wrist) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("ask", [link_placements, frame_placements, tool_placement, tool_jacobian])
def test_wrong_count_of_positions_is_an_error(ask: object) -> None:
    with pytest.raises(JointCountError):
        ask(build_model(load("pt600")), [0.0] * 4)  # type: ignore[operator]
