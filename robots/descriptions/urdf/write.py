"""Writer of descriptions as URDF.

URDF puts a link's frame on its joint's axis, but a D-H link's frame is elsewhere. So each D-H joint moves
an empty link "<joint>_axis", to which a fixed joint attaches the actual link. Every link, the tool and the
named frames keep the names and frames that they have everywhere else. A robot read from a URDF keeps its
links and joints; links that were fixed together are attached to the first of them.
"""

import xml.etree.ElementTree as Xml
from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from robots.kinematics.joints import joints_of
from robots.kinematics.kinematic_tree import BASE, Tree, TreeJoint, TreeLink, named_frames, tree_of
from robots.schema.poses import FloatArray, inverse, rotation_rpy
from robots.schema.robot_toml import JointType, RobotDescription
from robots.shapes.geometry import Color


def glb_beside(link: str) -> str:
    """Return the path of a link's shape in the folder meshes next to the URDF."""
    return f"meshes/{link}.glb"


def collision_beside(link: str) -> str:
    """Return the path of a link's collision shape in the folder meshes next to the URDF."""
    return f"meshes/{link}_collision.glb"


def to_urdf(
    description: RobotDescription,
    *,
    shape_uri: Callable[[str], str] = glb_beside,
    collision_uri: Callable[[str], str] | None = None,
    colors: Mapping[str, Color] | None = None,
) -> str:
    """Return a description as URDF text that refers to the shapes of `robots.descriptions.glb.link_glbs`.

    Limits and speeds are the description's, which may be tighter than those of its URDF.

    Args:
        shape_uri: Returns the address of a link's GLB by the link's name.
        collision_uri: The same for the GLB of `glb.collision_glbs`; None: `shape_uri` for both.
        colors: Colours of links, sRGB: Foxglove's viewer ignores those of GLB.
    """
    tree = tree_of(description)
    joints = joints_of(description)
    for number, lower, upper, speed in zip(
        tree.free, joints.lower, joints.upper, joints.max_speed, strict=True
    ):
        tree = _with_limits(tree, number, float(lower), float(upper), float(speed))
    frames = named_frames(description)
    return tree_urdf(description.name, tree, frames, shape_uri, collision_uri, colors=colors or {})


def tree_urdf(
    name: str,
    tree: Tree,
    frames: Mapping[str, tuple[str, FloatArray]] | None = None,
    shape_uri: Callable[[str], str] = glb_beside,
    collision_uri: Callable[[str], str] | None = collision_beside,
    *,
    colors: Mapping[str, Color] = MappingProxyType({}),
) -> str:
    """Return a tree of joints and links as URDF text.

    Args:
        frames: Named frames without a link: the link that carries each, and its (4, 4) pose there [m].
        shape_uri: Returns the address of the GLB of a link with a shape, by the link's name.
        collision_uri, colors: See `to_urdf`.
    """
    robot = Xml.Element("robot", name=name)
    robot.append(
        Xml.Comment(" Efforts are not known: 0. Meshes are glTF: metres, y up; z up in their link's frame. ")
    )
    # Existing links and joints keep their names; those added for URDF get unused names.
    links = {link.name for link in tree.links}
    bare = {frame: place for frame, place in (frames or {}).items() if frame not in links}
    taken = {*links, *bare}
    taken_joints = {joint.name for joint in tree.joints}
    carriers: dict[int, tuple[str, FloatArray]] = {}
    for number in (BASE, *range(len(tree.joints))):
        joint = None if number == BASE else tree.joints[number]
        here = [link for link in tree.links if link.joint == number]
        # The joint's child: the first link if its frame is the joint's frame, otherwise an empty link.
        first = here[0].name if here and (here[0].link_to_joint == np.eye(4)).all() else None
        carrier = first or _unused(f"{joint.name if joint else 'base'}_axis", taken)
        if first is None:
            Xml.SubElement(robot, "link", name=carrier)
        if joint is not None:
            _add_joint(robot, tree, joint, carriers[joint.parent], carrier)
        for link in here:
            _add_link(robot, link, shape_uri, collision_uri or shape_uri, colors.get(link.name))
            if link.name != carrier:
                on, on_to_joint = carriers.get(number, (carrier, np.eye(4)))
                _add_fixed(robot, on, link.name, inverse(on_to_joint) @ link.link_to_joint, taken_joints)
            carriers.setdefault(number, (link.name, link.link_to_joint))
        carriers.setdefault(number, (carrier, np.eye(4)))
    for frame, (on_link, frame_to_link) in bare.items():
        Xml.SubElement(robot, "link", name=frame)
        _add_fixed(robot, on_link, frame, frame_to_link, taken_joints)
    Xml.indent(robot)
    return '<?xml version="1.0"?>\n' + Xml.tostring(robot, encoding="unicode") + "\n"


def _with_limits(tree: Tree, number: int, lower: float, upper: float, max_speed: float) -> Tree:
    joints = list(tree.joints)
    old = joints[number]
    kept = old.continuous and (lower, upper) == (old.lower, old.upper)
    unchanged = {"limits": (lower, upper) == (old.lower, old.upper), "max_speed": max_speed == old.max_speed}
    doubts = {key: doubt for key, doubt in old.doubts.items() if unchanged[key]}
    joints[number] = replace(
        old, lower=lower, upper=upper, max_speed=max_speed, continuous=kept, doubts=doubts
    )
    return replace(tree, joints=tuple(joints))


def _unused(name: str, taken: set[str]) -> str:
    while name in taken:
        name += "_"
    taken.add(name)
    return name


def _add_link(
    robot: Xml.Element,
    link: TreeLink,
    shape_uri: Callable[[str], str],
    collision_uri: Callable[[str], str],
    color: Color | None,
) -> None:
    element = Xml.SubElement(robot, "link", name=link.name)
    uses = {"visual": shape_uri, "collision": collision_uri if link.collision else shape_uri}
    for use, address in uses.items() if link.shapes else ():
        shape = Xml.SubElement(element, use)
        Xml.SubElement(Xml.SubElement(shape, "geometry"), "mesh", filename=address(link.name))
        if use == "visual" and color is not None:
            material = Xml.SubElement(shape, "material", name=f"{link.name} color")
            Xml.SubElement(material, "color", rgba=" ".join(f"{each:.4g}" for each in (*color, 1.0)))


def _add_joint(
    robot: Xml.Element, tree: Tree, joint: TreeJoint, parent: tuple[str, FloatArray], child: str
) -> None:
    rotary = joint.type is JointType.ROTARY
    doubtful = "limits" in joint.doubts
    kind = "continuous" if joint.continuous and not doubtful else "revolute" if rotary else "prismatic"
    element = Xml.SubElement(robot, "joint", name=joint.name, type=kind)
    parent_link, parent_link_to_joint = parent
    _add_origin(element, inverse(parent_link_to_joint) @ joint.joint_to_parent)
    Xml.SubElement(element, "parent", link=parent_link)
    Xml.SubElement(element, "child", link=child)
    Xml.SubElement(element, "axis", xyz=" ".join(map(_exact, joint.axis)))
    limits = {} if joint.continuous or doubtful else {"lower": joint.lower, "upper": joint.upper}
    limits["velocity"] = joint.max_speed
    # A doubtful value is written as it was read, so that it stays doubtful.
    for doubt in joint.doubts.values():
        limits |= doubt.stated
    Xml.SubElement(element, "limit", {key: _exact(each) for key, each in limits.items()}, effort="0")
    if joint.mimic is not None:
        Xml.SubElement(
            element,
            "mimic",
            joint=tree.joints[joint.mimic.leader].name,
            multiplier=_exact(joint.mimic.multiplier),
            offset=_exact(joint.mimic.offset),
        )


def _add_fixed(
    robot: Xml.Element, parent: str, child: str, child_to_parent: FloatArray, taken: set[str]
) -> None:
    joint = Xml.SubElement(robot, "joint", name=_unused(f"{child}_fixed", taken), type="fixed")
    _add_origin(joint, child_to_parent)
    Xml.SubElement(joint, "parent", link=parent)
    Xml.SubElement(joint, "child", link=child)


def _add_origin(element: Xml.Element, placement: FloatArray) -> None:
    Xml.SubElement(
        element,
        "origin",
        xyz=" ".join(_exact(value) for value in placement[:3, 3]),
        rpy=" ".join(_exact(value) for value in rotation_rpy(placement[:3, :3])),
    )


def _exact(value: float) -> str:
    """Format a number with all digits of a double, so that reading it gives the same number."""
    return f"{float(value):.17g}"
