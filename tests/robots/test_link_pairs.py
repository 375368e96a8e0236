"""Which links touch: an arm of boxes whose answer is known."""

from pathlib import Path

import numpy as np
import pytest

from robots.collision import FEWEST, Contact, allowed_positions, sample_pairs
from robots.description import load
from robots.errors import DescriptionError
from robots.joints import joints_of
from robots.schema import RobotDescription

# A post, and two bars of 0.4 m in the plane above it: the second, folded back, reaches over the post.
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
# From the link's own joint, at x = -0.4, to 20 mm short of its end.
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


def contacts(description: RobotDescription, samples: int = FEWEST) -> dict[tuple[str, str], Contact]:
    return {pair.links: pair.contact for pair in sample_pairs(description, samples=samples).pairs}


def test_links_of_one_joint_are_adjacent_and_a_stretched_arm_never_touches_its_post(tmp_path: Path) -> None:
    assert contacts(an_arm(tmp_path, "[-20.0, 20.0]")) == {
        ("base", "shoulder"): Contact.ADJACENT,
        ("base", "elbow"): Contact.NEVER,
        ("shoulder", "elbow"): Contact.ADJACENT,
    }


def test_an_arm_that_can_fold_back_sometimes_touches_its_post(tmp_path: Path) -> None:
    description = an_arm(tmp_path, "[-180.0, 180.0]")
    (pair,) = [
        pair for pair in sample_pairs(description, samples=1000).pairs if pair.links == ("base", "elbow")
    ]
    assert pair.contact is Contact.SOMETIMES
    # The bar's end, 0.38 m from the elbow, comes within 0.1 m of the middle over about +-15 degrees of 360.
    assert 0.05 < pair.share < 0.15


def test_an_arm_that_stays_folded_always_touches_its_post(tmp_path: Path) -> None:
    description = an_arm(tmp_path, "[179.0, 181.0]", home=180.0)
    assert contacts(description)["base", "elbow"] is Contact.ALWAYS


def test_positions_beyond_a_constraint_are_not_tried(tmp_path: Path) -> None:
    only_stretched = "[[constraint]]\njoints = { shoulder = 1.0, elbow = 1.0 }\nlimits = [-30.0, 30.0]\n"
    description = an_arm(tmp_path, "[-180.0, 180.0]", more=only_stretched)
    assert contacts(description)["base", "elbow"] is Contact.NEVER


def test_however_thin_a_constraint_is_all_that_it_leaves_is_tried(tmp_path: Path) -> None:
    # The elbow goes wherever the shoulder takes it back by as much: +-170 degrees, as without a constraint.
    opposite = "[[constraint]]\njoints = { shoulder = 1.0, elbow = 0.05 }\nlimits = [-1e-9, 1e-9]\n"
    description = an_arm(tmp_path, "[-170.0, 170.0]", more=opposite)
    positions = np.degrees(allowed_positions(joints_of(description), 2000))
    assert len(positions) == 2000
    assert np.allclose(positions[:, 0], -0.05 * positions[:, 1], rtol=0, atol=1e-7)
    counts, _ = np.histogram(positions[:, 1], bins=4, range=(-170, 170))
    # 500 in each, and a deviation of 19: five of them.
    assert (abs(counts - 500) < 97).all()
    sampling = sample_pairs(description, samples=2000)
    assert sampling.tried == 2000
    assert {pair.links: pair.contact for pair in sampling.pairs}["base", "elbow"] is Contact.SOMETIMES


def test_a_home_in_a_corner_of_limits_and_constraints_leads_everywhere(tmp_path: Path) -> None:
    # Home is the right angle of a triangle whose other corners are (60, 0) and (0, 60) degrees.
    triangle = "[[constraint]]\njoints = { shoulder = 1.0, elbow = 1.0 }\nlimits = [-60.0, 60.0]\n"
    description = an_arm(tmp_path, "[0.0, 90.0]", shoulder="[0.0, 90.0]", more=triangle)
    positions = np.degrees(allowed_positions(joints_of(description), 2000))
    assert positions.sum(axis=1).max() <= 60.0 + 1e-9
    # The centre of a triangle, 20 and 20; a sum of s is as likely as the line there is long: 40 on average.
    assert positions.mean(axis=0) == pytest.approx([20.0, 20.0], abs=1.5)
    assert positions.sum(axis=1).mean() == pytest.approx(40.0, abs=1.5)


def test_constraints_that_leave_only_home_are_told_instead_of_never(tmp_path: Path) -> None:
    # Home is at both lower limits, and the sum may only go down from there.
    downwards = "[[constraint]]\njoints = { shoulder = 1.0, elbow = 1.0 }\nlimits = [-30.0, 0.0]\n"
    description = an_arm(tmp_path, "[0.0, 90.0]", shoulder="[0.0, 10.0]", more=downwards)
    with pytest.raises(DescriptionError, match="leave 1 positions to try: too few"):
        sample_pairs(description)


def test_too_few_positions_say_nothing(tmp_path: Path) -> None:
    with pytest.raises(DescriptionError, match="too few"):
        sample_pairs(an_arm(tmp_path, "[-20.0, 20.0]"), samples=FEWEST - 1)


def test_the_same_seed_finds_the_same(tmp_path: Path) -> None:
    description = an_arm(tmp_path, "[-180.0, 180.0]")
    one, other = (sample_pairs(description, samples=FEWEST, seed=7) for _ in range(2))
    assert one == other


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
    assert contacts(description)["base", "elbow"] is Contact.ALWAYS


def test_links_that_a_joint_of_a_urdf_carries_together_are_adjacent(tmp_path: Path) -> None:
    box = '<visual><geometry><box size="0.1 0.1 0.1"/></geometry></visual>'
    path = tmp_path / "two.urdf"
    path.write_text(
        f"""<robot name="two"><link name="foot">{box}</link><link name="arm">{box}</link>
        <link name="lamp">{box}</link>
        <joint name="turn" type="revolute"><parent link="foot"/><child link="arm"/>
        <axis xyz="0 0 1"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
        <joint name="screws" type="fixed"><parent link="arm"/><child link="lamp"/></joint></robot>"""
    )
    assert set(contacts(load(path)).values()) == {Contact.ADJACENT}
