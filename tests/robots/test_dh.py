"""URDF robots as D-H rows: the tool and the shapes keep their places."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from robots.descriptions.description import from_values, library_names, load
from robots.descriptions.save_description import write_description
from robots.descriptions.summary import dh_summary
from robots.descriptions.urdf.write import to_urdf
from robots.descriptions.urdf_to_dh import DhForm, dh_form
from robots.kinematics.kinematic_tree import tree_of
from robots.kinematics.model import build_model, frame_placements, link_placements, tool_placement
from robots.kinematics.views import views_of
from robots.schema.errors import DescriptionError
from robots.schema.poses import rpy_rotation
from robots.schema.robot_toml import DhDescription, Pose, UrdfDescription


def urdf(*joints: tuple[str, str, str, str], tool: str = "0.1 0.2 0.3") -> str:
    """Return a chain: each joint's type, origin xyz, rpy and axis; a ball on each link."""
    ball = (
        '<visual><origin xyz="0.1 0.2 0.3" rpy="1 2 3"/><geometry><sphere radius="0.1"/></geometry></visual>'
    )
    parts = [f'<link name="l0">{ball}</link>']
    for number, (kind, xyz, rpy, axis) in enumerate(joints, start=1):
        parts.append(f'<link name="l{number}">{ball}</link>')
        parts.append(
            f'<joint name="j{number}" type="{kind}"><origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>'
            f'<parent link="l{number - 1}"/><child link="l{number}"/>'
            '<limit lower="-1.5" upper="2" velocity="1" effort="1"/></joint>'
        )
    parts.append(
        f'<link name="tool0"/><joint name="end" type="fixed"><origin xyz="{tool}" rpy="0.3 0.2 0.1"/>'
        f'<parent link="l{len(joints)}"/><child link="tool0"/></joint>'
    )
    return f'<robot name="chain">{"".join(parts)}</robot>'


def described(folder: Path, text: str, extra: str = "") -> UrdfDescription:
    (folder / "arm.urdf").write_text(text)
    (folder / "robot.toml").write_text(f'name = "arm"\nurdf = "arm.urdf"\n{extra}')
    description = load(folder)
    assert isinstance(description, UrdfDescription)
    return description


def rebuilt(form: DhForm, folder: Path) -> DhDescription:
    description, problems = from_values(form.values, folder=folder)
    assert problems == ()
    assert isinstance(description, DhDescription)
    return description


Z_UP = ("revolute", "0 0 0.1", "0 0 0", "0 0 1")
CHAINS = {
    "parallel": urdf(Z_UP, ("revolute", "0.3 0.1 0.2", "0 0 0.4", "0 0 1")),
    "antiparallel": urdf(Z_UP, ("revolute", "0.3 0 0.2", "0 0 0", "0 0 -1")),
    "on one line": urdf(
        ("revolute", "0 0 0.1", "0 0 0.2", "0 0 1"), ("revolute", "0 0 0.2", "0 0 0.3", "0 0 1")
    ),
    "intersecting": urdf(Z_UP, ("revolute", "0 0 0.2", "0 0 0.7", "0 1 0")),
    "skew": urdf(Z_UP, ("revolute", "0.3 -0.1 0.2", "0.1 0.2 0.3", "1 2 3")),
    "sliding": urdf(
        Z_UP, ("prismatic", "0.3 -0.1 0.2", "0.1 0.2 0.3", "1 2 3"),
        ("revolute", "0.1 0.2 0.2", "0.4 0 0", "1 0 0"), ("prismatic", "0 0 0.2", "0 0 0", "1 0 0"),
    ),
    "moved base": urdf(
        ("revolute", "0.3 0.2 0.1", "0.1 0.2 0.3", "0 1 0"), ("revolute", "0 0 0.2", "0 0 0", "1 0 0")
    ),
    "base turned over": urdf(
        ("revolute", "0 0 0.1", "0 0 0", "0 0 -1"), ("revolute", "0 0 0.2", "0 0 0", "1 0 0")
    ),
    "one joint": urdf(("prismatic", "0 0 0.1", "0 0 0", "1 0 0")),
    "right angles as people write them": urdf(
        ("revolute", "0 0 0.089159", "0 0 0", "0 0 1"),
        ("revolute", "0 0.13585 0", "0 1.5707963267948966 0", "0 1 0"),
        ("revolute", "0 -0.1197 0.425", "0 0 0", "0 1 0"),
        ("revolute", "0 0 0.39225", "0 1.5707963267948966 0", "0 1 0"),
        ("revolute", "0 0.093 0", "0 0 0", "0 0 1"), ("revolute", "0 0 0.09465", "0 0 0", "0 1 0"),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CHAINS)
def test_tool_and_shapes_keep_their_places_at_all_positions(name: str, tmp_path: Path) -> None:
    before = described(tmp_path, CHAINS[name])
    form = dh_form(before)
    rows = build_model(rebuilt(form, tmp_path))
    urdf_model = build_model(before)
    shapes = {link.name: link.shapes for link in tree_of(before).links}
    random = np.random.default_rng(4)
    for _ in range(50):
        positions = random.uniform(rows.joints.lower, rows.joints.upper)
        was, now = link_placements(urdf_model, positions), link_placements(rows, positions)
        np.testing.assert_allclose(
            tool_placement(rows, positions), tool_placement(urdf_model, positions), atol=1e-12
        )
        for index, link in enumerate(("base", *rows.link_names[1:])):
            urdf_link = urdf_model.link_names[index]
            (old,), (new,) = shapes[urdf_link], form.shapes[link]
            np.testing.assert_allclose(
                now[index] @ new.shape_to_link, was[index] @ old.shape_to_link, atol=1e-12
            )


# Like KUKA arms: the first axis points down, so positive rotations are clockwise from above.
KUKA_LIKE = urdf(
    ("revolute", "0 0 0.4", "0 0 0", "0 0 -1"), ("revolute", "0.025 0 0", "0 0 0", "0 1 0"),
    ("revolute", "0.56 0 0", "0 0 0", "0 1 0"), ("revolute", "0 0 0.035", "0 0 0", "-1 0 0"),
    ("revolute", "0.515 0 0", "0 0 0", "0 1 0"), ("revolute", "0 0 0", "0 0 0", "-1 0 0"),
)  # fmt: skip
TILTED = urdf(
    ("revolute", "0.1 0.2 0.3", "0.4 0.1 0.2", "0 0 1"), ("revolute", "0.3 0 0.1", "0.3 0 0", "0 1 0")
)


@pytest.mark.parametrize("text", [KUKA_LIKE, TILTED])
def test_base_frame_is_kept_if_the_first_axis_is_not_its_z(text: str, tmp_path: Path) -> None:
    before = described(
        tmp_path,
        text,
        '[[frame]]\nname = "plate"\nlink = "l0"\nxyz = [10, 20, 30]\nrpy = [0, 0, 40]\n'
        "[view.mine]\neye = [1000, 0, 500]\ntarget = [0, 0, 400]\n",
    )
    form = dh_form(before)
    after = rebuilt(form, tmp_path)
    assert after.base.pose != Pose()
    assert form.notes == (
        "the first joint's axis is not the base's z: [base] pose gives the start of the first row",
    )
    # Read with Pinocchio's URDF parser instead of the project's.
    model = pin.buildModelFromXML(text)
    data, tool = model.createData(), model.getFrameId("tool0")
    by_rows = build_model(after)
    random = np.random.default_rng(5)
    for _ in range(50):
        positions = random.uniform(model.lowerPositionLimit, model.upperPositionLimit)
        pin.framesForwardKinematics(model, data, positions)
        expected = data.oMf[tool].homogeneous
        np.testing.assert_allclose(tool_placement(by_rows, positions), expected, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(link_placements(by_rows, positions)[0], np.eye(4))
    plate = frame_placements(by_rows, positions)["plate"]
    np.testing.assert_allclose(plate[:3, 3], [0.01, 0.02, 0.03], atol=1e-12)
    assert views_of(after)[-1].eye.tolist() == [1.0, 0.0, 0.5]


@pytest.mark.parametrize("text", [KUKA_LIKE, TILTED])
def test_rows_with_a_base_pose_survive_a_file_and_an_exported_urdf(text: str, tmp_path: Path) -> None:
    form = dh_form(described(tmp_path, text))
    saved = write_description(form.values, {}, tmp_path / "saved")
    original = load(saved.path)
    assert isinstance(original, DhDescription)
    again = rebuilt(dh_form(described(tmp_path, to_urdf(original))), tmp_path)
    one, other = build_model(original), build_model(again)
    assert other.link_names == one.link_names
    positions = np.linspace(-1.0, 1.0, len(one.joints))
    np.testing.assert_allclose(link_placements(other, positions), link_placements(one, positions), atol=1e-12)
    summary = dh_summary(original)
    assert summary is not None
    first = build_model(rebuilt(form, tmp_path))
    np.testing.assert_allclose(link_placements(one, positions), link_placements(first, positions), atol=1e-12)
    roll, pitch, yaw = summary["start"]["rpy"]
    start = rpy_rotation(roll, pitch, yaw)
    axis = pin.buildModelFromXML(text).jointPlacements[1].homogeneous[:3, :3] @ AXES[text]
    np.testing.assert_allclose(start[:, 2], axis, atol=1e-12)


AXES = {KUKA_LIKE: [0, 0, -1], TILTED: [0, 0, 1]}


def test_known_arm_gives_the_known_rows(tmp_path: Path) -> None:
    form = dh_form(described(tmp_path, CHAINS["right angles as people write them"]))
    rows = [(row["a"], row["alpha"], row["d"]) for row in form.values["joint"]]
    # The manufacturer's table of this arm, except for signs, because x and z point the other way.
    assert [abs(a) for a, _, _ in rows] == pytest.approx([0, 425, 392.25, 0, 0, 0], abs=1e-9)
    assert [abs(alpha) for _, alpha, _ in rows] == pytest.approx([90, 0, 0, 90, 90, 0], abs=1e-9)
    assert [abs(d) for _, _, d in rows] == pytest.approx([89.159, 0, 0, 109.15, 94.65, 0], abs=1e-9)
    assert not [note for note in form.notes if "base" in note]


@pytest.mark.parametrize("robot", library_names())
def test_rows_survive_an_exported_urdf(robot: str, tmp_path: Path) -> None:
    original = load(robot)
    assert isinstance(original, DhDescription)
    form = dh_form(described(tmp_path, to_urdf(original)))
    again = rebuilt(form, tmp_path)
    for before, after in zip(original.joints, again.joints, strict=True):
        keys = ("name", "type", "a", "alpha", "d", "theta", "link_name")
        assert [getattr(after, key) for key in keys] == pytest.approx([getattr(before, key) for key in keys])
        assert after.limits == pytest.approx(before.limits)
    one, other = build_model(original), build_model(again)
    assert other.link_names == one.link_names
    assert other.frame_names == one.frame_names
    random = np.random.default_rng(8)
    for _ in range(50):
        positions = random.uniform(one.joints.lower, one.joints.upper)
        np.testing.assert_allclose(
            link_placements(other, positions), link_placements(one, positions), atol=1e-12
        )
        frames = frame_placements(other, positions)
        for name, placement in frame_placements(one, positions).items():
            np.testing.assert_allclose(frames[name], placement, atol=1e-12)


def test_nearly_parallel_axes_count_as_parallel_and_the_note_says_by_how_much(tmp_path: Path) -> None:
    text = urdf(Z_UP, ("revolute", "1 0 0", "0.00001 0 0", "0 0 1"), tool="1 0 0")
    form = dh_form(described(tmp_path, text))
    assert form.values["joint"][0]["a"] == pytest.approx(1000)
    # One metre beyond an axis that is off by 1e-5 rad: slightly more than 0.01 mm.
    (note,) = form.notes
    assert note.startswith(
        "axes that are nearly parallel are taken as parallel: this moves the tool by up to "
    )
    assert 0.0 < float(note.split("up to ")[1].split(" mm")[0]) < 0.02


@pytest.mark.slow
def test_any_chain_is_exact_or_has_a_note(tmp_path: Path) -> None:
    random = np.random.default_rng(13)
    angles = [0.0, 0.0, np.pi / 2, -np.pi / 2, np.pi, 1.5708, 1.570796, 0.7]
    axes = ["1 0 0", "0 1 0", "0 0 1", "0 0 -1", "0.3 -2 1"]

    def joint() -> tuple[str, str, str, str]:
        kind = str(random.choice(["revolute", "revolute", "prismatic"]))
        xyz, rpy = random.choice([0.0, 0.2, -0.3], 3), random.choice(angles, 3)
        return kind, " ".join(map(str, xyz)), " ".join(map(str, rpy)), str(random.choice(axes))

    noted = 0
    for _ in range(60):
        before = described(tmp_path, urdf(*(joint() for _ in range(random.integers(1, 7)))))
        form = dh_form(before)
        if any("nearly parallel" in note for note in form.notes):
            noted += 1
            continue
        one, other = build_model(before), build_model(rebuilt(form, tmp_path))
        for _ in range(5):
            positions = random.uniform(one.joints.lower, one.joints.upper)
            expected = tool_placement(one, positions)
            np.testing.assert_allclose(tool_placement(other, positions), expected, atol=1e-12)
    assert noted < 30


def test_joints_outside_the_chain_are_fixed_at_home(tmp_path: Path) -> None:
    side = (
        '<link name="wing"><visual><geometry><sphere radius="1"/></geometry></visual></link>'
        '<joint name="flap" type="prismatic"><origin xyz="0 0 1"/><axis xyz="1 0 0"/><parent link="l1"/>'
        '<child link="wing"/><limit lower="0" upper="1" velocity="1"/></joint></robot>'
    )
    text = CHAINS["parallel"].replace("</robot>", side)
    form = dh_form(described(tmp_path, text, '[[joint]]\nname = "flap"\nhome = 500\n'))
    assert [row["name"] for row in form.values["joint"]] == ["j1", "j2"]
    assert form.notes == ("not on the way to the tool, so fixed at home: flap",)
    # The x axis of row 1 is along (0.3, 0.1), its origin is on joint 2's axis.
    wing = form.shapes["l1"][-1].shape_to_link
    turn = np.arctan2(0.1, 0.3)
    # In joint 1's frame, 0.1 m up, the wing is at (0.5, 0, 1); row 1 at (0.3, 0.1, -0.1).
    x, y = 0.5 - 0.3, 0.0 - 0.1
    expected = [x * np.cos(turn) + y * np.sin(turn), -x * np.sin(turn) + y * np.cos(turn), 1.1]
    np.testing.assert_allclose(wing[:3, 3], expected, atol=1e-12)


def test_chain_with_a_mimic_joint_is_refused(tmp_path: Path) -> None:
    text = CHAINS["parallel"].replace(
        '<joint name="j2" type="revolute">', '<joint name="j2" type="revolute"><mimic joint="j1"/>'
    )
    description = described(tmp_path, text, '[tool]\nlink = "tool0"\n')
    with pytest.raises(DescriptionError, match="joint 'j2' on the way to 'tool0' follows another"):
        dh_form(description)
