"""Parser of teach programs: plain lines that are easy to read, diff and write.

    program    = line *( newline line )
    line       = [ definition | statement ] [ "#" comment ]
    definition = "point" name "=" ( "joints" n*number | "pose" 6*number )
    statement  = "home"
               | "move_joints" target          straight line in joint space
               | "move_line" target            straight line of the tool
               | "speed" number                percent of the joints' maximum speeds, 1 to 100
               | "tool_speed" number           mm/s: asserted limit for the following moves
               | "wait" number                 seconds
               | "trace" ( "on" | "off" )
               | "repeat" count newline *line "end"
    target     = name                          a point, defined anywhere in the program
               | n*number                      of move_joints: degrees, mm of a prismatic joint
               | 6*number                      of move_line: x y z in mm, roll pitch yaw in degrees,
                                               the tool in the base frame
    name       = a-z *( a-z | 0-9 | "_" | "-" )

Words are separated by blanks. Roll, pitch and yaw rotate about the fixed x, y and z axes, in this order.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from math import radians

import numpy as np

from robots.errors import ProgramError
from robots.joints import FloatArray, Joints, JointType
from robots.poses import rpy_rotation
from robots.programs.statements import (
    Home,
    JointTarget,
    MoveJoints,
    MoveLine,
    PoseTarget,
    Program,
    Repeat,
    Speed,
    Statement,
    Target,
    ToolSpeed,
    Trace,
    Wait,
)
from robots.schema import nearest

MOST_BYTES = 64 * 1024
MOST_LINES = 10_000
MOST_STEPS = 100_000
MOST_DEPTH = 20
_MOST_PROBLEMS = 100
_LONGEST_NAME = 64

_STATEMENTS = ("home", "move_joints", "move_line", "point", "speed", "tool_speed", "wait", "trace", "repeat")
_NAME = re.compile(r"[a-z][a-z0-9_-]*")
_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
# Beyond any arm. A larger number is a typing error, and sums of such numbers may overflow.
_FARTHEST = 100_000.0
_POSE_WORDS = ("x", "y", "z", "roll", "pitch", "yaw")


class _LineError(Exception):
    """A line that cannot be read; the text says why."""


@dataclass
class _Block:
    """An open repeat, or the program itself (line 0)."""

    line: int
    count: int
    body: list[Statement] = field(default_factory=list)
    steps: int = 0


def parse_program(text: str, joints: Joints) -> Program:
    """Parse a program's text.

    Args:
        joints: The arm's joints: their number, and which are prismatic.

    Raises:
        ProgramError: If the text has a problem; the error lists all problems.
    """
    return _Parser(joints).program(text)


class _Parser:
    def __init__(self, joints: Joints) -> None:
        self._joints = joints
        self._points: dict[str, Target] = {}
        self._defined: dict[str, int] = {}
        self._problems: list[tuple[int, str]] = []
        self._blocks = [_Block(0, 1)]

    def program(self, text: str) -> Program:
        size = len(text.encode("utf-8", "replace"))
        if size > MOST_BYTES:
            raise ProgramError([(1, f"the program has {size} bytes; up to {MOST_BYTES} are read")])
        # Not str.splitlines(), which splits at characters that editors do not count as line breaks.
        lines = [
            line.partition("#")[0].split()
            for line in text.removeprefix("\ufeff").replace("\r\n", "\n").split("\n")
        ]
        if len(lines) > MOST_LINES:
            raise ProgramError(
                [(MOST_LINES, f"the program has {len(lines)} lines; up to {MOST_LINES} are read")]
            )
        # Points first: a program may use one above its definition.
        for handle in (self._define, self._take):
            for number, words in enumerate(lines, start=1):
                if words and (words[0] == "point") == (handle == self._define):
                    self._collect_problems(handle, number, words)
        for block in self._blocks[1:]:
            self._problems.append((block.line, "'repeat' has no 'end'"))
        if self._problems:
            raise ProgramError(sorted(self._problems)[:_MOST_PROBLEMS], found=len(self._problems))
        return Program(tuple(self._blocks[0].body), self._points)

    def _collect_problems(
        self, handle: Callable[[int, Sequence[str]], None], number: int, words: Sequence[str]
    ) -> None:
        try:
            handle(number, words)
        except _LineError as wrong:
            self._problems.append((number, str(wrong)))

    # ----------------------------------------------------------------- definitions

    def _define(self, line: int, words: Sequence[str]) -> None:
        if len(words) < 4 or words[2] != "=" or words[3] not in ("joints", "pose"):
            raise _LineError("write a definition as 'point NAME = joints ...' or 'point NAME = pose ...'")
        name = words[1]
        if not _NAME.fullmatch(name) or len(name) > _LONGEST_NAME:
            raise _LineError(
                f"{_quoted(name)} is not a valid point name: small letters, digits, _ and -, a letter first, "
                f"up to {_LONGEST_NAME}"
            )
        if name in (*_STATEMENTS, "end"):
            raise _LineError(f"{name!r} is a statement and not a valid point name: choose another")
        # A point with wrong numbers counts as defined, so that its uses are not reported too.
        before = self._defined.setdefault(name, line)
        if before != line:
            raise _LineError(f"point {name!r} is already defined in line {before}")
        if words[3] == "joints":
            self._points[name] = replace(self._joint_target("joints", words[4:]), name=name)
        else:
            self._points[name] = replace(_pose_target("pose", words[4:]), name=name)

    # ------------------------------------------------------------------ statements

    def _take(self, line: int, words: Sequence[str]) -> None:
        word, rest = words[0], words[1:]
        match word:
            case "repeat":
                self._open(line, rest)
            case "end":
                _no_arguments(word, rest)
                self._close()
            case _:
                statement = self._statement(line, word, rest)
                # The use of a point that could not be read is not reported as another problem.
                if statement is not None:
                    self._blocks[-1].body.append(statement)
                    self._count(self._blocks[-1], 1, line)

    def _statement(self, line: int, word: str, rest: Sequence[str]) -> Statement | None:
        match word:
            case "home":
                _no_arguments(word, rest)
                return Home(line)
            case "move_joints" | "move_line":
                target = self._target(word, rest)
                if target is None:
                    return None
                return MoveJoints(line, target) if word == "move_joints" else MoveLine(line, target)
            case "speed":
                return Speed(line, _one_number(word, rest, 1.0, 100.0, "percent"))
            case "tool_speed":
                return ToolSpeed(line, _one_number(word, rest, 1.0, 10_000.0, "mm/s") / 1000)
            case "wait":
                return Wait(line, _one_number(word, rest, 0.0, 3600.0, "seconds"))
            case "trace":
                if list(rest) not in (["on"], ["off"]):
                    found = _quoted(" ".join(rest)) if rest else "nothing"
                    raise _LineError(f"'trace' takes on or off, not {found}")
                return Trace(line, rest[0] == "on")
        raise _LineError(f"{_quoted(word)} is not a statement{nearest(word.lower(), (*_STATEMENTS, 'end'))}")

    def _target(self, word: str, rest: Sequence[str]) -> Target | None:
        if len(rest) == 1 and not _NUMBER.fullmatch(rest[0]):
            name = rest[0]
            if name not in self._defined:
                hint = nearest(name.lower(), self._defined) if self._defined else "; none is defined"
                raise _LineError(f"{word}: there is no point {_quoted(name)}{hint}")
            return self._points.get(name)
        if word == "move_joints":
            return self._joint_target(word, rest)
        return _pose_target(word, rest)

    def _joint_target(self, word: str, rest: Sequence[str]) -> JointTarget:
        values = _numbers(word, rest, self._joints.names, "degrees, mm of a prismatic joint")
        return JointTarget(np.array(values) * joint_scales(self._joints))

    # --------------------------------------------------------------------- repeats

    def _open(self, line: int, rest: Sequence[str]) -> None:
        try:
            count = _one_number("repeat", rest, 1, MOST_STEPS, "times")
            if count != int(count):
                raise _LineError(f"'repeat' takes a whole number, not {rest[0]}")
            if len(self._blocks) > MOST_DEPTH:
                raise _LineError(f"'repeat' is nested more than {MOST_DEPTH} deep")
        except _LineError:
            self._blocks.append(_Block(line, 1))  # so that its 'end' is not reported
            raise
        self._blocks.append(_Block(line, int(count)))

    def _close(self) -> None:
        if len(self._blocks) == 1:
            raise _LineError("'end' without an open 'repeat' above")
        block = self._blocks.pop()
        self._blocks[-1].body.append(Repeat(block.line, block.count, tuple(block.body)))
        self._count(self._blocks[-1], block.steps * block.count, block.line)

    def _count(self, block: _Block, steps: int, line: int) -> None:
        block.steps += steps
        if block.steps > MOST_STEPS:
            block.steps = 0  # report this once
            raise _LineError(f"the program has more than {MOST_STEPS} steps here, including repeats")


def joint_scales(joints: Joints) -> FloatArray:
    """Return the (n,) SI values of a program's units: radians per degree, metres per millimetre."""
    return np.array([radians(1.0) if kind is JointType.ROTARY else 0.001 for kind in joints.types])


def _pose_target(word: str, rest: Sequence[str]) -> PoseTarget:
    x, y, z, roll, pitch, yaw = _numbers(word, rest, _POSE_WORDS, "mm and degrees")
    return PoseTarget(pose_of(x, y, z, roll, pitch, yaw))


def pose_of(x: float, y: float, z: float, roll: float, pitch: float, yaw: float) -> FloatArray:
    """Return the (4, 4) [m] of a pose in mm and degrees."""
    pose = np.eye(4)
    pose[:3, :3] = rpy_rotation(radians(roll), radians(pitch), radians(yaw))
    pose[:3, 3] = np.array([x, y, z]) / 1000
    return pose


def _numbers(word: str, rest: Sequence[str], names: Sequence[str], units: str) -> list[float]:
    """Parse one number for each name."""
    wrong = [each for each in rest if not _NUMBER.fullmatch(each)]
    if wrong:
        raise _LineError(f"'{word}': {_quoted(wrong[0])} is not a number")
    if len(rest) != len(names):
        raise _LineError(
            f"'{word}' takes {len(names)} number{'s' if len(names) > 1 else ''} "
            f"({' '.join(names)}: {units}), not {len(rest)}"
        )
    values = [float(each) for each in rest]
    for name, value, text in zip(names, values, rest, strict=True):
        if not abs(value) <= _FARTHEST:
            raise _LineError(
                f"'{word}': {name} is {text[:40]}; must be between -{_FARTHEST:.0f} and {_FARTHEST:.0f}"
            )
    return values


def _one_number(word: str, rest: Sequence[str], lowest: float, highest: float, unit: str) -> float:
    if len(rest) != 1 or not _NUMBER.fullmatch(rest[0]):
        raise _LineError(
            f"'{word}' takes one number ({unit}), not {_quoted(' '.join(rest)) if rest else 'nothing'}"
        )
    value = float(rest[0])
    if not lowest <= value <= highest:
        raise _LineError(f"'{word}' is {rest[0][:40]}; must be between {lowest:g} and {highest:g} {unit}")
    return value


def _no_arguments(word: str, rest: Sequence[str]) -> None:
    if rest:
        raise _LineError(f"'{word}' takes no argument, not {_quoted(' '.join(rest))}")


def _quoted(words: str) -> str:
    return repr(words if len(words) <= 40 else f"{words[:37]}...")
