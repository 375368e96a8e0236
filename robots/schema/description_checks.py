"""Checks of a description beyond its types, and the texts of all problems."""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic_core import ErrorDetails

from robots.schema.robot_toml import (
    BASE_LINK,
    TOOL_FRAME,
    DhDescription,
    Joint,
    JointType,
    RobotDescription,
    Units,
    View,
    nearest,
)
from robots.schema.units import length_factor

Step = str | int

# Keys of a body that name a shape file.
_SHAPE_KEYS = ("mesh", "collision_mesh")
# No arm is that long. A larger number is a typing error, or metres in a file of millimetres.
_LONGEST_M = 100.0


@dataclass(frozen=True)
class Problem:
    """A problem in a description.

    Attributes:
        path: Keys and indices of the value: ("joint", 2, "limits"); empty for the whole file.
        text: A sentence: key, value and what would be right.
    """

    path: tuple[Step, ...]
    text: str


def type_problem(error: ErrorDetails, values: Mapping[str, Any]) -> Problem:
    """Convert one of pydantic's errors to a problem."""
    location = tuple(error["loc"])
    kind = error["type"]
    if kind == "unknown_key":
        location = (*location, error["ctx"]["key"])
        return Problem(location, f"{_key(location, values)}: {error['ctx']['text']}")
    key = _key(location, values)
    if kind == "missing":
        return Problem(location, f"{key} is missing")
    wanted = error["msg"][0].lower() + error["msg"][1:]
    wanted = wanted.replace("input should be", "must be").replace("string should match", "must match")
    return Problem(location, f"{key} = {_short(error['input'])}: {wanted}")


def _short(value: Any) -> str:
    try:
        text = repr(value)
    except ValueError:  # Python does not convert a number of over 4,300 digits to text
        text = "(a number with too many digits)"
    except RecursionError:
        text = "(nested too deeply)"
    return text if len(text) <= 80 else f"{text[:77]}..."


def _key(location: tuple[Step, ...], values: Any) -> str:
    """Return a location as `joint 'elbow' limits`: easier to find in the file than `joint.2.limits`."""
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
            words.append(step if step.isprintable() else _short(step))
    return " ".join(words) or "the file"


def row_problems(description: DhDescription) -> Iterator[Problem]:
    """Yield every contradiction in a description by D-H rows; `file_problems` checks its files."""
    if not description.joints:
        yield Problem(("joint",), "joint = []: an arm has at least one joint")
    for number, joint in enumerate(description.joints):
        yield from _joint_problems(("joint", number), joint, description.units)
    for name, numbers in _repeated(joint.name for joint in description.joints):
        text = f"joint {name!r}: {len(numbers)} joints have that name; each needs its own"
        yield Problem(("joint", numbers[-1], "name"), text)
    yield from _body_problems(("base",), "'base'", description.base.mesh_pose.xyz, description.units)
    start = description.base.pose.xyz
    yield from _length_problems(("base", "pose", "xyz"), "base pose xyz", start, description.units)
    joints = {joint.name: JointFacts(joint.type, joint.home) for joint in description.joints}
    yield from common_problems(description, links=description.link_names, joints=joints)


@dataclass(frozen=True)
class JointFacts:
    """A joint's values that the checks of a whole robot need; home in the file's units."""

    type: JointType
    home: float


def common_problems(
    description: RobotDescription, *, links: tuple[str, ...], joints: Mapping[str, JointFacts]
) -> Iterator[Problem]:
    """Yield the contradictions in the values that both forms of a description have."""
    yield from _name_problems(description, links)
    yield from _reference_problems(description, links)
    yield from _constraint_problems(description, joints)
    yield from _length_problems(("tool", "xyz"), "tool xyz", description.tool.xyz, description.units)
    for place, frame in enumerated("frame", description.frames):
        key = f"frame {frame.name!r} xyz"
        yield from _length_problems((*place, "xyz"), key, frame.xyz, description.units)
    for name, view in description.views.items():
        if _is_degenerate(view):
            text = (
                f"view {name!r} up = {list(view.up)}: must not be zero or along the line from eye to target"
            )
            yield Problem(("view", name, "up"), text)


def enumerated(key: str, rows: tuple[Any, ...]) -> Iterator[tuple[tuple[Step, ...], Any]]:
    """Return each row of a list of tables with its path."""
    return (((key, number), row) for number, row in enumerate(rows))


def limit_problems(
    place: tuple[Step, ...], name: str, limits: tuple[float, float], home: float | None, unit: str
) -> Iterator[Problem]:
    """Yield a problem if the lower limit is not below the upper, or home is outside the limits."""
    lower, upper = limits
    if lower >= upper:
        text = f"joint {name!r} limits = [{lower:g}, {upper:g}]: the lower must be below the upper"
        yield Problem((*place, "limits"), text)
    elif home is not None and not lower <= home <= upper:
        text = f"joint {name!r} home = {home:g}: must be within its limits {lower:g} to {upper:g} {unit}"
        yield Problem((*place, "home"), text)


def _joint_problems(place: tuple[Step, ...], joint: Joint, units: Units) -> Iterator[Problem]:
    unit = units.angle if joint.type is JointType.ROTARY else units.length
    yield from limit_problems(place, joint.name, joint.limits, joint.home, unit)
    for key in ("a", "d"):
        yield from _length_problems((*place, key), f"joint {joint.name!r} {key}", getattr(joint, key), units)
    yield from _body_problems((*place, "link"), f"{joint.link_name!r}", joint.link.mesh_pose.xyz, units)


def _body_problems(
    place: tuple[Step, ...], name: str, xyz: tuple[float, ...], units: Units
) -> Iterator[Problem]:
    yield from _length_problems((*place, "mesh_pose", "xyz"), f"link {name} mesh_pose xyz", xyz, units)


def _length_problems(
    place: tuple[Step, ...], key: str, value: float | tuple[float, ...], units: Units
) -> Iterator[Problem]:
    metres = length_factor(units)
    numbers = value if isinstance(value, tuple) else (value,)
    if any(abs(number) * metres > _LONGEST_M for number in numbers):
        found = list(value) if isinstance(value, tuple) else value
        yield Problem(place, f"{key} = {found}: more than {_LONGEST_M:g} m; is it in {units.length}?")


def _repeated(names: Any) -> Iterator[tuple[str, list[int]]]:
    places: dict[str, list[int]] = {}
    for number, name in enumerate(names):
        places.setdefault(name, []).append(number)
    return ((name, numbers) for name, numbers in places.items() if len(numbers) > 1)


def _name_problems(description: RobotDescription, links: tuple[str, ...]) -> Iterator[Problem]:
    # Links and frames share one name space in the model, in URDF and on the network.
    frames = [frame.name for frame in description.frames]
    taken = (links[0], TOOL_FRAME)
    for name, count in Counter([*links, TOOL_FRAME, *frames]).items():
        if count > 1 and (isinstance(description, DhDescription) or name in frames):
            reserved = f" ({name!r} is reserved)" if name in taken else ""
            text = f"name {name!r}: {count} links or frames have it{reserved}; each needs its own"
            yield Problem(_named(name, frames, links), text)


def _named(name: str, frames: list[str], links: tuple[str, ...]) -> tuple[Step, ...]:
    """Return the path of the last use of a name that is used more than once."""
    if name in frames:
        return ("frame", len(frames) - 1 - frames[::-1].index(name), "name")
    return ("joint", len(links) - 2 - links[::-1].index(name), "link", "name")


def _reference_problems(description: RobotDescription, links: tuple[str, ...]) -> Iterator[Problem]:
    for number, frame in enumerate(description.frames):
        if frame.link not in links:
            text = f"frame {frame.name!r} link = {frame.link!r}: no such link{nearest(frame.link, links)}"
            yield Problem(("frame", number, "link"), text)
    for number, pair in enumerate(description.collision.ignore):
        for name in pair:
            if name not in links:
                text = f"collision ignore = {list(pair)}: no link {name!r}{nearest(name, links)}"
                yield Problem(("collision", "ignore", number), text)


def _constraint_problems(
    description: RobotDescription, joints: Mapping[str, JointFacts]
) -> Iterator[Problem]:
    for number, constraint in enumerate(description.constraints):
        place: tuple[Step, ...] = ("constraint", number)
        lower, upper = constraint.limits
        names = " and ".join(constraint.joints)
        unknown = [name for name in constraint.joints if name not in joints]
        if not constraint.joints:
            yield Problem((*place, "joints"), "constraint joints = {}: name at least one joint")
        for name in unknown:
            yield Problem((*place, "joints"), f"constraint joints: no joint {name!r}{nearest(name, joints)}")
        if lower >= upper:
            text = f"constraint limits = [{lower:g}, {upper:g}]: the lower must be below the upper"
            yield Problem((*place, "limits"), text)
        elif constraint.joints and not unknown:
            total = sum(factor * joints[name].home for name, factor in constraint.joints.items())
            if len({joints[name].type for name in constraint.joints}) > 1:
                yield Problem((*place, "joints"), f"constraint on {names}: adds degrees to millimetres")
            elif not lower <= total <= upper:
                text = (
                    f"constraint on {names} limits = [{lower:g}, {upper:g}]: "
                    f"home gives {total:g}, outside them"
                )
                yield Problem((*place, "limits"), text)


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


def file_problems(values: Mapping[str, Any], folder: Path, *, confined: bool) -> Iterator[Problem]:
    """Yield a problem for every file or folder that the values name and that does not exist.

    Args:
        values: May have other problems too.
        confined: Reject every path outside the folder without looking for it.
    """
    for place, name in named_files(values):
        is_mesh = place[-1] in _SHAPE_KEYS
        key = f"link {_link_name(values, place)!r} {place[-1]}" if is_mesh else str(place[0])
        path = folder / name
        if "\0" in name:
            yield Problem(place, f"{key} = {_short(name)}: not a valid file name")
        elif confined and not path.resolve().is_relative_to(folder.resolve()):
            yield Problem(place, f"{key} = {_short(name)}: must be in the description's folder")
        elif place[0] == "packages":
            if not path.is_dir():
                yield Problem(place, f"packages {_short(name)}: no such folder in the description's folder")
        elif not _is_file(path):
            yield Problem(place, f"{key} = {_short(name)}: no such file in the description's folder")


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:  # the name is too long
        return False


def named_files(values: Mapping[str, Any]) -> Iterator[tuple[tuple[Step, ...], str]]:
    """Yield every file or folder that the values name, with the path of its key."""
    joints = values.get("joint")
    rows = joints if isinstance(joints, list) else []
    bodies: list[tuple[tuple[Step, ...], Any]] = [(("base",), values.get("base"))]
    bodies += [
        (("joint", number, "link"), row.get("link"))
        for number, row in enumerate(rows)
        if isinstance(row, dict)
    ]
    for place, body in bodies:
        for key in _SHAPE_KEYS if isinstance(body, dict) else ():
            if isinstance(body.get(key), str):
                yield (*place, key), body[key]
    if isinstance(values.get("urdf"), str):
        yield ("urdf",), values["urdf"]
        folders = values.get("packages")
        for number, folder in enumerate(folders if isinstance(folders, list) else []):
            if isinstance(folder, str):
                yield ("packages", number), folder


def _link_name(values: Mapping[str, Any], place: tuple[Step, ...]) -> str:
    if place[0] == "base":
        return BASE_LINK
    row = values["joint"][place[1]]
    return str(row["link"].get("name") or row.get("name", ""))
