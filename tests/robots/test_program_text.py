"""The text of teach programs: parsing, writing, and all problems."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robots.description import load
from robots.errors import ProgramError
from robots.joints import joints_of
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
from robots.programs.text import MOST_BYTES, MOST_LINES, MOST_STEPS, parse_program, pose_of
from robots.programs.write import program_text

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
    ("mov_line 1 2 3 4 5 6", "'mov_line' is not a statement; did you mean 'move_line'?"),
    ("Home", "'Home' is not a statement; did you mean 'home'?"),
    ("speed 300", "'speed' is 300; must be between 1 and 100 percent"),
    ("speed", "'speed' takes one number (percent), not nothing"),
    ("speed fast", "'speed' takes one number (percent), not 'fast'"),
    ("wait nan", "'wait' takes one number (seconds), not 'nan'"),
    ("wait -1", "'wait' is -1; must be between 0 and 3600 seconds"),
    ("wait 1e999", "'wait' is 1e999; must be between 0 and 3600 seconds"),
    ("tool_speed 0", "'tool_speed' is 0; must be between 1 and 10000 mm/s"),
    ("trace maybe", "'trace' takes on or off, not 'maybe'"),
    ("trace", "'trace' takes on or off, not nothing"),
    ("point home = joints 1 2 3 4 5", "'home' is a statement and not a valid point name: choose another"),
    ("point end = pose 1 2 3 4 5 6", "'end' is a statement and not a valid point name: choose another"),
    ("home now", "'home' takes no argument, not 'now'"),
    ("move_joints abov", "move_joints: there is no point 'abov'; did you mean 'above'?"),
    (
        "move_joints 1 2",
        (
            "'move_joints' takes 5 numbers (waist shoulder elbow wrist roll: degrees, mm of a prismatic "
            "joint), not 2"
        ),
    ),
    ("move_joints 1 2 3 4 O", "'move_joints': 'O' is not a number"),
    ("move_joints 1 2 3 4 1_0", "'move_joints': '1_0' is not a number"),
    (
        "move_line 1 2 3 4 5",
        "'move_line' takes 6 numbers (x y z roll pitch yaw: mm and degrees), not 5",
    ),
    (
        "move_line 1 2 3 4 5 1e300",
        "'move_line': yaw is 1e300; must be between -100000 and 100000",
    ),
    (
        "point A = pose 1 2 3 4 5 6",
        "'A' is not a valid point name: small letters, digits, _ and -, a letter first, up to 64",
    ),
    ("point x pose 1", "write a definition as 'point NAME = joints ...' or 'point NAME = pose ...'"),
    ("point above = joints 1 2 3 4 5", "point 'above' is already defined in line 1"),
    ("repeat 0", "'repeat' is 0; must be between 1 and 100000 times"),
    ("repeat 1.5", "'repeat' takes a whole number, not 1.5"),
    ("end", "'end' without an open 'repeat' above"),
)


@pytest.mark.parametrize(("line", "sentence"), WRONG)
def test_unreadable_line_is_reported_with_word_value_and_range(line: str, sentence: str) -> None:
    with pytest.raises(ProgramError) as caught:
        parse_program(f"{HEAD}{line}\n{'end' if line.startswith('repeat') else ''}", JOINTS)
    assert caught.value.problems == ((3, sentence),)


def test_all_problems_are_reported_by_line() -> None:
    with pytest.raises(ProgramError, match=r"line 1: .* \(and 3 more problems\)") as caught:
        parse_program("mov 1\nhome\nspeed 0\nrepeat 2\nmove_joints nowhere\n", JOINTS)
    assert [line for line, _ in caught.value.problems] == [1, 3, 4, 5]


def test_use_of_an_unreadable_point_is_not_reported() -> None:
    with pytest.raises(ProgramError) as caught:
        parse_program("point a = joints 1 2\nmove_joints a\n", JOINTS)
    assert [line for line, _ in caught.value.problems] == [1]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("#" * (MOST_BYTES + 1), f"the program has {MOST_BYTES + 1} bytes; up to {MOST_BYTES} are read"),
        ("\n" * MOST_LINES, f"the program has {MOST_LINES + 1} lines; up to {MOST_LINES} are read"),
        (
            "repeat 1000\nrepeat 101\nhome\nend\nend",
            f"the program has more than {MOST_STEPS} steps here, including repeats",
        ),
        ("repeat 2\n" * 21 + "home\n" + "end\n" * 21, "'repeat' is nested more than 20 deep"),
    ],
)
def test_too_large_program_is_refused_with_a_reason(text: str, sentence: str) -> None:
    with pytest.raises(ProgramError) as caught:
        parse_program(text, JOINTS)
    assert sentence in [problem for _, problem in caught.value.problems]


WORDS = "home move_joints move_line point a = joints pose speed repeat end wait 1 -2.5 1e9 # trace on é"
words = st.sampled_from((*WORDS.split(), "\n", "\n", "\r", "\x00"))


@settings(max_examples=80)
@given(st.lists(words, max_size=40).map(" ".join) | st.text(max_size=80))
def test_any_text_is_a_program_or_gets_problems_with_lines(text: str) -> None:
    try:
        program = parse_program(text, JOINTS)
    except ProgramError as error:
        problems = error.problems
    else:
        problems = ((1, "none"),)
        again = parse_program(program_text(program, JOINTS), JOINTS)
        assert program_text(again, JOINTS) == program_text(program, JOINTS)
    assert problems
    assert all(line >= 1 and sentence for line, sentence in problems)
