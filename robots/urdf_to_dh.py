"""A robot by URDF as D-H rows: what the page of definitions edits, and `robot import --dh` writes.

The chain from the base to the tool becomes rows; what each joint moves becomes one link, its shapes
placed anew in the row's frame. The tool, the named frames and every shape stand where they stood, at all
joint positions. What D-H rows cannot say is told in notes.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import degrees
from typing import Any

import numpy as np

from robots.dh_rows import Row, axis_to_z, base_frame, row_placement, rows_as_made, rows_of_axes
from robots.errors import DescriptionError
from robots.joints import Joints, joints_of
from robots.kinematic_tree import BASE, Shape, Tree, are_neighbours, chain_to, named_frames, tree_of
from robots.poses import FloatArray, inverse, rotation_rpy
from robots.schema import BASE_LINK, TOOL_FRAME, JointType, UrdfDescription
from robots.urdf.read import moved

# Digits after the point that are kept of degrees and millimetres: 90 stays 90, and nothing moves by 1e-13 m.
_DIGITS = 12
# A tool that the rows put elsewhere by more than this is told [m], [rad].
_TOLD = 1e-9


@dataclass(frozen=True, eq=False)
class DhForm:
    """A robot as D-H rows.

    Attributes:
        values: Of its robot.toml, in degrees and millimetres, without meshes.
        shapes: Of each link by name, "base" first, in the link's frame [m].
        collision: What is checked in their place, likewise; none where that is the same.
        notes: What changed on the way, a sentence each.
    """

    values: dict[str, Any]
    shapes: Mapping[str, tuple[Shape, ...]]
    collision: Mapping[str, tuple[Shape, ...]]
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class _Chain:
    """The chain to the tool at position zero: everything in the URDF's base frame.

    Attributes:
        numbers: Joints of the chain.
        joints: (4, 4) every joint's frame.
        rows: One a joint of the chain.
        frames: (4, 4) of the frame in which the rows begin, then of each row's end.
        link_names: Of the rows' links.
    """

    tree: Tree
    numbers: tuple[int, ...]
    joints: list[FloatArray]
    rows: tuple[Row, ...]
    frames: list[FloatArray]
    link_names: tuple[str, ...]

    def place(self, joint: int) -> int:
        """Which of the links carries what a joint moves: 0 for the base."""
        while joint != BASE and joint not in self.numbers:
            joint = self.tree.joints[joint].parent
        return 0 if joint == BASE else self.numbers.index(joint) + 1

    def link_to_base(self, place: int) -> FloatArray:
        """(4, 4) of a link's frame. The base keeps its own, wherever the rows begin."""
        return np.eye(4) if place == 0 else self.frames[place]


def dh_form(description: UrdfDescription) -> DhForm:
    """The robot's chain to its tool as D-H rows.

    Raises:
        DescriptionError: If a joint of the chain follows another, which rows cannot say.
    """
    tree, joints = tree_of(description), joints_of(description)
    frames = named_frames(description)
    chain = _chain(description, tree, joints, frames[TOOL_FRAME][0])
    links = {link.name: link for link in tree.links}

    def on_row(link: str, frame_to_link: FloatArray) -> tuple[int, FloatArray]:
        place = chain.place(links[link].joint)
        link_to_base = _joint_frame(chain, links[link].joint) @ links[link].link_to_joint
        return place, inverse(chain.link_to_base(place)) @ link_to_base @ frame_to_link

    names = (BASE_LINK, *chain.link_names)
    values: dict[str, Any] = {"name": description.name, "title": description.title}
    values["provenance"] = description.provenance
    if not np.array_equal(chain.frames[0], np.eye(4)):
        values["base"] = {"pose": _pose_values(chain.frames[0])}
    values["joint"] = list(_joint_values(chain, joints))
    _, tool_to_last = on_row(*frames[TOOL_FRAME])
    values["tool"] = _pose_values(tool_to_last)
    values["frame"] = list(_frame_values(tree, frames, names, on_row))
    places = {name: chain.place(link.joint) for name, link in links.items()}
    values |= _whole_robot_values(description, chain, names, places)
    shapes: dict[str, list[Shape]] = {name: [] for name in names}
    checked: dict[str, list[Shape]] = {name: [] for name in names}
    own: set[str] = set()
    for each in tree.links:
        place, placement = on_row(each.name, np.eye(4))
        for some, found in ((each.shapes, shapes), (each.checked, checked)):
            found[names[place]] += [
                replace(shape, shape_to_link=placement @ shape.shape_to_link) for shape in some
            ]
        if each.collision:
            own.add(names[place])
    return DhForm(
        {key: value for key, value in values.items() if value not in ("", [], {})},
        {name: tuple(found) for name, found in shapes.items()},
        {name: tuple(found) if name in own else () for name, found in checked.items()},
        tuple(_notes(chain, joints, tool_to_last)),
    )


def _frame_values(
    tree: Tree,
    frames: Mapping[str, tuple[str, FloatArray]],
    names: Sequence[str],
    on_row: Callable[[str, FloatArray], tuple[int, FloatArray]],
) -> Iterator[dict[str, Any]]:
    """The named frames, and the links without a shape, each on the link of its row."""
    taken = {*names, TOOL_FRAME}
    bare = {link.name: (link.name, np.eye(4)) for link in tree.links if not link.shapes}
    # Of our own writer, which needs them where a row's link does not stand on its joint's axis.
    made_for_rows = {
        link.name
        for link in tree.links
        if link.joint != BASE
        and link.name.rstrip("_") == f"{tree.joints[link.joint].name}_axis"
        and np.array_equal(link.link_to_joint, np.eye(4))
        and not link.shapes
    }
    for name, (link, frame_to_link) in {**bare, **frames}.items():
        place, placement = on_row(link, frame_to_link)
        # A bare link that stands where its row's does is that row's own: nothing is lost without it.
        at_row = np.allclose(placement, np.eye(4), rtol=0, atol=1e-12)
        if name == TOOL_FRAME or name in made_for_rows or (at_row and name in bare):
            continue
        yield {"name": _unused(name, taken), "link": names[place], **_pose_values(placement)}


def _chain(description: UrdfDescription, tree: Tree, joints: Joints, tool_link: str) -> _Chain:
    end = next(link for link in tree.links if link.name == tool_link)
    numbers = chain_to(tree, end.joint)
    if not numbers:
        raise DescriptionError(description.source, [f"tool link {tool_link!r}: no joint moves it"])
    for number in numbers:
        if tree.joints[number].mimic is not None:
            name = tree.joints[number].name
            text = f"joint {name!r} follows another on the way to {tool_link!r}: D-H rows cannot say that"
            raise DescriptionError(description.source, [text])
    homes = dict(zip(joints.names, joints.home.tolist(), strict=True))
    placed: list[FloatArray] = []
    for number, joint in enumerate(tree.joints):
        parent = np.eye(4) if joint.parent == BASE else placed[joint.parent]
        # What is beside the chain stands at home, for ever.
        position = 0.0 if number in numbers else _home(tree, number, homes)
        placed.append(parent @ joint.joint_to_parent @ moved(joint.type, joint.axis, position))
    axes = [placed[number] @ axis_to_z(tree.joints[number]) for number in numbers]
    base = base_frame(axes[0])
    if not np.array_equal(base, np.eye(4)):
        # Of our own writer, for rows that begin elsewhere: its first theta (or d) is in the pose now.
        made = rows_as_made(tree, numbers, placed[numbers[0]])
        base = placed[numbers[0]] if made else base
    else:
        made = rows_as_made(tree, numbers, base)
    rows = tuple(row for row, _ in made) if made else rows_of_axes(base, axes)
    frames = [base]
    for row in rows:
        frames.append(frames[-1] @ row_placement(row))
    taken = {BASE_LINK, TOOL_FRAME}
    names = tuple(
        _unused(made[place][1].name if made else _first_link(tree, number), taken)
        for place, number in enumerate(numbers)
    )
    return _Chain(tree, numbers, placed, rows, frames, names)


def _home(tree: Tree, number: int, homes: Mapping[str, float]) -> float:
    joint = tree.joints[number]
    if joint.mimic is None:
        return homes[joint.name]
    return joint.mimic.multiplier * homes[tree.joints[joint.mimic.leader].name] + joint.mimic.offset


def _first_link(tree: Tree, number: int) -> str:
    found = (link.name for link in tree.links if link.joint == number)
    return next(found, tree.joints[number].name)


def _joint_frame(chain: _Chain, joint: int) -> FloatArray:
    return np.eye(4) if joint == BASE else chain.joints[joint]


def _unused(name: str, taken: set[str]) -> str:
    name = name if name not in taken else f"{name}_frame"
    while name in taken:
        name += "_"
    taken.add(name)
    return name


def _joint_values(chain: _Chain, joints: Joints) -> Iterator[dict[str, Any]]:
    rows = zip(chain.numbers, chain.rows, chain.link_names, strict=True)
    for number, row, link in rows:
        joint = chain.tree.joints[number]
        index = joints.names.index(joint.name)
        factor = degrees(1.0) if joint.type is JointType.ROTARY else 1000.0
        yield {
            "name": joint.name,
            "type": str(joint.type),
            "a": _mm(row.a),
            "alpha": _deg(row.alpha),
            "d": _mm(row.d),
            "theta": _deg(row.theta),
            "limits": [_said(joints.lower[index] * factor), _said(joints.upper[index] * factor)],
            "max_speed": _said(joints.max_speed[index] * factor),
            "max_acceleration": _said(joints.max_acceleration[index] * factor),
            "max_jerk": _said(joints.max_jerk[index] * factor),
            "home": _said(joints.home[index] * factor),
            "link": {"name": link},
        }


def _whole_robot_values(
    description: UrdfDescription, chain: _Chain, names: Sequence[str], places: Mapping[str, int]
) -> dict[str, Any]:
    """Constraints, views and pairs of links, as far as they still mean something."""
    on_chain = {chain.tree.joints[number].name for number in chain.numbers}
    said = description.model_dump(mode="json", by_alias=True)
    if description.units.length != "mm" or description.units.angle != "deg":
        said["constraint"], said["view"] = [], {}
    return {
        "constraint": [each for each in said["constraint"] if set(each["joints"]) <= on_chain],
        "view": said["view"],
        "collision": {"ignore": pairs} if (pairs := _ignored(description, chain.tree, names, places)) else {},
    }


def _ignored(
    description: UrdfDescription, tree: Tree, names: Sequence[str], places: Mapping[str, int]
) -> list[list[str]]:
    """Pairs of rows' links that the robot.toml or an SRDF leaves out.

    A row's link may be made of several: then all pairs of these are left out, or one joint apart.
    """
    shaped = [link for link in tree.links if link.checked]
    said = {frozenset(pair) for pair in description.collision.ignore}
    said |= {frozenset(pair) for pair, _ in description.robot.ignored}
    checked: set[tuple[int, int]] = set()
    ignored: set[tuple[int, int]] = set()
    for one, other in combinations(shaped, 2):
        low, high = sorted((places[one.name], places[other.name]))
        if frozenset((one.name, other.name)) in said:
            ignored.add((low, high))
        elif not are_neighbours(tree, one.joint, other.joint):
            checked.add((low, high))
    # Rows that follow each other are ignored without a word.
    return [[names[low], names[high]] for low, high in sorted(ignored - checked) if high - low > 1]


def _notes(chain: _Chain, joints: Joints, tool_to_last: FloatArray) -> Iterator[str]:
    if not np.array_equal(chain.frames[0], np.eye(4)):
        yield "the first joint's axis is not the base's z: [base] pose says where the first row begins"
    beside = [joint.name for number, joint in enumerate(chain.tree.joints) if number not in chain.numbers]
    if beside:
        named = ", ".join(beside[:6]) + (f" and {len(beside) - 6} more" if len(beside) > 6 else "")
        yield f"not on the way to the tool, so no joints here, and still at home: {named}"
    distance, angle = _deviation(chain, joints, tool_to_last)
    if distance > _TOLD or angle > _TOLD:
        far = f"{distance * 1000:.2g} mm and {degrees(angle):.2g}°"
        yield f"axes that are nearly parallel are taken as parallel: the tool is up to {far} elsewhere"


def _deviation(chain: _Chain, joints: Joints, tool_to_last: FloatArray) -> tuple[float, float]:
    """How far the rows' tool gets from where the tree has it [m] and [rad], over some positions."""
    tree, random = chain.tree, np.random.default_rng(0)
    last_to_joint = inverse(chain.joints[chain.numbers[-1]]) @ chain.frames[-1]
    distance = angle = 0.0
    for _ in range(20):
        positions = dict(zip(joints.names, random.uniform(joints.lower, joints.upper), strict=True))
        by_tree, by_rows = np.eye(4), chain.frames[0]
        for number, row in zip(chain.numbers, chain.rows, strict=True):
            joint, position = tree.joints[number], float(positions[tree.joints[number].name])
            by_tree = by_tree @ joint.joint_to_parent @ moved(joint.type, joint.axis, position)
            by_rows = by_rows @ moved(joint.type, np.array([0.0, 0.0, 1.0]), position) @ row_placement(row)
        apart = (by_tree @ last_to_joint - by_rows) @ tool_to_last
        distance = max(distance, float(np.linalg.norm(apart[:3, 3])))
        # The chord of a small turn is the turn.
        angle = max(angle, float(np.linalg.norm(apart[:3, :3])) / np.sqrt(2.0))
    return distance, angle


def _pose_values(placement: FloatArray) -> dict[str, list[float]]:
    xyz = [_mm(value) for value in placement[:3, 3]]
    return {"xyz": xyz, "rpy": [_deg(angle) for angle in rotation_rpy(placement[:3, :3])]}


def _mm(metres: float) -> float:
    return _clean(metres * 1000.0)


def _deg(radians: float) -> float:
    return _clean(degrees(radians))


def _clean(number: float) -> float:
    return round(float(number), _DIGITS) + 0.0  # no minus zero


def _said(number: float) -> float:
    """A limit without what the URDF's own rounding left on it: 360, not 360.000000000024."""
    return round(float(number), 9) + 0.0
