"""Broken answers of FANUC's controllers by SNPX.

    python -m tests.controllers.fanuc.fuzz_snpx [--inputs N] [--seconds S] [--seed N] [--keep FOLDER]

Answers to the driver's own questions, changed at random, doubled, late, cut, and from the tables of other
clients. They may cause no exception and no leak. Joints, alarms and activities must be those of a strict
reading that is independent of the gateway's. The driver may send nothing but questions and its own
assignments, one at a time, and the latter once a connection. Anything else ends the run with exit status 1
and its input in the folder.
"""

import math
import random
import re
import struct
from collections import Counter, deque

from controllers.fanuc.axes import FanucSettings
from controllers.fanuc.driver import SNPX, SnpxDriver
from protocol_gateway.seam import (
    AlarmReceived,
    ControllerEvent,
    Effects,
    JointsReceived,
    MalformedReceived,
    Report,
    Send,
    SetTimer,
    StatusReceived,
)
from robots.kinematics.joints import JointType
from tests.fuzz.fuzzing import Finding, answers, campaign, changed

TIMEOUT_S = 1.0
NEW_CONNECTION_EACH = 500
SETTINGS = FanucSettings(assignments="own", j23=1, registers=(5,), io=("DI[1-16]", "RO[2-9]"))
# First word from 0, number of words: position, state, alarms.
POSITION, STATE, ALARMS = (10_000, 52), (10_052, 94), (10_146, 402)
OPERATOR = (0x46, 6000, 24)
ASSIGNMENT = re.compile(
    rb"CLRASG|SETASG 1\d{4} \d{1,3} (POS\[G1:0\]|PRG\[1\]|ALM\[1\]|R\[5\]|\$MNUTOOL\[1,1\]@1\.26"
    rb"|\$MNU(TOOL|FRAME)NUM\[1\]|\$MCR\.\$GENOVERRIDE|\$VERSION|\$SNPX_PARAM\.\$VERSION) \d{1,5}"
)


def fuzz(inputs: int, seed: int, counts: Counter[str]) -> tuple[int, Finding | None]:
    """Return how many answers were read, and the first that was handled wrongly."""
    return answers(inputs, seed, lambda: Bench(counts), renew_each=NEW_CONNECTION_EACH)


class Bench:
    """A driver, its clock and its open question.

    Attributes:
        problem: A wrong packet of the driver; empty: none.
    """

    def __init__(self, counts: Counter[str]) -> None:
        self.driver = SnpxDriver((JointType.ROTARY,) * 6, {}, options=SETTINGS)
        self.now_s = 0.0
        self.problem = ""
        self._counts = counts
        self._proof = 0
        self._begin()

    def _begin(self) -> None:
        self._question = b""
        self._asked_s = 0.0
        self._timer_s: float | None = None
        self._rest = b""
        self._texts: set[bytes] = set()
        self._unproven: Counter[tuple[int, int]] = Counter()
        self._old: deque[bytes] = deque(maxlen=5)
        self.perform(self.driver.opened(SNPX, self.now_s))

    def perform(self, effects: Effects) -> list[ControllerEvent]:
        """Note what the driver sends; return what it reports."""
        events: list[ControllerEvent] = []
        for effect in effects:
            match effect:
                case Send(_, data):
                    self._check(data)
                    if self._question and self.now_s < self._asked_s + TIMEOUT_S:
                        self.problem = "asks before the answer"
                    self._question, self._asked_s = data, self.now_s
                case SetTimer(at_s):
                    self._timer_s = at_s
                case Report(reported):
                    events += reported
                case _:
                    pass
        return events

    def _check(self, data: bytes) -> None:
        """Note a packet that is neither a question nor an assignment of the driver's own table."""
        text = data[56:]
        if data == bytes(56):
            right = not self._old
        elif data[31] == 0x80:
            right = data[50:54] == b"\x07\x38\0\0" and ASSIGNMENT.fullmatch(text) is not None
            right = right and text not in self._texts and data[54] + 256 * data[55] == len(text)
            self._texts.add(text)
            if b"PARAM.$VERSION" in text:
                self._proof = int(text.split()[-1])
        else:
            right = data[31] == 0xC0 and not text and not any(data[48:])
            right = right and (data[42], data[43]) in ((0x4F, 1), (4, 8), (4, 0x46), (4, 0x48))
        if not right:
            self.problem = f"sends {data!r}"

    def next_bytes(self, chance: random.Random) -> bytes:
        """Return an answer to the open question, or other bytes; a question is open then."""
        while not self._question:
            if self._timer_s is None:
                # The begin of a connection failed, or another client took the table.
                self._begin()
                continue
            self.now_s = max(self.now_s, self._timer_s)
            self.perform(self.driver.timer_ended({}, self.now_s))
        kind = chance.random()
        if kind < 0.05 and self._old:
            return chance.choice(self._old)
        if kind < 0.06:
            # The answer is lost.
            self.now_s = self._asked_s + TIMEOUT_S + 0.001
            self._question = b""
            self.perform(self.driver.timer_ended({}, self.now_s))
            return self.next_bytes(chance)
        right = self._right()
        if self._question == bytes(56) or self._question[31] == 0x80 or self._question[42] == 0x4F:
            # The begin is changed seldom, so that there is something after it.
            return right[0] if kind < 0.99 else changed(right[0], right, TOKENS, chance)
        if kind < 0.1:
            return self._answer(b"", kind=0xD1, status=chance.choice((0, 0x0700, 0x05F4)))
        return changed(chance.choice(right), right, TOKENS, chance)

    def _right(self) -> list[bytes]:
        """Return answers that a controller may give to the open question."""
        question = self._question
        if question == bytes(56):
            return [b"\1" + bytes(7) + b"\1" + bytes(47)]
        if question[31] == 0x80 or question[42] == 0x4F:
            return [self._answer(b"")]
        area, first, count = struct.unpack_from("<BHH", question, 43)
        if area != 8:
            return [self._answer(each[: count // 8]) for each in BITS]
        version = struct.pack("<i", 2 * self._proof)
        content = {POSITION: POSITIONS, STATE: STATES, ALARMS: ALARM_LISTS}[first, count]
        return [self._answer(each + version) for each in content]

    def _answer(self, data: bytes, *, kind: int = 0, status: int = 0) -> bytes:
        kind = kind or (0xD4 if len(data) <= 6 else 0x94)
        number = self._question[2]
        size = len(data) if kind == 0x94 else 0
        head = struct.pack("<BBBBH", 3, 0, number, 0, size).ljust(30, b"\0")
        head += bytes([number, kind]) + bytes.fromhex("100e0000303a00000101") + status.to_bytes(2, "big")
        if kind == 0x94:
            return head + bytes.fromhex("000000000101ff0400007c21")[:12] + data
        return head + data.ljust(6, b"\0") + bytes.fromhex("000000007c21")

    def receive(self, data: bytes) -> str:
        """Return the problem with bytes; empty: none."""
        self.now_s += 0.002
        if len(data) < 4096:
            self._old.append(data)
        question = self._question
        answer = self._strict(data, question)
        if answer is not None:
            self._question = b""
        events = self.perform(self.driver.received(SNPX, data, self.now_s))
        self._counts.update(type(event).__name__ for event in events)
        return self._compare(events, question, answer)

    # ------------------------------------------------------ a strict reading, written apart

    def _strict(self, data: bytes, question: bytes) -> bytes | None:
        """Return the data that answer a question, empty if it is refused; None: it is not answered."""
        data = self._rest + data
        found = None
        while len(data) >= 56:
            size = data[4] + 256 * data[5]
            first = data[0] == 1 and size == 0 and data[31] == 0
            later = data[0] == 3 and data[2] > 0 and data[3] == 0 and data[40] == data[41] == 1
            later = later and data[31] in (0xD4, 0x94, 0xD1) and size <= 1024
            later = later and (size > 0) == (data[31] == 0x94)
            if not first and not later:
                data = b""
                break
            if len(data) < 56 + size:
                break
            packet, data = data[: 56 + size], data[56 + size :]
            if found is None and question and first is (question == bytes(56)):
                if first:
                    found = b""
                elif packet[2] == question[2]:
                    found = self._content(packet, question)
        self._rest = data
        return found

    @staticmethod
    def _content(packet: bytes, question: bytes) -> bytes:
        if packet[31] == 0xD1 or packet[42] or packet[43] or question[31] == 0x80 or question[42] != 4:
            return b""
        count = question[46] + 256 * question[47]
        size = 2 * count if question[43] == 8 else count // 8
        if packet[31] == 0xD4:
            return packet[44 : 44 + size] if size <= 6 else b""
        return packet[56:] if len(packet) == 56 + size else b""

    def _compare(self, events: list[ControllerEvent], question: bytes, answer: bytes | None) -> str:
        place = struct.unpack_from("<BHH", question, 43) if question and question[31] == 0xC0 else (0, 0, 0)
        block = place[1:] if place[0] == 8 else (0, 0)
        content = self._proven(block, answer) if answer and place[0] == 8 else None
        right = strict_joints(content) if content and block == POSITION else None
        joints = [each.positions for each in events if isinstance(each, JointsReceived)]
        if len(joints) != (right is not None):
            return f"joints {joints}, a strict reading gives {right}"
        if right is not None and any(
            abs(a - b) > 1e-9 * max(1.0, abs(b)) for a, b in zip(joints[0], right, strict=True)
        ):
            return f"joints {joints}, a strict reading gives {right}"
        states = [each for each in events if isinstance(each, StatusReceived)]
        if len(states) != (place == OPERATOR and bool(answer)):
            return f"states {states} from {answer!r}"
        reported = [each.number for each in events if isinstance(each, AlarmReceived) and each.number]
        listed = strict_alarms(content) if content and block == ALARMS else 0
        if len(reported) > listed:
            return f"alarms {reported} from {answer!r}"
        given_up = any(isinstance(each, MalformedReceived) and "one table" in each.reason for each in events)
        if given_up != (self._unproven[block] == 3 and content is None and bool(answer)):
            return f"the table is given up after {self._unproven[block]} answers"
        if given_up:
            # A new gateway would make it again.
            self.driver = SnpxDriver((JointType.ROTARY,) * 6, {}, options=SETTINGS)
            self._begin()
        return ""

    def _proven(self, block: tuple[int, ...], answer: bytes) -> bytes | None:
        """Return the words of a block without their proof; None: they are another client's."""
        assert len(block) == 2
        found = int.from_bytes(answer[-4:], "little", signed=True)
        if found % self._proof or not 2 <= found // self._proof <= 99:
            self._unproven[block] += 1
            return None
        self._unproven[block] = 0
        return answer[:-4]


def strict_joints(data: bytes) -> list[float] | None:
    """Return the joints of a position [rad]; None: it has none."""
    axes = [struct.unpack("<f", data[at : at + 4])[0] for at in range(52, 88, 4)]
    if data[88:90] == b"\0\0" or not all(map(math.isfinite, axes)):
        return None
    return [each * 0.017453292519943295 for each in (axes[0], axes[1], axes[2] + axes[1], *axes[3:6])]


def strict_alarms(data: bytes) -> int:
    """Return the number of alarms in a list."""
    return sum(data[at : at + 4] != bytes(4) for at in range(0, 800, 200))


# -------------------------------------------------------------------------------- inputs


def _position(axes: tuple[float, ...], valid: int = 1) -> bytes:
    head = struct.pack("<9f8h", 500.0, -20.0, 800.0, 180.0, -90.0, 0.5, 0, 0, 0, 0, 0, 1, 1, 0, -1, 0, valid)
    return head + struct.pack("<9f6h", *axes, *(0.0,) * (9 - len(axes)), valid, 15, 15, 0, 0, 0)


def _alarm(facility: int, code: int, severity: int, text: str, name: str = "") -> bytes:
    head = struct.pack("<11h", facility, code, 0, 0, severity, 2026, 11, 26, 9, 30, 0)
    return head + text.encode("shift_jis").ljust(80, b"\0") + bytes(80) + name.encode().ljust(18, b"\0")


_NONE = _alarm(0, 0, 128, "")
POSITIONS = (
    _position((10.0, 20.0, -30.0, 0.5, 90.0, -180.0)),
    _position((10.0, 20.0, -30.0, 0.5, 90.0, -180.0), 0),
    _position((1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0), -1),
    _position((math.nan, 0.0, 0.0, 0.0, 0.0, 0.0)),
    _position((3e38, 3e38, 3e38, 0.0, 0.0, 0.0)),
)
STATES = (
    b"WELD".ljust(16, b"\0")
    + struct.pack("<2h", 42, 2)
    + b"MAIN".ljust(16, b"\0")
    + b"V9.40P/23".ljust(80, b"\0")
    + struct.pack("<3i", 100, 0, 1)
    + _position(())[:52]
    + struct.pack("<f", 2.5),
    bytes(116) + struct.pack("<3i", -1, 2**31 - 1, 0) + bytes(52) + struct.pack("<f", math.inf),
)
ALARM_LISTS = (
    _NONE * 4,
    _alarm(11, 1, 54, "SRVO-001 Operator panel E-stop", "SERVO") + _NONE * 3,
    _alarm(19, 104, 0, "TPIF-104 \u30c6\u30a3\u30fc\u30c1", "WARN")
    + _alarm(12, 231, 43, "INTP-231")
    + _NONE * 2,
    b"".join(_alarm(24, number, 38, f"MOTN-{number:03d}", "STOP.L") for number in range(17, 21)),
)
BITS = (bytes(8), b"\x03\0\0\0\0\0\0\0", b"\xa7\xff\x01\0\0\0\0\0", b"\x20" * 8)
TOKENS = (
    *(b"\0", b"\0\0\0\0", b"\xff\xff\xff\xff", b"\0\0\x80\x7f", b"\0\0\xc0\x7f", b"\1\1", b"\xd4", b"\x94"),
    *(b"\xd1", b"\3\0", b"\1\0", b"\x68\0", b"\x10\x0e\0\0", "異常".encode("shift_jis"), b"\x1b[2J"),
)


if __name__ == "__main__":
    campaign(
        __doc__,
        fuzz,
        name="snpx",
        verdict="no exception, no joints and no alarm but what a strict reading gives; only questions and "
        "the driver's own assignments were sent",
    )
