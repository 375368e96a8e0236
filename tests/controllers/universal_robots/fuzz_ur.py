"""Broken messages of Universal Robots' controllers: RTDE and the primary interface.

    python -m tests.controllers.universal_robots.fuzz_ur [--inputs N] [--seconds S] [--seed N] [--keep FOLDER]

Real messages, changed at random, some in one input, cut into pieces anywhere. They may cause no exception and
no leak. States and alarms must equal those of a strict parser that is independent of the gateway's. Anything
else ends the run with exit status 1 and its input in the folder.
"""

import math
import random
import struct
from collections import Counter
from collections.abc import Sequence

from controllers.universal_robots.interfaces.primary import Alarm, PrimaryStream, SafetyModeChanged
from controllers.universal_robots.interfaces.rtde_reader import RtdeReader
from controllers.universal_robots.interfaces.state import OUTPUTS, ControllerState
from tests.fuzz.fuzzing import Finding, campaign, changed, cut

LONGEST = 4096
FIELDS = {"timestamp": "DOUBLE", "actual_q": "VECTOR6D", "robot_mode": "INT32", "payload": "DOUBLE"}


def fuzz(messages: int, seed: int, counts: Counter[str]) -> tuple[int, Finding | None]:
    """Return how many messages were read, and the first input that was handled wrongly."""
    chance = random.Random(seed)
    done = 0
    while done < messages:
        number = chance.choice((1, 1, 2, 3, 5))
        primary = chance.random() < 0.5
        seeds = PRIMARY if primary else RTDE
        data = b"".join(changed(chance.choice(seeds), seeds, TOKENS, chance) for _ in range(number))
        try:
            problem = (_primary if primary else _rtde)(data, cut(data, chance), counts)
        except Exception as error:
            problem = repr(error)
        if problem:
            return done, Finding(data, problem)
        done += number
    return done, None


# --------------------------------------------------------------------------- the codec


def _rtde(data: bytes, pieces: Sequence[bytes], counts: Counter[str]) -> str:
    reader = RtdeReader(125.0, FIELDS)
    reader.connected()
    reader.receive(HANDSHAKE)
    reader.to_send()
    events = [event for piece in pieces for event in reader.receive(piece)]
    counts.update(type(event).__name__ for event in events)
    if sent := reader.to_send():
        return f"sends {sent!r} after the handshake"
    states = [(e.timestamp_s, e.positions, e.robot_mode) for e in events if isinstance(e, ControllerState)]
    right = strict_states(data)
    return "" if states == right else f"states {states}, a strict reading gives {right}"


def _primary(data: bytes, pieces: Sequence[bytes], counts: Counter[str]) -> str:
    stream = PrimaryStream()
    events = [event for piece in pieces for event in stream.receive(piece)]
    counts.update(type(event).__name__ for event in events)
    read = [
        (each.code, each.argument, each.level if isinstance(each, Alarm) else each.mode)
        for each in events
        if isinstance(each, Alarm | SafetyModeChanged)
    ]
    right = strict_alarms(data)
    return "" if read == right else f"alarms {read}, a strict reading gives {right}"


# -------------------------------------------------------------- a strict reading, written apart


def strict_states(data: bytes) -> list[tuple[float, tuple[float, ...], int]]:
    """Return the states of a stream after the handshake, up to an impossible length or an end of the data."""
    states = []
    for kind, body in strict_packages(data)[0]:
        # A pause that was not requested ends the use of the connection.
        if kind == ord("P") and body in (b"\0", b"\1"):
            break
        if kind == ord("U") and len(body) == 1 + 8 * 7 + 4 + 8 and body[0] == 1:
            numbers = [struct.unpack(">d", body[1 + 8 * i : 9 + 8 * i])[0] for i in range(7)]
            mode = int.from_bytes(body[57:61], "big", signed=True)
            if all(number - number == 0 for number in numbers):
                states.append((numbers[0], tuple(numbers[1:]), mode))
    return states


def strict_packages(data: bytes) -> tuple[list[tuple[int, bytes]], bytes | None]:
    """Return letter and body of RTDE's packages, and the rest; None: a length is impossible."""
    packages = []
    at = 0
    while len(data) - at >= 3:
        size = data[at] * 256 + data[at + 1]
        if size < 3 or size > LONGEST:
            return packages, None
        if at + size > len(data):
            break
        packages.append((data[at + 2], data[at + 3 : at + size]))
        at += size
    return packages, data[at:]


def strict_alarms(data: bytes) -> list[tuple[int, int, int]]:
    """Return code, argument and level or mode of alarms and of changes of the safety mode."""
    alarms = []
    at = 0
    while len(data) - at >= 5:
        size = int.from_bytes(data[at : at + 4], "big", signed=True)
        message = data[at + 4] == 20
        if size < 5 or size > (65_536 if message else 1_048_576) or at + size > len(data):
            break
        body = data[at + 15 : at + size] if size >= 15 else b""
        kind = data[at + 14] if size >= 15 else 255
        code, argument = (int.from_bytes(body[i : i + 4], "big", signed=True) for i in (0, 4))
        if message and kind == 6 and len(body) >= 20:
            alarms.append((code, argument, int.from_bytes(body[8:12], "big", signed=True)))
        if message and kind == 5 and len(body) >= 17:
            alarms.append((code, argument, body[8]))
        at += size
    return alarms


# -------------------------------------------------------------------------------- inputs


def rtde_package(letter: bytes, payload: bytes = b"") -> bytes:
    return struct.pack(">H", 3 + len(payload)) + letter + payload


def _primary_package(kind: int, payload: bytes) -> bytes:
    return struct.pack(">iB", 5 + len(payload), kind) + payload


def _message(kind: int, payload: bytes) -> bytes:
    return _primary_package(20, struct.pack(">QbB", 25_643_784_000, -2, kind) + payload)


DATA = rtde_package(b"U", b"\1" + struct.pack(">7did", 12.5, 0.1, -1.5, 1.2, -0.4, 1.57, 3.0, 7, 1.2))
VERSION = rtde_package(b"v", struct.pack(">4I", 5, 21, 0, 0))
HANDSHAKE = b"".join(
    (
        rtde_package(b"V", b"\1"),
        VERSION,
        rtde_package(b"O", b"\1" + ",".join(FIELDS.values()).encode()),
        rtde_package(b"S", b"\1"),
    )
)
RTDE = (
    *(DATA,) * 6,
    rtde_package(b"V", b"\1"),
    VERSION,
    rtde_package(b"O", b"\1" + ",".join(OUTPUTS.values()).encode()),
    rtde_package(b"I", b"\1UINT32,IN_USE,NOT_FOUND"),
    rtde_package(b"S", b"\1"),
    rtde_package(b"P", b"\1"),
    rtde_package(b"M", b"\x05hello\x04RTDE\x02"),
)
PRIMARY = (
    *(_message(6, struct.pack(">iiiII", 153, 3, 3, 0, 7) + b"too hot"),) * 4,
    _message(5, struct.pack(">iiBII", 11, 1, 3, 0, 0)),
    _message(3, b"\x09URControl\x05\x15" + struct.pack(">ii", 0, 42) + b"26-11-2026"),
    _message(7, struct.pack(">ii", 0, 0) + b"\x13PROGRAM_XXX_STARTEDweld"),
    _message(10, struct.pack(">ii", 12, 4) + b"name not found"),
    _message(0, "größer".encode()),
    _message(2, struct.pack(">II???", 1, 0, False, True, True) + b"\x05TitleText"),
    _primary_package(16, struct.pack(">IB", 47, 0) + bytes(42)),
    _primary_package(25, bytes(300)),
)
TOKENS = (
    *(b"\0", b"\0\0", b"\0\3", b"\x10\x00", b"\x10\x01", b"\xff\xff", b"\x7f\xff\xff\xff", b"\0\1\0\0"),
    *(struct.pack(">d", each) for each in (math.nan, math.inf, -math.inf, 1e308, -0.0, 5e-324)),
    *(b"\0\0\0\5\x10", b"\0\0\0\4", b"\x80\0\0\0", b"\1", b"\2", b"U", b"DOUBLE,", b"\xc2\xb2", b"\x1b[2J"),
)


if __name__ == "__main__":
    campaign(
        __doc__,
        fuzz,
        name="ur",
        verdict="no exception, no state and no alarm but what a strict reading gives",
    )
