"""Conversion of a URDF robot to D-H rows, for the robot definition page and `robot import --dh`.

The chain from the base to the tool becomes rows. The links behind each joint become one link, with their
shapes in the row's frame. The tool, the named frames and all shapes keep their places at all joint positions.
Notes list everything that D-H rows cannot describe.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import degrees
from typing import Any

import numpy as np

from robots.descriptions.urdf.read import moved
from robots.kinematics.dh_rows import Row, axis_to_z, base_frame, original_rows, row_placement, rows_of_axes
from robots.kinematics.joints import Joints, joints_of
from robots.kinematics.kinematic_tree import (
    BASE,
    Shape,
    Tree,
    are_neighbours,
    chain_to,
    named_frames,
    tree_of,
)
from robots.schema.errors import DescriptionError
from robots.schema.poses import FloatArray, inverse, rotation_rpy
from robots.schema.robot_toml import BASE_LINK, TOOL_FRAME, JointType, UrdfDescription

# Decimals of degrees and millimetres: 90 stays 90, and no frame moves by more than 1e-13 m.
_DIGITS = 12
# A larger deviation of the rows' tool gets a note [m], [rad].
_NOTED_DEVIATION = 1e-9


@dataclass(frozen=True, eq=False)
class DhForm:
    """A robot as D-H rows.

    Attributes:
        values: The values of its robot.toml, in degrees and millimetres, without shapes.
        shapes: Each link's shapes by name, "base" first, in the link's frame [m].
        collision: Each link's separate collision shapes, likewise; empty without any.
        notes: Changes of the conversion, a sentence each.
    """

    values: dict[str, Any]
    shapes: Mapping[str, tuple[Shape, ...]]
    collision: Mapping[str, tuple[Shape, ...]]
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class _Chain:
    """The chain to the tool at position zero, in the URDF's base frame.

    Attributes:
        numbers: Joints of the chain.
        joints: (4, 4) every joint's frame.
        rows: One per joint of the chain.
        frames: (4, 4) the frame in which the rows begin, then each row's end.
        link_names: The rows' links.
    """

    tree: Tree
    numbers: tuple[int, ...]
    joints: list[FloatArray]
    rows: tuple[Row, ...]
    frames: list[FloatArray]
    link_names: tuple[str, ...]

    def place(self, joint: int) -> int:
        """Return the index of the new link for what a joint moves: 0 for the base."""
        while joint != BASE and joint not in self.numbers:
            joint = self.tree.joints[joint].parent
        return 0 if joint == BASE else self.numbers.index(joint) + 1

    def link_to_base(self, place: int) -> FloatArray:
        """Return the (4, 4) of a new link's frame. The base keeps its frame, wherever the rows begin."""
        return np.eye(4) if place == 0 else self.frames[place]


def dh_form(description: UrdfDescription) -> DhForm:
    """Convert the robot's chain to its tool to D-H rows.

    Raises:
        DescriptionError: If the chain has a mimic joint, which D-H rows cannot describe, or no joint.
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
    kept = ("name", "title", "title_zh", "provenance", "provenance_zh")
    values: dict[str, Any] = {key: getattr(description, key) for key in kept}
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
    with_collision: set[str] = set()
    for each in tree.links:
        place, placement = on_row(each.name, np.eye(4))
        for some, found in ((each.shapes, shapes), (each.checked, checked)):
            found[names[place]] += [
                replace(shape, shape_to_link=placement @ shape.shape_to_link) for shape in some
            ]
        if each.collision:
            with_collision.add(names[place])
    return DhForm(
        {key: value for key, value in values.items() if value not in ("", [], {})},
        {name: tuple(found) for name, found in shapes.items()},
        {name: tuple(found) if name in with_collision else () for name, found in checked.items()},
        tuple(_notes(chain, joints, tool_to_last)),
    )


def _frame_values(
    tree: Tree,
    frames: Mapping[str, tuple[str, FloatArray]],
    names: Sequence[str],
    on_row: Callable[[str, FloatArray], tuple[int, FloatArray]],
) -> Iterator[dict[str, Any]]:
    """Yield the named frames and the links without a shape, each on the link of its row."""
    taken = {*names, TOOL_FRAME}
    bare = {link.name: (link.name, np.eye(4)) for link in tree.links if not link.shapes}
    # robots.descriptions.urdf.write adds these links where a row's link is not on its joint's axis.
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
        # A link without a shape at its row's link frame adds nothing.
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
            text = f"joint {name!r} on the way to {tool_link!r} follows another: not possible in D-H rows"
            raise DescriptionError(description.source, [text])
    homes = dict(zip(joints.names, joints.home.tolist(), strict=True))
    placed: list[FloatArray] = []
    for number, joint in enumerate(tree.joints):
        parent = np.eye(4) if joint.parent == BASE else placed[joint.parent]
        # Joints outside the chain are fixed at home.
        position = 0.0 if number in numbers else _home(tree, number, homes)
        placed.append(parent @ joint.joint_to_parent @ moved(joint.type, joint.axis, position))
    axes = [placed[number] @ axis_to_z(tree.joints[number]) for number in numbers]
    base = base_frame(axes[0])
    if not np.array_equal(base, np.eye(4)):
        # From urdf.write, for rows that begin elsewhere: the pose includes the first theta or d.
        made = original_rows(tree, numbers, placed[numbers[0]])
        base = placed[numbers[0]] if made else base
    else:
        made = original_rows(tree, numbers, base)
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
        limits = [_rounded(joints.lower[index] * factor), _rounded(joints.upper[index] * factor)]
        # Assumed values become invalid ones, so that right ones must be stated.
        assumed = {key for key, each in joints.doubts.get(joint.name, {}).items() if each.assumed}
        yield {
            "name": joint.name,
            "type": str(joint.type),
            "a": _mm(row.a),
            "alpha": _degrees(row.alpha),
            "d": _mm(row.d),
            "theta": _degrees(row.theta),
            "limits": [0.0, 0.0] if "limits" in assumed else limits,
            "max_speed": 0.0 if "max_speed" in assumed else _rounded(joints.max_speed[index] * factor),
            "max_acceleration": _rounded(joints.max_acceleration[index] * factor),
            "max_jerk": _rounded(joints.max_jerk[index] * factor),
            "home": _rounded(joints.home[index] * factor),
            "link": {"name": link},
        }


def _whole_robot_values(
    description: UrdfDescription, chain: _Chain, names: Sequence[str], places: Mapping[str, int]
) -> dict[str, Any]:
    """Return the constraints, views and ignored link pairs that are still valid for the rows."""
    on_chain = {chain.tree.joints[number].name for number in chain.numbers}
    values = description.model_dump(mode="json", by_alias=True)
    if description.units.length != "mm" or description.units.angle != "deg":
        values["constraint"], values["view"] = [], {}
    return {
        "constraint": [each for each in values["constraint"] if set(each["joints"]) <= on_chain],
        "view": values["view"],
        "collision": {"ignore": pairs} if (pairs := _ignored(description, chain.tree, names, places)) else {},
    }


def _ignored(
    description: UrdfDescription, tree: Tree, names: Sequence[str], places: Mapping[str, int]
) -> list[list[str]]:
    """Return the pairs of rows' links that the robot.toml or an SRDF excludes from collision checks.

    A row's link may be made of several links. A pair of such links is excluded only if every pair of their
    parts is excluded or at most one joint apart.
    """
    shaped = [link for link in tree.links if link.checked]
    excluded = {frozenset(pair) for pair in description.collision.ignore}
    excluded |= {frozenset(pair) for pair, _ in description.robot.ignored}
    checked: set[tuple[int, int]] = set()
    ignored: set[tuple[int, int]] = set()
    for one, other in combinations(shaped, 2):
        low, high = sorted((places[one.name], places[other.name]))
        if frozenset((one.name, other.name)) in excluded:
            ignored.add((low, high))
        elif not are_neighbours(tree, one.joint, other.joint):
            checked.add((low, high))
    # Consecutive rows need no entry: neighbours are always ignored.
    return [[names[low], names[high]] for low, high in sorted(ignored - checked) if high - low > 1]


def _notes(chain: _Chain, joints: Joints, tool_to_last: FloatArray) -> Iterator[str]:
    if not np.array_equal(chain.frames[0], np.eye(4)):
        yield "the first joint's axis is not the base's z: [base] pose gives the start of the first row"
    outside = [joint.name for number, joint in enumerate(chain.tree.joints) if number not in chain.numbers]
    if outside:
        named = ", ".join(outside[:6]) + (f" and {len(outside) - 6} more" if len(outside) > 6 else "")
        yield f"not on the way to the tool, so fixed at home: {named}"
    distance, angle = _deviation(chain, joints, tool_to_last)
    if distance > _NOTED_DEVIATION or angle > _NOTED_DEVIATION:
        moved_by = f"{distance * 1000:.2g} mm and {degrees(angle):.2g}°"
        yield f"axes that are nearly parallel are taken as parallel: this moves the tool by up to {moved_by}"


def _deviation(chain: _Chain, joints: Joints, tool_to_last: FloatArray) -> tuple[float, float]:
    """Return the largest deviation of the rows' tool from the tree's, over random positions [m] and [rad]."""
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
        # For a small rotation, the chord equals the angle.
        angle = max(angle, float(np.linalg.norm(apart[:3, :3])) / np.sqrt(2.0))
    return distance, angle


def _pose_values(placement: FloatArray) -> dict[str, list[float]]:
    xyz = [_mm(value) for value in placement[:3, 3]]
    return {"xyz": xyz, "rpy": [_degrees(angle) for angle in rotation_rpy(placement[:3, :3])]}


def _mm(metres: float) -> float:
    return _clean(metres * 1000.0)


def _degrees(radians: float) -> float:
    return _clean(degrees(radians))


def _clean(number: float) -> float:
    return round(float(number), _DIGITS) + 0.0  # no minus zero


def _rounded(number: float) -> float:
    """Round a limit, to remove the URDF's rounding error: 360, not 360.000000000024."""
    return round(float(number), 9) + 0.0
