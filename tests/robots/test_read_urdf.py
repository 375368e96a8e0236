"""URDF files: read as Pinocchio reads them, and refused in words where they are wrong."""

import time
from pathlib import Path

import numpy as np
import pinocchio
import pytest

from robots.descriptions.description import load
from robots.descriptions.shape_inspection import inspect_shapes
from robots.descriptions.urdf.files import files_of
from robots.descriptions.urdf.read import UrdfRobot, read_urdf
from robots.kinematics.kinematic_tree import Shape, end_link
from robots.kinematics.model import build_model, frame_placements, link_placements, tool_jacobian
from robots.schema.errors import DescriptionError
from robots.shapes.geometry import Geometry, bounds

LIMIT = '<limit lower="-1" upper="2" velocity="3" effort="1"/>'
# A branching arm: skew axes, a slide, a gripper with a second finger that follows, a continuous joint.
ARM = f"""<?xml version="1.0"?>
<robot name="skew">
  <material name="blue"><color rgba="0 0 1 0.5"/></material>
  <link name="world"/>
  <link name="pillar">
    <visual><origin xyz="0 0 1"/><geometry><box size="2 4 6"/></geometry><material name="blue"/></visual>
    <visual><geometry><cylinder radius="1" length="4"/></geometry></visual>
    <collision><geometry><sphere radius="9"/></geometry></collision>
  </link>
  <link name="arm"><collision><geometry><sphere radius="0.5"/></geometry></collision></link>
  <link name="slide"/> <link name="hand"/> <link name="left"/> <link name="right"/> <link name="wheel"/>
  <link name="flange"/>
  <joint name="stand" type="fixed">
    <origin xyz="1 2 3" rpy="0.1 0.2 0.3"/><parent link="world"/><child link="pillar"/>
  </joint>
  <joint name="turn" type="revolute">
    <origin xyz="0.1 0.2 0.3" rpy="0.5 -0.4 0.3"/><axis xyz="1 2 -3"/>
    <parent link="pillar"/><child link="arm"/>{LIMIT}
  </joint>
  <joint name="reach" type="prismatic">
    <origin xyz="0 0 0.3" rpy="0 1.2 0"/><axis xyz="0 1 0"/><parent link="arm"/><child link="slide"/>{LIMIT}
  </joint>
  <joint name="roll" type="continuous">
    <origin xyz="0.4 0 0"/><axis xyz="0 0 1"/><parent link="slide"/><child link="hand"/>
    <limit velocity="2" effort="1"/>
  </joint>
  <joint name="left_finger" type="prismatic">
    <axis xyz="1 0 0"/><parent link="hand"/><child link="left"/>{LIMIT}
  </joint>
  <joint name="right_finger" type="prismatic">
    <axis xyz="-1 0 0"/><parent link="hand"/><child link="right"/>{LIMIT}
    <mimic joint="left_finger" multiplier="2" offset="0.5"/>
  </joint>
  <joint name="spin" type="revolute">
    <origin xyz="0 5 0"/><parent link="pillar"/><child link="wheel"/>{LIMIT}
  </joint>
  <joint name="end" type="fixed"><origin xyz="0 0 0.2"/><parent link="hand"/><child link="flange"/></joint>
</robot>
"""


def read(text: str, folder: Path = Path()) -> UrdfRobot:
    return read_urdf(text, folder / "arm.urdf", resolve=files_of(folder / "arm.urdf"))


def with_change(old: str, new: str) -> str:
    assert old in ARM
    return ARM.replace(old, new, 1)


def arm_file(folder: Path, text: str = ARM) -> Path:
    path = folder / "arm.urdf"
    path.write_text(text)
    return path


def pinocchios_placements(text: str, names: tuple[str, ...], by_joint: dict[str, float]) -> np.ndarray:
    """Return every link's placement as Pinocchio's reader computes it."""
    model = pinocchio.buildModelFromXML(text)
    data = model.createData()
    positions = pinocchio.neutral(model)
    for name, value in by_joint.items():
        joint = model.joints[model.getJointId(name)]
        # Pinocchio has cosine and sine for a continuous joint.
        positions[joint.idx_q : joint.idx_q + joint.nq] = (
            [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
        )
    pinocchio.framesForwardKinematics(model, data, positions)
    frames = [model.getFrameId(name, pinocchio.FrameType.BODY) for name in names]
    return np.array([data.oMf[frame].homogeneous for frame in frames])


def test_link_placements_equal_those_of_pinocchio(tmp_path: Path) -> None:
    model = build_model(load(arm_file(tmp_path)))
    assert model.joints.names == ("turn", "reach", "roll", "left_finger", "spin")
    random = np.random.default_rng(5)
    for _ in range(100):
        positions = random.uniform(model.joints.lower, model.joints.upper)
        by_joint = dict(zip(model.joints.names, positions, strict=True))
        by_joint["right_finger"] = 2 * by_joint["left_finger"] + 0.5
        expected = pinocchios_placements(ARM, model.link_names, by_joint)
        np.testing.assert_allclose(link_placements(model, positions), expected, atol=1e-12, rtol=0)


def test_mimic_joint_moves_the_tool_with_its_source_joint(tmp_path: Path) -> None:
    text = with_change('<link name="flange"/>', '<link name="flange"/><link name="tip"/>').replace(
        "</robot>",
        '<joint name="tip_joint" type="fixed"><parent link="right"/><child link="tip"/></joint></robot>',
    )
    folder = tmp_path / "arm"
    folder.mkdir()
    arm_file(folder, text)
    (folder / "robot.toml").write_text('name = "arm"\nurdf = "arm.urdf"\n[tool]\nlink = "tip"\n')
    model = build_model(load(folder))
    jacobian = tool_jacobian(model, model.joints.home)
    assert jacobian.shape == (6, 5)
    before = frame_placements(model, [0, 0, 0, 0, 0])["tool"]
    after = frame_placements(model, [0, 0, 0, 0.001, 0])["tool"]
    moved = np.linalg.norm(after[:3, 3] - before[:3, 3])
    assert moved == pytest.approx(0.002, abs=1e-12)
    np.testing.assert_allclose(jacobian[:3, 3], (after - before)[:3, 3] / 0.001, atol=1e-9)


def test_limits_are_read_and_a_continuous_joint_gets_one_turn_each_way(
    tmp_path: Path,
) -> None:
    joints = build_model(load(arm_file(tmp_path))).joints
    np.testing.assert_allclose(joints.lower, [-1, -1, -2 * np.pi, -1, -1])
    np.testing.assert_allclose(joints.upper, [2, 2, 2 * np.pi, 2, 2])
    np.testing.assert_allclose(joints.max_speed, [3, 3, 2, 3, 3])
    np.testing.assert_allclose(joints.max_acceleration, 4 * joints.max_speed)
    np.testing.assert_allclose(joints.max_jerk, 10 * joints.max_acceleration)
    np.testing.assert_allclose(joints.home, np.zeros(5))


def test_visual_and_collision_shapes_replace_each_other_where_one_is_missing() -> None:
    links = {link.name: link for link in read(ARM).tree.links}
    box, cylinder = links["pillar"].shapes
    assert (box.color, box.opacity) == ((0.0, 0.0, 1.0), 0.5)
    assert bounds_in_link(box) == ([-1, -2, -2], [1, 2, 4])
    assert bounds_in_link(cylinder) == ([-1, -1, -2], [1, 1, 2])
    (around,) = links["pillar"].checked
    assert bounds_in_link(around)[1] == pytest.approx([9, 9, 9], rel=0.01)
    (ball,) = links["arm"].shapes
    assert links["arm"].checked == links["arm"].shapes
    assert bounds_in_link(ball)[1] == pytest.approx([0.5, 0.5, 0.5], rel=0.01)
    assert links["hand"].shapes == links["hand"].checked == ()


def test_shapes_of_round_collision_shapes_contain_the_shapes() -> None:
    links = {link.name: link for link in read(ARM).tree.links}
    (around,) = links["pillar"].checked
    assert isinstance(around.source, Geometry)
    (part,) = around.source.parts
    corners = part.vertices[part.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    depths = np.einsum("ij,ij->i", normals, corners[:, 0]) / np.linalg.norm(normals, axis=1)
    assert depths.min() > 9 * 0.995
    assert np.linalg.norm(part.vertices, axis=1).max() < 9 * 1.005


def test_collision_geometry_equal_to_the_visual_geometry_is_stored_once() -> None:
    visual = '<visual><geometry><box size="1 2 3"/></geometry></visual>'
    both = visual + visual.replace("visual", "collision")
    text = with_change('<link name="hand"/>', f'<link name="hand">{both}</link>')
    (hand,) = (link for link in read(text).tree.links if link.name == "hand")
    assert len(hand.shapes) == 1
    assert hand.collision == ()


def test_a_missing_file_counts_as_unchecked_only_where_a_check_would_use_it() -> None:
    seen = '<visual><geometry><mesh filename="seen.stl"/></geometry></visual>'
    checked = '<collision><geometry><mesh filename="checked.stl"/></geometry></collision>'
    box = '<collision><geometry><box size="1 1 1"/></geometry></collision>'

    def unchecked(inside: str) -> tuple[str, ...]:
        return read(with_change('<link name="hand"/>', f'<link name="hand">{inside}</link>')).unchecked

    assert unchecked(seen) == ("seen.stl",)
    assert unchecked(seen + box) == ()
    assert unchecked(seen + checked) == ("checked.stl",)


def bounds_in_link(shape: Shape) -> tuple[list[float], list[float]]:
    assert isinstance(shape.source, Geometry)
    low, high = (corner + shape.shape_to_link[:3, 3] for corner in bounds(shape.source))
    return [round(float(value), 12) for value in low], [round(float(value), 12) for value in high]


def test_tool_is_at_the_end_of_the_longest_chain_unless_a_link_has_a_tools_name() -> None:
    # The right finger follows the left one.
    assert end_link(read(ARM).tree) == "left"
    named = ARM.replace('"flange"', '"arm_tool0"')
    assert end_link(read(named).tree) == "arm_tool0"


@pytest.mark.parametrize(
    ("address", "files", "note"),
    [
        (r"meshes\arm.stl", ["meshes/arm.stl"], "meshes/arm.stl"),
        (r"package://kit\Meshes\arm.STL", ["kit/meshes/arm.stl"], "meshes/arm.stl"),
        ("meshes/ARM.stl", ["Meshes/arm.STL", "Meshes/other.stl"], "Meshes/arm.STL"),
        ("meshes/arm.STL", ["meshes/arm.stl", "meshes/ARM.stl"], None),
        ("meshes/arm.stl", ["meshes/arm.stl", "meshes/ARM.stl"], ""),
        (r"C:\robots\arm.stl", ["meshes/arm.stl"], None),
    ],
)
def test_an_address_of_windows_is_taken_for_the_only_file_that_fits(tmp_path, address, files, note):
    for name in files:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("")
    urdf = tmp_path / "arm.urdf"
    geometry = f'<link name="hand"><visual><geometry><mesh filename="{address}"/></geometry></visual></link>'
    urdf.write_text(with_change('<link name="hand"/>', geometry))
    robot = read_urdf(urdf.read_bytes(), urdf, resolve=files_of(urdf))
    assert robot.missing == ((address,) if note is None else ())
    told = [each for each in robot.notes if "is taken for" in each]
    assert told == ([f"mesh {address!r}: is taken for {note}"] if note else [])
    if note is None:
        found, _ = inspect_shapes(load(urdf))
        hint = found[0].text.removeprefix(f"mesh {address!r}: no such file; did you mean ")
        assert hint.lower() == "'meshes/arm.stl'?"


def test_a_long_address_or_many_of_them_take_no_long_time(tmp_path):
    for number in range(300):
        (tmp_path / f"{number}.stl").write_text("")
    resolve = files_of(tmp_path / "arm.urdf")
    began = time.process_time()
    assert resolve("../" * 1_000_000 + "x.stl") is None
    assert all(resolve(f"x{number}.STL") is None for number in range(1000))
    assert time.process_time() - began < 10.0


def test_packages_are_found_above_and_beside_the_file_and_in_configured_folders(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    geometry = (
        '<link name="hand"><visual><geometry><mesh filename="{}" scale="1 2 3"/></geometry></visual></link>'
    )
    package = tmp_path / "arms"
    for folder in (package / "urdf", package / "meshes", tmp_path / "elsewhere" / "other" / "meshes"):
        folder.mkdir(parents=True)
    (package / "meshes" / "a b.stl").write_text("")
    (tmp_path / "elsewhere" / "other" / "meshes" / "b.stl").write_text("")

    def found(address: str, **options: object) -> str | None:
        urdf = package / "urdf" / "arm.urdf"
        text = with_change('<link name="hand"/>', geometry.format(address))
        robot = read_urdf(text, urdf, resolve=files_of(urdf, **options))  # type: ignore[arg-type]
        (shape,) = next(link.shapes for link in robot.tree.links if link.name == "hand") or (None,)
        if shape is None:
            assert robot.missing == (address,)
            return None
        np.testing.assert_array_equal(shape.shape_to_link, np.diag([1, 2, 3, 1]))
        assert isinstance(shape.source, Path)
        return shape.source.name

    assert found("package://arms/meshes/a%20b.stl") == "a b.stl"
    assert found("../meshes/a b.stl") == "a b.stl"
    assert found(f"file://{package}/meshes/a b.stl") == "a b.stl"
    assert found("package://other/meshes/b.stl") is None
    assert found("package://other/meshes/b.stl", packages=[tmp_path / "elsewhere"]) == "b.stl"
    assert found("package://other/meshes/b.stl", packages=[tmp_path / "elsewhere" / "other"]) == "b.stl"
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"/nowhere:{tmp_path / 'elsewhere'}")
    assert found("package://other/meshes/b.stl") == "b.stl"
    assert found("package://other/meshes/b.stl", confined=package) is None
    assert found("../meshes/a b.stl", confined=package / "urdf") is None
    assert found("../meshes/a b.stl", confined=package) == "a b.stl"


def test_names_that_are_invalid_in_keys_are_changed_with_a_note() -> None:
    robot = read(ARM.replace('"hand"', '"my/hand 1"').replace('"roll"', '"_roll"'))
    assert "my_hand_1" in [link.name for link in robot.tree.links]
    assert "joint_roll" in [joint.name for joint in robot.tree.joints]
    assert robot.notes == (
        "link 'my/hand 1' is called 'my_hand_1' here",
        "joint '_roll' is called 'joint_roll' here",
    )


def test_joint_with_equal_limits_is_fixed_at_that_position() -> None:
    text = with_change(LIMIT, '<limit lower="0.5" upper="0.5" velocity="1" effort="1"/>')
    robot = read(text)
    assert "turn" not in [joint.name for joint in robot.tree.joints]
    arm = next(link for link in robot.tree.links if link.name == "arm")
    expected = pinocchios_placements(text, ("arm",), {"turn": 0.5})[0]
    np.testing.assert_allclose(arm.link_to_joint, expected, atol=1e-12)


def test_missing_speed_of_a_continuous_joint_is_assumed_with_a_note() -> None:
    robot = read(with_change('<limit velocity="2" effort="1"/>', ""))
    assert robot.notes == ("joint 'roll': has no velocity limit; 1.571 rad/s is assumed",)
    assert not any(joint.doubts for joint in robot.tree.joints)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ('<robot name="skew">', '<robot name="skew"', "is not XML: "),
        ('<?xml version="1.0"?>', '<!DOCTYPE a [<!ENTITY b "c">]>', "has a DOCTYPE with declarations"),
        ('<link name="world"/>', '<xacro:arm prefix=""/>', "is xacro; convert it to a URDF first"),
        ('xyz="1 2 3"', 'xyz="${x} 2 3"', "is xacro"),
        ('<link name="world"/>', "", "joint 'stand' parent link 'world': no such link"),
        ('<link name="world"/>', '<link name="world"/><link name="island"/>',
         "links 'world', 'island': more than one link has no parent joint"),
        ('<link name="world"/>', '<link name="world"/><link name="world"/>', "link 'world': 2 have"),
        ('<link name="world"/>', '<link name="world"/><link/>', "<link> number 2: has no name"),
        ('<joint name="stand"', '<joint name="turn"', "joint 'turn': 2 have that name"),
        ('<parent link="world"/>', '<parent link="flange"/>', "links 'pillar', 'arm', 'slide', 'hand' and"),
        ('<child link="wheel"/>', '<child link="hand"/>', "joint 'spin' child link 'hand': joint 'r"),
        ('<axis xyz="1 2 -3"/>', '<axis xyz="0 0 0"/>', "joint 'turn' axis xyz = '0 0 0': is zero"),
        ('<axis xyz="1 2 -3"/>', '<axis xyz="1 2"/>', "joint 'turn' axis xyz = '1 2': must be 3 numbers"),
        ('xyz="0.1 0.2 0.3"', 'xyz="0 0 350"', "joint 'turn' origin xyz = '0 0 350': more than 100 m; a"),
        ('xyz="0.1 0.2 0.3"', 'xyz="nan 0 0"', "joint 'turn' origin xyz = 'nan 0 0': must be 3 numbers"),
        ('lower="-1" upper="2"', 'lower="2" upper="-1"', "joint 'turn' limit lower = 2, upper = -1: "),
        (LIMIT, "", "joint 'turn': has no <limit lower upper velocity>; a revolute joint needs one"),
        ('type="revolute"', 'type="floating"', "joint 'turn' type 'floating': is not supported"),
        ('mimic joint="left_finger"', 'mimic joint="finger"', "joint 'right_finger' mimic joint 'finger'"),
        ('mimic joint="left_finger"', 'mimic joint="right_finger"',
         "joint 'right_finger' mimic joint 'right_finger': follows itself"),
        ('size="2 4 6"', 'size="2 4"', "link 'pillar' visual box size = '2 4': must be 3 numbers"),
        ('rgba="0 0 1 0.5"', 'rgba="blue"', "material 'blue' color rgba = 'blue': must be 4 numbers"),
    ],
)  # fmt: skip
def test_error_of_a_wrong_urdf_names_the_element_and_the_correction(
    old: str, new: str, expected: str, tmp_path: Path
) -> None:
    with pytest.raises(DescriptionError) as caught:
        load(arm_file(tmp_path, with_change(old, new)))
    assert caught.value.problems[0].startswith(expected)
    assert str(caught.value).startswith(str(tmp_path / "arm.urdf"))
    assert "\n" not in str(caught.value)


def test_urdf_with_thousands_of_links_is_rejected() -> None:
    with pytest.raises(DescriptionError, match="has 3,000 links; at most 2,000 are read"):
        read("<robot>" + "".join(f"<link name='l{number}'/>" for number in range(3000)) + "</robot>")


def test_cycle_of_links_apart_from_the_root_is_rejected() -> None:
    circle = "".join(
        f'<link name="{a}"/><joint name="{a}{b}" type="fixed"><parent link="{a}"/><child link="{b}"/></joint>'
        for a, b in (("one", "two"), ("two", "one"))
    )
    with pytest.raises(DescriptionError, match="links 'one', 'two': form a cycle; a robot is a tree"):
        read(ARM.replace("</robot>", circle + "</robot>"))


def test_urdf_with_changed_bytes_is_read_or_raises_a_description_error() -> None:
    random = np.random.default_rng(12)
    pieces = [
        "nan",
        "1e999",
        "-",
        '"',
        "<",
        ">",
        "/",
        "\x00",
        "world",
        "hand",
        "0 0 0",
        "mimic",
        "fixed",
        "&#0;",
    ]
    refused = []
    for _ in range(400):
        text = ARM
        for _ in range(random.integers(1, 4)):
            at, long = int(random.integers(len(text))), int(random.integers(12))
            text = text[:at] + str(random.choice(pieces)) * int(random.integers(2)) + text[at + long :]
        try:
            robot = read(text)
        except DescriptionError as error:
            refused.append(str(error))
        else:
            assert robot.tree.free
    assert 50 < len(refused) < 400
    assert not [text for text in refused if "\n" in text or len(text) > 500]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "is not XML"),
        ("<html/>", "<html>: a URDF's outermost element must be <robot>"),
        ('<robot name="r"/>', "has no <link>"),
        ('<robot name="r"><link name="a"/></robot>', "has no movable joint"),
    ],
)
def test_urdf_that_is_not_an_arm_is_rejected(text: str, expected: str) -> None:
    with pytest.raises(DescriptionError, match=expected):
        read(text)
