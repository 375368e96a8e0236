import itertools
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol_gateway.unit_protocol.records import AbsolutePositions, Command
from protocol_gateway.unit_protocol.stream import LONGEST_UNIT_BYTES, Malformed, Unit, UnitStream
from tests.protocol_gateway.test_grammar import PAPER

HOME = b"1#COMMAND*home@"
BAD = b"2#COMMAND*stop@"
MIXED = PAPER + BAD + b"\r\n" + HOME + b"\xff\x00@" + b"1#7*x@" + PAPER


def read(*pieces):
    stream = UnitStream()
    return [event for piece in pieces for event in stream.receive(piece)]


def test_the_stream_parses_the_papers_unit():
    (unit,) = read(PAPER)
    assert unit == Unit(
        (Command(("trace", "home")), AbsolutePositions((100.0, 30.45, 92.66, -67.1, -25.85))), PAPER[:-1], 0
    )


@pytest.mark.parametrize("cut", range(len(MIXED) + 1))
def test_unit_split_at_every_byte_parses_the_same(cut):
    assert read(MIXED[:cut], MIXED[cut:]) == read(MIXED)


@pytest.mark.parametrize("size", [1, 2, 3, 7, 32])
def test_pieces_of_any_size_parse_the_same(size):
    assert read(*[MIXED[i : i + size] for i in range(0, len(MIXED), size)]) == read(MIXED)


def test_good_units_around_a_bad_one_survive():
    first, bad, last = read(HOME + BAD + HOME)
    assert isinstance(first, Unit)
    assert isinstance(last, Unit)
    assert bad == Malformed(len(HOME), "2#COMMAND*stop", "the count says 2 records, there are 1")
    assert last.offset == len(HOME + BAD)


def test_unprintable_bytes_are_shown_in_hexadecimal():
    (bad,) = read(b"\x1b[2J\xff@")
    assert bad.text == r"\x1b[2J\xff"


def test_the_longest_unit_has_64_kib_with_its_terminator():
    long_enough = b"1#X*".ljust(LONGEST_UNIT_BYTES - 1, b"x") + b"@"
    (unit,) = read(long_enough)
    assert isinstance(unit, Unit)
    (too_long,) = read(long_enough[:-1] + b"x@")
    assert isinstance(too_long, Malformed)


@pytest.mark.parametrize("size", [1 << 20, 65_536, 4096, 997])
def test_64_kib_without_a_terminator_are_one_event(size):
    data = HOME + b"x" * 200_000 + b"@" + HOME
    first, bad, last = read(*[data[i : i + size] for i in range(0, len(data), size)])
    assert isinstance(first, Unit)
    assert bad == Malformed(len(HOME), "x" * 256 + "…", "not ended within 65536 bytes")
    assert isinstance(last, Unit)
    assert last.offset == len(data) - len(HOME)


def test_an_endless_unit_is_rejected_and_not_kept():
    stream = UnitStream()
    (bad,) = stream.receive(b"x" * LONGEST_UNIT_BYTES)
    assert isinstance(bad, Malformed)
    assert stream.receive(b"x" * 10_000_000) == []
    assert stream.receive(b"@" + HOME)[0].records == (Command(("home",)),)


def test_an_unfinished_unit_is_nothing():
    assert read(PAPER[:-1]) == []


@given(st.binary(max_size=400), st.lists(st.integers(0, 400), max_size=6))
def test_any_bytes_are_events_and_no_exception(data, cuts):
    places = [0, *sorted(cuts), len(data)]
    events = read(*[data[a:b] for a, b in itertools.pairwise(places)])
    assert events == read(data)
    assert all(isinstance(event, Unit | Malformed) for event in events)
    assert len(events) == data.count(b"@")


@given(st.text("0123456789#*&;@-. COMANDhome\n", max_size=80))
def test_near_misses_of_units_are_events_and_no_exception(text):
    assert len(read(text.encode("ascii"))) == text.count("@")


_N = LONGEST_UNIT_BYTES - 40

SLOW_TO_READ = {
    "digits": b"1#ABSOLUTE.DEG*" + b"1" * _N + b"x@",
    "digits and a point": b"1#ABSOLUTE.DEG*" + b"1" * (_N // 2) + b"." + b"1" * (_N // 2) + b"x@",
    "exponent": b"1#TIME*1e" + b"9" * _N + b"x@",
    "blanks after a sign": b"1#TIME*-" + b" " * _N + b"x@",
    "a type of zeros": b"1#" + b"0" * _N + b"x1*2@",
    "a type of digits": b"1#" + b"7" * _N + b" 1@",
    "a speed": b"1#COMMAND*speed" + b" " * _N + b"x@",
    "a count": b"0" * _N + b"1#TIME*x@",
    "many numbers": b"1#ABSOLUTE.DEG*" + (b"1" * 300 + b"x;") * (_N // 302) + b"@",
    "many records": b"1#" + b"&" * _N + b"@",
    "many units": b"@" * LONGEST_UNIT_BYTES,
}


@pytest.mark.parametrize("data", SLOW_TO_READ.values(), ids=SLOW_TO_READ)
def test_no_unit_of_64_kib_takes_long_to_read(data):
    begin_s = time.process_time()
    assert read(data + HOME)[-1].data == HOME[:-1]
    assert time.process_time() - begin_s < 3.0  # a non-linear parser takes far longer
