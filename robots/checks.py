"""What a description must hold beyond its types, and how a problem is put in words."""

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any

from pydantic_core import ErrorDetails

from robots.schema import (
    BASE_LINK,
    TOOL_FRAME,
    Joint,
    JointType,
    RobotDescription,
    Units,
    View,
    nearest,
)


def sentence(error: ErrorDetails, values: Mapping[str, Any]) -> str:
    """One of pydantic's errors as one line: key, value and what would be right."""
    location = list(error["loc"])
    kind = error["type"]
    if kind == "unknown_key":
        return f"{_key([*location, error['ctx']['key']], values)}: {error['ctx']['text']}"
    key = _key(location, values)
    if kind == "missing":
        return f"{key} is missing"
    wanted = error["msg"][0].lower() + error["msg"][1:]
    wanted = wanted.replace("input should be", "must be").replace("string should match", "must match")
    return f"{key} = {error['input']!r}: {wanted}"


def _key(location: list[int | str], values: Any) -> str:
    """`joint 'elbow' limits` rather than `joint.2.limits`: people look for names."""
    words: list[str] = []
    for step in location:
        try:
            values = values[step]
        except (KeyError, IndexError, TypeError):
            values = None
        if isinstance(step, int):
            name = values.get("name") if isinstance(values, dict) else None
            words.append(f"{name!r}" if isinstance(name, str) else f"number {step + 1}")
        else:
            words.append(str(step))
    return " ".join(words) or "the file"


def problems_of(description: RobotDescription) -> tuple[str, ...]:
    """Every contradiction inside a description, and every mesh file that is not there."""
    return tuple(
        problem
        for check in (_joint_problems, _name_problems, _reference_problems, _view_problems, _mesh_problems)
        for problem in check(description)
    )


def _joint_problems(description: RobotDescription) -> Iterator[str]:
    if not description.joints:
        yield "joint = []: an arm has at least one joint"
    for joint in description.joints:
        lower, upper = joint.limits
        unit = _unit(joint, description.units)
        if lower >= upper:
            yield f"joint {joint.name!r} limits = [{lower:g}, {upper:g}]: the lower must be below the upper"
        elif not lower <= joint.home <= upper:
            yield (
                f"joint {joint.name!r} home = {joint.home:g}: must be within its limits "
                f"{lower:g} to {upper:g} {unit}"
            )
    for constraint in description.constraints:
        if not constraint.joints:
            yield "constraint joints = {}: name at least one joint"
            continue
        lower, upper = constraint.limits
        if lower >= upper:
            yield f"constraint limits = [{lower:g}, {upper:g}]: the lower must be below the upper"
            continue
        homes = {joint.name: joint.home for joint in description.joints}
        total = sum(factor * homes.get(name, 0.0) for name, factor in constraint.joints.items())
        if not lower <= total <= upper and set(constraint.joints) <= set(homes):
            names = " and ".join(constraint.joints)
            yield f"constraint on {names} limits = [{lower:g}, {upper:g}]: home gives {total:g}, outside them"


def _name_problems(description: RobotDescription) -> Iterator[str]:
    for name, count in Counter(joint.name for joint in description.joints).items():
        if count > 1:
            yield f"joint {name!r}: {count} joints have that name; each needs its own"
    # Links and frames share one list of frames in the model, in URDF and on the network.
    frames = [*description.link_names, TOOL_FRAME, *(frame.name for frame in description.frames)]
    for name, count in Counter(frames).items():
        if count > 1:
            reserved = f" ({name!r} is taken already)" if name in (BASE_LINK, TOOL_FRAME) else ""
            yield f"name {name!r}: {count} links or frames have it{reserved}; each needs its own"


def _reference_problems(description: RobotDescription) -> Iterator[str]:
    links = description.link_names
    for frame in description.frames:
        if frame.link not in links:
            yield f"frame {frame.name!r} link = {frame.link!r}: no such link{nearest(frame.link, links)}"
    for pair in description.collision.ignore:
        for name in pair:
            if name not in links:
                yield f"collision ignore = {list(pair)}: no link {name!r}{nearest(name, links)}"
    joints = {joint.name: joint for joint in description.joints}
    for constraint in description.constraints:
        for name in constraint.joints:
            if name not in joints:
                yield f"constraint joints: no joint {name!r}{nearest(name, joints)}"
        types = {joints[name].type for name in constraint.joints if name in joints}
        if len(types) > 1:
            yield f"constraint on {' and '.join(constraint.joints)}: adds degrees to millimetres"


def _view_problems(description: RobotDescription) -> Iterator[str]:
    for name, view in description.views.items():
        if _is_degenerate(view):
            yield f"view {name!r} up = {list(view.up)}: must not be zero or along the line from eye to target"


def _is_degenerate(view: View) -> bool:
    look = [target - eye for target, eye in zip(view.target, view.eye, strict=True)]
    up = view.up
    cross = (
        look[1] * up[2] - look[2] * up[1],
        look[2] * up[0] - look[0] * up[2],
        look[0] * up[1] - look[1] * up[0],
    )
    size = sum(x * x for x in look) * sum(x * x for x in up)
    return sum(x * x for x in cross) <= 1e-12 * size


def _mesh_problems(description: RobotDescription) -> Iterator[str]:
    for name, body in description.bodies.items():
        path = description.mesh_path(body)
        if path is not None and not path.is_file():
            yield f"link {name!r} mesh = {body.mesh!r}: no such file beside the description"


def _unit(joint: Joint, units: Units) -> str:
    return units.angle if joint.type is JointType.ROTARY else units.length
