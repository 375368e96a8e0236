"""An arm as a tree of joints and links, however it was described: what D-H rows, URDF and VRML come to.

All in SI. A joint turns about or moves along an axis through its own frame's origin; at position
zero that frame stands at `joint_to_parent`. A link hangs on a joint, or on the base, at a fixed place.
Nothing heavier than NumPy is imported.
"""

from collections.abc import Collection
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robots.meshes.mesh import Color, Mesh
from robots.poses import dh_fixed_part, pose_matrix, rpy_rotation
from robots.schema import (
    BASE_LINK,
    TOOL_FRAME,
    Body,
    DhDescription,
    JointType,
    RobotDescription,
    UrdfDescription,
)
from robots.units import angle_factor, length_factor

FloatArray = NDArray[np.float64]

BASE = -1

# What people call the frame at the end of an arm, the best first.
_TOOL_NAMES = (
    "tool",
    "tool0",
    "tcp",
    "hand_tcp",
    "ee_link",
    "tool_link",
    "tool_tip",
    "end_effector",
    "eef",
    "ee",
)


@dataclass(frozen=True)
class Mimic:
    """A joint that follows another: position = multiplier x leader's position + offset [rad] or [m].

    Attributes:
        leader: Number of the joint that it follows, one that follows none itself.
    """

    leader: int
    multiplier: float
    offset: float


@dataclass(frozen=True, eq=False)
class TreeJoint:
    """A joint that moves.

    Attributes:
        parent: Number of the joint that carries it, a lower one than its own; BASE for none.
        joint_to_parent: (4, 4) its frame at position zero, in the parent joint's frame (or the base's).
        axis: (3,) unit vector in its own frame.
        lower, upper: [rad] or [m].
        max_speed: [rad/s] or [m/s].
        mimic: The joint that it follows; such a joint is none of the robot's joints.
        continuous: Nothing stops it; lower and upper are ours.
    """

    name: str
    type: JointType
    parent: int
    joint_to_parent: FloatArray
    axis: FloatArray
    lower: float
    upper: float
    max_speed: float
    mimic: Mimic | None = None
    continuous: bool = False


@dataclass(frozen=True, eq=False)
class Shape:
    """Something that a link looks like: a mesh file, or a mesh made for it.

    Attributes:
        mesh: A file, or what was made (a box, a cylinder, a sphere).
        shape_to_link: (4, 4) from the file's units and axes to the link's frame [m]: scale and all.
        color: Of its materials named "paint", or of all where none is; none: its own.
        opacity: 0 to 1; none: its own.
        in_stated_unit: The file counts in the unit that it states, if it does (a URDF's COLLADA).
        within: Only files below this folder are read beside the mesh file; none: any place will do.
    """

    mesh: Path | Mesh
    shape_to_link: FloatArray
    color: Color | None = None
    opacity: float | None = None
    in_stated_unit: bool = False
    within: Path | None = None


@dataclass(frozen=True, eq=False)
class TreeLink:
    """A link, or a frame that stands on one.

    Attributes:
        joint: Number of the joint that moves it; BASE: it does not move.
        link_to_joint: (4, 4) its frame in that joint's frame (or the base's).
        shapes: What it looks like; none for a bare frame.
        collision: What is checked in place of `shapes`; none: `shapes` are checked.
    """

    name: str
    joint: int
    link_to_joint: FloatArray
    shapes: tuple[Shape, ...] = ()
    collision: tuple[Shape, ...] = ()

    @property
    def checked(self) -> tuple[Shape, ...]:
        """The shapes that a collision check uses."""
        return self.collision or self.shapes


@dataclass(frozen=True, eq=False)
class Tree:
    """Joints from the base outwards, and links, the base's own first."""

    joints: tuple[TreeJoint, ...]
    links: tuple[TreeLink, ...]

    @property
    def free(self) -> tuple[int, ...]:
        """Numbers of the joints that follow no other: the robot's joints."""
        return tuple(number for number, joint in enumerate(self.joints) if joint.mimic is None)


def bare_links(tree: Tree, shaped: Collection[int]) -> tuple[int, ...]:
    """Numbers of the links that no check covers.

    A bare frame (`tool0`, `flange`) that is fixed to a link with a shape is none of them.

    Args:
        shaped: Numbers of the links that have a shape.
    """
    covered = {tree.links[number].joint for number in shaped}
    return tuple(number for number, link in enumerate(tree.links) if link.joint not in covered)


def tree_of(description: RobotDescription) -> Tree:
    """The joints and links of a description, whichever its form."""
    if isinstance(description, UrdfDescription):
        tree: Tree = description.robot.tree
        colors = {row.name: rgb(row.color) for row in description.links}
        tree = replace(tree, links=tuple(_painted(link, colors.get(link.name)) for link in tree.links))
    else:
        assert isinstance(description, DhDescription)
        tree = _tree_of_rows(description)
    return _confined(tree, description)


def _confined(tree: Tree, description: RobotDescription) -> Tree:
    """The same tree; what its mesh files name is read from the robot's own folder only."""

    def confined(shape: Shape) -> Shape:
        mesh = shape.mesh
        return replace(shape, within=description.folder_around(mesh)) if isinstance(mesh, Path) else shape

    return replace(
        tree,
        links=tuple(
            replace(
                link,
                shapes=tuple(map(confined, link.shapes)),
                collision=tuple(map(confined, link.collision)),
            )
            for link in tree.links
        ),
    )


def _tree_of_rows(description: DhDescription) -> Tree:
    """How a standard D-H row becomes a joint and a link's frame.

    Row 0 ends at the base's pose.

    joint i's placement = link frame of row i-1 (Trans(z, d) Trans(x, a) Rot(x, alpha)), then
        rotary:     Rot(z, theta), and the variable turns about z
        prismatic:  Rot(z, theta) Trans(z, d), and the variable moves along z
    link i's frame      = joint i, then Trans(z, d) Trans(x, a) Rot(x, alpha)  (prismatic: without d)

    Source: Chen, Zhang, Xue 2001, section 3.2.
    """
    units = description.units
    length, angle = length_factor(units), angle_factor(units)
    links = [TreeLink(BASE_LINK, BASE, np.eye(4), *_shapes(description, description.base))]
    before = pose_matrix(description.base.pose, units)  # the end of row i-1 in joint i-1, or the base
    joints = []
    for number, row in enumerate(description.joints):
        rotary = row.type is JointType.ROTARY
        turn = np.eye(4)
        turn[:3, :3] = rpy_rotation(0.0, 0.0, row.theta * angle)
        placement = before @ turn if rotary else before @ turn @ dh_fixed_part(row.d * length, 0.0, 0.0)
        factor = angle if rotary else length
        joints.append(
            TreeJoint(
                name=row.name,
                type=row.type,
                parent=number - 1,
                joint_to_parent=placement,
                axis=np.array([0.0, 0.0, 1.0]),
                lower=row.limits[0] * factor,
                upper=row.limits[1] * factor,
                max_speed=row.max_speed * factor,
            )
        )
        before = dh_fixed_part(row.d * length if rotary else 0.0, row.a * length, row.alpha * angle)
        links.append(TreeLink(row.link_name, number, before, *_shapes(description, row.link)))
    return Tree(tuple(joints), tuple(links))


def _shapes(description: DhDescription, body: Body) -> tuple[tuple[Shape, ...], tuple[Shape, ...]]:
    """What a body looks like, and what is checked in its place."""
    scale = np.diag([body.mesh_scale, body.mesh_scale, body.mesh_scale, 1.0])
    placement = pose_matrix(body.mesh_pose, description.units) @ scale
    color = None if body.color is None else rgb(body.color)
    drawn, checked = description.mesh_path(body), description.collision_path(body)
    return (
        () if drawn is None else (Shape(drawn, placement, color),),
        () if checked is None else (Shape(checked, placement),),
    )


def _painted(link: TreeLink, color: Color | None) -> TreeLink:
    if color is None:
        return link
    return replace(link, shapes=tuple(replace(shape, color=color) for shape in link.shapes))


def rgb(color: str) -> Color:
    """Red, green and blue, 0 to 1, of "#rrggbb"."""
    red, green, blue = (int(color[start : start + 2], 16) / 255 for start in (1, 3, 5))
    return red, green, blue


def color_text(color: Color) -> str:
    """A colour as "#rrggbb"."""
    return "#" + "".join(f"{round(255 * part):02x}" for part in color)


def tool_frame(description: RobotDescription) -> tuple[str, FloatArray]:
    """Which link carries the tool, and the tool's frame on it (4, 4) [m]."""
    if isinstance(description, UrdfDescription):
        link = description.tool.link or end_link(tree_of(description))
    else:
        assert isinstance(description, DhDescription)
        link = description.link_names[-1]
    return link, pose_matrix(description.tool, description.units)


def named_frames(description: RobotDescription) -> dict[str, tuple[str, FloatArray]]:
    """The tool and the named frames: their link, and where they are on it (4, 4) [m]."""
    return {TOOL_FRAME: tool_frame(description)} | {
        frame.name: (frame.link, pose_matrix(frame, description.units)) for frame in description.frames
    }


def end_link(tree: Tree) -> str:
    """The link that is an arm's end: one with such a name, else the last of the longest chain.

    What joints move that follow others is a gripper's finger, not the end.
    """
    own = [
        link
        for link in tree.links
        if all(tree.joints[number].mimic is None for number in chain_to(tree, link.joint))
    ]
    by_name = {link.name: link for link in own}
    for wanted in _TOOL_NAMES:
        found = [name for name in by_name if name == wanted or name.endswith(f"_{wanted}")]
        if found:
            return max(found, key=lambda name: len(chain_to(tree, by_name[name].joint)))
    depths = [len(chain_to(tree, link.joint)) for link in own]
    deepest = max(depths)
    return [link.name for link, depth in zip(own, depths, strict=True) if depth == deepest][-1]


def position_factors(tree: Tree) -> tuple[FloatArray, FloatArray]:
    """Positions of all joints from those of the robot's own: (all, n) factors and (all,) offsets."""
    factors, offsets = np.zeros((len(tree.joints), len(tree.free))), np.zeros(len(tree.joints))
    for number, joint in enumerate(tree.joints):
        leader = number if joint.mimic is None else joint.mimic.leader
        factors[number, tree.free.index(leader)] = 1.0 if joint.mimic is None else joint.mimic.multiplier
        offsets[number] = 0.0 if joint.mimic is None else joint.mimic.offset
    return factors, offsets


def chain_to(tree: Tree, joint: int) -> tuple[int, ...]:
    """Numbers of the joints between the base and what a joint moves, from the base on."""
    numbers: list[int] = []
    while joint != BASE:
        numbers.append(joint)
        joint = tree.joints[joint].parent
    return tuple(reversed(numbers))


def are_neighbours(tree: Tree, one: int, other: int) -> bool:
    """Return whether links on these joints are on the same one, or one joint apart."""
    return one == other or any(
        joint != BASE and tree.joints[joint].parent == parent
        for joint, parent in ((one, other), (other, one))
    )
