"""Reading robot descriptions: from the library, from a file, from text, from values.

Every file is checked whole: a wrong one tells all that is wrong with it.
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

from robots.bounded_toml import MOST_CHARACTERS, parse_toml
from robots.description_checks import Problem, Step, file_problems, row_problems, type_problem
from robots.errors import DescriptionError, MeshError
from robots.example_robots import EXAMPLES, ExampleRobot, example_names, example_robot, example_values
from robots.schema import DhDescription, JointType, Pose, RobotDescription, UrdfDescription, nearest
from robots.urdf.checks import urdf_problems
from robots.urdf.files import files_of
from robots.urdf.read import MOST_URDF_CHARACTERS, UrdfRobot, read_urdf
from robots.urdf.srdf import ignored_beside

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

LIBRARY = Path(__file__).parent / "library"
DESCRIPTION_FILE = "robot.toml"
_VRML = (".wrl", ".vrml", ".wrz")
# What describes a robot without a robot.toml.
ROBOT_FILES = (".urdf", ".xacro", *_VRML)

# Each may be wrong in several ways, and each way is a sentence.
_MOST_VALUES = 20_000

# In place of what is wrong, so that all the rest can be checked too.
_STAND_INS: Mapping[str, Any] = {
    "name": "x", "a": 0.0, "alpha": 0.0, "d": 0.0, "limits": [-1.0, 1.0], "max_speed": 1.0,
    "max_acceleration": 1.0, "max_jerk": 1.0, "link": "base", "joints": {}, "joint": [], "color": "#000000",
    "eye": [1.0, 0.0, 0.0], "target": [0.0, 0.0, 0.0],
}  # fmt: skip


def library_names() -> tuple[str, ...]:
    """Names of the robots that come with the project, sorted."""
    return tuple(sorted(path.parent.name for path in LIBRARY.glob(f"*/{DESCRIPTION_FILE}")))


def known_names() -> tuple[str, ...]:
    """Names that `load` takes: the library's robots, then the example robots where they are installed."""
    return (*library_names(), *example_names())


def load(source: str | Path, *, confined: bool = False) -> RobotDescription:
    """Read a robot's description.

    Args:
        source: A library robot's name ("pt600"), an example robot's ("ur5"), or the path of a robot.toml,
            of its folder, of a URDF, or of a robot in VRML as OpenHRP has it.
        confined: Nothing outside the file's own folder is read for it, now or later: it is somebody else's.

    Raises:
        DescriptionError: If there is no such file, or it cannot be used as it is; the text names
            the file, the key, its value and what would be right.
    """
    path = _find(source)
    if isinstance(path, ExampleRobot):
        return described(example_values(path), path.urdf)
    if path.suffix.lower() in ROBOT_FILES:
        return described({"name": robot_name(path.stem), "urdf": path.name}, path, confined=confined)
    return parse(_text(path), path, confined=confined)


def described(values: dict[str, Any], urdf: Path, *, confined: bool = False) -> RobotDescription:
    """The description of a robot that has a URDF and no robot.toml, from a robot.toml's values.

    Raises:
        DescriptionError: As `load`.
    """
    description, problems = from_values(values, folder=urdf.parent, confined=confined)
    if description is None:
        raise _refusal(urdf, problems)
    text = "".join(f"{key} = {json.dumps(values[key])}\n" for key in ("name", "urdf"))
    return description.read_from(urdf, text)


def robot_name(word: str) -> str:
    """A file's name as a robot's name: small letters, digits, - and _."""
    return re.sub(r"[^a-z0-9_-]", "_", word.lower()).lstrip("_-") or "robot"


def parse(text: str, source: Path, *, confined: bool = False) -> RobotDescription:
    """The description in a robot.toml's text; mesh files are looked for beside `source`.

    Raises:
        DescriptionError: As `load`.
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
    """The description that a robot.toml's values give, and every problem with them.

    Args:
        folder: Where its files are.
        confined: Refuse every file outside the folder, now and later: for values that somebody sent.

    Returns:
        A description, or None where there is a problem.
    """
    if _is_huge(values):
        return None, (Problem((), f"holds more than {_MOST_VALUES} values; no robot needs so many"),)
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
    """Return whether there are more values than are worth a problem each."""
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
    """What the file holds that `urdf` names: a URDF, or OpenHRP's VRML, which says as much."""
    folder = description.source.parent
    urdf = folder / description.urdf
    if urdf.suffix.lower() in _VRML:
        from robots.vrml_robot import read_vrml_robot

        try:
            found = read_vrml_robot(urdf, within=description.folder_around(urdf))
        except MeshError as error:
            place = f"{error.place}: " if error.place else ""
            raise DescriptionError(error.source, [f"{place}{error.reason}"]) from error
        return UrdfRobot(found.name, found.tree, found.notes)
    packages = [folder / package for package in description.packages]
    resolve = files_of(urdf, packages, confined=folder if confined else None)
    robot = read_urdf(_text(urdf, most=MOST_URDF_CHARACTERS), urdf, resolve=resolve)
    if confined and not urdf.resolve().is_relative_to(folder.resolve()):
        return robot
    ignored, note = ignored_beside(urdf, robot.name, robot.tree)
    return replace(robot, ignored=tuple(ignored), notes=(*robot.notes, *([note] if note else [])))


def _text(path: Path, *, most: int = MOST_CHARACTERS) -> str:
    try:
        with path.open(encoding="utf-8") as file:
            return file.read(most + 1)  # one more than its reader takes
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "is not UTF-8 text"
        raise DescriptionError(path, [f"cannot be read: {reason}"]) from error


def _other_problems(values: dict[str, Any], wrong: list[tuple[Step, ...]]) -> Iterator[Problem]:
    """What else is wrong than some values' types: found with something right in their places."""
    mended = deepcopy(values)
    for place in wrong:
        _mend(mended, place)
    try:
        description = _model(mended)
    except ValidationError:
        return
    if isinstance(description, UrdfDescription):
        return
    # A table with a wrong value is not judged further, nor is who refers to it by a name that is wrong.
    tables = {place[:2] for place in wrong}
    names_known = not any(place[-1] in ("name", "joint", "link") for place in wrong)
    for problem in row_problems(description):
        refers = problem.path[0] in ("frame", "constraint", "collision")
        if problem.path[:2] not in tables and (names_known or not refers):
            yield problem


def _mend(values: Any, place: tuple[Step, ...]) -> None:
    """Put a stand-in where a value is wrong; take it out where nothing must stand."""
    *steps, last = place
    for step in steps:
        try:
            values = values[step]
        except (KeyError, IndexError, TypeError):
            return
    # A number's place in a list (limits 0) is mended in the list's own.
    if isinstance(values, dict) and isinstance(last, str):
        if last in _STAND_INS:
            values[last] = _STAND_INS[last]
        else:
            values.pop(last, None)
    elif isinstance(values, list) and isinstance(last, int) and last < len(values):
        values[last] = float(last)


def _find(source: str | Path) -> Path | ExampleRobot:
    path = Path(source)
    # A bare word is a library robot, whatever lies in the working folder.
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
