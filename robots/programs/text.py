"""The text of a teach program: plain lines that people read, diff and teach.

    program    = line *( newline line )
    line       = [ definition | statement ] [ "#" comment ]
    definition = "point" name "=" ( "joints" n*number | "pose" 6*number )
    statement  = "home"
               | "move_joints" target          joints straight to their positions
               | "move_line" target            the tool on a straight line
               | "speed" number                percent of the joints' greatest speeds, 1 to 100
               | "tool_speed" number           mm/s: a promise, from here on
               | "wait" number                 seconds
               | "trace" ( "on" | "off" )
               | "repeat" count newline *line "end"
    target     = name                          a point, defined anywhere in the program
               | n*number                      of move_joints: degrees, mm of a prismatic joint
               | 6*number                      of move_line: x y z in mm, roll pitch yaw in degrees,
                                               the tool in the base frame
    name       = a-z *( a-z | 0-9 | "_" | "-" )

Words are parted by blanks. Roll, pitch and yaw turn about the fixed x, y and z axes, in this order.
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
# Beyond any arm: what is larger is a slip of the hand, and sums of it might not be finite.
_FARTHEST = 100_000.0
_POSE_WORDS = ("x", "y", "z", "roll", "pitch", "yaw")


class _Wrong(Exception):
    """A line that cannot be read; the text says why."""


@dataclass
class _Block:
    """A repeat that is still open, or the program itself (line 0)."""

    line: int
    count: int
    body: list[Statement] = field(default_factory=list)
    steps: int = 0


def parse_program(text: str, joints: Joints) -> Program:
    """The program that a text says.

    Args:
        joints: Of the arm that it is for: how many, and which are prismatic.

    Raises:
        ProgramError: If something cannot be read; it tells every problem of the text.
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
        # Only what editors count as lines.
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
                    self._guarded(handle, number, words)
        for block in self._blocks[1:]:
            self._problems.append((block.line, "'repeat' has no 'end'"))
        if self._problems:
            raise ProgramError(sorted(self._problems)[:_MOST_PROBLEMS], found=len(self._problems))
        return Program(tuple(self._blocks[0].body), self._points)

    def _guarded(
        self, handle: Callable[[int, Sequence[str]], None], number: int, words: Sequence[str]
    ) -> None:
        try:
            handle(number, words)
        except _Wrong as wrong:
            self._problems.append((number, str(wrong)))

    # ----------------------------------------------------------------- definitions

    def _define(self, line: int, words: Sequence[str]) -> None:
        if len(words) < 4 or words[2] != "=" or words[3] not in ("joints", "pose"):
            raise _Wrong("a point is defined as 'point NAME = joints ...' or 'point NAME = pose ...'")
        name = words[1]
        if not _NAME.fullmatch(name) or len(name) > _LONGEST_NAME:
            raise _Wrong(
                f"{_quoted(name)} is no name for a point: small letters, digits, _ and -, a letter first, "
                f"up to {_LONGEST_NAME}"
            )
        if name in (*_STATEMENTS, "end"):
            raise _Wrong(f"{name!r} is a statement and no name for a point: take another")
        # A point whose numbers are wrong is defined all the same: its users are not.
        before = self._defined.setdefault(name, line)
        if before != line:
            raise _Wrong(f"point {name!r} is defined in line {before} already")
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
                _nothing_behind(word, rest)
                self._close()
            case _:
                statement = self._statement(line, word, rest)
                # What a point that could not be read is for is no problem of its own.
                if statement is not None:
                    self._blocks[-1].body.append(statement)
                    self._count(self._blocks[-1], 1, line)

    def _statement(self, line: int, word: str, rest: Sequence[str]) -> Statement | None:
        match word:
            case "home":
                _nothing_behind(word, rest)
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
                    said = _quoted(" ".join(rest)) if rest else "nothing"
                    raise _Wrong(f"'trace' takes on or off, not {said}")
                return Trace(line, rest[0] == "on")
        raise _Wrong(f"{_quoted(word)} is no statement{nearest(word.lower(), (*_STATEMENTS, 'end'))}")

    def _target(self, word: str, rest: Sequence[str]) -> Target | None:
        if len(rest) == 1 and not _NUMBER.fullmatch(rest[0]):
            name = rest[0]
            if name not in self._defined:
                hint = nearest(name.lower(), self._defined) if self._defined else "; none is defined"
                raise _Wrong(f"{word}: there is no point {_quoted(name)}{hint}")
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
                raise _Wrong(f"'repeat' takes a whole number, not {rest[0]}")
            if len(self._blocks) > MOST_DEPTH:
                raise _Wrong(f"'repeat' is nested more than {MOST_DEPTH} deep")
        except _Wrong:
            self._blocks.append(_Block(line, 1))  # its 'end' is right
            raise
        self._blocks.append(_Block(line, int(count)))

    def _close(self) -> None:
        if len(self._blocks) == 1:
            raise _Wrong("'end' ends nothing: there is no open 'repeat' above")
        block = self._blocks.pop()
        self._blocks[-1].body.append(Repeat(block.line, block.count, tuple(block.body)))
        self._count(self._blocks[-1], block.steps * block.count, block.line)

    def _count(self, block: _Block, steps: int, line: int) -> None:
        block.steps += steps
        if block.steps > MOST_STEPS:
            block.steps = 0  # said once
            raise _Wrong(f"the program comes to more than {MOST_STEPS} steps here, its repeats counted")


def joint_scales(joints: Joints) -> FloatArray:
    """(n,) SI units in what programs count in: radians in a degree, metres in a millimetre."""
    return np.array([radians(1.0) if kind is JointType.ROTARY else 0.001 for kind in joints.types])


def _pose_target(word: str, rest: Sequence[str]) -> PoseTarget:
    x, y, z, roll, pitch, yaw = _numbers(word, rest, _POSE_WORDS, "mm and degrees")
    return PoseTarget(pose_of(x, y, z, roll, pitch, yaw))


def pose_of(x: float, y: float, z: float, roll: float, pitch: float, yaw: float) -> FloatArray:
    """(4, 4) in metres of a pose in mm and degrees."""
    pose = np.eye(4)
    pose[:3, :3] = rpy_rotation(radians(roll), radians(pitch), radians(yaw))
    pose[:3, 3] = np.array([x, y, z]) / 1000
    return pose


def _numbers(word: str, rest: Sequence[str], names: Sequence[str], units: str) -> list[float]:
    """A number for each name."""
    wrong = [each for each in rest if not _NUMBER.fullmatch(each)]
    if wrong:
        raise _Wrong(f"'{word}': {_quoted(wrong[0])} is no number")
    if len(rest) != len(names):
        raise _Wrong(
            f"'{word}' takes {len(names)} number{'s' if len(names) > 1 else ''} "
            f"({' '.join(names)}: {units}), not {len(rest)}"
        )
    values = [float(each) for each in rest]
    for name, value, said in zip(names, values, rest, strict=True):
        if not abs(value) <= _FARTHEST:
            raise _Wrong(
                f"'{word}': {name} is {said[:40]}; from -{_FARTHEST:.0f} to {_FARTHEST:.0f} is right"
            )
    return values


def _one_number(word: str, rest: Sequence[str], lowest: float, highest: float, unit: str) -> float:
    if len(rest) != 1 or not _NUMBER.fullmatch(rest[0]):
        raise _Wrong(
            f"'{word}' takes one number ({unit}), not {_quoted(' '.join(rest)) if rest else 'nothing'}"
        )
    value = float(rest[0])
    if not lowest <= value <= highest:
        raise _Wrong(f"'{word}' is {rest[0][:40]}; from {lowest:g} to {highest:g} {unit} is right")
    return value


def _nothing_behind(word: str, rest: Sequence[str]) -> None:
    if rest:
        raise _Wrong(f"'{word}' stands alone, not with {_quoted(' '.join(rest))}")


def _quoted(words: str) -> str:
    return repr(words if len(words) <= 40 else f"{words[:37]}...")
