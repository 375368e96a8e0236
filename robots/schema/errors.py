"""Errors of robots.

RobotError
├── DescriptionError    a description cannot be used: file, key, value and what would be right
├── ShapeError          a shape file cannot be read: file, place and what is wrong there
├── SaveError           a robot cannot be written to its folder
│   └── RobotExistsError    a robot of that name exists
├── VerificationRecordError a file is no record of a verification
├── ProgramError        a teach program cannot be read: each line, word, value and what would be right
└── CodedRobotError     an error with a reason of the table
    ├── JointCountError joint positions do not have one value per joint
    └── PoseError       a tool pose is not valid
"""

from collections.abc import Sequence
from pathlib import Path

from robomesh import reason_codes as codes
from robomesh.reasons import Reason


class RobotError(Exception):
    """Base of the errors of robots; its text is one line for the user."""


class DescriptionError(RobotError):
    """A robot description that cannot be used.

    Attributes:
        source: The file, or the requested name.
        problems: Every problem found, a sentence each: key, value and what would be right.
        paths: Keys and numbers that lead to each problem's value; empty where it has none.
    """

    def __init__(
        self,
        source: str | Path,
        problems: Sequence[str],
        *,
        paths: Sequence[tuple[str | int, ...]] | None = None,
    ) -> None:
        self.source = str(source)
        self.problems = tuple(problems)
        self.paths = tuple(paths) if paths is not None else ((),) * len(self.problems)
        more = len(self.problems) - 1
        rest = f" (and {more} more problem{'s' if more > 1 else ''})" if more else ""
        super().__init__(f"{self.source}: {self.problems[0]}{rest}")


class ShapeError(RobotError):
    """A shape file that cannot be read.

    Attributes:
        source: The file.
        place: "line 12", "byte 96"; empty for the whole file.
        reason: The fault at this place.
        missing: A required file that does not exist, as the shape file names it.
    """

    def __init__(self, source: str | Path, reason: str, *, place: str = "", missing: str = "") -> None:
        self.missing = missing
        self.source = str(source)
        self.place = place
        self.reason = reason
        super().__init__(f"{self.source}{', ' + place if place else ''}: {reason}")


class SaveError(RobotError):
    """A robot that cannot be written; the folder is unchanged.

    Attributes:
        target: The robot's folder.
        reason: The cause, for the error text.
    """

    def __init__(self, target: Path, reason: str) -> None:
        self.target = target
        self.reason = reason
        super().__init__(f"{target}: not saved, {reason}")


class RobotExistsError(SaveError):
    """A robot of that name exists.

    Attributes:
        changed: The robot was to be replaced, but changed after the caller read it.
    """

    def __init__(self, target: Path, *, changed: bool = False) -> None:
        self.changed = changed
        super().__init__(
            target, "the robot was changed since it was read" if changed else "a robot of that name exists"
        )


class VerificationRecordError(RobotError):
    """A file that is no record of a verification."""


class ProgramError(RobotError):
    """A teach program that cannot be read.

    Attributes:
        problems: Each problem's line, from 1, and its reason; only the first of many.
        found: The number of all problems.
    """

    def __init__(self, problems: Sequence[tuple[int, Reason]], *, found: int | None = None) -> None:
        self.problems = tuple(problems)
        self.found = len(self.problems) if found is None else found
        line, reason = self.problems[0]
        more = self.found - 1
        rest = f" (and {more} more problem{'s' if more > 1 else ''})" if more else ""
        super().__init__(f"line {line}: {reason}{rest}")


class CodedRobotError(RobotError):
    """An error with a reason of the table."""

    def __init__(self, reason: Reason) -> None:
        super().__init__(reason)
        self.reason = reason


class JointCountError(CodedRobotError):
    """Joint positions without one value per joint."""


class PoseError(CodedRobotError):
    """A tool pose that is not valid."""


def reason_of(error: RobotError) -> Reason:
    """Return an error's reason; files have too many problems for codes, so theirs is the text."""
    return error.reason if isinstance(error, CodedRobotError) else codes.OTHER(detail=error)
