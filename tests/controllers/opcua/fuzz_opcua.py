"""Broken lines of the process that reads OPC UA.

    python -m tests.controllers.opcua.fuzz_opcua [--inputs N] [--seconds S] [--seed N] [--keep FOLDER]

Lines of a server's items and values, changed at random, cut and in the wrong order. They may cause no
exception and no leak. Joints and stops must be those of a strict reading that is independent of the
gateway's. It also decides what is of one moment. The driver may return nothing but reports. Anything else
ends the run with exit status 1 and its input in the folder.
"""

import json
import math
import random
from collections import Counter
from typing import Any

from controllers.opcua.driver import OPCUA, OpcUaDriver
from controllers.opcua.settings import OpcUaSettings
from protocol_gateway.seam import (
    Activity,
    ControllerEvent,
    JointsReceived,
    Mode,
    Report,
    StatusReceived,
)
from robots.kinematics.joints import JointType
from tests.fuzz.fuzzing import Finding, campaign, changed, cut

JOINTS = 3
NEW_CONNECTION_EACH = 200
SAMPLING_S = 0.05
DEGREE, RADIAN, MILLIMETRE, METRE = 17476, 4405297, 5066068, 5067858
ROTARY_UNITS = {DEGREE: math.pi / 180, RADIAN: 1.0}
OTHER_KINDS = (
    *("override", "in_control", "on_path", "mass", "mode", "emergency_stop", "protective_stop"),
    *("program", "loaded", "execution", "temperature", "software", "manufacturer", "model", "serial"),
)
TOKENS = (
    *(b"null", b"true", b"false", b"NaN", b"Infinity", b"-1", b"1e999", b'""', b"[]", b"{}", b"\n", b","),
    *(b'"found"', b'"values"', b'"alive"', b"]", b"}", b"\xff", b"99999999999999999999", b"17476"),
)


def fuzz(inputs: int, seed: int, counts: Counter[str]) -> tuple[int, Finding | None]:
    """Return how many lines were read, and the first that was handled wrongly."""
    chance = random.Random(seed)
    bench = Bench(counts)
    for done in range(inputs):
        if done % NEW_CONNECTION_EACH == 0:
            bench.open()
            line = json.dumps(bench.items(chance)).encode() + b"\n"
        else:
            line = bench.next_line(chance)
        data = changed(line, bench.lines, TOKENS, chance) if chance.random() < 0.5 else line
        if not data.endswith(b"\n"):
            data += b"\n"
        problem = ""
        try:
            for part in cut(data, chance):
                problem = problem or bench.receive(part)
        except Exception as error:
            problem = repr(error)
        problem = problem or bench.compare()
        if problem:
            return done, Finding(data, problem)
    return inputs, None


class Bench:
    """A driver, and a strict reading beside it."""

    def __init__(self, counts: Counter[str]) -> None:
        self._counts = counts
        self._driver = OpcUaDriver((JointType.ROTARY,) * JOINTS, {}, options=OpcUaSettings())
        self._now_s, self._time_s = 1000.0, 1.79e9
        self.lines: list[bytes] = [b"{}\n"]

    def open(self) -> None:
        """Begin a connection."""
        self._driver.closed(OPCUA, self._now_s)
        self._driver.opened(OPCUA, self._now_s)
        self._strict = Strict()
        self._events: list[ControllerEvent] = []
        self._received = b""

    def items(self, chance: random.Random) -> dict[str, Any]:
        """Return the list of items of a connection; some lack a unit or have another."""
        units = (DEGREE, DEGREE, DEGREE, DEGREE, RADIAN, RADIAN, MILLIMETRE, 0)
        usual = chance.choice((DEGREE, RADIAN))
        exact = chance.random() < 0.8
        listed: list[list[Any]] = [
            [
                "position",
                f"Axis_{n}",
                usual if exact else chance.choice(units),
                "",
                chance.choice((0, 1, 1, 1)),
            ]
            for n in range(1, JOINTS + 1 + (chance.random() < 0.05))
        ]
        listed += [[kind, "", 0, "", 0] for kind in OTHER_KINDS if chance.random() < 0.7]
        listed += [["motor", "Axis_2", 4408652, "°C", 0], ["speed", "Axis_1", 4536630, "", 1]]
        chance.shuffle(listed)
        self._listed = listed
        return {"found": listed, "server": "fuzz", "sampling_s": SAMPLING_S}

    def next_line(self, chance: random.Random) -> bytes:
        """Return a notification or a keep-alive."""
        self._time_s += 0.05
        if chance.random() < 0.15:
            return b'{"alive":true}\n'
        readings = []
        for number, item in enumerate(self._listed):
            position = item[0] == "position"
            if chance.random() > (0.9 if position else 0.2):
                continue
            value: Any = round(chance.uniform(-170, 170), 3)
            if not position:
                value = chance.choice((value, True, False, "text", None, 0.0, 1.0, 3.0, 4.0))
            at_s = self._time_s + chance.choice((0.0, 0.0, 0.0, 0.01, 0.2))
            readings.append(
                [number, value, chance.choice((at_s, at_s, at_s, at_s, None)), chance.random() < 0.97]
            )
        line = json.dumps({"values": readings} if readings else {"alive": True}).encode() + b"\n"
        self.lines = [*self.lines[-20:], line]
        return line

    def receive(self, part: bytes) -> str:
        """Give bytes to the driver; return what it does wrongly."""
        self._now_s += 0.01
        self._received += part
        for effect in self._driver.received(OPCUA, part, self._now_s):
            if not isinstance(effect, Report):
                return f"{effect} is no report"
            self._events += effect.events
        return ""

    def compare(self) -> str:
        """Compare what was reported with a strict reading of the same whole lines."""
        *lines, self._received = self._received.split(b"\n")
        wanted: list[tuple[float, ...]] = []
        activities: list[Activity | None] = []
        for line in lines:
            self._strict.read(line, wanted, activities)
        events, self._events = self._events, []
        for event in events:
            self._counts[type(event).__name__] += 1
        found = [each for each in events if isinstance(each, JointsReceived)]
        allowed = [each for each in wanted if each]
        for joints in found:
            if not any(_close(joints.positions, each) for each in allowed):
                return f"joints {joints.positions}, a strict reading gives {allowed}"
        stops = [e.activity for e in events if isinstance(e, StatusReceived)]
        if len(stops) != len(activities):
            return f"{len(stops)} statuses, a strict reading gives {len(activities)}"
        for activity, strict in zip(stops, activities, strict=True):
            # Motion is judged by positions and time, which the strict reading does not repeat.
            if (activity is Activity.STOPPED) is not (strict is Activity.STOPPED):
                return f"activity {activity}, a strict reading gives {strict}"
        for event in events:
            if isinstance(event, StatusReceived) and event.mode not in (None, Mode.LOCAL, Mode.REMOTE):
                return f"mode {event.mode}"
        return ""


def _close(one: tuple[float, ...], other: tuple[float, ...]) -> bool:
    return len(one) == len(other) and all(
        math.isclose(a, b, rel_tol=1e-9, abs_tol=1e-12) for a, b in zip(one, other, strict=True)
    )


class Strict:
    """Independent reading: dictionaries, no classes of the gateway's."""

    def __init__(self) -> None:
        self.items: list[Any] | None = None
        self.values: dict[int, tuple[Any, Any, bool]] = {}
        self.factors: list[tuple[int, float]] = []
        self.limit_s = 0.01

    def read(self, line: bytes, wanted: list[tuple[float, ...]], activities: list[Activity | None]) -> None:
        try:
            data = json.loads(line)
        except (ValueError, RecursionError):
            return
        if not isinstance(data, dict):
            return
        if set(data) == {"found", "server", "sampling_s"}:
            self.begin(data)
        elif self.items is not None and data in ({"alive": True}, {"alive": 1}) and data["alive"] is True:
            self.take([], wanted, activities)
        elif self.items is not None and set(data) == {"values"}:
            readings = data["values"]
            if (
                isinstance(readings, list)
                and 0 < len(readings) <= 512
                and all(map(self.is_reading, readings))
            ):
                self.take(readings, wanted, activities)

    def begin(self, data: dict[str, Any]) -> None:
        listed, sampling_s = data["found"], data["sampling_s"]
        good = (
            self.items is None
            and isinstance(listed, list)
            and len(listed) <= 512
            and isinstance(data["server"], str)
            and type(sampling_s) in (int, float)
            and abs(sampling_s) <= 1e10
            and all(map(is_item, listed))
        )
        if not good:
            return
        self.items, self.limit_s = listed, max(sampling_s, 0.01)
        axes = {each[1][:200]: n for n, each in enumerate(listed) if each[0] == "position"}
        if len(axes) != JOINTS:
            return
        factors = []
        for name in sorted(axes, key=natural):
            _, _, number, text, profile = listed[axes[name]]
            factor = ROTARY_UNITS.get(number)
            if factor is None and number not in KNOWN:
                factor = {"°": math.pi / 180, "deg": math.pi / 180, "rad": 1.0}.get(text.strip())
            if factor is None or profile in (3, 4):
                return
            factors.append((axes[name], factor))
        self.factors = factors

    def is_reading(self, each: Any) -> bool:
        assert self.items is not None
        if not isinstance(each, list) or len(each) != 4:
            return False
        item, value, at_s, good = each
        return (
            type(item) is int
            and 0 <= item < len(self.items)
            and type(value) in (int, float, str, bool, type(None))
            and (at_s is None or (type(at_s) in (int, float) and abs(at_s) <= 1e10))
            and type(good) is bool
        )

    def take(
        self, readings: list[Any], wanted: list[tuple[float, ...]], activities: list[Activity | None]
    ) -> None:
        assert self.items is not None
        times_s: dict[int, float] = {}
        for item, value, at_s, good in readings:
            before = self.values.get(item)
            value = number(value) if type(value) in (int, float) else value
            value = value[:200] if isinstance(value, str) else value
            if at_s is not None and (before is None or before[0] != value):
                times_s[item] = at_s
            self.values[item] = value, at_s, good
        positions = []
        for item, factor in self.factors:
            value, _, good = self.values.get(item, (None, None, False))
            positions.append(value * factor if good and type(value) is float else None)
        moments = [times_s[item] for item, _ in self.factors if item in times_s]
        together = not moments or max(moments) - min(moments) <= self.limit_s
        if self.factors and together and None not in positions:
            wanted.append(tuple(each for each in positions if each is not None))
        stopped = False
        for n, item in enumerate(self.items):
            value, _, good = self.values.get(n, (None, None, False))
            if good and item[0] in ("emergency_stop", "protective_stop"):
                # A number that equals True is no boolean.
                stopped = stopped or value is True
            if good and item[0] == "in_control":
                stopped = stopped or value is False
        activities.append(Activity.STOPPED if stopped else None)


KNOWN = {
    int.from_bytes(code.encode(), "big")
    for code in [
        "DD",
        "C81",
        "MMT",
        "CMT",
        "MTR",
        "E96",
        "2A",
        "C16",
        "2M",
        "MTS",
        "P1",
        "KGM",
        "GRM",
        "CEL",
        "KEL",
        "FAH",
        "AMP",
        "4K",
        "VLT",
        "NU",
        "NEW",
        "SEC",
        "C26",
        "HUR",
    ]
}
KINDS = {*OTHER_KINDS, "position", "speed", "motor", "declared"}


def number(value: float) -> float | None:
    """Return a finite number, None otherwise."""
    try:
        return float(value) if math.isfinite(float(value)) else None
    except OverflowError:
        return None


def is_item(each: Any) -> bool:
    return (
        isinstance(each, list)
        and [type(part) for part in each] == [str, str, int, str, int]
        and each[0] in KINDS
    )


def natural(name: str) -> list[tuple[int, str]]:
    """Return digits as numbers: Axis_2 before Axis_10."""
    parts: list[tuple[int, str]] = []
    digits = ""
    for char in [*name, ""]:
        if char and char in "0123456789":
            digits += char
            continue
        if digits:
            parts.append((int(digits), ""))
            digits = ""
        if char:
            parts.append((-1, char))
    return parts


if __name__ == "__main__":
    campaign(
        __doc__,
        fuzz,
        name="opcua",
        verdict="no exception, no joints and no activity but what a strict reading gives; nothing was sent",
    )
