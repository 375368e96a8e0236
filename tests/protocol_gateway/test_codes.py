import pytest

from protocol_gateway.seam.errors import CodeTableError, UnitError
from protocol_gateway.unit_protocol.codes import NAMES, code_table
from protocol_gateway.unit_protocol.records import (
    AbsolutePositions,
    Command,
    Unknown,
    read_records,
    write_unit,
)

TABLE = {2: "ABSOLUTE.DEG", 101: "COMMAND:home", 107: "COMMAND:speed", -9: "FORCE"}

BOTH_WAYS = [
    (AbsolutePositions((1.0,)), b"1#2*1.00@"),
    (Command(("home",)), b"1#101@"),
    (Command(("speed=50",)), b"1#107*50@"),
    # Without a code in this table, the name is used.
    (Command(("stop",)), b"1#COMMAND*stop@"),
]


@pytest.mark.parametrize(("record", "data"), BOTH_WAYS)
def test_a_code_stands_for_a_type_or_for_one_command_both_ways(record, data):
    table = code_table(TABLE)
    assert write_unit((record,), table) == data
    assert read_records(data[:-1], table) == (record,)


def test_names_are_read_where_the_table_has_codes_too():
    assert read_records(b"1#ABSOLUTE.DEG*1.00", code_table(TABLE)) == (AbsolutePositions((1.0,)),)


def test_a_site_files_table_replaces_the_default():
    assert read_records(b"1#1*home") == (Command(("home",)),)
    assert read_records(b"1#1*home", code_table(TABLE)) == (Unknown("1", ("home",)),)


def test_a_controllers_own_type_gets_its_name_from_the_site_file():
    assert read_records(b"1#-9*1.5", code_table(TABLE)) == (Unknown("FORCE", ("1.5",)),)


def test_without_a_table_names_are_written():
    assert code_table({}) is NAMES
    assert write_unit((Command(("home",)),)) == b"1#COMMAND*home@"


def test_commands_with_and_without_codes_keep_their_order():
    data = write_unit((Command(("trace", "home", "speed=20")),), code_table(TABLE))
    assert data == b"3#COMMAND*trace&101&107*20@"
    assert read_records(data[:-1], code_table(TABLE)) == (
        Command(("trace",)),
        Command(("home",)),
        Command(("speed=20",)),
    )


@pytest.mark.parametrize("data", [b"1#101*stop", b"1#107", b"1#107*10;20"])
def test_data_that_a_commands_code_does_not_take_is_malformed(data):
    with pytest.raises(UnitError, match="10"):
        read_records(data, code_table(TABLE))


@pytest.mark.parametrize(
    ("codes", "text"),
    [
        ({101: "COMMAND:dance"}, "101"),
        ({2: ""}, "2"),
        ({2: "A*B"}, "A"),
        ({2**31: "STATUS"}, "int32"),
        ({2: "STATUS", 3: "STATUS"}, "two codes"),
    ],
)
def test_a_table_that_cannot_be_used_names_its_entry(codes, text):
    with pytest.raises(CodeTableError, match=text):
        code_table(codes)
