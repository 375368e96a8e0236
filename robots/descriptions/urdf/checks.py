"""Checks that a URDF description's keys fit the joints and links of its URDF."""

from collections import Counter
from collections.abc import Iterator

from robots.kinematics.joints import joints_of
from robots.kinematics.kinematic_tree import TreeJoint, tree_of
from robots.schema.description_checks import (
    JointFacts,
    Problem,
    common_problems,
    enumerated,
    limit_problems,
)
from robots.schema.robot_toml import TOOL_FRAME, JointSettings, Pose, UrdfDescription, nearest
from robots.schema.units import position_factor


def urdf_problems(description: UrdfDescription) -> Iterator[Problem]:
    """Yield every contradiction between a description and its URDF, and within the description."""
    tree = tree_of(description)
    links = tuple(link.name for link in tree.links)
    free = {tree.joints[number].name: tree.joints[number] for number in tree.free}
    known = _rows(description, free)
    yield from known
    if not known:
        # Further checks need rows that all name joints of the URDF.
        joints = joints_of(description.model_copy(update={"constraints": ()}))
        homes = {}
        for name, kind, home in zip(joints.names, joints.types, joints.home.tolist(), strict=True):
            homes[name] = JointFacts(kind, home / position_factor(kind, description.units))
        yield from common_problems(description, links=links, joints=homes)
    named = ((place, row.name) for place, row in enumerated("link", description.links))
    for place, name in (*named, (("tool",), description.tool.link)):
        if name is not None and name not in links:
            key = "name" if place[0] == "link" else "link"
            yield Problem(
                (*place, key), f"{place[0]} {key} = {name!r}: the URDF has no such link{nearest(name, links)}"
            )
    moved = description.tool.link not in (None, TOOL_FRAME) or _is_moved(description.tool)
    if TOOL_FRAME in links and moved:
        yield Problem(("tool",), "tool: the URDF has a link named 'tool', which already places the tool")


def _rows(description: UrdfDescription, free: dict[str, TreeJoint]) -> list[Problem]:
    counts = Counter(row.name for row in description.joints)
    found = []
    for place, row in enumerated("joint", description.joints):
        joint = free.get(row.name)
        if joint is None:
            text = f"joint {row.name!r}: the URDF has no such movable joint{nearest(row.name, free)}"
            found.append(Problem((*place, "name"), text))
        elif counts[row.name] > 1:
            text = f"joint {row.name!r}: {counts[row.name]} tables have that name; keep one"
            found.append(Problem((*place, "name"), text))
        else:
            found += _row(description, place, row, joint)
    return found


def _row(
    description: UrdfDescription, place: tuple[str | int, ...], row: JointSettings, joint: TreeJoint
) -> Iterator[Problem]:
    factor = position_factor(joint.type, description.units)
    unit = description.units.angle if joint.type == "rotary" else description.units.length
    limits = row.limits or (joint.lower / factor, joint.upper / factor)
    yield from limit_problems(place, row.name, limits, row.home, unit)
    if row.limits and not joint.continuous and "limits" not in joint.doubts:
        # Tolerates rounding of hand-written numbers.
        slack = 1e-6 * (joint.upper - joint.lower)
        if row.limits[0] * factor < joint.lower - slack or row.limits[1] * factor > joint.upper + slack:
            lower, upper = joint.lower / factor, joint.upper / factor
            text = (
                f"joint {row.name!r} limits = [{limits[0]:g}, {limits[1]:g}]: "
                f"must be within the URDF's {lower:g} to {upper:g} {unit}"
            )
            yield Problem((*place, "limits"), text)


def _is_moved(pose: Pose) -> bool:
    return any((*pose.xyz, *pose.rpy))
