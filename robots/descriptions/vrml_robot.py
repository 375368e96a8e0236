"""Reader of robots in VRML: the Humanoid, Joint and Segment PROTOs of OpenHRP and Choreonoid, after H-Anim.

    Humanoid    humanoidBody [ Joint ]
    Joint       translation, rotation: its frame in its parent's; jointType, jointAxis, jointId,
                llimit, ulimit, lvlimit, uvlimit, children [ Joint or Segment ]
    Segment     children: the link's shapes

In SI, as OpenHRP. `robots.shapes.files.vrml.drawing` reads such a file as a shape with all joints at zero.
"""

import re
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from robots.descriptions.urdf.limits import REACH, SPEED, probable_range, probable_speed
from robots.kinematics.kinematic_tree import BASE, FloatArray, Shape, Tree, TreeJoint, TreeLink
from robots.schema.errors import ShapeError
from robots.schema.robot_toml import JointType
from robots.shapes.files.vrml.drawing import Drawing
from robots.shapes.files.vrml.files import Files
from robots.shapes.files.vrml.parser import MAX_DEPTH, Node
from robots.shapes.files.vrml.protos import found_proto, instance
from robots.shapes.files.vrml.values import nodes_of, number, numbers, strings, transform_matrix
from robots.shapes.geometry import Geometry

_TYPES = {
    "rotate": JointType.ROTARY,
    "revolute": JointType.ROTARY,
    "slide": JointType.PRISMATIC,
    "prismatic": JointType.PRISMATIC,
}
_CHAIN = ("Humanoid", "Joint", "Segment")
_AXES = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}
_FARTHEST = 1e9  # [m]


@dataclass(frozen=True, eq=False)
class VrmlRobot:
    """The robot in a file.

    Attributes:
        name: The name of its Humanoid in the file.
        notes: Oddities and how they were read, a sentence each.
    """

    name: str
    tree: Tree
    notes: tuple[str, ...] = ()


def read_vrml_robot(path: Path, *, within: Path | None = None) -> VrmlRobot:
    """Read the robot in a VRML file: joints in the order of jointId, and the shapes of its links.

    Args:
        within: Read only files below this folder; others count as missing.

    Raises:
        ShapeError: If the file cannot be read, or has no movable joint or an invalid one.
    """
    files = Files(within)
    reading = _Reading(Drawing(files), path if within is None else path.resolve())
    for node in files.scene(reading.path).nodes:
        reading.node(node, BASE, np.eye(4), 0)
    if not reading.joints:
        raise ShapeError(path, "holds no robot: no Joint with a jointType of 'rotate' or 'slide'")
    reading.drawing.warn_of_skipped()
    tree = reading.tree()
    return VrmlRobot(reading.name or path.stem, tree, (*files.warnings(), *reading.notes))


@dataclass
class _Reading:
    drawing: Drawing
    path: Path
    name: str = ""
    notes: list[str] = field(default_factory=list)
    joints: list[TreeJoint] = field(default_factory=list)
    ids: list[int] = field(default_factory=list)
    links: list[TreeLink] = field(default_factory=list)
    names: set[str] = field(default_factory=set)
    known: dict[Node, bool] = field(default_factory=dict)

    def node(self, node: Node, joint: int, placement: FloatArray, depth: int) -> None:
        """Read a node at a (4, 4) placement on a joint."""
        if depth > MAX_DEPTH:
            raise node.error(f"nested deeper than {MAX_DEPTH}")
        if np.abs(placement).max() > _FARTHEST:
            raise node.error(f"is more than {_FARTHEST:g} m away")
        found = _expand_protos(node)
        if found is None:
            return
        if found.type == "Humanoid":
            self.name = self.name or " ".join(strings(found, "name")) or found.name
            below = placement @ transform_matrix(found)
            for child in nodes_of(found, "humanoidBody"):
                self.node(child, joint, below, depth + 1)
        elif found.type == "Joint":
            self.joint(found, joint, placement, depth)
        elif found.type == "Segment":
            self.link(found.name or "link", [found], joint, placement, even_bare=True)
        elif self.holds_joint(found, depth):
            below = placement @ transform_matrix(found) if found.type == "Transform" else placement
            for child in nodes_of(found, "children"):
                self.node(child, joint, below, depth + 1)
        else:
            name = "base" if joint == BASE else self.joints[joint].name
            self.link(f"{name}_shape", [node], joint, placement)

    def holds_joint(self, node: Node, depth: int) -> bool:
        """Return whether a Humanoid, Joint or Segment is below a node."""
        if node not in self.known:
            self.known[node] = depth <= MAX_DEPTH and any(
                found is not None and (found.type in _CHAIN or self.holds_joint(found, depth + 1))
                for found in map(_expand_protos, nodes_of(node, "children"))
            )
        return self.known[node]

    def joint(self, node: Node, parent: int, placement: FloatArray, depth: int) -> None:
        kind = (strings(node, "jointType") or [""])[0]
        placed = placement @ transform_matrix(node)
        if np.abs(placed).max() > _FARTHEST or not np.allclose(placed[:3, :3] @ placed[:3, :3].T, np.eye(3)):
            raise node.error("is scaled or far away; a joint's frame can only be moved and rotated")
        if kind in _TYPES:
            limits = self.limits(node, _TYPES[kind])
            if limits is not None:
                self.joints.append(self.moving(node, _TYPES[kind], parent, placed, limits))
                self.ids.append(int(number(node, "jointId", -1.0)))
                parent, placed = len(self.joints) - 1, np.eye(4)
        elif kind == "free" and parent != BASE:
            raise node.error("jointType 'free' on another joint; only a robot's root can be free")
        elif kind not in ("fixed", "free"):
            node.warn(f"jointType {kind[:40]!r} is not {', '.join(_TYPES)}, fixed or free; taken as fixed")
        count = len(self.links)
        for child in nodes_of(node, "children"):
            self.node(child, parent, placed, depth + 1)
        if parent != BASE and not any(link.joint == parent for link in self.links[count:]):
            self.link(f"{self.joints[parent].name}_link", [], parent, placed, even_bare=True)

    def moving(
        self, node: Node, kind: JointType, parent: int, placed: FloatArray, limits: tuple[float, float]
    ) -> TreeJoint:
        speeds = [
            abs(float(values[0]))
            for name in ("uvlimit", "lvlimit")
            if len(values := numbers(node, name, [])) and values[0]
        ]
        known = bool(len(numbers(node, "ulimit", [])))
        lower, upper, doubt = probable_range(kind, *limits) if known else (*limits, None)
        speed, doubtful_speed = probable_speed(kind, min(speeds, default=SPEED[kind]), doubt)
        doubts = {"limits": doubt, "max_speed": doubtful_speed}
        return TreeJoint(
            name=self.unique(node.name or " ".join(strings(node, "name")) or f"joint{len(self.joints) + 1}"),
            type=kind,
            parent=parent,
            joint_to_parent=placed,
            axis=_axis(node),
            lower=lower,
            upper=upper,
            max_speed=speed,
            continuous=kind is JointType.ROTARY and (not known or (doubt is not None and doubt.assumed)),
            doubts={key: each for key, each in doubts.items() if each is not None},
        )

    def limits(self, node: Node, kind: JointType) -> tuple[float, float] | None:
        """Return the lower and upper limit; None if they are equal, so that the joint cannot move."""
        lower, upper = numbers(node, "llimit", []), numbers(node, "ulimit", [])
        if not len(lower) or not len(upper):
            node.warn(f"no llimit and ulimit; {-REACH[kind]:.4g} to {REACH[kind]:.4g} is taken")
            return -REACH[kind], REACH[kind]
        low, high = float(lower[0]), float(upper[0])
        if low > high:
            raise node.error(f"llimit {low:g} is above ulimit {high:g}; swap them")
        if low == high:
            node.warn(f"llimit and ulimit are both {low:g}; the joint is fixed at zero")
            return None
        return low, high

    def link(
        self, name: str, nodes: list[Node], joint: int, placement: FloatArray, *, even_bare: bool = False
    ) -> None:
        drawing, first, first_wire = self.drawing, len(self.drawing.parts), len(self.drawing.wires)
        for node in nodes:
            drawing.draw(node, np.eye(4), (self.path, self.path.resolve()))
        geometry = Geometry(tuple(drawing.parts[first:]), wires=tuple(drawing.wires[first_wire:]))
        shapes = (Shape(geometry, np.eye(4)),) if geometry.parts or geometry.wires else ()
        if not shapes and not even_bare:
            return
        self.links.append(TreeLink(self.unique(name), joint, placement, shapes))

    def unique(self, name: str) -> str:
        """Return an unused name that is valid in keys and file names."""
        safe = re.sub(r"[^A-Za-z0-9_.-]", "_", name)
        safe = safe if safe[0].isalnum() else f"n{safe}"
        number, found = 2, safe
        while found in self.names:
            found, number = f"{safe}_{number}", number + 1
        self.names.add(found)
        return found

    def tree(self) -> Tree:
        """Return the tree with the joints in the order of their jointId, the base's link first."""
        order = sorted(range(len(self.joints)), key=lambda joint: (self.ids[joint] < 0, self.ids[joint]))
        rank = {joint: place for place, joint in enumerate(order)} | {BASE: BASE}
        if any(rank[joint.parent] > rank[number] for number, joint in enumerate(self.joints)):
            self.notes.append("a jointId is lower than its parent's; joints are in the file's order")
            order = list(range(len(self.joints)))
            rank = {joint: joint for joint in (BASE, *order)}
        links = [replace(link, joint=rank[link.joint]) for link in self.links]
        if not any(link.joint == BASE for link in links):
            links.insert(0, TreeLink(self.unique("base"), BASE, np.eye(4)))
        links.sort(key=lambda link: link.joint != BASE)
        joints = [replace(self.joints[old], parent=rank[self.joints[old].parent]) for old in order]
        return Tree(tuple(joints), tuple(links))


def _expand_protos(node: Node) -> Node | None:
    """Expand a node's PROTOs, down to a Humanoid, Joint or Segment with its defaults if it is one."""
    step: Node | None = node
    for _ in range(MAX_DEPTH):
        if step is None or step.proto is None:
            return step
        if step.type in _CHAIN:
            definition = found_proto(step.proto)
            defaults = definition.defaults if definition is not None else {}
            return replace(step, fields=defaults | step.fields, proto=None)
        step = instance(step, step.proto)
    raise node.error("a PROTO that leads back to itself")


def _axis(node: Node) -> FloatArray:
    value = node.fields.get("jointAxis")
    words = strings(node, "jointAxis")
    if words:
        if words[0].upper() not in _AXES:
            raise node.error(f"jointAxis {words[0][:40]!r}; it takes X, Y, Z or three numbers")
        return np.array(_AXES[words[0].upper()])
    axis = numbers(node, "jointAxis", [0.0, 0.0, 1.0], 3) if value is not None else np.array([0.0, 0.0, 1.0])
    length = float(np.linalg.norm(axis))
    if length == 0:
        raise node.error("jointAxis is 0 0 0; it takes a direction")
    unit: FloatArray = axis / length
    return unit
