"""Broken answers of Yaskawa's controllers by HSES.

    python -m tests.controllers.yaskawa.fuzz_hses [--inputs N] [--seconds S] [--seed N] [--keep FOLDER]

Answers to the driver's own questions, changed at random, doubled, late and in the wrong order. They may cause
no exception and no leak. Joints, alarms and activities must be those of a strict reading that is independent
of the gateway's, and the driver may send nothing but reads, one at a time. Anything else ends the run with
exit status 1 and its input in the folder.
"""

import random
import struct
from collections import Counter, deque

from controllers.yaskawa.axes import YaskawaSettings
from controllers.yaskawa.driver import HSES, HsesDriver
from protocol_gateway.seam import (
    AlarmReceived,
    ControllerEvent,
    Effects,
    JointsReceived,
    Report,
    Send,
    SetTimer,
    Severity,
    SignalsReceived,
    StatusReceived,
)
from robots.kinematics.joints import JointType
from tests.fuzz.fuzzing import Finding, answers, campaign, changed

READS = {0x70: 1, 0x72: 1, 0x73: 1, 0x74: 1, 0x75: 1, 0x77: 1, 0x78: 0x0E, 0x89: 1}
BUSY = (0xD8F1, 0xD8FA, 0xE444, 0xFFF6)
TIMEOUT_S = 0.3
NEW_SOCKET_EACH = 2000


def fuzz(inputs: int, seed: int, counts: Counter[str]) -> tuple[int, Finding | None]:
    """Return how many datagrams were read, and the first that was handled wrongly."""
    bench = Bench(counts)

    def renewed() -> Bench:
        bench.open()
        return bench

    return answers(inputs, seed, renewed, renew_each=NEW_SOCKET_EACH, cuts=False)


class Bench:
    """A driver, its clock and its open question.

    Attributes:
        problem: What it sent wrongly; empty: nothing.
    """

    def __init__(self, counts: Counter[str]) -> None:
        settings = YaskawaSettings(pulses_per_degree=(1000.0,) * 6)
        self.driver = HsesDriver((JointType.ROTARY,) * 6, {}, options=settings)
        self.now_s = 0.0
        self.problem = ""
        self._counts = counts
        self._question = b""
        self._asked_s = 0.0
        self._timer_s = 0.0
        self._old: deque[bytes] = deque(maxlen=5)
        self._alarms_seen: set[bytes] = set()

    def open(self) -> None:
        """Begin with a new socket, which does not get the answers of the one before."""
        self._question = b""
        self._old.clear()
        self.perform(self.driver.opened(HSES, self.now_s))

    def perform(self, effects: Effects) -> list[ControllerEvent]:
        """Note what the driver sends; return what it reports."""
        events: list[ControllerEvent] = []
        for effect in effects:
            match effect:
                case Send(_, data):
                    command, _, _, service = struct.unpack_from("<HHBB", data, 24)
                    if len(data) != 32 or READS.get(command) != service or data[6:8] != b"\0\0":
                        self.problem = f"sends {data!r}"
                    if self._question and self.now_s < self._asked_s + TIMEOUT_S:
                        self.problem = "asks before the answer"
                    self._question, self._asked_s = data, self.now_s
                case SetTimer(at_s):
                    self._timer_s = self.now_s if at_s is None else at_s
                case Report(reported):
                    events += reported
                case _:
                    pass
        return events

    def next_bytes(self, chance: random.Random) -> bytes:
        """Return an answer to the open question, or another datagram; a question is open then."""
        while not self._question:
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
        number, command = self._question[11], self._question[24]
        right = [answer_datagram(number, READS[command], data) for data in DATA[command]]
        if command == 0x74:
            return answer_datagram(number, 1, b"", status=0x28)
        if kind < 0.1:
            return answer_datagram(
                number, READS[command], b"", status=0x1F, added=chance.choice((*BUSY, 0xB008))
            )
        return changed(chance.choice(right), right, TOKENS, chance)

    def receive(self, data: bytes) -> str:
        """Return the problem with a datagram; empty: none."""
        self.now_s += 0.002
        self._old.append(data)
        question = self._question
        answer = strict_answer(data, question)
        if answer is not None:
            self._question = b""
        events = self.perform(self.driver.received(HSES, data, self.now_s))
        self._counts.update(type(event).__name__ for event in events)
        return self._compare(events, question, answer)

    def _compare(self, events: list[ControllerEvent], question: bytes, answer: bytes | None) -> str:
        command, of_tool = question[24], question[24] == 0x75 and question[26] > 100
        joints = [each.positions for each in events if isinstance(each, JointsReceived)]
        right = strict_joints(answer) if command == 0x75 and not of_tool and answer else None
        place = strict_place(answer) if of_tool and answer else None
        places = [
            [value for signal, value in each.values if signal.name in ("tool.pose.x", "tool.pose.z")]
            for each in events
            if isinstance(each, SignalsReceived) and any(s.name == "tool.pose.x" for s, _ in each.values)
        ]
        if places != ([] if place is None else [place]):
            return f"poses {places}, a strict reading gives {place}"
        if len(joints) != (right is not None):
            return f"joints {joints}, a strict reading gives {right}"
        if right is not None and any(abs(a - b) > 1e-9 for a, b in zip(joints[0], right, strict=True)):
            return f"joints {joints}, a strict reading gives {right}"
        states = [each for each in events if isinstance(each, StatusReceived)]
        if len(states) != (command == 0x72 and answer is not None and len(answer) == 8):
            return f"states {states} from {answer!r}"
        codes = [
            int(each.number)
            for each in events
            if isinstance(each, AlarmReceived) and each.severity is Severity.ERROR
        ]
        alarm = answer is not None and command == 0x70 and len(answer) in (60, 268)
        code = int.from_bytes(answer[:4], "little") if answer is not None and alarm else 0
        # An alarm that is known is not repeated.
        return "" if codes in ([], [code]) and (not codes or code) else f"alarms {codes} from {answer!r}"


# -------------------------------------------------------------- a strict reading, written apart


def strict_answer(data: bytes, question: bytes) -> bytes | None:
    """Return the data that answer a question; None: the datagram is not its answer.

    An answer that reports an error has no data.
    """
    if len(data) < 32 or data[:6] != b"YERC\x20\x00" or data[9:11] != b"\x01\x01" or not data[15] & 0x80:
        return None
    size = data[6] + 256 * data[7]
    if size > 479 or size != len(data) - 32 or data[11] != question[11]:
        return None
    if data[24] - 0x80 != question[29] or data[26] > 2:
        return None
    added = int.from_bytes(data[28 : 28 + 2 * data[26]], "little")
    return b"" if data[25] or added in BUSY else data[32:]


def strict_joints(data: bytes) -> list[float] | None:
    """Return the joints of a position [rad]; None: it has none."""
    if len(data) not in (44, 48, 52) or data[:4] != b"\0\0\0\0":
        return None
    pulses = [int.from_bytes(data[at : at + 4], "little", signed=True) for at in range(20, 44, 4)]
    return [value / 1000 * 0.017453292519943295 for value in pulses]


def strict_place(data: bytes) -> list[float] | None:
    """Return x and z of a tool's pose in the base's or the robot's frame [m]; None: it has none."""
    if len(data) not in (44, 48, 52) or data[:4] not in (b"\x10\0\0\0", b"\x11\0\0\0"):
        return None
    return [int.from_bytes(data[at : at + 4], "little", signed=True) * 1e-6 for at in (20, 28)]


# -------------------------------------------------------------------------------- inputs


def answer_datagram(number: int, service: int, data: bytes, *, status: int = 0, added: int = 0) -> bytes:
    head = struct.pack("<4sHHBBBBI8s", b"YERC", 32, len(data), 3, 1, 1, number, 1 << 31, b"99999999")
    return head + struct.pack("<BBBxHH", service + 0x80, status, bool(added), added, 0) + data


_ALARM = struct.pack("<3I", 4107, 1, 1) + b"2026/11/26 09:30" + b"OUT OF RANGE".ljust(32, b"\0")
DATA = {
    0x70: (_ALARM, _ALARM + bytes(208), bytes(60)),
    0x72: (b"\xc4\0\0\0\x40\0\0\0", b"\xcc\0\0\0\x50\0\0\0", b"\x20\0\0\0\x02\0\0\0"),
    0x73: (b"WELD".ljust(32, b"\0") + struct.pack("<3I", 12, 3, 5000),),
    0x74: (b"S\0\0\0L\0\0\0U\0\0\0R\0\0\0B\0\0\0T\0\0\0\0\0\0\0\0\0\0\0",),
    0x75: (
        struct.pack("<5I8i", 0, 0, 1, 0, 0, 90_000, -45_000, 1, -1, 0, 2**31 - 1, 0, 0),
        struct.pack("<5I7i", 0, 0, 1, 0, 0, 1, 2, 3, 4, 5, 6, 7),
        struct.pack("<5I6i", 0, 0, 1, 0, 0, 1, 2, 3, 4, 5, 6),
        struct.pack("<5I8i", 16, 0, 1, 0, 0, 500_000, 0, 700_000, 0, 0, 0, 0, 0),
        struct.pack("<5I6i", 17, 0, 2, 0, 0, -500_000, 1, 2**31 - 1, 1_800_000, -900_000, 2**31 - 1),
    ),
    0x77: (struct.pack("<8i", 1, -2, 3, 0, 0, 0, 0, 0), bytes(28)),
    0x78: (b"\x05",),
    0x89: (b"DS2.07".ljust(24, b"\0") + b"ES0165D".ljust(16, b"\0") + b"12.34\0\0\0",),
}
TOKENS = (
    *(b"\0", b"\0\0\0\0", b"\xff\xff\xff\xff", b"\xff\xff\xff\x7f", b"\0\0\0\x80", b"\x10\0\0\0"),
    *(b"YERC", b"\x20\0", b"\x34\0", b"\x30\0", b"99999999", b"\x81\0", b"\x8e\0", b"\x1f\x01\0\xf1\xd8"),
    *("異常".encode("shift_jis"), "größer".encode(), b"\x1b[2J", b"\x85\xe2\x80\xa8"),
)


if __name__ == "__main__":
    campaign(
        __doc__,
        fuzz,
        name="yaskawa",
        verdict="no exception, no joints and no alarm but what a strict reading gives; only reads were sent",
    )
