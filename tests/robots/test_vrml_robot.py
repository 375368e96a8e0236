"""Robots in VRML: OpenHRP's Humanoid, Joint and Segment, as in its files."""

from math import pi
from pathlib import Path

import numpy as np
import pytest

from robots.descriptions.vrml_robot import VrmlRobot, read_vrml_robot
from robots.kinematics.kinematic_tree import BASE
from robots.schema.errors import ShapeError
from robots.schema.robot_toml import JointType
from robots.shapes.files.vrml.read import read_vrml
from robots.shapes.geometry import Geometry, bounds

PROTOS = """
PROTO Joint [
  exposedField SFVec3f translation 0 0 0  exposedField SFRotation rotation 0 0 1 0
  exposedField SFVec3f center 0 0 0       exposedField SFVec3f scale 1 1 1
  exposedField MFNode children [ ]        exposedField MFFloat llimit [ ]
  exposedField MFFloat ulimit [ ]         exposedField MFFloat lvlimit [ ]
  exposedField MFFloat uvlimit [ ]        exposedField SFString jointType ""
  exposedField SFInt32 jointId -1         exposedField SFVec3f jointAxis 0 0 1
] { Transform { translation IS translation rotation IS rotation center IS center scale IS scale
    children IS children } }
PROTO Segment [ exposedField MFNode children [ ] exposedField SFFloat mass 0 ] {
  Group { children IS children } }
PROTO Humanoid [
  exposedField MFNode humanoidBody [ ] exposedField MFNode joints [ ] field SFString name "" ] {
  Group { children IS humanoidBody } }
"""
BOX = "Shape { geometry Box { size 2 2 2 } }"
ARM = """
DEF ARM Humanoid { name "the arm" humanoidBody [
  DEF WAIST Joint { jointType "fixed" translation 0 0 1 children [
    DEF BASE_LINK Segment { mass 3 children Shape { geometry Box { } } }
    DEF SHOULDER Joint { jointType "rotate" jointId 0 jointAxis 0 0 2 translation 0 0 0.5
      llimit -1 ulimit 2 lvlimit -3 uvlimit 4 children [
      DEF UPPER Segment { children Transform { translation 0 0 7 children Shape { geometry Box { } } } }
      DEF ELBOW Joint { jointType "slide" jointId 1 jointAxis "Y" translation 1 0 0
        rotation 1 0 0 1.5707963267948966 llimit 0 ulimit 0.5 children [
        DEF LOWER Segment { children Shape { geometry Sphere { } } }
        DEF TIP Joint { jointType "fixed" translation 0 0 3 children DEF HAND Segment { } }
      ] }
    ] }
  ] }
] joints [ USE WAIST USE SHOULDER USE ELBOW USE TIP ] }
"""


def robot(folder: Path, text: str, protos: str = PROTOS) -> VrmlRobot:
    path = folder / "arm.wrl"
    path.write_text(f"#VRML V2.0 utf8\n{protos}{text}")
    return read_vrml_robot(path)


@pytest.mark.parametrize("protos", [PROTOS, ""], ids=["with its PROTOs", "without"])
def test_joints_have_their_axes_limits_and_speeds(tmp_path: Path, protos: str) -> None:
    found = robot(tmp_path, ARM, protos)
    shoulder, elbow = found.tree.joints
    assert found.name == "the arm"
    assert (shoulder.name, shoulder.type, shoulder.parent) == ("SHOULDER", JointType.ROTARY, BASE)
    assert (shoulder.lower, shoulder.upper, shoulder.max_speed) == (-1, 2, 3)
    assert shoulder.axis.tolist() == [0, 0, 1]
    # On the base, 1 up and 0.5 more.
    np.testing.assert_allclose(shoulder.joint_to_parent[:3, 3], [0, 0, 1.5])
    assert (elbow.name, elbow.type, elbow.parent) == ("ELBOW", JointType.PRISMATIC, 0)
    assert (elbow.lower, elbow.upper) == (0, 0.5)
    assert elbow.axis.tolist() == [0, 1, 0]
    # A quarter turn about x: y goes to z.
    np.testing.assert_allclose(elbow.joint_to_parent[:3, 1], [0, 0, 1], atol=1e-12)


def test_links_are_on_their_joints_with_their_shapes(tmp_path: Path) -> None:
    base, upper, lower, hand = robot(tmp_path, ARM).tree.links
    assert [(link.name, link.joint) for link in (base, upper, lower, hand)] == [
        ("BASE_LINK", BASE),
        ("UPPER", 0),
        ("LOWER", 1),
        ("HAND", 1),
    ]
    assert base.link_to_joint[:3, 3].tolist() == [0, 0, 1]
    assert hand.link_to_joint[:3, 3].tolist() == [0, 0, 3]
    assert hand.shapes == ()
    (shape,) = upper.shapes
    assert isinstance(shape.source, Geometry)
    assert bounds(shape.source)[0].tolist() == [-1, -1, 6]
    assert shape.shape_to_link.tolist() == np.eye(4).tolist()


def test_shape_of_the_same_file_is_the_robot_at_zero(tmp_path: Path) -> None:
    robot(tmp_path, ARM)
    low, high = bounds(read_vrml(tmp_path / "arm.wrl"))
    # The box at the waist, the upper one 7 above the shoulder, the ball at the elbow.
    np.testing.assert_allclose(low, [-1, -1, 0], atol=1e-9)
    np.testing.assert_allclose(high, [2, 1, 9.5], atol=1e-9)


TURNS = 'jointType "rotate" llimit -1 ulimit 1'


def joint(name: str, fields: str, children: str = "") -> str:
    return f"DEF {name} Joint {{ {fields} children [ {children} ] }}"


def test_joints_are_in_the_order_of_jointid(tmp_path: Path) -> None:
    second = joint("B", f"{TURNS} jointId 1")
    third = joint("C", f"{TURNS} jointId 2", "DEF C_LINK Segment { }")
    passive = joint("P", TURNS)
    first = joint("A", f"{TURNS} jointId 0", f"{passive} {third} {second}")
    tree = robot(tmp_path, first).tree
    assert [found.name for found in tree.joints] == ["A", "B", "C", "P"]
    assert [found.parent for found in tree.joints] == [BASE, 0, 0, 0]
    assert {link.name: link.joint for link in tree.links} == {
        "base": BASE,
        "A_link": 0,
        "P_link": 3,
        "C_LINK": 2,
        "B_link": 1,
    }


def test_order_with_a_joint_before_its_parent_is_rejected(tmp_path: Path) -> None:
    inner = joint("B", f"{TURNS} jointId 0")
    found = robot(tmp_path, joint("A", f"{TURNS} jointId 1", inner))
    assert [known.name for known in found.tree.joints] == ["A", "B"]
    assert "a jointId is lower than its parent's; joints are in the file's order" in found.notes


def test_joint_without_limits_turns_once_each_way(tmp_path: Path) -> None:
    found = robot(tmp_path, joint("A", 'jointType "rotate"'))
    (known,) = found.tree.joints
    assert (known.lower, known.upper, known.continuous) == (-2 * pi, 2 * pi, True)
    assert "no llimit and ulimit" in found.notes[0]


def test_limits_in_degrees_are_doubtful(tmp_path: Path) -> None:
    fields = 'jointType "rotate" llimit -170 ulimit 170 uvlimit 180'
    (known,) = robot(tmp_path, joint("A", fields)).tree.joints
    assert (known.upper, known.max_speed) == pytest.approx((170 * pi / 180, pi))
    assert "probably degrees: -2.9671 to 2.9671 rad" in known.doubts["limits"].text
    assert known.doubts["max_speed"].stated == {"velocity": 180}


def test_free_root_is_fixed(tmp_path: Path) -> None:
    found = robot(tmp_path, joint("W", 'jointType "free" translation 0 0 2', joint("A", TURNS)))
    (known,) = found.tree.joints
    assert known.joint_to_parent[:3, 3].tolist() == [0, 0, 2]


def test_joints_may_be_in_groups_and_transforms(tmp_path: Path) -> None:
    inner = joint("A", f"{TURNS} translation 1 0 0")
    placed = f"Transform {{ translation 0 0 5 children [ {inner} {BOX} ] }}"
    found = robot(tmp_path, f"Group {{ children {placed} }}")
    assert found.tree.joints[0].joint_to_parent[:3, 3].tolist() == [1, 0, 5]
    base = found.tree.links[0]
    assert len(base.shapes) == 1
    assert base.link_to_joint[:3, 3].tolist() == [0, 0, 5]


def test_names_are_made_safe_and_unique(tmp_path: Path) -> None:
    found = robot(tmp_path, joint("a:b", TURNS, joint("a/b", TURNS)))
    assert [known.name for known in found.tree.joints] == ["a_b", "a_b_2"]


def test_missing_shape_of_a_link_is_a_note(tmp_path: Path) -> None:
    found = robot(tmp_path, joint("A", TURNS, 'Segment { children Inline { url "x.wrl" } }'))
    assert "Inline: 'x.wrl': no such file; it is left out" in found.notes[0]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (BOX, "holds no robot: no Joint with a jointType of 'rotate' or 'slide'"),
        (joint("A", 'jointType "rotate" llimit 1 ulimit -1'), "llimit 1 is above ulimit -1"),
        (joint("A", 'jointType "rotate" jointAxis 0 0 0'), "jointAxis is 0 0 0; it takes a direction"),
        (joint("A", 'jointType "rotate" jointAxis "W"'), "jointAxis 'W'; it takes X, Y, Z or three numbers"),
        (joint("A", 'jointType "rotate" jointAxis 0 1'), "jointAxis has 2 numbers; it takes 3"),
        (joint("A", 'jointType "rotate" scale 2 2 2'), "a joint's frame can only be moved and rotated"),
        (
            joint("A", TURNS, joint("B", 'jointType "free"')),
            "jointType 'free' on another joint; only a robot's root can be free",
        ),
    ],
)
def test_invalid_robot_is_refused(tmp_path: Path, text: str, reason: str) -> None:
    with pytest.raises(ShapeError) as caught:
        robot(tmp_path, text)
    assert reason in str(caught.value)
