"""Reader of robot descriptions: from the library, a file, a text or values.

Every file is checked completely, so an error lists all problems of a file.
"""

import json
import re
import tomllib
from collections.abc import Iterator, Mapping
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from robots.descriptions.example_robots import (
    EXAMPLES,
    ExampleRobot,
    example_names,
    example_robot,
    example_values,
)
from robots.descriptions.urdf.checks import urdf_problems
from robots.descriptions.urdf.files import files_of
from robots.descriptions.urdf.read import MOST_URDF_BYTES, UrdfRobot, read_urdf
from robots.descriptions.urdf.srdf import ignored_beside
from robots.schema.bounded_toml import MOST_CHARACTERS, parse_toml
from robots.schema.description_checks import Problem, Step, file_problems, row_problems, type_problem
from robots.schema.errors import DescriptionError, ShapeError
from robots.schema.robot_toml import (
    DhDescription,
    JointSettings,
    JointType,
    Model,
    Pose,
    RobotDescription,
    StatedModel,
    Units,
    UrdfDescription,
    nearest,
)
from robots.schema.units import position_factor

__all__ = [
    "JointType",
    "Pose",
    "Problem",
    "RobotDescription",
    "from_values",
    "known_names",
    "library_names",
    "load",
    "parse",
]

LIBRARY = Path(__file__).parents[1] / "library"
DESCRIPTION_FILE = "robot.toml"
_VRML = (".wrl", ".vrml", ".wrz")
# Formats that describe a robot without a robot.toml.
ROBOT_FILES = (".urdf", ".xacro", *_VRML)

# Each value may have several problems of a sentence each.
_MOST_VALUES = 20_000

# Valid values that replace wrong ones, so that the other values can be checked too.
_STAND_INS: Mapping[str, Any] = {
    "name": "x", "a": 0.0, "alpha": 0.0, "d": 0.0, "limits": [-1.0, 1.0], "max_speed": 1.0,
    "max_acceleration": 1.0, "max_jerk": 1.0, "link": "base", "joints": {}, "joint": [], "color": "#000000",
    "eye": [1.0, 0.0, 0.0], "target": [0.0, 0.0, 0.0],
}  # fmt: skip


def library_names() -> tuple[str, ...]:
    """Return the sorted names of the robots in the library."""
    return tuple(sorted(path.parent.name for path in LIBRARY.glob(f"*/{DESCRIPTION_FILE}")))


def known_names() -> tuple[str, ...]:
    """Return the names that `load` accepts: the library's robots, then the installed example robots."""
    return (*library_names(), *example_names())


def load(source: Model, *, confined: bool = False) -> RobotDescription:
    """Read a robot's description.

    Args:
        source: A library robot's name ("pt600"), an example robot's ("ur5"), or the path of a robot.toml,
            its folder, a URDF, or an OpenHRP robot in VRML; or one of these with stated limits.
        confined: Never read a file outside the description's folder; for a description that is not trusted.

    Raises:
        DescriptionError: If the file does not exist or has a problem; the text names the file, the key,
            its value and what would be right.
    """
    if isinstance(source, StatedModel):
        return _with_limits(load(source.model, confined=confined), source)
    path = _find(source)
    if isinstance(path, ExampleRobot):
        return describe_urdf(example_values(path), path.urdf)
    if path.suffix.lower() in ROBOT_FILES:
        return describe_urdf({"name": robot_name(path.stem), "urdf": path.name}, path, confined=confined)
    return parse(_text(path), path, confined=confined)


def _with_limits(description: RobotDescription, stated: StatedModel) -> RobotDescription:
    if not isinstance(description, UrdfDescription):
        raise DescriptionError(stated.model, ["has no URDF: change limits and max_speed in its robot.toml"])
    types = {joint.name: joint.type for joint in description.robot.tree.joints}
    rows = {row.name: row for row in description.joints}
    for row in stated.joints:
        kind = types.get(row.name, JointType.ROTARY)
        factor = position_factor(kind, Units()) / position_factor(kind, description.units)
        values = {
            "limits": row.limits and (row.limits[0] * factor, row.limits[1] * factor),
            "max_speed": row.max_speed and row.max_speed * factor,
        }
        given = {key: each for key, each in values.items() if each is not None}
        rows[row.name] = rows.get(row.name, JointSettings(name=row.name)).model_copy(update=given)
    description = description.model_copy(update={"joints": tuple(rows.values())})
    if problems := tuple(urdf_problems(description)):
        raise _refusal(description.source, problems)
    return description


def describe_urdf(values: dict[str, Any], urdf: Path, *, confined: bool = False) -> RobotDescription:
    """Return the description of a robot with a URDF and no robot.toml, from a robot.toml's values.

    Raises:
        DescriptionError: See `load`.
    """
    description, problems = from_values(values, folder=urdf.parent, confined=confined)
    if description is None:
        raise _refusal(urdf, problems)
    text = "".join(f"{key} = {json.dumps(values[key])}\n" for key in ("name", "urdf"))
    return description.read_from(urdf, text)


def robot_name(word: str) -> str:
    """Convert a file's name to a robot's name: small letters, digits, - and _."""
    return re.sub(r"[^a-z0-9_-]", "_", word.lower()).lstrip("_-") or "robot"


def parse(text: str, source: Path, *, confined: bool = False) -> RobotDescription:
    """Parse a robot.toml's text; shape files are relative to the folder of `source`.

    Raises:
        DescriptionError: See `load`.
    """
    try:
        values = parse_toml(text)
    except tomllib.TOMLDecodeError as error:
        raise DescriptionError(source, [f"is not TOML: {error}"]) from error
    description, problems = from_values(values, folder=source.parent, confined=confined)
    if description is None:
        raise _refusal(source, problems)
    return description.read_from(source, text)


def _refusal(source: Path, problems: tuple[Problem, ...]) -> DescriptionError:
    return DescriptionError(
        source, [problem.text for problem in problems], paths=[problem.path for problem in problems]
    )


def from_values(
    values: dict[str, Any], *, folder: Path, confined: bool = False
) -> tuple[RobotDescription | None, tuple[Problem, ...]]:
    """Make a description from a robot.toml's values, and return every problem in them.

    Args:
        folder: The folder of the description's files.
        confined: Never read a file outside the folder; for values from the network.

    Returns:
        The description, or None if there is a problem; and the problems.
    """
    if _is_huge(values):
        return None, (Problem((), f"has more than {_MOST_VALUES} values"),)
    files = tuple(file_problems(values, folder, confined=confined))
    try:
        description = _model(values).read_from(folder / DESCRIPTION_FILE, "")
        description = description.confined_to(folder) if confined else description
    except ValidationError as error:
        wrong = tuple(type_problem(detail, values) for detail in error.errors())
        others = _other_problems(values, [problem.path for problem in wrong])
        return None, (*wrong, *others, *files)
    if isinstance(description, UrdfDescription):
        if files:
            return None, files
        try:
            robot = _urdf_robot(description, confined=confined)
        except DescriptionError as error:
            return None, tuple(Problem(("urdf",), text) for text in error.problems)
        title = description.title or robot.name
        description = description.model_copy(update={"title": title}).with_robot(robot)
        problems = tuple(urdf_problems(description))
    else:
        problems = (*row_problems(description), *files)
    return (None, problems) if problems else (description, ())


def _is_huge(values: Any) -> bool:
    """Return whether there are too many values to report a problem for each."""
    ahead, count = [values], 0
    while ahead and count <= _MOST_VALUES:
        inside = ahead.pop()
        more = list(inside.values()) if isinstance(inside, dict) else inside
        ahead += [each for each in more if isinstance(each, dict | list)]
        count += len(more)
    return count > _MOST_VALUES


def _model(values: Mapping[str, Any]) -> DhDescription | UrdfDescription:
    form = UrdfDescription if "urdf" in values else DhDescription
    return form.model_validate(values)


def _urdf_robot(description: UrdfDescription, *, confined: bool) -> UrdfRobot:
    """Read the file that `urdf` names: a URDF or an OpenHRP robot in VRML."""
    folder = description.source.parent
    urdf = folder / description.urdf
    if urdf.suffix.lower() in _VRML:
        from robots.descriptions.vrml_robot import read_vrml_robot

        try:
            found = read_vrml_robot(urdf, within=description.folder_around(urdf))
        except ShapeError as error:
            place = f"{error.place}: " if error.place else ""
            raise DescriptionError(error.source, [f"{place}{error.reason}"]) from error
        return UrdfRobot(found.name, found.tree, found.notes)
    packages = [folder / package for package in description.packages]
    resolve = files_of(urdf, packages, confined=folder if confined else None)
    robot = read_urdf(_urdf_bytes(urdf), urdf, resolve=resolve)
    if confined and not urdf.resolve().is_relative_to(folder.resolve()):
        return robot
    ignored, note = ignored_beside(urdf, robot.name, robot.tree)
    return replace(robot, ignored=tuple(ignored), notes=(*robot.notes, *([note] if note else [])))


def _urdf_bytes(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(MOST_URDF_BYTES + 1)
    except OSError as error:
        raise DescriptionError(path, [f"cannot be read: {error.strerror}"]) from error


def _text(path: Path) -> str:
    try:
        with path.open(encoding="utf-8") as file:
            # One more than the limit, so that the parser can reject the text.
            return file.read(MOST_CHARACTERS + 1)
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "is not UTF-8 text"
        raise DescriptionError(path, [f"cannot be read: {reason}"]) from error


def _other_problems(values: dict[str, Any], wrong: list[tuple[Step, ...]]) -> Iterator[Problem]:
    """Yield the problems other than wrong types: check the values with valid ones in place of the wrong."""
    repaired = deepcopy(values)
    for place in wrong:
        _replace_wrong_value(repaired, place)
    try:
        description = _model(repaired)
    except ValidationError:
        return
    if isinstance(description, UrdfDescription):
        return
    # Skip tables with a wrong value, and references if a name is wrong: they may refer to this name.
    tables = {place[:2] for place in wrong}
    names_known = not any(place[-1] in ("name", "joint", "link") for place in wrong)
    for problem in row_problems(description):
        refers = problem.path[0] in ("frame", "constraint", "collision")
        if problem.path[:2] not in tables and (names_known or not refers):
            yield problem


def _replace_wrong_value(values: Any, place: tuple[Step, ...]) -> None:
    """Replace a wrong value by a valid one; remove it if its key is optional."""
    *steps, last = place
    for step in steps:
        try:
            values = values[step]
        except (KeyError, IndexError, TypeError):
            return
    # Replace a single number within a list (limits 0) by its index.
    if isinstance(values, dict) and isinstance(last, str):
        if last in _STAND_INS:
            values[last] = _STAND_INS[last]
        else:
            values.pop(last, None)
    elif isinstance(values, list) and isinstance(last, int) and last < len(values):
        values[last] = float(last)


def _find(source: str | Path) -> Path | ExampleRobot:
    path = Path(source)
    # A word without a suffix is a library robot, even if the working folder has a file of this name.
    bare = len(path.parts) == 1 and not path.suffix
    library_file = LIBRARY / path / DESCRIPTION_FILE
    if bare and library_file.is_file():
        return library_file
    if bare and str(source) in EXAMPLES:
        return example_robot(str(source))
    if bare and not path.exists():
        hint = nearest(str(source), known_names())
        raise DescriptionError(source, [f"no such robot in the library{hint}"])
    return path / DESCRIPTION_FILE if path.is_dir() else path
