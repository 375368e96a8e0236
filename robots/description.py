"""Reading robot descriptions: from the library, from a file, from text.

Every file is checked whole: a wrong one tells all that is wrong with it.
"""

import tomllib
from pathlib import Path

from pydantic import ValidationError

from robots.checks import problems_of, sentence
from robots.errors import DescriptionError
from robots.schema import JointType, Pose, RobotDescription, nearest

__all__ = ["JointType", "Pose", "RobotDescription", "library_names", "load", "parse"]

LIBRARY = Path(__file__).parent / "library"
DESCRIPTION_FILE = "robot.toml"


def library_names() -> tuple[str, ...]:
    """Names of the robots that come with the project, sorted."""
    return tuple(sorted(path.parent.name for path in LIBRARY.glob(f"*/{DESCRIPTION_FILE}")))


def load(source: str | Path) -> RobotDescription:
    """Read a robot's description.

    Args:
        source: A library robot's name ("pt600"), or the path of a robot.toml or of its folder.

    Raises:
        DescriptionError: If there is no such file, or it cannot be used as it is; the text names
            the file, the key, its value and what would be right.
    """
    path = _find(source)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "is not UTF-8 text"
        raise DescriptionError(path, [f"cannot be read: {reason}"]) from error
    return parse(text, path)


def parse(text: str, source: Path) -> RobotDescription:
    """The description in a robot.toml's text; mesh files are looked for beside `source`.

    Raises:
        DescriptionError: As `load`.
    """
    try:
        values = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise DescriptionError(source, [f"is not TOML: {error}"]) from error
    if "urdf" in values:
        raise DescriptionError(
            source, [f"urdf = {values['urdf']!r}: not read yet; describe the arm by its D-H rows, [[joint]]"]
        )
    try:
        description = RobotDescription.model_validate(values).read_from(source, text)
    except ValidationError as error:
        raise DescriptionError(source, [sentence(detail, values) for detail in error.errors()]) from error
    problems = problems_of(description)
    if problems:
        raise DescriptionError(source, problems)
    return description


def _find(source: str | Path) -> Path:
    path = Path(source)
    if path.suffix.lower() in (".urdf", ".xacro"):
        raise DescriptionError(source, ["URDF is not read yet; give a robot.toml with D-H rows, [[joint]]"])
    # A bare word is a library robot, whatever lies in the working folder.
    bare = len(path.parts) == 1 and not path.suffix
    library_file = LIBRARY / path / DESCRIPTION_FILE
    if bare and library_file.is_file():
        return library_file
    if bare and not path.exists():
        hint = nearest(str(source), library_names())
        raise DescriptionError(source, [f"no such robot in the library{hint}"])
    return path / DESCRIPTION_FILE if path.is_dir() else path
