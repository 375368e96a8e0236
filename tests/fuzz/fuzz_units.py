"""Broken units for the gateway: what a controller may send it, and what an old client program may ask.

    python -m tests.fuzz.fuzz_units [--inputs N] [--seconds S] [--seed N] [--keep FOLDER]

Real units, changed at random, some in one input, cut into pieces anywhere. They may cause no exception and no
leak. Joint positions and motions must equal those of a strict parser that is independent of the gateway's.
Anything else ends the run with exit status 1 and its input in the folder.
"""

import logging
import random
import re
from collections.abc import Mapping, Sequence

from google.protobuf.message import Message

from controllers.unit.driver import UnitDriver
from protocol_gateway.legacy.requests import asks_for_more, requests_of
from protocol_gateway.link.timestamping import EventTime, Timestamper
from protocol_gateway.seam import JointsReceived
from protocol_gateway.telemetry.journal import Journal
from protocol_gateway.telemetry.signals import Signals
from protocol_gateway.telemetry.telemetry import Telemetry
from protocol_gateway.unit_protocol.codes import TYPES, code_table
from protocol_gateway.unit_protocol.records import Error, asks_to_stop
from protocol_gateway.unit_protocol.stream import Unit, UnitStream
from robots.descriptions.description import load
from robots.kinematics.joints import joints_of
from tests.fuzz.fuzzing import Finding, campaign, cut

JOINTS = joints_of(load("pt600"))
LONGEST = 64 * 1024

CODES: tuple[Mapping[int, str], ...] = (
    {},
    {
        2: "ABSOLUTE.DEG",
        3: "RELATIVE.DEG",
        5: "STATUS",
        -7: "TIME",
        101: "COMMAND:home",
        102: "COMMAND:speed",
    },
)
SEEDS = (
    b"2# COMMAND* trace; home&ABSOLUTE.DEG* 100.00; 30.45; 92.66; - 67.10; - 25.85",
    b"1#ABSOLUTE.DEG*100.00;30.45;92.66;-67.10;-25.85",
    b"1#2*1;.5;2.;-0;007",
    b"4#ABSOLUTE.DEG*1;2;3;4;5&VELOCITY.DEG*0.1;0.2;0.3;0.4;0.5&STATUS*moving;remote;homed&TIME*12.34",
    b"1#RELATIVE.DEG*0.10;0;0;0;-1e-1",
    b"1#COMMAND*home",
    b"2#COMMAND*speed=50;reset&COMMAND*stop",
    b"2#101&102*50",
    b"1#STATUS*idle;local",
    b"1#ERROR*5;joint 2: 131.0 is beyond 130.0",
    b"2#OVEN*212;hot&TIME*3",
    b"\r\n1#3*1;2;3;4;5",
)
TOKENS = (
    *b"# * & ; - + . 1# 0 nan inf 1e999 1e-320 1_0 \xff \0 \v \x85 \xc2\xb2".split(b" "),
    *(b" ", b"- ", b"\t", b"\r\n", b"9" * 310, b"0" * 310, b"1" * 450),
    *b"stop home speed= homed idle 2147483648 -2147483649 99999999999 101 -7".split(),
    *b"ABSOLUTE.DEG* RELATIVE.DEG* TIME* STATUS* COMMAND* ERROR* &VELOCITY.DEG*1;2;3;4;5".split(),
)
_NUMBER_AT = re.compile(rb"-? ?[0-9.]+")


def main() -> None:
    logging.disable()
    campaign(
        __doc__,
        lambda inputs, seed, counts: fuzz(inputs, seed),
        inputs=10_000_000,
        seconds=7200.0,
        name="units",
        # State between inputs is bounded: numbers and words of a few units.
        growth_mib=24,
        verdict="no exception, no motion but what a strict reading gives",
    )


def fuzz(inputs: int, seed: int) -> tuple[int, Finding | None]:
    """Return how many inputs the gateway accepted, and the first that it handled wrongly."""
    chance = random.Random(seed)
    gateways = [Gateway(codes) for codes in CODES]
    for count in range(inputs):
        data = mutated(chance)
        pieces = cut(data, chance)
        gateway = chance.choice(gateways)
        try:
            take = gateway.controller_sends if chance.random() < 0.5 else gateway.client_sends
            problem = take(data, pieces)
        except Exception as error:
            problem = repr(error)
        if problem:
            return count, Finding(data, problem)
    return inputs, None


# -------------------------------------------------------------------- the gateway's ends


class Gateway:
    """Both sides of a gateway that read units, with all of their effects except sockets and disk."""

    def __init__(self, codes: Mapping[int, str]) -> None:
        self._codes = dict(codes) or dict(enumerate(TYPES, start=1))
        self._driver = UnitDriver(JOINTS.types, codes)
        self._client = UnitStream(code_table(codes))
        self._now_s = 0.0
        self._timestamper = Timestamper()
        journal = Journal(Sink(), "arm", monotonic_s=lambda: self._now_s)  # type: ignore[arg-type]
        self._telemetry = Telemetry(
            JOINTS,
            fast=Sink(),  # type: ignore[arg-type]
            slow=Sink(),  # type: ignore[arg-type]
            raw=Sink(),  # type: ignore[arg-type]
            signals=Signals(Sink(), journal, JOINTS.names),  # type: ignore[arg-type]
            journal=journal,
            stale_after_s=1.0,
            on_status=lambda: None,
            on_activity=lambda activity, dated_s: None,
            on_refused=lambda: None,
            stop_expected=lambda now_s: False,
        )

    def controller_sends(self, data: bytes, pieces: Sequence[bytes]) -> str:
        """Return the problem on the link's side; empty: none."""
        self._now_s += 0.01
        events = [event for piece in pieces for event in self._driver.read(piece).events]
        now = EventTime(self._now_s, int(self._now_s * 1e9))
        for event, received in zip(events, self._timestamper.timestamps(events, now), strict=True):
            if received.wall_ns > now.wall_ns:
                return f"{event} is stamped {received.wall_ns - now.wall_ns} ns after its receipt"
            self._telemetry.on_event(event, received)
        read = [event.positions for event in events if isinstance(event, JointsReceived)]
        right = [
            tuple(value * scale for value, scale in zip(values, SCALES, strict=True))
            for unit in strict_units(data, self._codes)
            if all(len(values) == len(SCALES) for name, values in unit if name in _STATES)
            for name, values in unit
            if name == "ABSOLUTE.DEG"
        ]
        return "" if read == right else f"joints {read}, a strict reading gives {right}"

    def client_sends(self, data: bytes, pieces: Sequence[bytes]) -> str:
        """Return the problem on the side of old client programs; empty: none."""
        units = [
            event for piece in pieces for event in self._client.receive(piece) if isinstance(event, Unit)
        ]
        right = strict_units(data, self._codes)
        if len(units) != len(right):
            return f"{len(units)} units, a strict reading gives {len(right)}"
        for unit, records in zip(units, right, strict=True):
            asks_to_stop(unit.records), asks_for_more(unit.records)
            requests = requests_of(unit.records, JOINTS)
            if isinstance(requests, Error):
                continue
            moves = [tuple(each.joint_positions) for each in requests if each.joint_positions]
            targets = [values for name, values in records if name in ("ABSOLUTE.DEG", "RELATIVE.DEG")]
            if moves != [tuple(v * s for v, s in zip(each, SCALES, strict=True)) for each in targets]:
                return f"moves to {moves}, a strict reading gives {targets}"
        return ""


class Sink:
    """Publisher without subscribers, which encodes every message."""

    def put(
        self, message: Message, *, source_time_ns: int | None = None, dated_by: int | None = None
    ) -> None:
        message.SerializeToString()


SCALES = tuple(0.017453292519943295 for _ in JOINTS.types)
_STATES = ("ABSOLUTE.DEG", "VELOCITY.DEG")

# -------------------------------------------------------------- a strict reading, written apart

_W = rb"[ \t\r\n]*"
_NUMBER = re.compile(rb"[+-]?" + _W + rb"(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_CODE = re.compile(rb"[+-]?" + _W + rb"[0-9]+")
_ERROR_NUMBER = re.compile(rb"[0-9]{1,9}")
_NUMBERS = ("ABSOLUTE.DEG", "RELATIVE.DEG", "VELOCITY.DEG", "TIME")
_BLANKS = b" \t\r\n"

StrictUnit = list[tuple[str, tuple[float, ...]]]


def strict_units(data: bytes, codes: Mapping[int, str]) -> list[StrictUnit]:
    """Return the well-formed units of a text that ends with "@": type and, if any, numbers of each record."""
    units = (strict(unit, codes) for unit in data.split(b"@")[:-1])
    return [unit for unit in units if unit is not None]


def strict(unit: bytes, codes: Mapping[int, str]) -> StrictUnit | None:
    if len(unit) >= LONGEST or not unit.isascii() or unit.count(b"#") != 1:
        return None
    count, body = unit.split(b"#")
    records = body.split(b"&")
    if not count.strip(_BLANKS).isdigit() or count.strip(_BLANKS).lstrip(b"0") != str(len(records)).encode():
        return None
    read = [strict_record(record, codes) for record in records]
    return None if None in read else [record for record in read if record is not None]


def strict_record(record: bytes, codes: Mapping[int, str]) -> tuple[str, tuple[float, ...]] | None:
    type_text, *data = [part.strip(_BLANKS) for part in record.split(b"*")]
    if not type_text or len(data) > 1:
        return None
    name = type_text.decode()
    if _CODE.fullmatch(type_text):
        digits = re.sub(rb"[ \t\r\n]", b"", type_text)
        number = int(digits) if len(digits.lstrip(b"+-0")) < 12 else 2**40
        if not -(2**31) <= number < 2**31:
            return None
        name = codes.get(number, name)
    coded = name != type_text.decode() and name.startswith("COMMAND:")
    items = [item.strip(_BLANKS) for item in data[0].split(b";")] if data and data[0] else []
    if coded:
        return (name, ()) if len(items) == (name == "COMMAND:speed") else None
    if name in ("COMMAND", "STATUS"):
        return (name, ()) if items and all(items) else None
    if name == "ERROR":
        return (name, ()) if items and _ERROR_NUMBER.fullmatch(items[0]) else None
    if name not in _NUMBERS:
        return name, ()
    if not items or (name == "TIME" and len(items) > 1):
        return None
    if any(len(item) > 400 or not _NUMBER.fullmatch(item) for item in items):
        return None
    values = tuple(float(re.sub(rb"[ \t\r\n]", b"", item)) for item in items)
    return (name, values) if all(abs(value) < float("inf") for value in values) else None


# -------------------------------------------------------------------------------- inputs


def mutated(chance: random.Random) -> bytes:
    """Return some units, most of them changed, ended by "@"; a few are far too long."""
    if chance.random() < 0.0002:
        filling = chance.choice(SEEDS) + b";" + chance.choice(TOKENS)
        return filling * (chance.choice((65_000, 65_536, 140_000)) // len(filling)) + b"@"
    units = chance.choices(SEEDS, k=chance.choice((1, 1, 2, 3)))
    return b"@".join([_changed(unit, chance) for unit in units]) + b"@"


def _changed(unit: bytes, chance: random.Random) -> bytes:
    data = bytearray(unit)
    for _ in range(chance.choice((0, 1, 1, 1, 2, 4, 8))):
        at = int(chance.random() * (len(data) + 1))
        length = chance.choice((1, 1, 2, 4, 8, 32))
        match int(chance.random() * 9):
            case 0 if at < len(data):
                data[at] ^= 1 << int(chance.random() * 8)
            case 1:
                data[at : at + length] = chance.randbytes(length)
            case 2:
                del data[at : at + length]
            case 3:
                del data[at:]
            case 4:
                other = chance.choice(SEEDS)
                begin = int(chance.random() * len(other))
                data[at:at] = other[begin : begin + length]
            case 5:
                data[at:at] = data[at : at + length] * chance.choice((1, 3, 100))
            case 6 | 7:
                data[at:at] = chance.choice(TOKENS)
            case 8:
                if number := _NUMBER_AT.search(data, at):
                    data[number.start() : number.end()] = chance.choice(TOKENS)
    return bytes(data)


if __name__ == "__main__":
    main()
