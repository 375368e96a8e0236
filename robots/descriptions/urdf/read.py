"""Reader of URDF: joints and links as a tree.

The interpretation is that of ROS's `urdf` and of Pinocchio. Names are made safe for keys and files. A note
reports each irregularity that could be handled. Inertia, transmissions and plug-ins are ignored.

Source: https://wiki.ros.org/urdf/XML.
"""

import re
import xml.etree.ElementTree as Xml
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from robots.descriptions.urdf.files import Resolve
from robots.descriptions.urdf.limits import REACH, probable_range, probable_speed
from robots.descriptions.urdf.shapes import Shapes
from robots.descriptions.urdf.values import WrongElement, numbers, origin, quoted
from robots.kinematics.kinematic_tree import BASE, Doubt, Mimic, Tree, TreeJoint, TreeLink
from robots.schema.errors import DescriptionError
from robots.schema.poses import FloatArray, axis_rotation
from robots.schema.robot_toml import JointType
from robots.schema.xml_text import XmlError, read_xml

MOST_URDF_BYTES = 20_000_000
_MOST_LINKS = 2_000
_TYPES = {"revolute": JointType.ROTARY, "continuous": JointType.ROTARY, "prismatic": JointType.PRISMATIC}


@dataclass(frozen=True, eq=False)
class UrdfRobot:
    """The robot in a URDF.

    Attributes:
        name: The name in the file.
        notes: Irregularities and how they were handled, a sentence each.
        missing: Shape files that were not found, as named in the URDF.
        unchecked: Missing files that a collision check would use.
        ignored: Pairs of links that an SRDF excludes from checks, and the SRDF's file name.
    """

    name: str
    tree: Tree
    notes: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()
    unchecked: tuple[str, ...] = ()
    ignored: tuple[tuple[tuple[str, str], str], ...] = ()


def read_urdf(data: bytes | str, source: Path, *, resolve: Resolve) -> UrdfRobot:
    """Return the robot in a URDF.

    Args:
        data: Its text, or its bytes in its own encoding.
        source: Name of the file for error messages.
        resolve: Returns the file for an address in the URDF, or None if there is none.

    Raises:
        DescriptionError: If it is not a URDF of an arm; the text names the element and what it must be.
    """
    try:
        root, notes = _root(data)
        robot = _Reading(root, resolve).robot()
        return replace(robot, notes=(*notes, *robot.notes))
    except WrongElement as error:
        raise DescriptionError(source, [str(error)]) from None


def _root(data: bytes | str) -> tuple[Xml.Element, tuple[str, ...]]:
    if len(data) > MOST_URDF_BYTES:
        raise WrongElement(f"has {len(data):,} bytes; at most {MOST_URDF_BYTES:,} are read")
    try:
        root, notes = read_xml(data)
    except XmlError as error:
        raise WrongElement(str(error)) from None
    if any("xacro" in element.tag or any("${" in value for value in element.attrib.values())
           for element in root.iter() if isinstance(element.tag, str)):  # fmt: skip
        raise WrongElement(_XACRO)
    if root.tag != "robot":
        raise WrongElement(f"<{root.tag}>: a URDF's outermost element must be <robot>")
    return root, notes


_XACRO = "is xacro; convert it to a URDF first: xacro robot.xacro > robot.urdf"


class _Reading:
    """The state of reading one file."""

    def __init__(self, root: Xml.Element, resolve: Resolve) -> None:
        self.root = root
        self.notes: list[str] = []
        self.links = _by_name(root, "link")
        self.joints = _by_name(root, "joint")
        self.link_names = self._safe_names("link", self.links)
        self.joint_names = self._safe_names("joint", self.joints)
        self.shapes = Shapes(root, resolve)
        self.tree_joints: list[TreeJoint] = []
        self.tree_links: list[TreeLink] = []
        # Positions of the joints that cannot move, and numbers in the tree of the joints that can.
        self.fixed_positions: dict[str, float] = {}
        self.numbers: dict[str, int] = {}

    def robot(self) -> UrdfRobot:
        children = self._children()
        child_links = {child for joints in children.values() for _, child in joints}
        roots = [name for name in self.links if name not in child_links]
        if not self.links:
            raise WrongElement("has no <link>")
        if len(self.links) > _MOST_LINKS:
            raise WrongElement(f"has {len(self.links):,} links; at most {_MOST_LINKS:,} are read")
        if len(roots) > 1:
            raise WrongElement(
                f"links {_listed(roots)}: more than one link has no parent joint; a robot has one root"
            )
        if not roots:
            raise WrongElement(
                f"joint {next(iter(self.joints))!r}: the links form a cycle; a robot has one root"
            )
        self._walk(roots[0], children)
        if len(self.tree_links) < len(self.links):
            reached = {link.name for link in self.tree_links}
            lost = [name for name in self.links if self.link_names[name] not in reached]
            raise WrongElement(f"links {_listed(lost)}: form a cycle; a robot is a tree")
        tree = Tree(tuple(self._followers()), tuple(self.tree_links))
        if not tree.free:
            raise WrongElement("has no movable joint; an arm has at least one")
        notes = (*self.notes, *self.shapes.notes)
        name = self.root.get("name") or "robot"
        return UrdfRobot(name, tree, notes, tuple(self.shapes.missing), tuple(self.shapes.unchecked))

    def _safe_names(self, kind: str, elements: Mapping[str, Xml.Element]) -> dict[str, str]:
        """Return for each name a variant that is valid in keys, file names and frames."""
        safe: dict[str, str] = {}
        for name in elements:
            changed = re.sub(r"[^A-Za-z0-9_.-]", "_", name)
            changed = changed if changed[0].isalnum() else f"{kind}{changed}"
            while changed != name and (changed in elements or changed in safe.values()):
                changed += "_"
            if changed != name:
                self.notes.append(f"{kind} {name!r} is called {changed!r} here")
            safe[name] = changed
        return safe

    def _children(self) -> dict[str, list[tuple[str, str]]]:
        """Return for each link its child joints and their child links, in file order."""
        children: dict[str, list[tuple[str, str]]] = {}
        carried: dict[str, str] = {}
        for name, joint in self.joints.items():
            ends = []
            for end in ("parent", "child"):
                link = _child(joint, end, f"joint {name!r}").get("link", "")
                if link not in self.links:
                    raise WrongElement(f"joint {name!r} {end} link {link!r}: no such link")
                ends.append(link)
            if ends[1] in carried:
                raise WrongElement(
                    f"joint {name!r} child link {ends[1]!r}: joint {carried[ends[1]]!r} already has it"
                )
            carried[ends[1]] = name
            children.setdefault(ends[0], []).append((name, ends[1]))
        return children

    def _walk(self, root: str, children: Mapping[str, list[tuple[str, str]]]) -> None:
        """Add links and joints to the tree in depth-first order."""
        waiting: list[tuple[str, str | None, int, FloatArray]] = [(root, None, BASE, np.eye(4))]
        while waiting:
            link, joint, number, link_to_joint = waiting.pop()
            if joint is not None:
                number, link_to_joint = self._step(joint, number, link_to_joint)
            shapes = self.shapes.of(self.links[link], link)
            self.tree_links.append(TreeLink(self.link_names[link], number, link_to_joint, *shapes))
            waiting += [
                (child, name, number, link_to_joint) for name, child in reversed(children.get(link, []))
            ]

    def _step(self, name: str, parent: int, link_to_joint: FloatArray) -> tuple[int, FloatArray]:
        """Add a joint; return the number of the joint that moves its link, and the link's frame in it.

        A joint that cannot move is not added: its parent's number is returned.
        """
        element = self.joints[name]
        what = f"joint {name!r}"
        placement = link_to_joint @ origin(element, what)
        kind = element.get("type", "")
        if kind == "fixed":
            return parent, placement
        if kind not in _TYPES:
            known = "revolute, continuous, prismatic and fixed"
            raise WrongElement(f"{what} type {kind!r}: is not supported; use {known}")
        axis = self._axis(element, what)
        lower, upper, speed, doubts = self._limits(element, what, kind)
        if lower == upper and element.find("mimic") is None:
            self.notes.append(f"{what}: its limits are equal, so it is fixed at {lower:g}")
            self.fixed_positions[name] = lower
            return parent, placement @ moved(_TYPES[kind], axis, lower)
        joint = TreeJoint(
            name=self.joint_names[name],
            type=_TYPES[kind],
            parent=parent,
            joint_to_parent=placement,
            axis=axis,
            lower=lower,
            upper=upper,
            max_speed=speed,
            continuous=kind == "continuous"
            or (kind == "revolute" and "limits" in doubts and doubts["limits"].assumed),
            doubts=doubts,
        )
        self.numbers[name] = len(self.tree_joints)
        self.tree_joints.append(joint)
        return self.numbers[name], np.eye(4)

    def _axis(self, element: Xml.Element, what: str) -> FloatArray:
        axis = element.find("axis")
        vector = np.array(
            [1.0, 0.0, 0.0] if axis is None else numbers(axis, "xyz", 3, f"{what} axis", "1 0 0")
        )
        length = float(np.linalg.norm(vector))
        if length < 1e-9:
            raise WrongElement(f"{what} axis xyz = {quoted(axis, 'xyz')}: is zero; it must have a direction")
        # A vector of length one keeps exactly the digits of the file.
        return vector if length == 1.0 else vector / length

    def _limits(
        self, element: Xml.Element, what: str, kind: str
    ) -> tuple[float, float, float, dict[str, Doubt]]:
        """Return lower and upper limit and speed, and the doubts about those that the file states."""
        limit = element.find("limit")
        if limit is None and kind != "continuous":
            raise WrongElement(f"{what}: has no <limit lower upper velocity>; a {kind} joint needs one")
        (lower,), (upper,), (speed,) = (
            numbers(limit, key, 1, f"{what} limit", "0") for key in ("lower", "upper", "velocity")
        )
        type_, doubt = _TYPES[kind], None
        if kind == "continuous":
            lower, upper = -REACH[type_], REACH[type_]
        elif lower > upper:
            raise WrongElement(
                f"{what} limit lower = {lower:g}, upper = {upper:g}: lower must be less than upper"
            )
        # The limits of a joint that follows another one, or that cannot move, are not used.
        elif element.find("mimic") is None and not lower == upper != 0:
            stated = (
                value if limit is not None and key in limit.attrib else None
                for key, value in (("lower", lower), ("upper", upper))
            )
            lower, upper, doubt = probable_range(type_, *stated)
        probable, doubtful_speed = probable_speed(type_, speed, doubt)
        doubts = {"limits": doubt, "max_speed": doubtful_speed}
        found = {key: each for key, each in doubts.items() if each is not None}
        # URDF demands no <limit> of a continuous joint, and that of a mimic joint is not used.
        unused = element.find("mimic") is not None or (kind == "continuous" and speed <= 0)
        if unused and "max_speed" in found:
            self.notes.append(f"{what}: {found.pop('max_speed').text}")
        return lower, upper, probable, found

    def _followers(self) -> Iterator[TreeJoint]:
        """Yield the joints; a mimic joint refers to the free joint at the end of its chain."""
        free = [name for name in self.numbers if self.joints[name].find("mimic") is None]
        for name, number in self.numbers.items():
            joint = self.tree_joints[number]
            if self.joints[name].find("mimic") is None:
                yield joint
                continue
            leader, multiplier, offset = self._followed(name)
            if leader in self.fixed_positions and free:
                offset += multiplier * self.fixed_positions[leader]
                leader, multiplier = free[0], 0.0
            yield replace(joint, mimic=Mimic(self.numbers[leader], multiplier, offset))

    def _followed(self, name: str) -> tuple[str, float, float]:
        what, multiplier, offset = f"joint {name!r} mimic", 1.0, 0.0
        seen = {name}
        while (mimic := self.joints[name].find("mimic")) is not None:
            leader = mimic.get("joint", "")
            if leader not in self.numbers and leader not in self.fixed_positions:
                raise WrongElement(f"{what} joint {leader!r}: no such movable joint")
            if leader in seen:
                raise WrongElement(f"{what} joint {leader!r}: follows itself")
            (factor,) = numbers(mimic, "multiplier", 1, what, "1")
            (shift,) = numbers(mimic, "offset", 1, what, "0")
            multiplier, offset = multiplier * factor, multiplier * shift + offset
            seen.add(leader)
            name = leader
            if leader in self.fixed_positions:
                break
        return name, multiplier, offset


def moved(kind: JointType, axis: FloatArray, position: float) -> FloatArray:
    """Return the (4, 4) motion of a joint's link at a position [rad] or [m]."""
    placement = np.eye(4)
    if kind is JointType.PRISMATIC:
        placement[:3, 3] = position * axis
        return placement
    placement[:3, :3] = axis_rotation(axis, position)
    return placement


def _by_name(root: Xml.Element, kind: str) -> dict[str, Xml.Element]:
    elements = root.findall(kind)
    for number, element in enumerate(elements):
        if not element.get("name"):
            raise WrongElement(f"<{kind}> number {number + 1}: has no name")
    for name, count in Counter(element.get("name", "") for element in elements).items():
        if count > 1:
            raise WrongElement(f"{kind} {name!r}: {count} have that name; names must be unique")
    return {element.get("name", ""): element for element in elements}


def _child(element: Xml.Element, tag: str, what: str) -> Xml.Element:
    child = element.find(tag)
    if child is None:
        raise WrongElement(f"{what}: has no <{tag}>")
    return child


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - 4} more" if len(names) > 4 else ""
    return ", ".join(map(repr, names[:4])) + more
