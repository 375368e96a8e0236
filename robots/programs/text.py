"""Parser of teach programs: plain lines that are easy to read, diff and write.

    program    = line *( newline line )
    line       = [ definition | statement ] [ "#" comment ]
    definition = "point" name "=" ( "joints" n*number | "pose" 6*number )
    statement  = "home"
               | "move_joints" target          straight line in joint space
               | "move_line" target            straight line of the tool
               | "move_line_by" frame 6*number   straight line of the tool, from where it is
               | "speed" number                percent of the joints' maximum speeds, 1 to 100
               | "tool_speed" number           mm/s: asserted limit for the following moves
               | "wait" number                 seconds
               | "trace" ( "on" | "off" )
               | "repeat" count newline *line "end"
    target     = name                          a point, defined anywhere in the program
               | n*number                      of move_joints: degrees, mm of a prismatic joint
               | 6*number                      of move_line: x y z in mm, roll pitch yaw in degrees,
                                               the tool in the base frame
    frame      = "tool" | "base" | "site"        whose axes x y z in mm, roll pitch yaw in degrees name
    name       = a-z *( a-z | 0-9 | "_" | "-" )

Words are separated by blanks. Roll, pitch and yaw rotate about the fixed x, y and z axes, in this order.
"""

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from math import radians

import numpy as np

from robomesh import reason_codes as codes
from robomesh.reasons import Code, Reason
from robots.kinematics.joints import FloatArray, Joints, JointType
from robots.programs import MOST_BYTES
from robots.programs.statements import (
    Home,
    JointTarget,
    MoveJoints,
    MoveLine,
    MoveLineBy,
    PoseTarget,
    Program,
    Repeat,
    Speed,
    Statement,
    StepFrame,
    Target,
    ToolSpeed,
    Trace,
    Wait,
)
from robots.schema.errors import ProgramError
from robots.schema.poses import rpy_rotation
from robots.schema.robot_toml import similar

MOST_LINES = 10_000
MOST_STEPS = 100_000
MOST_DEPTH = 20
_MOST_PROBLEMS = 100
_LONGEST_NAME = 64
# Names that the unknown one of a problem is compared with; a comparison takes 20 us.
_MOST_COMPARED = 100

_STATEMENTS = (
    *("home", "move_joints", "move_line", "move_line_by", "point"),
    *("speed", "tool_speed", "wait", "trace", "repeat"),
)
_NAME = re.compile(r"[a-z][a-z0-9_-]*")
# Each digit has one place, so that a long word that is no number is rejected in linear time.
_NUMBER = re.compile(r"[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]+)?")
# Beyond any arm. A larger number is a typing error, and sums of such numbers may overflow.
_FARTHEST = 100_000.0
_POSE_WORDS = ("x", "y", "z", "roll", "pitch", "yaw")


class _LineError(Exception):
    """A line that cannot be read, with the reason."""

    def __init__(self, reason: Reason) -> None:
        super().__init__(reason.text)
        self.reason = reason


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
        self._problems: list[tuple[int, Reason]] = []
        self._blocks = [_Block(0, 1)]

    def program(self, text: str) -> Program:
        size = len(text.encode("utf-8", "replace"))
        if size > MOST_BYTES:
            raise ProgramError([(1, codes.PROGRAM_BYTES(count=size, most=MOST_BYTES))])
        # Not str.splitlines(), which splits at characters that editors do not count as line breaks.
        lines = [
            line.partition("#")[0].split()
            for line in text.removeprefix("\ufeff").replace("\r\n", "\n").split("\n")
        ]
        if len(lines) > MOST_LINES:
            raise ProgramError([(MOST_LINES, codes.PROGRAM_LINES(count=len(lines), most=MOST_LINES))])
        # Points first: a program may use one above its definition.
        for handle in (self._define, self._take):
            for number, words in enumerate(lines, start=1):
                if words and (words[0] == "point") == (handle == self._define):
                    self._collect_problems(handle, number, words)
        for block in self._blocks[1:]:
            self._problems.append((block.line, codes.REPEAT_NOT_CLOSED()))
        if self._problems:
            by_line = sorted(self._problems, key=lambda each: (each[0], each[1].text))
            raise ProgramError(by_line[:_MOST_PROBLEMS], found=len(by_line))
        return Program(tuple(self._blocks[0].body), self._points)

    def _collect_problems(
        self, handle: Callable[[int, Sequence[str]], None], number: int, words: Sequence[str]
    ) -> None:
        try:
            handle(number, words)
        except _LineError as wrong:
            self._problems.append((number, wrong.reason))

    # ----------------------------------------------------------------- definitions

    def _define(self, line: int, words: Sequence[str]) -> None:
        if len(words) < 4 or words[2] != "=" or words[3] not in ("joints", "pose"):
            raise _LineError(codes.POINT_FORM())
        name = words[1]
        if not _NAME.fullmatch(name) or len(name) > _LONGEST_NAME:
            raise _LineError(codes.POINT_NAME(name=_short(name), most=_LONGEST_NAME))
        if name in (*_STATEMENTS, "end"):
            raise _LineError(codes.POINT_RESERVED(name=name))
        # A point with wrong numbers counts as defined, so that its uses are not reported too.
        before = self._defined.setdefault(name, line)
        if before != line:
            raise _LineError(codes.POINT_TWICE(name=name, line=before))
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
            case "move_line_by":
                if not rest or rest[0] not in tuple(StepFrame):
                    raise _LineError(codes.FRAME_FORM(given=_given(rest[:1])))
                return MoveLineBy(line, StepFrame(rest[0]), _pose_target(word, rest[1:]).tool_to_base)
            case "speed":
                return Speed(line, _one_number(word, rest, 1.0, 100.0, "percent"))
            case "tool_speed":
                return ToolSpeed(line, _one_number(word, rest, 1.0, 10_000.0, "mm/s") / 1000)
            case "wait":
                return Wait(line, _one_number(word, rest, 0.0, 3600.0, "seconds"))
            case "trace":
                if list(rest) not in (["on"], ["off"]):
                    raise _LineError(codes.TRACE_FORM(given=_given(rest)))
                return Trace(line, rest[0] == "on")
        if near := self._similar(word, (*_STATEMENTS, "end")):
            raise _LineError(codes.STATEMENT_NEAR(word=_short(word), near=near))
        raise _LineError(codes.STATEMENT_UNKNOWN(word=_short(word), names=", ".join((*_STATEMENTS, "end"))))

    def _target(self, word: str, rest: Sequence[str]) -> Target | None:
        if len(rest) == 1 and not _NUMBER.fullmatch(rest[0]):
            name = rest[0]
            if name not in self._defined:
                raise _LineError(self._no_point(word, name))
            return self._points.get(name)
        if word == "move_joints":
            return self._joint_target(word, rest)
        return _pose_target(word, rest)

    def _no_point(self, word: str, name: str) -> Reason:
        shown, defined = _short(name), ", ".join(islice(self._defined, _MOST_COMPARED))
        if not self._defined:
            return codes.POINT_NONE(word=word, name=shown)
        if near := self._similar(name, self._defined):
            return codes.POINT_NEAR(word=word, name=shown, near=near)
        return codes.POINT_UNKNOWN(word=word, name=shown, names=defined)

    def _similar(self, word: str, names: Iterable[str]) -> str:
        """Return the most similar name of the first hundred, for a problem that is listed; empty: none."""
        listed = len(self._problems) < _MOST_PROBLEMS
        return similar(word.lower(), islice(names, _MOST_COMPARED)) if listed else ""

    def _joint_target(self, word: str, rest: Sequence[str]) -> JointTarget:
        values = _numbers(word, rest, self._joints.names, codes.JOINT_NUMBERS)
        return JointTarget(np.array(values) * joint_scales(self._joints))

    # --------------------------------------------------------------------- repeats

    def _open(self, line: int, rest: Sequence[str]) -> None:
        try:
            count = _one_number("repeat", rest, 1, MOST_STEPS, "times")
            if count != int(count):
                raise _LineError(codes.REPEAT_NOT_WHOLE(given=rest[0]))
            if len(self._blocks) > MOST_DEPTH:
                raise _LineError(codes.REPEAT_TOO_DEEP(most=MOST_DEPTH))
        except _LineError:
            self._blocks.append(_Block(line, 1))  # so that its 'end' is not reported
            raise
        self._blocks.append(_Block(line, int(count)))

    def _close(self) -> None:
        if len(self._blocks) == 1:
            raise _LineError(codes.END_WITHOUT_REPEAT())
        block = self._blocks.pop()
        self._blocks[-1].body.append(Repeat(block.line, block.count, tuple(block.body)))
        self._count(self._blocks[-1], block.steps * block.count, block.line)

    def _count(self, block: _Block, steps: int, line: int) -> None:
        block.steps += steps
        if block.steps > MOST_STEPS:
            block.steps = 0  # report this once
            raise _LineError(codes.PROGRAM_STEPS(most=MOST_STEPS))


def joint_scales(joints: Joints) -> FloatArray:
    """Return the (n,) SI values of a program's units: radians per degree, metres per millimetre."""
    return np.array([radians(1.0) if kind is JointType.ROTARY else 0.001 for kind in joints.types])


def _pose_target(word: str, rest: Sequence[str]) -> PoseTarget:
    x, y, z, roll, pitch, yaw = _numbers(word, rest, _POSE_WORDS, codes.POSE_NUMBERS)
    return PoseTarget(pose_of(x, y, z, roll, pitch, yaw))


def pose_of(x: float, y: float, z: float, roll: float, pitch: float, yaw: float) -> FloatArray:
    """Return the (4, 4) [m] of a pose in mm and degrees."""
    pose = np.eye(4)
    pose[:3, :3] = rpy_rotation(radians(roll), radians(pitch), radians(yaw))
    pose[:3, 3] = np.array([x, y, z]) / 1000
    return pose


def _numbers(word: str, rest: Sequence[str], names: Sequence[str], wrong_count: Code) -> list[float]:
    """Parse one number for each name.

    Args:
        wrong_count: Reason for another number of numbers.
    """
    wrong = [each for each in rest if not _NUMBER.fullmatch(each)]
    if wrong:
        raise _LineError(codes.NOT_A_NUMBER(word=word, given=_short(wrong[0])))
    if len(rest) != len(names):
        raise _LineError(wrong_count(word=word, count=len(names), names=" ".join(names), given=len(rest)))
    values = [float(each) for each in rest]
    for name, value, text in zip(names, values, rest, strict=True):
        if not abs(value) <= _FARTHEST:
            raise _LineError(codes.NUMBER_TOO_LARGE(word=word, name=name, given=text[:40], most=_FARTHEST))
    return values


def _one_number(word: str, rest: Sequence[str], lowest: float, highest: float, unit: str) -> float:
    if len(rest) != 1 or not _NUMBER.fullmatch(rest[0]):
        raise _LineError(codes.ONE_NUMBER(word=word, unit=unit, given=_given(rest)))
    value = float(rest[0])
    if not lowest <= value <= highest:
        raise _LineError(
            codes.NUMBER_OUTSIDE(word=word, given=rest[0][:40], least=lowest, most=highest, unit=unit)
        )
    return value


def _no_arguments(word: str, rest: Sequence[str]) -> None:
    if rest:
        raise _LineError(codes.NO_ARGUMENT(word=word, given=_short(" ".join(rest))))


def _given(rest: Sequence[str]) -> str:
    return f"'{_short(' '.join(rest))}'" if rest else "nothing"


def _short(words: str) -> str:
    return words if len(words) <= 40 else f"{words[:37]}..."
