import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol_gateway.seam.errors import UnitError, UnitFormatError
from protocol_gateway.unit_protocol.codes import NAMES, code_table
from protocol_gateway.unit_protocol.grammar import plain_text
from protocol_gateway.unit_protocol.records import (
    AbsolutePositions,
    Command,
    Error,
    RelativePositions,
    Status,
    Time,
    Unknown,
    Velocities,
    read_number,
    read_records,
    speed_percent,
    write_number,
    write_unit,
)

BOTH_WAYS = [
    (Command(("trace", "home")), b"1#COMMAND*trace;home@"),
    (Command(("speed=50",)), b"1#COMMAND*speed=50@"),
    (
        AbsolutePositions((100.0, 30.45, 92.66, -67.1, -25.85)),
        b"1#ABSOLUTE.DEG*100.00;30.45;92.66;-67.10;-25.85@",
    ),
    (AbsolutePositions((0.123456789,)), b"1#ABSOLUTE.DEG*0.123456789@"),
    (RelativePositions((-0.5, 0.0)), b"1#RELATIVE.DEG*-0.50;0.00@"),
    (Velocities((1e-7,)), b"1#VELOCITY.DEG*0.0000001@"),
    (Status(("idle", "remote", "homed")), b"1#STATUS*idle;remote;homed@"),
    (Error(1, "too many clients"), b"1#ERROR*1;too many clients@"),
    (Error(9, ""), b"1#ERROR*9@"),
    (Time(12.345), b"1#TIME*12.345@"),
    (Unknown("FORCE", ("1", "N")), b"1#FORCE*1;N@"),
    (Unknown("4711", ()), b"1#4711@"),
]

MALFORMED = [
    b"1#COMMAND",
    b"1#COMMAND*;home",
    b"1#ABSOLUTE.DEG",
    b"1#ABSOLUTE.DEG*1;;3",
    b"1#ABSOLUTE.DEG*1;two",
    b"1#ABSOLUTE.DEG*nan",
    b"1#ABSOLUTE.DEG*inf",
    b"1#ABSOLUTE.DEG*-Infinity",
    b"1#ABSOLUTE.DEG*1e999",
    b"1#ABSOLUTE.DEG*1_0",
    b"1#ABSOLUTE.DEG*0x10",
    b"1#ABSOLUTE.DEG*1 0",
    b"1#ABSOLUTE.DEG*--1",
    b"1#ABSOLUTE.DEG*.",
    b"1#VELOCITY.DEG*",
    b"1#STATUS",
    b"1#ERROR",
    b"1#ERROR*x;y",
    b"1#TIME",
    b"1#TIME*1;2",
    # All or nothing: valid records do not help.
    b"2#COMMAND*home&ABSOLUTE.DEG*1;x",
]

_finite = st.floats(allow_nan=False, allow_infinity=False)
_values = st.lists(_finite, min_size=1, max_size=7).map(tuple)
_plain = st.text(max_size=20).map(plain_text)
_words = st.lists(_plain.filter(bool), min_size=1, max_size=4).map(tuple)
typed_records = st.one_of(
    st.builds(Command, _words),
    st.builds(AbsolutePositions, _values),
    st.builds(RelativePositions, _values),
    st.builds(Velocities, _values),
    st.builds(Status, _words),
    st.builds(Error, st.integers(0, 999_999_999), _plain),
    st.builds(Time, _finite),
    st.builds(Unknown, st.sampled_from(["FORCE", "A B", "99", "-2147483648"]), _words),
)
CODES = code_table({1: "COMMAND", 12: "ABSOLUTE.DEG", 101: "COMMAND:home", 5: "STATUS"})


@pytest.mark.parametrize(("record", "data"), BOTH_WAYS)
def test_records_are_formatted_and_parsed(record, data):
    assert write_unit((record,)) == data
    assert read_records(data[:-1]) == (record,)


def test_the_papers_example_has_its_numbers_with_blanks_between_sign_and_digits():
    data = b"2# COMMAND* trace; home&ABSOLUTE.DEG* 100.00; 30.45; 92.66; - 67.10; - 25.85"
    assert read_records(data) == (
        Command(("trace", "home")),
        AbsolutePositions((100.0, 30.45, 92.66, -67.10, -25.85)),
    )


@pytest.mark.parametrize("data", MALFORMED)
def test_an_invalid_record_rejects_the_unit(data):
    with pytest.raises(UnitError):
        read_records(data)


@pytest.mark.parametrize(
    ("text", "value"),
    [("+5", 5.0), ("- 5", -5.0), (".5", 0.5), ("5.", 5.0), ("1e3", 1000.0), ("-\t2E-1", -0.2)],
)
def test_numbers_are_parsed_in_every_form_of_controllers(text, value):
    assert read_number(text) == value


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_number_that_is_not_finite_is_not_written(value):
    with pytest.raises(UnitFormatError):
        write_unit((AbsolutePositions((value,)),))


@given(_finite)
def test_any_number_survives_a_round_trip_with_two_decimals_or_more(value):
    text = write_number(value)
    assert read_number(text) == value
    assert len(text.partition(".")[2]) >= 2
    assert "e" not in text


@pytest.mark.parametrize(("word", "percent"), [("speed=50", 50.0), ("speed = 7.5", 7.5), ("home", None)])
def test_a_speed_is_a_word_with_a_number(word, percent):
    assert speed_percent(word) == percent


@pytest.mark.parametrize("word", ["speed=", "speed=fast", "speed=nan", "speed=1e999"])
def test_a_speed_without_a_finite_number_is_malformed(word):
    with pytest.raises(UnitError):
        speed_percent(word)


@given(st.lists(typed_records, min_size=1, max_size=5).map(tuple))
def test_any_typed_unit_survives_a_round_trip(unit):
    assert read_records(write_unit(unit, NAMES)[:-1], NAMES) == unit


@given(st.lists(typed_records.filter(lambda r: not isinstance(r, Command | Unknown)), min_size=1).map(tuple))
def test_any_typed_unit_in_codes_survives_a_round_trip(unit):
    assert read_records(write_unit(unit, CODES)[:-1], CODES) == unit
