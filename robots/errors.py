"""Errors of robots.

RobotError
├── DescriptionError    a description that cannot be used: file, key, value and what would be right
├── MeshError           a mesh file that cannot be read: file, place and what is wrong there
└── JointCountError     joint positions of another robot: one value a joint is asked for
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
    """

    def __init__(self, source: str | Path, problems: Sequence[str]) -> None:
        self.source = str(source)
        self.problems = tuple(problems)
        more = len(self.problems) - 1
        rest = f" (and {more} more problem{'s' if more > 1 else ''})" if more else ""
        super().__init__(f"{self.source}: {self.problems[0]}{rest}")


class MeshError(RobotError):
    """A mesh file that cannot be read.

    Attributes:
        source: The file.
        place: Where in it: "line 12", "byte 96"; empty for the whole file.
        reason: What is wrong there.
    """

    def __init__(self, source: str | Path, reason: str, *, place: str = "") -> None:
        self.source = str(source)
        self.place = place
        self.reason = reason
        super().__init__(f"{self.source}{', ' + place if place else ''}: {reason}")


class JointCountError(RobotError):
    """Joint positions that do not have one value a joint."""

    def __init__(self, expected: int, got: tuple[int, ...]) -> None:
        self.expected = expected
        self.got = got
        super().__init__(f"joint positions of shape {got}: this robot takes ({expected},), one value a joint")
