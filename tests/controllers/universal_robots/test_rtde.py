"""Codec of RTDE: bytes written from the layout, and the handshake of the reader."""

import re
import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controllers.universal_robots.interfaces import rtde_messages as rtde
from controllers.universal_robots.interfaces.modes import RobotMode, RobotStatus, SafetyStatus, name_of
from controllers.universal_robots.interfaces.packages import Malformed
from controllers.universal_robots.interfaces.rtde_messages import (
    LONGEST_PACKAGE_BYTES,
    ControllerVersion,
    DataReceived,
    InputsSetUp,
    OutputsSetUp,
    PauseAnswered,
    ProtocolVersionAnswered,
    Recipe,
    RtdeStream,
    StartAnswered,
    TextReceived,
)
from controllers.universal_robots.interfaces.rtde_reader import Failed, Ready, RtdeReader
from controllers.universal_robots.interfaces.state import OUTPUTS, ControllerState

FEW = {"timestamp": "DOUBLE", "actual_q": "VECTOR6D", "robot_mode": "INT32"}
Q = (0.1, -1.5, 1.2, -0.4, 1.57, 3.0)


def decoded(data, *, version=2, recipe=None, piece=None):
    """Return the events of a controller's bytes, in pieces."""
    stream = RtdeStream()
    stream.version, stream.recipe = version, recipe
    piece = piece or len(data) or 1
    return [
        event if isinstance(event, Malformed) else stream.decode(event)
        for at in range(0, len(data), piece)
        for event in stream.receive(data[at : at + piece])
    ]


def packed(letter, payload=b""):
    return struct.pack(">H", 3 + len(payload)) + letter + payload


MESSAGES = [
    (packed(b"V", b"\x01"), ProtocolVersionAnswered(True)),
    (packed(b"V", b"\x00"), ProtocolVersionAnswered(False)),
    (bytes.fromhex("0013 76 00000005 00000015 00000000 0001e240"), ControllerVersion(5, 21, 0, 123456)),
    (packed(b"O", b"\x01DOUBLE,VECTOR6D"), OutputsSetUp(1, ("DOUBLE", "VECTOR6D"))),
    (packed(b"O", b"\x00DOUBLE,NOT_FOUND"), OutputsSetUp(0, ("DOUBLE", "NOT_FOUND"))),
    (packed(b"I", b"\x03UINT32,IN_USE"), InputsSetUp(3, ("UINT32", "IN_USE"))),
    (packed(b"S", b"\x01"), StartAnswered(True)),
    (packed(b"P", b"\x00"), PauseAnswered(False)),
    (packed(b"M", b"\x05hello\x04RTDE\x02"), TextReceived(2, "hello", "RTDE")),
    (packed(b"M", b"\x00\x00\x03"), TextReceived(3, "", "")),
]


@pytest.mark.parametrize("piece", [1, 2, 5, 1000])
def test_messages_are_read_however_the_stream_is_split(piece):
    data = b"".join(each for each, _ in MESSAGES)
    assert decoded(data, piece=piece) == [message for _, message in MESSAGES]


def test_requests_have_the_layout_of_the_protocol():
    assert rtde.request_protocol_version(2) == bytes.fromhex("0005 56 0002")
    assert rtde.request_controller_version() == bytes.fromhex("0003 76")
    assert rtde.set_up_outputs(["timestamp", "actual_q"], 125.0) == (
        bytes.fromhex("001d 4f 405f400000000000") + b"timestamp,actual_q"
    )
    assert rtde.set_up_outputs(["timestamp"], None) == bytes.fromhex("000c 4f") + b"timestamp"
    assert rtde.set_up_inputs(["speed_slider_mask"]) == bytes.fromhex("0014 49") + b"speed_slider_mask"
    assert rtde.start() == bytes.fromhex("0003 53")
    assert rtde.pause() == bytes.fromhex("0003 50")
    with pytest.raises(ValueError, match="2048 are permitted"):
        rtde.set_up_outputs(["n" * 100] * 21, 1.0)


def test_version_1_has_no_recipe_numbers_and_no_sources():
    assert decoded(packed(b"O", b"DOUBLE"), version=1) == [OutputsSetUp(None, ("DOUBLE",))]
    assert decoded(packed(b"M", b"\x01hot"), version=1) == [TextReceived(1, "hot", "")]
    recipe = Recipe(["timestamp"], ["DOUBLE"], None)
    data = packed(b"U", struct.pack(">d", 12.5))
    assert decoded(data, version=1, recipe=recipe) == [DataReceived({"timestamp": 12.5})]


def test_data_of_every_type_is_read():
    names = tuple(rtde.FORMATS)
    recipe = Recipe(names, names, 7)
    values = {
        "BOOL": True,
        "UINT8": 255,
        "UINT32": 2**32 - 1,
        "UINT64": 2**64 - 1,
        "INT32": -(2**31),
        "DOUBLE": -0.5,
        "VECTOR3D": (1.0, 2.0, 3.0),
        "VECTOR6D": Q,
        "VECTOR6INT32": (255, 253, -1, 0, 1, 2),
        "VECTOR6UINT32": (1, 2, 3, 4, 5, 2**32 - 1),
    }
    layout = ">B?BIQid3d6d6i6I"
    flat = [x for each in values.values() for x in (each if isinstance(each, tuple) else (each,))]
    payload = struct.pack(layout, 7, *flat)
    assert decoded(packed(b"U", payload), recipe=recipe) == [DataReceived(values)]
    assert recipe.write(values) == payload


RECIPE = Recipe(["timestamp", "actual_q"], ["DOUBLE", "VECTOR6D"], 1)
DATA = b"\x01" + struct.pack(">7d", 1.0, *Q)


def test_only_needed_values_have_to_be_finite():
    recipe = Recipe(["actual_q", "payload"], ["VECTOR6D", "DOUBLE"], 1, needed=["actual_q"])
    payload = b"\x01" + struct.pack(">7d", *Q, float("nan"))
    assert decoded(packed(b"U", payload), recipe=recipe) == [DataReceived({"actual_q": Q})]
    payload = b"\x01" + struct.pack(">7d", *Q[:5], float("nan"), 1.0)
    (event,) = decoded(packed(b"U", payload), recipe=recipe)
    assert event.reason == "actual_q is not finite"


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (packed(b"U", b"\x02" + DATA[1:]), "recipe 2, set up is recipe 1"),
        (packed(b"U"), "recipe none"),
        (packed(b"U", DATA[:-1]), "56 bytes of data, the recipe has 57"),
        (packed(b"U", DATA + b"\x00"), "58 bytes of data"),
        (
            packed(b"U", b"\x01" + struct.pack(">7d", 1.0, *Q[:3], float("nan"), 0, 0)),
            "actual_q is not finite",
        ),
        (packed(b"U", b"\x01" + struct.pack(">7d", float("-inf"), *Q)), "timestamp is not finite"),
        (packed(b"X", b"abc"), "unknown type 88"),
        (packed(b"V", b"\x01\x02"), "answer 01 02: must be 00 or 01"),
        (packed(b"V"), "without a byte"),
        (packed(b"S", b"\x07"), "answer 07"),
        (packed(b"v", b"\x00" * 15), "15 bytes of a version"),
        (packed(b"O"), "without a recipe"),
        (packed(b"O", b"\x01DOUBLE,\xff\x1b[2J"), r"type .*xff.*2J' is unknown"),
        (packed(b"O", b"\x01"), "type '' is unknown"),
        (packed(b"M", b"\x09short"), "shorter than its length"),
        (packed(b"M", b"\x01a\x01b"), "0 bytes after the texts"),
        (packed(b"M"), "shorter than its length"),
    ],
)
def test_invalid_package_is_an_event_and_the_next_one_is_read(data, reason):
    first, second = decoded(data + packed(b"U", DATA), recipe=RECIPE)
    assert isinstance(first, Malformed)
    assert re.search(reason, first.reason), first.reason
    assert (first.offset, first.fatal) == (0, False)
    assert first.text.isprintable()
    assert second == DataReceived({"timestamp": 1.0, "actual_q": Q})


@pytest.mark.parametrize("header", ["0000 55", "0002 55", "1001 55", "ffff 4d"])
def test_impossible_length_ends_the_stream_at_once_without_a_buffer(header):
    stream = RtdeStream()
    good = packed(b"S", b"\x01")
    (first, lost) = stream.receive(good + bytes.fromhex(header))
    assert stream.decode(first) == StartAnswered(True)
    assert (lost.fatal, lost.offset, stream.lost) == (True, 4, True)
    assert "must be 3 to 4096" in lost.reason
    assert stream.receive(good * 1000) == []


def test_data_before_a_set_up_is_malformed():
    (event,) = decoded(packed(b"U", DATA))
    assert event.reason == "data before a set-up of outputs"


# ------------------------------------------------------------------------ reader


def answers(*packages):
    return b"".join(packages)


VERSION_5 = bytes.fromhex("0013 76 00000005 00000015 00000000 00000000")
VERSION_3 = bytes.fromhex("0013 76 00000003 0000000f 00000000 00000000")
ACCEPTED, REFUSED = b"\x01", b"\x00"


def few(*, mode=7, timestamp=3.5):
    return packed(b"U", b"\x01" + struct.pack(">d6di", timestamp, *Q, mode))


def test_handshake_ends_with_states():
    reader = RtdeReader(125.0, FEW)
    assert reader.connected() == rtde.request_protocol_version(2)
    assert reader.receive(packed(b"V", ACCEPTED)) == []
    assert reader.to_send() == rtde.request_controller_version()
    assert reader.to_send() == b""
    assert reader.receive(VERSION_5) == []
    assert reader.to_send() == rtde.set_up_outputs(tuple(FEW), 125.0)
    assert reader.receive(packed(b"O", b"\x01DOUBLE,VECTOR6D,INT32")) == []
    assert reader.to_send() == rtde.start()
    # The controller may send the first data in the same piece as its answer.
    ready, state = reader.receive(answers(packed(b"S", ACCEPTED), few()))
    assert ready == Ready(ControllerVersion(5, 21, 0, 0), 2, 125.0, ())
    assert isinstance(state, ControllerState)
    assert (state.timestamp_s, state.positions, state.robot_mode) == (3.5, Q, RobotMode.RUNNING)
    assert state.currents_a is None
    assert reader.to_send() == b""


def test_unknown_fields_are_left_out_and_named():
    reader = RtdeReader(10.0, FEW)
    reader.connected()
    reader.receive(answers(packed(b"V", ACCEPTED), VERSION_5, packed(b"O", b"\x00DOUBLE,VECTOR6D,NOT_FOUND")))
    assert reader.to_send().endswith(rtde.set_up_outputs(("timestamp", "actual_q"), 10.0))
    data = packed(b"U", b"\x02" + struct.pack(">7d", 1.0, *Q))
    ready, state = reader.receive(answers(packed(b"O", b"\x02DOUBLE,VECTOR6D"), packed(b"S", ACCEPTED), data))
    assert ready.missing == ("robot_mode",)
    assert state.robot_mode is None


def test_cb3_is_asked_for_at_most_125_hz():
    reader = RtdeReader(500.0, FEW)
    reader.connected()
    reader.receive(answers(packed(b"V", ACCEPTED), VERSION_3))
    assert reader.to_send().endswith(rtde.set_up_outputs(tuple(FEW), 125.0))


def test_controller_without_version_2_is_read_with_version_1():
    reader = RtdeReader(125.0, FEW)
    reader.connected()
    reader.receive(packed(b"V", REFUSED))
    assert reader.to_send() == rtde.request_protocol_version(1)
    reader.receive(answers(packed(b"V", ACCEPTED), VERSION_3))
    assert reader.to_send().endswith(rtde.set_up_outputs(tuple(FEW), None))
    data = packed(b"U", struct.pack(">d6di", 2.0, *Q, 7))
    ready, state = reader.receive(
        answers(packed(b"O", b"DOUBLE,VECTOR6D,INT32"), packed(b"S", ACCEPTED), data)
    )
    assert (ready.protocol_version, ready.frequency_hz, state.timestamp_s) == (1, None, 2.0)


@pytest.mark.parametrize(
    ("received", "reason"),
    [
        ((packed(b"V", REFUSED), packed(b"V", REFUSED)), "neither protocol version 2 nor 1"),
        ((packed(b"V", ACCEPTED), VERSION_5, packed(b"O", b"\x01DOUBLE")), "sent 1 types for 3 fields"),
        (
            (packed(b"V", ACCEPTED), VERSION_5, packed(b"O", b"\x00DOUBLE,NOT_FOUND,INT32")),
            "has no field actual_q",
        ),
        (
            (packed(b"V", ACCEPTED), VERSION_5, packed(b"O", b"\x01DOUBLE,VECTOR6D,UINT8")),
            "field robot_mode has the type UINT8: must be INT32",
        ),
        (
            (
                packed(b"V", ACCEPTED),
                VERSION_5,
                packed(b"O", b"\x01DOUBLE,VECTOR6D,INT32"),
                packed(b"S", REFUSED),
            ),
            "refused to start",
        ),
    ],
)
def test_handshake_that_cannot_succeed_says_why(received, reason):
    reader = RtdeReader(125.0, FEW)
    reader.connected()
    (failed,) = reader.receive(answers(*received))
    assert isinstance(failed, Failed)
    assert reason in failed.reason


def test_answer_that_was_not_requested_has_no_effect():
    reader = RtdeReader(125.0, FEW)
    reader.connected()
    events = reader.receive(
        answers(packed(b"S", ACCEPTED), packed(b"I", b"\x01UINT8"), packed(b"O", b"DOUBLE"))
    )
    assert [event.reason for event in events] == ["an answer that was not requested"] * 3
    assert reader.to_send() == b""


def test_new_connection_begins_anew():
    reader = RtdeReader(125.0, FEW)
    reader.connected()
    reader.receive(answers(packed(b"V", ACCEPTED), VERSION_5, b"\x00"))
    assert reader.connected() == rtde.request_protocol_version(2)
    assert reader.to_send() == b""
    reader.receive(packed(b"V", ACCEPTED))
    assert reader.to_send() == rtde.request_controller_version()


def test_all_fields_fit_into_a_recipe_and_give_a_state():
    names = tuple(OUTPUTS)
    assert len(rtde.set_up_outputs(names, 500.0)) < 1024
    values = {"timestamp": 1.0, "actual_q": Q, "robot_status_bits": 3, "safety_status_bits": 1 << 2 | 1 << 10}
    values |= {"standard_analog_input0": 0.5, "standard_analog_input1": 1.5, "safety_mode": 3}
    reader = RtdeReader(500.0, {name: OUTPUTS[name] for name in values})
    reader.connected()
    types = ",".join(OUTPUTS[name] for name in values).encode()
    payload = Recipe(list(values), [OUTPUTS[name] for name in values], 1).write(values)
    *_, state = reader.receive(
        answers(
            packed(b"V", ACCEPTED), VERSION_5, packed(b"O", b"\x01" + types), packed(b"S", ACCEPTED),
            packed(b"U", payload),
        )
    )  # fmt: skip
    assert state.robot_status == RobotStatus.POWER_ON | RobotStatus.PROGRAM_RUNNING
    assert state.safety_status == SafetyStatus.PROTECTIVE_STOPPED | SafetyStatus.STOPPED_DUE_TO_SAFETY
    assert state.analog_inputs == (0.5, 1.5)
    assert state.analog_outputs == (None, None)
    assert state.safety_mode == 3


def test_value_without_a_name_is_named_by_its_number():
    assert name_of(RobotMode, 7) == "RUNNING"
    assert name_of(RobotMode, 42) == "unknown 42"


# -------------------------------------------------------------------------- nonsense


@settings(max_examples=150, deadline=None)
@given(
    data=st.lists(
        st.one_of(
            st.sampled_from([data for data, _ in MESSAGES] + [packed(b"U", DATA)]),
            st.binary(max_size=40),
            st.builds(
                packed, st.sampled_from([bytes([each]) for each in b"VvMUOISPx"]), st.binary(max_size=80)
            ),
        ),
        max_size=8,
    ).map(b"".join),
    version=st.sampled_from([1, 2]),
    piece=st.integers(1, 60),
)
def test_any_bytes_give_events_that_do_not_depend_on_the_pieces(data, version, piece):
    whole = decoded(data, version=version, recipe=RECIPE)
    assert decoded(data, version=version, recipe=RECIPE, piece=piece) == whole
    for event in whole:
        if isinstance(event, DataReceived):
            assert all(
                abs(value) < float("inf") for value in (event.values["timestamp"], *event.values["actual_q"])
            )


def test_stream_keeps_no_more_than_one_package():
    stream = RtdeStream()
    for _ in range(200):
        stream.receive(packed(b"M", bytes(LONGEST_PACKAGE_BYTES - 3)) * 3 + b"\x0f")
        stream = RtdeStream() if stream.lost else stream
        assert len(stream._packages._buffer) <= LONGEST_PACKAGE_BYTES
