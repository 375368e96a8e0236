"""Errors of robots.

RobotError
├── DescriptionError    a description that cannot be used: file, key, value and what would be right
├── MeshError           a mesh file that cannot be read: file, place and what is wrong there
├── SaveError           a robot that cannot be written where it was to go
│   └── RobotExistsError    there is one of that name
├── JointCountError     joint positions of another robot: one value a joint is asked for
├── ProgramError        a teach program that cannot be read: each line, word, value and what would be right
└── PoseError           a tool's pose that is none
"""

from collections.abc import Sequence
from pathlib import Path


class RobotError(Exception):
    """Base of the errors of robots; its text is one line for people."""


class DescriptionError(RobotError):
    """A robot description that cannot be used.

    Attributes:
        source: The file, or the name that was asked for.
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


class MeshError(RobotError):
    """A mesh file that cannot be read.

    Attributes:
        source: The file.
        place: Where in it: "line 12", "byte 96"; empty for the whole file.
        reason: What is wrong there.
        missing: A file that it cannot be read without, as it names it.
    """

    def __init__(self, source: str | Path, reason: str, *, place: str = "", missing: str = "") -> None:
        self.missing = missing
        self.source = str(source)
        self.place = place
        self.reason = reason
        super().__init__(f"{self.source}{', ' + place if place else ''}: {reason}")


class SaveError(RobotError):
    """A robot that cannot be written; what was there is as it was.

    Attributes:
        target: Its folder.
        reason: Why not.
    """

    def __init__(self, target: Path, reason: str) -> None:
        self.target = target
        self.reason = reason
        super().__init__(f"{target}: not saved, {reason}")


class RobotExistsError(SaveError):
    """There is a robot of that name.

    Attributes:
        changed: It is not the one any more that was to be replaced.
    """

    def __init__(self, target: Path, *, changed: bool = False) -> None:
        self.changed = changed
        super().__init__(
            target, "the robot there was changed" if changed else "there is a robot of that name"
        )


class ProgramError(RobotError):
    """A teach program that cannot be read.

    Attributes:
        problems: Each problem's line, from 1, and a sentence; the first hundred or so.
        found: How many there are.
    """

    def __init__(self, problems: Sequence[tuple[int, str]], *, found: int | None = None) -> None:
        self.problems = tuple(problems)
        self.found = len(self.problems) if found is None else found
        line, text = self.problems[0]
        more = self.found - 1
        rest = f" (and {more} more problem{'s' if more > 1 else ''})" if more else ""
        super().__init__(f"line {line}: {text}{rest}")


class JointCountError(RobotError):
    """Joint positions that do not have one value a joint."""

    def __init__(self, expected: int, got: tuple[int, ...]) -> None:
        self.expected = expected
        self.got = got
        super().__init__(f"joint positions of shape {got}: this robot takes ({expected},), one value a joint")


class PoseError(RobotError):
    """A tool's pose that is none.

    Attributes:
        reason: What is wrong with it, after "the pose".
    """

    def __init__(self, reason: str) -> None:
        self.reason = reason
        super().__init__(f"the pose {reason}")
