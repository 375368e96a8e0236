"""Descriptions as URDF.

URDF puts a link's frame on its joint's axis; a D-H link's frame is elsewhere. So each joint moves
a bare link "<joint>_axis", and the link proper hangs on that by a fixed joint: every link, the tool
and the named frames keep the names and the frames that they have everywhere else.
"""

import xml.etree.ElementTree as Xml
from collections.abc import Callable

import numpy as np

from robots.joints import FloatArray, angle_factor, joints_of, length_factor
from robots.poses import dh_fixed_part, pose_matrix, rotation_rpy, rpy_rotation
from robots.schema import BASE_LINK, TOOL_FRAME, JointType, RobotDescription


def glb_beside(link: str) -> str:
    """The mesh of a link, as a file in the folder meshes beside the URDF."""
    return f"meshes/{link}.glb"


def to_urdf(description: RobotDescription, *, mesh_uri: Callable[[str], str] = glb_beside) -> str:
    """The description as URDF text, with the meshes that `robots.glb.link_meshes` gives.

    Args:
        mesh_uri: Address of a link's GLB by the link's name.
    """
    robot = Xml.Element("robot", name=description.name)
    robot.append(
        Xml.Comment(" Efforts are not known: 0. Meshes are in metres, z upwards, in their link's frame. ")
    )
    for name, body in description.bodies.items():
        link = Xml.SubElement(robot, "link", name=name)
        if body.mesh is not None:
            for element in ("visual", "collision"):
                geometry = Xml.SubElement(Xml.SubElement(link, element), "geometry")
                Xml.SubElement(geometry, "mesh", filename=mesh_uri(name))
    _add_joints(robot, description)
    frames = {TOOL_FRAME: (description.link_names[-1], pose_matrix(description.tool, description.units))}
    frames |= {
        frame.name: (frame.link, pose_matrix(frame, description.units)) for frame in description.frames
    }
    for name, (link_name, frame_to_link) in frames.items():
        Xml.SubElement(robot, "link", name=name)
        _add_fixed(robot, link_name, name, frame_to_link)
    Xml.indent(robot)
    return '<?xml version="1.0"?>\n' + Xml.tostring(robot, encoding="unicode") + "\n"


def _add_joints(robot: Xml.Element, description: RobotDescription) -> None:
    joints = joints_of(description)
    length, angle = length_factor(description.units), angle_factor(description.units)
    parent = BASE_LINK
    for index, row in enumerate(description.joints):
        rotary = row.type is JointType.ROTARY
        d, a, alpha = row.d * length, row.a * length, row.alpha * angle
        origin = np.eye(4)
        origin[:3, :3] = rpy_rotation(0.0, 0.0, row.theta * angle)
        if not rotary:
            origin[2, 3] = d
        axis_link = f"{row.name}_axis"
        Xml.SubElement(robot, "link", name=axis_link)
        joint = Xml.SubElement(robot, "joint", name=row.name, type="revolute" if rotary else "prismatic")
        _add_origin(joint, origin)
        Xml.SubElement(joint, "parent", link=parent)
        Xml.SubElement(joint, "child", link=axis_link)
        Xml.SubElement(joint, "axis", xyz="0 0 1")
        Xml.SubElement(
            joint,
            "limit",
            lower=_exact(joints.lower[index]),
            upper=_exact(joints.upper[index]),
            velocity=_exact(joints.max_speed[index]),
            effort="0",
        )
        _add_fixed(robot, axis_link, row.link_name, dh_fixed_part(d if rotary else 0.0, a, alpha))
        parent = row.link_name


def _add_fixed(robot: Xml.Element, parent: str, child: str, child_to_parent: FloatArray) -> None:
    joint = Xml.SubElement(robot, "joint", name=f"{child}_fixed", type="fixed")
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
    """All of a double's digits, so that nothing is lost on the way back."""
    return f"{float(value):.17g}"
