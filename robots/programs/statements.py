"""What a teach program says, in SI: its statements, nested as they were written."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

from robots.joints import FloatArray


@dataclass(frozen=True, eq=False)
class JointTarget:
    """Where the joints are to be: (n,) [rad] or [m]; the name of the point, if it is one."""

    positions: FloatArray
    name: str = ""


@dataclass(frozen=True, eq=False)
class PoseTarget:
    """Where the tool is to be: (4, 4), tool to base [m]; the name of the point, if it is one."""

    tool_to_base: FloatArray
    name: str = ""


Target: TypeAlias = JointTarget | PoseTarget


@dataclass(frozen=True)
class Home:
    """Go to the home position, as slowly as homing is."""

    line: int


@dataclass(frozen=True, eq=False)
class MoveJoints:
    """Go to a target, straight between the joint positions."""

    line: int
    target: Target


@dataclass(frozen=True, eq=False)
class MoveLine:
    """Go to a target, the tool on a straight line and turning evenly."""

    line: int
    target: Target


@dataclass(frozen=True)
class Speed:
    """Percent of the joints' greatest speeds from here on, 1 to 100."""

    line: int
    percent: float


@dataclass(frozen=True)
class ToolSpeed:
    """A promise that the tool is no faster from here on [m/s]."""

    line: int
    most: float


@dataclass(frozen=True)
class Wait:
    """Stand for some seconds."""

    line: int
    seconds: float


@dataclass(frozen=True)
class Trace:
    """Turn the controller's trace on or off."""

    line: int
    on: bool


@dataclass(frozen=True, eq=False)
class Repeat:
    """Do some statements several times."""

    line: int
    count: int
    body: tuple["Statement", ...]


Statement: TypeAlias = Home | MoveJoints | MoveLine | Speed | ToolSpeed | Wait | Trace | Repeat


@dataclass(frozen=True, eq=False)
class Program:
    """A program for one kind of arm.

    Attributes:
        points: Targets by name.
    """

    statements: tuple[Statement, ...]
    points: Mapping[str, Target]
