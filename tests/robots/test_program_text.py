"""The text of teach programs: parsing, writing, and all problems."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robomesh import reason_codes as codes
from robomesh.reasons import Reason
from robots.descriptions.description import load
from robots.kinematics.joints import joints_of
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
from robots.programs.text import MOST_LINES, MOST_STEPS, parse_program, pose_of
from robots.programs.write import program_text
from robots.schema.errors import ProgramError

JOINTS = joints_of(load("pt600"))
ABOVE = JointTarget(np.radians([10.0, 20.0, 30.0, 0.0, -5.5]), "above")
PART = PoseTarget(pose_of(400.0, 0.0, 300.25, 180.0, 0.0, 90.0), "part")
POINTS: dict[str, Target] = {"above": ABOVE, "part": PART}
HEAD = "point above = joints 10 20 30 0 -5.5\npoint part = pose 400 0 300.25 180 0 90\n"

TABLE: tuple[tuple[str, tuple[Statement, ...]], ...] = (
    ("home\n", (Home(3),)),
    ("speed 50\n", (Speed(3, 50.0),)),
    ("tool_speed 250\n", (ToolSpeed(3, 0.25),)),
    ("wait 0.5\n", (Wait(3, 0.5),)),
    ("trace on\ntrace off\n", (Trace(3, True), Trace(4, False))),
    ("move_joints above\n", (MoveJoints(3, ABOVE),)),
    ("move_joints part\n", (MoveJoints(3, PART),)),
    ("move_line part\n", (MoveLine(3, PART),)),
    ("move_line above\n", (MoveLine(3, ABOVE),)),
    ("move_joints 10 20 30 0 -5.5\n", (MoveJoints(3, JointTarget(ABOVE.positions)),)),
    ("move_line 400 0 300.25 180 0 90\n", (MoveLine(3, PoseTarget(PART.tool_to_base)),)),
    (
        "move_line_by tool 0 0 -50 0 0 0\nmove_line_by site 10 0 0 0 0 90\n",
        (
            MoveLineBy(3, StepFrame.TOOL, pose_of(0.0, 0.0, -50.0, 0.0, 0.0, 0.0)),
            MoveLineBy(4, StepFrame.SITE, pose_of(10.0, 0.0, 0.0, 0.0, 0.0, 90.0)),
        ),
    ),
    (
        "repeat 3\n  home\n  repeat 2\n    wait 1\n  end\nend\n",
        (Repeat(3, 3, (Home(4), Repeat(5, 2, (Wait(6, 1.0),)))),),
    ),
)


def comparable(statement: Statement) -> tuple[object, ...]:
    """Convert a statement to comparable values."""
    if isinstance(statement, Repeat):
        return ("repeat", statement.line, statement.count, *map(comparable, statement.body))
    if isinstance(statement, MoveJoints | MoveLine):
        target = statement.target
        values = target.positions if isinstance(target, JointTarget) else target.tool_to_base
        return (type(statement), statement.line, target.name, *np.round(values, 9).ravel().tolist())
    if isinstance(statement, MoveLineBy):
        return (statement.line, statement.frame, *np.round(statement.offset, 9).ravel().tolist())
    return (statement,)


@pytest.mark.parametrize(("text", "statements"), TABLE)
def test_text_and_statements_round_trip(text: str, statements: tuple[Statement, ...]) -> None:
    program = parse_program(HEAD + text, JOINTS)
    assert [comparable(each) for each in program.statements] == [comparable(each) for each in statements]
    assert program_text(Program(statements, POINTS), JOINTS) == HEAD + text


def test_comments_blank_lines_and_the_place_of_a_point_do_not_matter() -> None:
    text = "\ufeff# all of it\r\n\r\n  move_joints above   # taught today\r\n" + HEAD.replace("\n", "\r\n")
    (move,) = parse_program(text, JOINTS).statements
    assert comparable(move) == comparable(MoveJoints(3, ABOVE))


WRONG = (
    ("mov_line 1 2 3 4 5 6", codes.STATEMENT_NEAR(word="mov_line", near="move_line")),
    ("Home", codes.STATEMENT_NEAR(word="Home", near="home")),
    (
        "jump",
        codes.STATEMENT_UNKNOWN(
            word="jump",
            names="home, move_joints, move_line, move_line_by, point, "
            "speed, tool_speed, wait, trace, repeat, end",
        ),
    ),
    ("speed 300", codes.NUMBER_OUTSIDE(word="speed", given="300", least=1, most=100, unit="percent")),
    ("speed", codes.ONE_NUMBER(word="speed", unit="percent", given="nothing")),
    ("speed fast", codes.ONE_NUMBER(word="speed", unit="percent", given="'fast'")),
    ("wait nan", codes.ONE_NUMBER(word="wait", unit="seconds", given="'nan'")),
    ("wait -1", codes.NUMBER_OUTSIDE(word="wait", given="-1", least=0, most=3600, unit="seconds")),
    ("wait 1e999", codes.NUMBER_OUTSIDE(word="wait", given="1e999", least=0, most=3600, unit="seconds")),
    ("tool_speed 0", codes.NUMBER_OUTSIDE(word="tool_speed", given="0", least=1, most=10_000, unit="mm/s")),
    ("trace maybe", codes.TRACE_FORM(given="'maybe'")),
    ("trace", codes.TRACE_FORM(given="nothing")),
    ("move_line_by", codes.FRAME_FORM(given="nothing")),
    ("move_line_by 1 2 3 4 5 6", codes.FRAME_FORM(given="'1'")),
    (
        "move_line_by tool 1 2 3",
        codes.POSE_NUMBERS(word="move_line_by", count=6, names="x y z roll pitch yaw", given=3),
    ),
    ("point home = joints 1 2 3 4 5", codes.POINT_RESERVED(name="home")),
    ("point end = pose 1 2 3 4 5 6", codes.POINT_RESERVED(name="end")),
    ("home now", codes.NO_ARGUMENT(word="home", given="now")),
    ("move_joints abov", codes.POINT_NEAR(word="move_joints", name="abov", near="above")),
    ("move_line zzz", codes.POINT_UNKNOWN(word="move_line", name="zzz", names="above, part")),
    (
        "move_joints 1 2",
        codes.JOINT_NUMBERS(word="move_joints", count=5, names="waist shoulder elbow wrist roll", given=2),
    ),
    ("move_joints 1 2 3 4 O", codes.NOT_A_NUMBER(word="move_joints", given="O")),
    ("move_joints 1 2 3 4 1_0", codes.NOT_A_NUMBER(word="move_joints", given="1_0")),
    (
        "move_line 1 2 3 4 5",
        codes.POSE_NUMBERS(word="move_line", count=6, names="x y z roll pitch yaw", given=5),
    ),
    (
        "move_line 1 2 3 4 5 1e300",
        codes.NUMBER_TOO_LARGE(word="move_line", name="yaw", given="1e300", most=100_000),
    ),
    ("point A = pose 1 2 3 4 5 6", codes.POINT_NAME(name="A", most=64)),
    ("point x pose 1", codes.POINT_FORM()),
    ("point above = joints 1 2 3 4 5", codes.POINT_TWICE(name="above", line=1)),
    ("repeat 0", codes.NUMBER_OUTSIDE(word="repeat", given="0", least=1, most=MOST_STEPS, unit="times")),
    ("repeat 1.5", codes.REPEAT_NOT_WHOLE(given="1.5")),
    ("end", codes.END_WITHOUT_REPEAT()),
)


@pytest.mark.parametrize(("line", "reason"), WRONG)
def test_unreadable_line_is_reported_with_word_value_and_range(line: str, reason: Reason) -> None:
    with pytest.raises(ProgramError) as caught:
        parse_program(f"{HEAD}{line}\n{'end' if line.startswith('repeat') else ''}", JOINTS)
    assert caught.value.problems == ((3, reason),)


def test_all_problems_are_reported_by_line() -> None:
    with pytest.raises(ProgramError, match=r"line 1: .* \(and 3 more problems\)") as caught:
        parse_program("mov 1\nhome\nspeed 0\nrepeat 2\nmove_joints nowhere\n", JOINTS)
    assert [line for line, _ in caught.value.problems] == [1, 3, 4, 5]


def test_use_of_an_unreadable_point_is_not_reported() -> None:
    with pytest.raises(ProgramError) as caught:
        parse_program("point a = joints 1 2\nmove_joints a\n", JOINTS)
    assert [line for line, _ in caught.value.problems] == [1]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("#" * (MOST_BYTES + 1), codes.PROGRAM_BYTES(count=MOST_BYTES + 1, most=MOST_BYTES)),
        ("\n" * MOST_LINES, codes.PROGRAM_LINES(count=MOST_LINES + 1, most=MOST_LINES)),
        ("repeat 1000\nrepeat 101\nhome\nend\nend", codes.PROGRAM_STEPS(most=MOST_STEPS)),
        ("repeat 2\n" * 21 + "home\n" + "end\n" * 21, codes.REPEAT_TOO_DEEP(most=20)),
        ("move_joints above", codes.POINT_NONE(word="move_joints", name="above")),
        ("repeat 2\nhome", codes.REPEAT_NOT_CLOSED()),
    ],
)
def test_too_large_program_is_refused_with_a_reason(text: str, reason: Reason) -> None:
    with pytest.raises(ProgramError) as caught:
        parse_program(text, JOINTS)
    assert reason in [problem for _, problem in caught.value.problems]


WORDS = "home move_joints move_line point a = joints pose speed repeat end wait 1 -2.5 1e9 # trace on é"
words = st.sampled_from((*WORDS.split(), "\n", "\n", "\r", "\x00"))


@pytest.mark.slow
@settings(max_examples=80)
@given(st.lists(words, max_size=40).map(" ".join) | st.text(max_size=80))
def test_any_text_is_a_program_or_gets_problems_with_lines(text: str) -> None:
    try:
        program = parse_program(text, JOINTS)
    except ProgramError as error:
        problems = error.problems
    else:
        problems = ((1, codes.PROGRAM_EMPTY()),)
        again = parse_program(program_text(program, JOINTS), JOINTS)
        assert program_text(again, JOINTS) == program_text(program, JOINTS)
    assert problems
    assert all(line >= 1 and reason.text for line, reason in problems)
