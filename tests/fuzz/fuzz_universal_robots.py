"""Broken messages of Universal Robots' controllers: RTDE and the primary interface.

    python tests/fuzz/fuzz_universal_robots.py [--messages N] [--seconds S] [--seed N] [--keep FOLDER]

Real messages, changed at random, some in one input, cut into pieces anywhere. They may cause no exception and
no leak. States and alarms must equal those of a strict parser that is independent of the gateway's. Anything
else ends the run with exit status 1 and its input in the folder.
"""

import argparse
import math
import random
import struct
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from protocol_gateway.drivers.universal_robots.primary import Alarm, PrimaryStream, SafetyModeChanged
from protocol_gateway.drivers.universal_robots.rtde_reader import RtdeReader
from protocol_gateway.drivers.universal_robots.state import OUTPUTS, ControllerState

GROWTH_MIB = 16
WARM_UP = 20_000
LONGEST = 4096
FIELDS = {"timestamp": "DOUBLE", "actual_q": "VECTOR6D", "robot_mode": "INT32", "payload": "DOUBLE"}


class Finding(NamedTuple):
    """Input that the codec handles wrongly."""

    data: bytes
    problem: str


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--messages", type=int, default=1_000_000)
    parser.add_argument("--seconds", type=float, default=3600.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=Path, default=Path(tempfile.gettempdir()) / "robomesh-fuzz")
    arguments = parser.parse_args()
    begun_s = time.monotonic()
    counts: Counter[str] = Counter()
    done, finding = fuzz(WARM_UP, arguments.seed, counts)
    begun_mib = rss_mib()
    while finding is None and done < arguments.messages and time.monotonic() < begun_s + arguments.seconds:
        more, finding = fuzz(
            min(50_000, arguments.messages - done), arguments.seed * 1_000_003 + done, counts
        )
        done += more
    took_s, mib = time.monotonic() - begun_s, rss_mib()
    print(f"{done:,} messages in {took_s:.0f} s, {time.process_time():.0f} s of CPU")
    print(", ".join(f"{count:,} {name}" for name, count in counts.most_common()))
    print(f"memory {begun_mib:.1f} MiB after {WARM_UP:,} messages, {mib:.1f} MiB at the end")
    if finding is not None:
        arguments.keep.mkdir(parents=True, exist_ok=True)
        path = arguments.keep / f"ur-seed{arguments.seed}-{done}.bin"
        path.write_bytes(finding.data)
        sys.exit(f"{path}: {finding.problem}")
    if mib - begun_mib > GROWTH_MIB:
        sys.exit(f"memory grew by {mib - begun_mib:.1f} MiB, {GROWTH_MIB} are allowed")
    print("no exception, no state and no alarm but what a strict reading gives")


def fuzz(messages: int, seed: int, counts: Counter[str]) -> tuple[int, Finding | None]:
    """Return how many messages were read, and the first input that was handled wrongly."""
    chance = random.Random(seed)
    done = 0
    while done < messages:
        number = chance.choice((1, 1, 2, 3, 5))
        primary = chance.random() < 0.5
        seeds = PRIMARY if primary else RTDE
        data = b"".join(_changed(chance.choice(seeds), seeds, chance) for _ in range(number))
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
    at = 0
    while len(data) - at >= 3:
        size = data[at] * 256 + data[at + 1]
        if size < 3 or size > LONGEST or at + size > len(data):
            break
        body = data[at + 3 : at + size]
        # A pause that was not requested ends the use of the connection.
        if data[at + 2] == ord("P") and body in (b"\0", b"\1"):
            break
        if data[at + 2] == ord("U") and len(body) == 1 + 8 * 7 + 4 + 8 and body[0] == 1:
            numbers = [struct.unpack(">d", body[1 + 8 * i : 9 + 8 * i])[0] for i in range(7)]
            mode = int.from_bytes(body[57:61], "big", signed=True)
            (payload,) = struct.unpack(">d", body[61:69])
            if all(number - number == 0 for number in (*numbers, payload)):
                states.append((numbers[0], tuple(numbers[1:]), mode))
        at += size
    return states


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


def _rtde_package(letter: bytes, payload: bytes = b"") -> bytes:
    return struct.pack(">H", 3 + len(payload)) + letter + payload


def _primary_package(kind: int, payload: bytes) -> bytes:
    return struct.pack(">iB", 5 + len(payload), kind) + payload


def _message(kind: int, payload: bytes) -> bytes:
    return _primary_package(20, struct.pack(">QbB", 25_643_784_000, -2, kind) + payload)


DATA = _rtde_package(b"U", b"\1" + struct.pack(">7did", 12.5, 0.1, -1.5, 1.2, -0.4, 1.57, 3.0, 7, 1.2))
VERSION = _rtde_package(b"v", struct.pack(">4I", 5, 21, 0, 0))
HANDSHAKE = b"".join(
    (
        _rtde_package(b"V", b"\1"),
        VERSION,
        _rtde_package(b"O", b"\1" + ",".join(FIELDS.values()).encode()),
        _rtde_package(b"S", b"\1"),
    )
)
RTDE = (
    *(DATA,) * 6,
    _rtde_package(b"V", b"\1"),
    VERSION,
    _rtde_package(b"O", b"\1" + ",".join(OUTPUTS.values()).encode()),
    _rtde_package(b"I", b"\1UINT32,IN_USE,NOT_FOUND"),
    _rtde_package(b"S", b"\1"),
    _rtde_package(b"P", b"\1"),
    _rtde_package(b"M", b"\x05hello\x04RTDE\x02"),
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


def _changed(message: bytes, seeds: Sequence[bytes], chance: random.Random) -> bytes:
    data = bytearray(message)
    for _ in range(chance.choice((0, 0, 1, 1, 1, 2, 4))):
        at = int(chance.random() * (len(data) + 1))
        length = chance.choice((1, 1, 2, 4, 8, 32))
        match int(chance.random() * 8):
            case 0 if at < len(data):
                data[at] ^= 1 << int(chance.random() * 8)
            case 1:
                data[at : at + length] = chance.randbytes(length)
            case 2:
                del data[at : at + length]
            case 3:
                del data[at:]
            case 4:
                other = chance.choice(seeds)
                begin = int(chance.random() * len(other))
                data[at:at] = other[begin : begin + length]
            case 5:
                token = chance.choice(TOKENS)
                data[at : at + len(token)] = token
            case 6:
                data[at:at] = chance.choice(TOKENS)
            case 7 if len(data) > 5 and chance.random() < 0.01:
                data += bytes(70_000)
    return bytes(data)


def cut(data: bytes, chance: random.Random) -> list[bytes]:
    """Split the same bytes as TCP may deliver them."""
    places = sorted(int(chance.random() * len(data)) for _ in range(chance.choice((0, 0, 1, 3))))
    return [data[begin:end] for begin, end in zip([0, *places], [*places, len(data)], strict=True)]


def rss_mib() -> float:
    """Return the memory of this process now."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096 / 2**20


if __name__ == "__main__":
    main()
