"""Codec of the primary interface: bytes written from the layout."""

import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controllers.universal_robots.interfaces.modes import ReportLevel, SafetyMode
from controllers.universal_robots.interfaces.packages import Malformed
from controllers.universal_robots.interfaces.primary import (
    LONGEST_MESSAGE_BYTES,
    LONGEST_SKIPPED_BYTES,
    LONGEST_TEXT,
    Alarm,
    KeyMessage,
    Origin,
    Popup,
    PrimaryStream,
    PrimaryText,
    PrimaryVersion,
    RuntimeFault,
    SafetyModeChanged,
)

TIME = 123_456_789
ORIGIN = Origin(TIME, -2)


def package(kind, payload):
    return struct.pack(">iB", 5 + len(payload), kind) + payload


def message(kind, payload, source=-2):
    return package(20, struct.pack(">QbB", TIME, source, kind) + payload)


STATE = package(16, bytes(1381))
MESSAGES = [
    (message(3, b"\x09URControl\x05\x15" + struct.pack(">ii", 0, 42) + b"26-11-2026"),
     PrimaryVersion(ORIGIN, "URControl", 5, 21, 0, 42, "26-11-2026")),
    (message(6, struct.pack(">iiiII", 153, 3, 3, 0, 7) + b"too hot", source=2),
     Alarm(Origin(TIME, 2), 153, 3, ReportLevel.VIOLATION, 0, 7, "too hot")),
    (message(6, struct.pack(">iiiII", -1, 0, 0, 0, 0)), Alarm(ORIGIN, -1, 0, ReportLevel.DEBUG, 0, 0, "")),
    (message(7, struct.pack(">ii", 0, 0) + b"\x13PROGRAM_XXX_STARTEDweld"),
     KeyMessage(ORIGIN, 0, 0, "PROGRAM_XXX_STARTED", "weld")),
    (message(5, struct.pack(">iiBII", 11, 1, 3, 0, 0)),
     SafetyModeChanged(ORIGIN, 11, 1, SafetyMode.PROTECTIVE_STOP)),
    (message(10, struct.pack(">ii", 12, 4) + b"no such name"), RuntimeFault(ORIGIN, 12, 4, "no such name")),
    (message(0, "größer".encode()), PrimaryText(ORIGIN, "größer")),
    (message(2, struct.pack(">II???", 1, 0, False, True, True) + b"\x05TitleText"),
     Popup(ORIGIN, "Title", "Text", False, True, True)),
]  # fmt: skip


def events_of(data, piece=None):
    stream = PrimaryStream()
    piece = piece or len(data) or 1
    return [e for at in range(0, len(data), piece) for e in stream.receive(data[at : at + piece])], stream


@pytest.mark.parametrize("piece", [1, 3, 100, 10_000])
def test_messages_between_states_are_read_however_the_stream_is_split(piece):
    data = b"".join(STATE + each for each, _ in MESSAGES)
    events, stream = events_of(data, piece)
    assert events == [event for _, event in MESSAGES]
    assert stream.skipped == len(MESSAGES)


def test_alarm_is_named_as_in_the_list_of_error_codes():
    alarm = MESSAGES[1][1]
    assert alarm.name == "C153A3"


def test_other_robot_messages_are_counted():
    events, stream = events_of(message(9, bytes(8)) + message(14, b"") + MESSAGES[0][0])
    assert events == [MESSAGES[0][1]]
    assert stream.ignored == 2


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (package(20, b"\x00" * 9), "ends after 9 bytes of a part of 10"),
        (message(6, b"\x00" * 19), "ends after 19 bytes of a part of 20"),
        (message(5, b"\x00" * 16), "ends after 16 bytes"),
        (message(7, b"\x00" * 8), "title is longer"),
        (message(7, bytes(8) + b"\x05abcd"), "title is longer"),
        (message(3, b"\x02ab\x05"), "ends after 1 bytes"),
        (message(2, b""), "ends after 0 bytes"),
        (message(10, b"\x00"), "ends after 1 bytes"),
    ],
)
def test_invalid_message_is_an_event_and_the_next_one_is_read(data, reason):
    (first, second), _ = events_of(STATE + data + MESSAGES[1][0])
    assert isinstance(first, Malformed)
    assert reason in first.reason
    assert (first.offset, first.fatal) == (len(STATE), False)
    assert second == MESSAGES[1][1]


@pytest.mark.parametrize(
    ("length", "kind"),
    [
        (4, 20),
        (-1, 20),
        (0, 16),
        (LONGEST_MESSAGE_BYTES + 1, 20),
        (LONGEST_SKIPPED_BYTES + 1, 16),
        (2**31 - 1, 25),
    ],
)
def test_impossible_length_ends_the_stream_at_once(length, kind):
    (lost,), stream = events_of(struct.pack(">iB", length, kind) + MESSAGES[0][0])
    assert lost.fatal
    assert f"announces {length} bytes" in lost.reason
    assert stream.lost
    assert stream.receive(MESSAGES[0][0]) == []


def test_skipped_package_is_not_kept():
    stream = PrimaryStream()
    stream.receive(struct.pack(">iB", LONGEST_SKIPPED_BYTES, 25))
    for _ in range(8):
        stream.receive(bytes(LONGEST_SKIPPED_BYTES // 8 - 5))
        assert len(stream._packages._buffer) == 0
    assert stream.receive(bytes(35) + MESSAGES[0][0]) == [MESSAGES[0][1]]


def test_texts_are_safe_to_print_and_limited():
    (event,), _ = events_of(message(0, "\x1b[2J\r\n\u202e".encode() + b"\xff" + b"a" * 5000))
    assert event.text.isprintable()
    assert len(event.text) == LONGEST_TEXT


@settings(max_examples=150, deadline=None)
@given(
    data=st.lists(
        st.one_of(
            st.sampled_from([data for data, _ in MESSAGES] + [STATE]),
            st.binary(max_size=30),
            st.builds(message, st.integers(0, 15), st.binary(max_size=60)),
            st.builds(package, st.integers(0, 255), st.binary(max_size=60)),
        ),
        max_size=8,
    ).map(b"".join),
    piece=st.integers(1, 80),
)
def test_any_bytes_give_events_that_do_not_depend_on_the_pieces(data, piece):
    whole, _ = events_of(data)
    split, _ = events_of(data, piece)
    assert split == whole
