import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol_gateway.seam.errors import UnitError, UnitFormatError
from protocol_gateway.unit_protocol.grammar import RawRecord, format_unit, parse_unit, plain_text, type_code

PAPER = b"2# COMMAND* trace; home&ABSOLUTE.DEG* 100.00; 30.45; 92.66; - 67.10; - 25.85@"

# Cases in both directions.
BOTH_WAYS = [
    ([("COMMAND", "home")], b"1#COMMAND*home@"),
    ([("COMMAND", "trace", "home")], b"1#COMMAND*trace;home@"),
    ([("STATUS",)], b"1#STATUS@"),
    ([("2", "1.00", "-2.00")], b"1#2*1.00;-2.00@"),
    ([("-2147483648",), ("2147483647",)], b"2#-2147483648&2147483647@"),
    ([("ERROR", "1", "too many clients")], b"1#ERROR*1;too many clients@"),
    ([("X", "", "")], b"1#X*;@"),
    (
        [("COMMAND", "trace", "home"), ("ABSOLUTE.DEG", "100.00", "30.45", "92.66", "-67.10", "-25.85")],
        b"2#COMMAND*trace;home&ABSOLUTE.DEG*100.00;30.45;92.66;-67.10;-25.85@",
    ),
]

MALFORMED = [
    (b"", "no '#'"),
    (b"COMMAND*home", "no '#'"),
    (b"#COMMAND*home", "not a number"),
    (b"one#COMMAND*home", "not a number"),
    (b"-1#COMMAND*home", "not a number"),
    (b"0#COMMAND*home", "there are 1"),
    (b"2#COMMAND*home", "there are 1"),
    (b"1#COMMAND*home&STATUS", "there are 2"),
    (b"9" * 60_000 + b"#COMMAND*home", "there are 1"),
    (b"1#", "without a type"),
    (b"1#*home", "without a type"),
    (b"2#COMMAND*home&", "without a type"),
    (b"1#COMMAND*home*stop", "second '*'"),
    (b"1#COMMAND*ho1#COMMAND*home", "second '#'"),
    (b"1#2147483648*1", "outside int32"),
    (b"1#-2147483649*1", "outside int32"),
    (b"1#" + b"7" * 60_000, "outside int32"),
    (b"1#COMMAND*h\xc3\xb6me", "outside ASCII"),
]

_text = (
    st.text(st.characters(max_codepoint=127, exclude_characters="#*&;@"), min_size=1, max_size=12)
    .map(str.strip)
    .filter(lambda text: text and text == text.strip(" \t\r\n"))
)
_name = _text.filter(lambda text: text[-1:] not in "0123456789")
_type = _name | st.integers(-(2**31), 2**31 - 1).map(str)
_items = st.lists(_text | st.just(""), max_size=8).map(tuple).filter(lambda items: items != ("",))
raw_records = st.builds(RawRecord, _type, _items)


def records(*rows):
    return tuple(RawRecord(row[0], tuple(row[1:])) for row in rows)


@pytest.mark.parametrize(("rows", "data"), BOTH_WAYS)
def test_units_are_formatted_and_parsed(rows, data):
    assert format_unit(records(*rows)) == data
    assert parse_unit(data[:-1]) == records(*rows)


def test_the_papers_example_with_blanks_is_two_records():
    assert parse_unit(PAPER[:-1]) == records(
        ("COMMAND", "trace", "home"), ("ABSOLUTE.DEG", "100.00", "30.45", "92.66", "- 67.10", "- 25.85")
    )


def test_blanks_of_every_kind_around_items_types_and_counts_mean_nothing():
    assert parse_unit(b"\r\n 1 \t#\n COMMAND \r* home \t; stop\n") == records(("COMMAND", "home", "stop"))


def test_a_star_without_data_is_a_record_without_items():
    assert parse_unit(b"1#STATUS* ") == records(("STATUS",))


@pytest.mark.parametrize(("data", "reason"), MALFORMED)
def test_a_malformed_unit_is_refused_with_its_reason(data, reason):
    with pytest.raises(UnitError, match=reason.replace("*", r"\*")):
        parse_unit(data)


@pytest.mark.parametrize(
    "unit",
    [
        (),
        records(("",)),
        records(("A*B",)),
        records(("A", "x;y")),
        records(("A", "x@")),
        records(("A", " x")),
        records(("A", "°")),
        records(("A", "")),
        records(("2147483648",)),
    ],
)
def test_an_ambiguous_value_is_not_formatted(unit):
    with pytest.raises(UnitFormatError):
        format_unit(unit)


@pytest.mark.parametrize(
    ("text", "code"), [("2", 2), ("+2", 2), ("- 5", -5), ("007", 7), ("V2", None), ("2.5", None), ("-", None)]
)
def test_a_type_is_a_name_or_an_int32_code(text, code):
    assert type_code(text) == code


@given(st.lists(raw_records, min_size=1, max_size=6).map(tuple))
def test_any_unit_survives_a_round_trip(unit):
    assert parse_unit(format_unit(unit)[:-1]) == unit


@given(st.binary(max_size=200))
def test_any_bytes_are_a_unit_or_are_refused(data):
    with contextlib.suppress(UnitError):
        assert parse_unit(data)


@pytest.mark.slow
@given(st.text(max_size=60))
def test_any_text_can_be_made_plain(text):
    plain = plain_text(text)
    assert not plain or parse_unit(format_unit(records(("ERROR", "2", plain)))[:-1])[0].items[1] == plain
