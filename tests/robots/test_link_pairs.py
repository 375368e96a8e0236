"""Random positions within limits, and verdicts on pairs of links, of an arm made of boxes."""

from pathlib import Path

import numpy as np
import pytest

from robots.bodies.link_pairs import plan_of
from robots.bodies.verdicts import Kind
from robots.collision import allowed_positions
from robots.descriptions.description import load
from robots.kinematics.joints import joints_of
from robots.schema.robot_toml import RobotDescription

# Studies run in separate processes.
pytestmark = pytest.mark.slow

# A post, and two bars of 0.4 m in the plane above it. Folded back, the second reaches over the post.
ARM = """
name = "scara"
[base]
mesh = "post.wrl"
mesh_scale = 1.0
[[joint]]
name = "shoulder"
a = 400.0
alpha = 0.0
d = 0.0
limits = {shoulder}
max_speed = 90.0
max_acceleration = 360.0
max_jerk = 3600.0
link = {{ mesh = "bar.wrl", mesh_scale = 1.0 }}
[[joint]]
name = "elbow"
a = 400.0
alpha = 0.0
d = 0.0
limits = {elbow}
max_speed = 90.0
max_acceleration = 360.0
max_jerk = 3600.0
home = {home}
link = {{ mesh = "{end}", mesh_scale = 1.0 }}
"""
POST = "Shape { geometry Box { size 0.2 0.2 0.25 } }"
# From the link's joint, at x = -0.4, to 20 mm before its end.
BAR = "Transform { translation -0.2 0 0.01 children Shape { geometry Box { size 0.36 0.04 0.02 } } }"


def an_arm(
    folder: Path,
    elbow: str,
    *,
    shoulder: str = "[-10.0, 10.0]",
    home: float = 0.0,
    end: str = BAR,
    more: str = "",
) -> RobotDescription:
    for name, scene in {"post": POST, "bar": BAR, "end": end}.items():
        (folder / f"{name}.wrl").write_text(f"#VRML V2.0 utf8\n{scene}\n")
    path = folder / "robot.toml"
    path.write_text(ARM.format(shoulder=shoulder, elbow=elbow, home=home, end="end.wrl") + more)
    return load(path)


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


def kinds(description: RobotDescription) -> dict[tuple[str, str], Kind]:
    return {each.links: each.kind for each in plan_of(description).verdicts}


def test_links_one_joint_apart_are_adjacent_and_others_apart_at_home_are_checked(tmp_path: Path) -> None:
    assert kinds(an_arm(tmp_path, "[-20.0, 20.0]")) == {
        ("base", "shoulder"): Kind.ADJACENT,
        ("base", "elbow"): Kind.APART,
        ("shoulder", "elbow"): Kind.ADJACENT,
    }


def test_an_arm_whose_limits_keep_it_folded_always_touches_its_post(tmp_path: Path) -> None:
    folded = an_arm(tmp_path, "[179.0, 181.0]", home=180.0)
    assert kinds(folded)["base", "elbow"] is Kind.ALWAYS
    may_unfold = an_arm(tmp_path, "[-180.0, 180.0]", home=180.0)
    assert kinds(may_unfold)["base", "elbow"] is Kind.TOUCHING


def test_positions_beyond_a_constraint_are_not_sampled(tmp_path: Path) -> None:
    only_folded = "[[constraint]]\njoints = { elbow = 1.0 }\nlimits = [179.0, 181.0]\n"
    description = an_arm(tmp_path, "[-180.0, 180.0]", home=180.0, more=only_folded)
    assert kinds(description)["base", "elbow"] is Kind.ALWAYS


def test_samples_fill_a_constraint_of_any_thickness(tmp_path: Path) -> None:
    # The elbow has all positions that the shoulder compensates: +-170 degrees, as without a constraint.
    opposite = "[[constraint]]\njoints = { shoulder = 1.0, elbow = 0.05 }\nlimits = [-1e-9, 1e-9]\n"
    description = an_arm(tmp_path, "[-170.0, 170.0]", more=opposite)
    positions = np.degrees(allowed_positions(joints_of(description), 2000))
    assert len(positions) == 2000
    assert np.allclose(positions[:, 0], -0.05 * positions[:, 1], rtol=0, atol=1e-7)
    counts, _ = np.histogram(positions[:, 1], bins=4, range=(-170, 170))
    # 500 expected in each, with a standard deviation of 19: allow five of them.
    assert (abs(counts - 500) < 97).all()


def test_samples_spread_from_a_home_in_a_corner_of_the_limits(tmp_path: Path) -> None:
    # Home is the right angle of a triangle with the other corners (60, 0) and (0, 60) degrees.
    triangle = "[[constraint]]\njoints = { shoulder = 1.0, elbow = 1.0 }\nlimits = [-60.0, 60.0]\n"
    description = an_arm(tmp_path, "[0.0, 90.0]", shoulder="[0.0, 90.0]", more=triangle)
    positions = np.degrees(allowed_positions(joints_of(description), 2000))
    assert positions.sum(axis=1).max() <= 60.0 + 1e-9
    # The centre of the triangle is 20, 20. The density of a sum is the length of its line: 40 on average.
    assert positions.mean(axis=0) == pytest.approx([20.0, 20.0], abs=1.5)
    assert positions.sum(axis=1).mean() == pytest.approx(40.0, abs=1.5)


def test_contact_in_the_only_allowed_position_does_not_exclude_a_pair(tmp_path: Path) -> None:
    # Home is at both lower limits, and the sum may only decrease from there.
    downwards = "[[constraint]]\njoints = { shoulder = 1.0, elbow = 1.0 }\nlimits = [150.0, 180.0]\n"
    description = an_arm(tmp_path, "[180.0, 190.0]", shoulder="[0.0, 10.0]", home=180.0, more=downwards)
    assert len(allowed_positions(joints_of(description), 2000)) == 1
    assert kinds(description)["base", "elbow"] is Kind.TOUCHING


def test_same_seed_gives_the_same_samples(tmp_path: Path) -> None:
    joints = joints_of(an_arm(tmp_path, "[-180.0, 180.0]"))
    one, other = (allowed_positions(joints, 1000, 7) for _ in range(2))
    assert np.array_equal(one, other)
    assert not np.array_equal(one, allowed_positions(joints, 1000, 8))


@pytest.mark.parametrize(
    ("points", "faces"),
    [
        ("0 0 0, 0 0 0, 0 0 0", "0 1 2 -1"),
        ("0 0 0, -0.1 0 0, -0.05 0 0", "0 1 2 -1"),
        ("0 0 0, -0.1 0 0, -0.1 0.1 0, 0 0.1 0", "0 1 2 3 -1"),
    ],
    ids=["a point", "a line", "a square"],
)
def test_a_link_without_volume_is_a_thin_plate(tmp_path: Path, points: str, faces: str) -> None:
    coord = f"coord Coordinate {{ point [ {points} ] }}"
    end = f"Shape {{ geometry IndexedFaceSet {{ {coord} coordIndex [ {faces} ] }} }}"
    description = an_arm(tmp_path, "[179.0, 181.0]", home=180.0, end=end)  # its frame is inside the post then
    assert kinds(description)["base", "elbow"] is Kind.ALWAYS


def test_links_on_the_same_joint_of_a_urdf_are_adjacent(tmp_path: Path) -> None:
    box = '<visual><geometry><box size="0.1 0.1 0.1"/></geometry></visual>'
    path = tmp_path / "two.urdf"
    path.write_text(
        f"""<robot name="two"><link name="foot">{box}</link><link name="arm">{box}</link>
        <link name="lamp">{box}</link>
        <joint name="turn" type="revolute"><parent link="foot"/><child link="arm"/>
        <axis xyz="0 0 1"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
        <joint name="screws" type="fixed"><parent link="arm"/><child link="lamp"/></joint></robot>"""
    )
    assert set(kinds(load(path)).values()) == {Kind.ADJACENT}
