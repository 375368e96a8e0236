"""Tree of joints and links: the common form of D-H rows, URDF and VRML.

All in SI. A joint rotates about or moves along an axis through the origin of its frame, which is at
`joint_to_parent` at position zero. A link is fixed to a joint or to the base. Imports nothing heavier than
NumPy.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robots.schema.poses import dh_fixed_part, pose_matrix, rpy_rotation
from robots.schema.robot_toml import (
    BASE_LINK,
    TOOL_FRAME,
    Body,
    DhDescription,
    JointType,
    RobotDescription,
    UrdfDescription,
)
from robots.schema.units import angle_factor, length_factor
from robots.shapes.geometry import Color, Geometry

FloatArray = NDArray[np.float64]

BASE = -1

# Common names of the frame at the end of an arm, in order of preference.
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
        leader: Number of the followed joint, which is not a mimic joint itself.
    """

    leader: int
    multiplier: float
    offset: float


@dataclass(frozen=True)
class Doubt:
    """A value of a source that no arm has.

    Attributes:
        text: The value, why it is doubtful, and what is used in its place.
        stated: Attributes of URDF's <limit> that state it [rad] or [m], and per second.
        assumed: The value in its place is a default.
    """

    text: str
    stated: Mapping[str, float]
    assumed: bool = False


@dataclass(frozen=True, eq=False)
class TreeJoint:
    """A movable joint.

    Attributes:
        parent: Number of the parent joint, lower than the joint's own number; BASE for none.
        joint_to_parent: (4, 4) the joint's frame at position zero, in the parent joint's frame or the base's.
        axis: (3,) unit vector in the joint's frame.
        lower, upper: [rad] or [m].
        max_speed: [rad/s] or [m/s].
        mimic: The followed joint; a mimic joint is not one of the robot's joints.
        continuous: The source gives no limits; lower and upper are defaults.
        doubts: Doubts about the source, by the key of a robot.toml that settles each (limits, max_speed).
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
    doubts: Mapping[str, Doubt] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Shape:
    """A shape of a link: a file or a generated geometry.

    Attributes:
        source: A file, or a generated shape (a box, a cylinder, a sphere).
        shape_to_link: (4, 4) from the file's units and axes to the link's frame [m], including the scale.
        color: Colour of the materials named "paint", or of all materials if none has this name; None keeps
            the shape's colours.
        opacity: 0 to 1; None keeps the shape's opacity.
        in_stated_unit: Apply the unit that the file states, if any (COLLADA), and turn glTF's y up to z up.
        within: Read only files below this folder when the shape file names them; None: any folder.
    """

    source: Path | Geometry
    shape_to_link: FloatArray
    color: Color | None = None
    opacity: float | None = None
    in_stated_unit: bool = False
    within: Path | None = None


@dataclass(frozen=True, eq=False)
class TreeLink:
    """A link, or a frame without a shape.

    Attributes:
        joint: Number of the joint that moves the link; BASE: the link does not move.
        link_to_joint: (4, 4) the link's frame in that joint's frame or the base's.
        shapes: The drawn shapes; empty for a frame.
        collision: The shapes to check for collisions; empty: check `shapes`.
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
    """Joints from the base outwards, and links, the base first."""

    joints: tuple[TreeJoint, ...]
    links: tuple[TreeLink, ...]

    @property
    def free(self) -> tuple[int, ...]:
        """Numbers of the robot's joints: all but the mimic joints."""
        return tuple(number for number, joint in enumerate(self.joints) if joint.mimic is None)


def bare_links(tree: Tree, shaped: Collection[int]) -> tuple[int, ...]:
    """Return the numbers of the links that no collision check covers.

    A frame (`tool0`, `flange`) that is fixed to a link with a shape counts as covered.

    Args:
        shaped: Numbers of the links that have a shape.
    """
    covered = {tree.links[number].joint for number in shaped}
    return tuple(number for number, link in enumerate(tree.links) if link.joint not in covered)


def tree_of(description: RobotDescription) -> Tree:
    """Return the joints and links of a description in either form."""
    if isinstance(description, UrdfDescription):
        tree: Tree = description.robot.tree
        colors = {row.name: rgb(row.color) for row in description.links}
        tree = replace(tree, links=tuple(_painted(link, colors.get(link.name)) for link in tree.links))
    else:
        assert isinstance(description, DhDescription)
        tree = _tree_of_rows(description)
    return _confined(tree, description)


def _confined(tree: Tree, description: RobotDescription) -> Tree:
    """Return the tree with each shape file's references limited to its `folder_around`."""

    def confined(shape: Shape) -> Shape:
        source = shape.source
        return replace(shape, within=description.folder_around(source)) if isinstance(source, Path) else shape

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
    """Convert standard D-H rows to joints and link frames.

    Row 0 ends at the base's pose.

    joint i's placement = link frame of row i-1 (Trans(z, d) Trans(x, a) Rot(x, alpha)), then
        rotary:     Rot(z, theta), and the position rotates about z
        prismatic:  Rot(z, theta) Trans(z, d), and the position moves along z
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
    """Return a body's drawn shapes and its separate collision shapes."""
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
    """Parse "#rrggbb" to red, green and blue, 0 to 1."""
    red, green, blue = (int(color[start : start + 2], 16) / 255 for start in (1, 3, 5))
    return red, green, blue


def color_text(color: Color) -> str:
    """Format a colour as "#rrggbb"."""
    return "#" + "".join(f"{round(255 * part):02x}" for part in color)


def tool_frame(description: RobotDescription) -> tuple[str, FloatArray]:
    """Return the name of the link with the tool, and the tool's frame on it (4, 4) [m]."""
    if isinstance(description, UrdfDescription):
        link = description.tool.link or end_link(tree_of(description))
    else:
        assert isinstance(description, DhDescription)
        link = description.link_names[-1]
    return link, pose_matrix(description.tool, description.units)


def named_frames(description: RobotDescription) -> dict[str, tuple[str, FloatArray]]:
    """Return the link and the frame on it (4, 4) [m] of the tool and each named frame, by name."""
    return {TOOL_FRAME: tool_frame(description)} | {
        frame.name: (frame.link, pose_matrix(frame, description.units)) for frame in description.frames
    }


def end_link(tree: Tree) -> str:
    """Return an arm's end link: one with a common tool name, else the last link of the longest chain.

    Links behind a mimic joint do not count: they are the fingers of a gripper.
    """
    candidates = [
        link
        for link in tree.links
        if all(tree.joints[number].mimic is None for number in chain_to(tree, link.joint))
    ]
    by_name = {link.name: link for link in candidates}
    for wanted in _TOOL_NAMES:
        found = [name for name in by_name if name == wanted or name.endswith(f"_{wanted}")]
        if found:
            return max(found, key=lambda name: len(chain_to(tree, by_name[name].joint)))
    depths = [len(chain_to(tree, link.joint)) for link in candidates]
    deepest = max(depths)
    return [link.name for link, depth in zip(candidates, depths, strict=True) if depth == deepest][-1]


def position_factors(tree: Tree) -> tuple[FloatArray, FloatArray]:
    """Return (all, n) factors and (all,) offsets from the robot's joint positions to those of all joints."""
    factors, offsets = np.zeros((len(tree.joints), len(tree.free))), np.zeros(len(tree.joints))
    for number, joint in enumerate(tree.joints):
        leader = number if joint.mimic is None else joint.mimic.leader
        factors[number, tree.free.index(leader)] = 1.0 if joint.mimic is None else joint.mimic.multiplier
        offsets[number] = 0.0 if joint.mimic is None else joint.mimic.offset
    return factors, offsets


def chain_to(tree: Tree, joint: int) -> tuple[int, ...]:
    """Return the numbers of the joints from the base to a joint, inclusive."""
    numbers: list[int] = []
    while joint != BASE:
        numbers.append(joint)
        joint = tree.joints[joint].parent
    return tuple(reversed(numbers))


def are_neighbours(tree: Tree, one: int, other: int) -> bool:
    """Return whether links on these joints are on the same joint, or one joint apart."""
    return one == other or any(
        joint != BASE and tree.joints[joint].parent == parent
        for joint, parent in ((one, other), (other, one))
    )
