"""Statements of a teach program, in SI, nested as in the text."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import TypeAlias

from robots.kinematics.joints import FloatArray


@dataclass(frozen=True, eq=False)
class JointTarget:
    """Target joint positions: (n,) [rad] or [m], with the name of the point if it has one."""

    positions: FloatArray
    name: str = ""


@dataclass(frozen=True, eq=False)
class PoseTarget:
    """Target tool pose: (4, 4), tool to base [m], with the name of the point if it has one."""

    tool_to_base: FloatArray
    name: str = ""


Target: TypeAlias = JointTarget | PoseTarget


@dataclass(frozen=True)
class Home:
    """Move to the home position at homing speed."""

    line: int


@dataclass(frozen=True, eq=False)
class MoveJoints:
    """Move to a target on a straight line in joint space."""

    line: int
    target: Target


@dataclass(frozen=True, eq=False)
class MoveLine:
    """Move to a target with the tool on a straight line, rotating uniformly."""

    line: int
    target: Target


class StepFrame(StrEnum):
    """The frame whose axes a `MoveLineBy` names."""

    TOOL = "tool"
    BASE = "base"
    SITE = "site"


@dataclass(frozen=True, eq=False)
class MoveLineBy:
    """Move by an offset, with the tool on a straight line, rotating uniformly about its origin.

    Attributes:
        offset: (4, 4) translation [m] and rotation along and about the frame's axes.
    """

    line: int
    frame: StepFrame
    offset: FloatArray


@dataclass(frozen=True)
class Speed:
    """Set the speed to a percentage of the joints' maximum speeds, 1 to 100."""

    line: int
    percent: float


@dataclass(frozen=True)
class ToolSpeed:
    """Assert a limit of the tool's speed for the following moves [m/s]; the check verifies it."""

    line: int
    most: float


@dataclass(frozen=True)
class Wait:
    """Wait for some seconds."""

    line: int
    seconds: float


@dataclass(frozen=True)
class Trace:
    """Turn the controller's trace on or off."""

    line: int
    on: bool


@dataclass(frozen=True, eq=False)
class Repeat:
    """Repeat statements several times."""

    line: int
    count: int
    body: tuple["Statement", ...]


Statement: TypeAlias = Home | MoveJoints | MoveLine | MoveLineBy | Speed | ToolSpeed | Wait | Trace | Repeat


@dataclass(frozen=True, eq=False)
class Program:
    """A program for one kind of arm.

    Attributes:
        points: Targets by name.
    """

    statements: tuple[Statement, ...]
    points: Mapping[str, Target]
