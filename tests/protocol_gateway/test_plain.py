import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from protocol_gateway.seam.errors import UnitError
from protocol_gateway.unit_protocol.codes import NAMES, code_table
from protocol_gateway.unit_protocol.plain import plain_readers, read_plain
from protocol_gateway.unit_protocol.records import read_records

OWN = code_table({2: "ABSOLUTE.DEG", -9: "TIME", 12: "OVEN", 101: "COMMAND:home"})
TABLES = {"names": NAMES, "codes of its own": OWN}

PLAIN = (
    b"1#ABSOLUTE.DEG*100.00;30.45;92.66;-67.10;-25.85",
    b"1# ABSOLUTE.DEG* 100.00; 30.45; 92.66; - 67.10; - 25.85",
    b"\r\n1#2*1;.5;2.;-0;007",
    b"4#ABSOLUTE.DEG*1.00;2.00&VELOCITY.DEG*0.00;0.00&STATUS*idle;remote;homed&TIME*12.340000",
)

# Pieces of units: their combinations are often well formed, or nearly.
_TEXTS = (
    "1 2 3 # * & ; . - + -  e5 0 00 9 7.25 -0.0 ABSOLUTE.DEG TIME STATUS VELOCITY.DEG RELATIVE.DEG "
    "COMMAND ERROR OVEN 101 -9 12 idle homed Idle home stop speed=5 nan inf 1_0 1e999 \t \n \v \f \xff "
    "1#ABSOLUTE.DEG* 1#TIME* 2#STATUS*idle&2*"
)
_PIECES = st.lists(st.sampled_from(_TEXTS.split(" ")), max_size=14).map(
    lambda pieces: "".join(pieces).encode("latin-1")
)
_NUMBERS = st.text("0123456789.-; \t\n\v_e", max_size=30).map(lambda text: b"1#ABSOLUTE.DEG*" + text.encode())


@pytest.mark.parametrize("unit", PLAIN)
def test_common_units_are_plain(unit):
    assert read_plain(unit, plain_readers(NAMES)) == read_records(unit)


@pytest.mark.parametrize("table", TABLES.values(), ids=TABLES)
@given(data=_PIECES | _NUMBERS | st.binary(max_size=60))
@example(data=b"1#ABSOLUTE.DEG*" + b"9" * 310)
@example(data=b"1#ABSOLUTE.DEG*" + b"0" * 290)
@example(data=b"1#ABSOLUTE.DEG*1;;2")
@example(data=b"1#ABSOLUTE.DEG*1 2")
@example(data=b"1#TIME*1;2")
@example(data=b"1#\vTIME*1")
@example(data=b"1#TIME*\v1")
@example(data=b"1#TIME*- - 1")
@example(data=b"1#STATUS*idle;")
@example(data=b"2#TIME*1")
@example(data=b"1#2")
@example(data=b"1#101*1")
def test_plain_units_parse_like_the_grammar(table, data):
    plain = read_plain(data, plain_readers(table))
    if plain is None:
        return
    try:
        assert plain == read_records(data, table)
    except UnitError as error:
        pytest.fail(f"{data!r} is malformed ({error}), and was read as {plain}")
