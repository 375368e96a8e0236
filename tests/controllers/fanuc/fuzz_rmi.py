"""Broken answers of FANUC's controllers by RMI.

    python -m tests.controllers.fanuc.fuzz_rmi [--inputs N] [--seconds S] [--seed N] [--keep FOLDER]

Answers to the driver's own messages, changed at random, doubled, late and cut. They may cause no exception
and no leak. A motion may be sent once, and only after an answer that a strict reading, which is independent
of the gateway's, takes for the end of the initialization; it ends only with its own answer, or is given up
for a reason that the reading finds. The driver may send five messages, and nothing else. Anything else ends
the run with exit status 1 and its input in the folder.
"""

import random
import re
from collections import Counter
from typing import Any, ClassVar

from controllers.fanuc.axes import FanucSettings
from controllers.fanuc.rmi.motion_driver import RMI, SESSION, FanucMotionDriver
from protocol_gateway.link.timers import Timers
from protocol_gateway.seam import (
    Activity,
    Effects,
    FateUnknown,
    JointsReceived,
    Mode,
    MoveAbsolute,
    Open,
    Report,
    Send,
    SetTimer,
    StatusReceived,
)
from protocol_gateway.seam.errors import NotReadyError
from robots.kinematics.joints import JointType
from tests.fuzz.fuzzing import Finding, answers, campaign, changed

NEW_BENCH_EACH = 400
SETTINGS = FanucSettings(assignments="own", j23=1, motion=True)
HERE = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
INITIALIZE = b'{"Command": "FRC_Initialize", "GroupMask": 1}\r\n'
ABORT = b'{"Command": "FRC_Abort"}\r\n'
MOTION = re.compile(
    rb'\{"Instruction": "FRC_JointMotionJRep", "SequenceID": 1, "JointAngle": \{'
    rb'("J[1-9]": -?[\d.e-]+(, )?){9}\}, "SpeedType": "Percent", "Speed": 5, '
    rb'"TermType": "FINE", "TermValue": 0\}\r\n'
)
ALLOWED = {
    b'{"Communication": "FRC_Connect"}\r\n',
    b'{"Communication": "FRC_Disconnect"}\r\n',
    INITIALIZE,
    ABORT,
}
NUMBERS = (0, 1, 2, 7015, 2556937, 2556942, 2556952, 2556955, 2556957, 2**31, -1)
TOKENS = (
    *(
        b"0",
        b"1",
        b"-0",
        b"0.0",
        b"1e0",
        b"true",
        b"null",
        b'"',
        b"{",
        b"}",
        b"[",
        b",",
        b":",
        b"\\",
        b"\r\n",
    ),
    *(b'"ErrorID"', b'"SequenceID"', b'"SequenceID" : 1', b'"ErrorID" : 0,', b"FRC_Initialize", b"FRC_Abort"),
    *(
        b"FRC_JointMotionJRep",
        b"Instruction",
        b"Command",
        b"Communication",
        b"NaN",
        b"Infinity",
        b"\x00",
        b"\xff",
    ),
    *(b" ", b"2147483648", b"16002", b"70000", b"\\u0046", b"[" * 2000),
)


def fuzz(inputs: int, seed: int, counts: Counter[str]) -> tuple[int, Finding | None]:
    """Return how many messages were read, and the first that was handled wrongly."""
    return answers(inputs, seed, lambda: Bench(counts), renew_each=NEW_BENCH_EACH)


class Bench:
    """Driver with a clock and a strict model of its state.

    Its state is one of: connecting, idle, initializing, moving, aborting.
    """

    def __init__(self, counts: Counter[str]) -> None:
        self.driver = FanucMotionDriver((JointType.ROTARY,) * 6, {}, options=SETTINGS)
        self.now_s = 0.0
        self.state = "connecting"
        self.problem = ""
        self._given_up = False
        self._counts = counts
        self._rest = b""
        self._old: list[bytes] = []
        self._timers = Timers()
        self._timed(self.driver.started(0.0))
        self._timed(self.driver.controlled(True, 0.0))
        self._timed(self.driver.opened(RMI, 0.0))

    def _timed(self, effects: Effects) -> Effects:
        """Set the timers that effects name; return the effects."""
        for each in effects:
            if isinstance(each, SetTimer):
                self._timers.set(each)
        return effects

    def _move(self) -> None:
        """Command a motion with a fresh state."""
        self.now_s += 0.01
        self.driver._noted(JointsReceived(HERE), self.now_s, self.now_s)
        self.driver._noted(StatusReceived(Activity.IDLE, Mode.REMOTE), self.now_s, self.now_s)
        target = tuple(each + 0.1 for each in HERE)
        try:
            effects = self._timed(self.driver.command(self.driver.prepare(MoveAbsolute(target)), self.now_s))
        except NotReadyError:
            # The arm has not rested for long enough since a stop.
            self.now_s += 1.0
            return
        assert [each.data for each in effects if isinstance(each, Send)] == [INITIALIZE]
        self.state = "initializing"

    def next_bytes(self, chance: random.Random) -> bytes:
        """Return a message of the controller, most often one that the driver awaits."""
        if self.state == "idle":
            self._move()
        if chance.random() < 0.05 and self._old:
            return chance.choice(self._old)
        error = 0 if chance.random() < 0.7 else chance.choice(NUMBERS)
        connect = (
            f'"Communication" : "FRC_Connect", "ErrorID" : {error}, "PortNumber" : 16002, "MajorVersion" : 7'
        )
        right = {
            "connecting": f'{{{connect}, "MinorVersion" : 0}} \r\n',
            "initializing": f'{{"Command": "FRC_Initialize", "ErrorID": {error}, "GroupMask": 1}}\r\n',
            "moving": f'{{"Instruction": "FRC_JointMotionJRep", "ErrorID": {error}, "SequenceID": 1}}\r\n',
            "aborting": f'{{"Command": "FRC_Abort", "ErrorID": {error}}}\r\n',
            "fault": '{"Communication":"FRC_SystemFault","SequenceID":1}\r\n',
            "idle": '{"Command": "Unknown", "ErrorID": 2556950}\r\n',
        }
        messages = [each.encode() for each in right.values()]
        due = right[self.state].encode() if chance.random() < 0.9 else chance.choice(messages)
        return due if chance.random() < 0.5 else changed(due, messages, TOKENS, chance)

    def receive(self, data: bytes) -> str:
        """Return the problem with bytes; empty: none."""
        self.now_s += 0.001
        if len(data) < 4096:
            self._old = [*self._old[-4:], data]
        channel = RMI if self.state == "connecting" else SESSION
        *lines, self._rest = (self._rest + data).split(b"\r\n")
        long = any(len(each) > 4096 for each in (*lines, self._rest))
        found = [self._strict(each) for each in lines]
        effects = self._timed(self.driver.received(channel, data, self.now_s))
        return self._compare(effects, [each for each in found if each is not None], long)

    def _compare(self, effects: Effects, found: list[dict[str, Any]], long: bool) -> str:
        sent = [each.data for each in effects if isinstance(each, Send)]
        fate = any(isinstance(each, FateUnknown) for each in effects)
        opened = [each for each in effects if isinstance(each, Open)]
        for each in effects:
            if isinstance(each, Report):
                self._counts.update(type(event).__name__ for event in each.events)
        if wrong := [each for each in sent if each not in ALLOWED and not MOTION.fullmatch(each)]:
            return f"sends {wrong[0]!r}"
        expected_sent, expected_fate, late = [], False, False
        for message in found:
            names, state = {*message.values()} - {0}, self.state
            error = message.get("ErrorID", 0)
            if state == "initializing" and "FRC_Initialize" in names:
                expected_sent.append("abort" if error else "motion")
                self.state, expected_fate = ("aborting", True) if error else ("moving", expected_fate)
            elif state == "moving" and "FRC_JointMotionJRep" in names and message["SequenceID"] == 1:
                expected_sent.append("abort")
                self.state, expected_fate = "aborting", expected_fate or error != 0
            elif state in ("initializing", "moving") and "FRC_SystemFault" in names:
                expected_sent.append("abort")
                self.state, expected_fate = "aborting", True
                self._given_up = state == "initializing"
            elif "FRC_Initialize" in names and self._given_up:
                # An initialization that was given up is answered at last: its program is ended.
                self._given_up, late = False, True
            elif state == "aborting" and "FRC_Abort" in names:
                self._counts["aborts"] += 1
                if error in (0, 2556937, 2556942, 2556943):
                    self.state = "idle"
            elif state == "connecting" and "FRC_Connect" in names and not error:
                self.state = "joined"
        self._counts.update(expected_sent)
        # After a line that is too long, the driver has left the connection.
        fate_allowed = expected_fate or (long and self.state != "connecting")
        kinds = [
            "abort" if each == ABORT else "motion" if MOTION.fullmatch(each) else "other" for each in sent
        ]
        if kinds.count("motion") != expected_sent.count("motion"):
            return f"sends {kinds}, but a strict reading gives {expected_sent}"
        if (fate and not fate_allowed) or (expected_fate and not fate):
            return f"fate unknown: {fate}, but a strict reading gives {expected_fate}"
        if "abort" in kinds and "abort" not in expected_sent and not long and not late:
            return f"sends {kinds}, but a strict reading gives {expected_sent}"
        if (self.state == "joined") != any(each.channel is SESSION for each in opened):
            return f"opens {opened}, which is not what a strict reading gives"
        return self._go_on(long)

    def _go_on(self, long: bool) -> str:
        if self.state == "joined":
            self._rest, self.state = b"", "idle"
            self._timed(self.driver.opened(SESSION, self.now_s))
        elif long or self.driver._line.name in ("CLOSED", "LOST"):
            # It was left, or FRC_Connect was refused: another connection.
            self.__init__(self._counts)  # type: ignore[misc]
        elif self.state == "aborting" and "again" in self._timers:
            self.now_s = self._timers["again"]
            effects = self._timed(self.driver.timer_ended(self._timers.take(self.now_s), self.now_s))
            sent = [each for each in effects if isinstance(each, Send)]
            if "initialize" not in self._timers and self.driver._line.name == "CLOSED":
                # An initialization that was given up was not answered in time.
                self.__init__(self._counts)  # type: ignore[misc]
            elif [each.data for each in sent] != [ABORT]:
                return f"repeats {sent}"
        elif self.state == "idle" and self.driver._initialize_open:
            # An initialization that was given up is answered at last.
            answer = b'{"Command": "FRC_Initialize", "ErrorID": 0}\r\n'
            self._timed(self.driver.received(SESSION, answer, self.now_s))
            self.state, self._given_up = "aborting", self.driver._initialize_open
        return ""

    # ------------------------------------------------------ a strict reading, written apart

    def _strict(self, line: bytes) -> dict[str, Any] | None:
        """Parse the used keys of a message; None: invalid."""
        line = line.strip(b" ")
        if len(line) > 4096:
            return None
        try:
            found = Reader(line.decode("ascii")).message()
        except (ValueError, RecursionError, IndexError):
            return None
        kind = " ".join(each for each in ("Communication", "Command", "Instruction") if each in found)
        kinds = {
            "FRC_Connect": "Communication",
            "FRC_SystemFault": "Communication",
            "FRC_Initialize": "Command",
            "FRC_Abort": "Command",
            "FRC_JointMotionJRep": "Instruction",
        }
        name = found.get(kind)
        if not isinstance(name, str) or kinds.get(name) != kind:
            return None
        used: dict[str, Any] = {kind: name}
        if name != "FRC_SystemFault":
            used["ErrorID"] = _whole(found, "ErrorID", 0, 2**31 - 1)
        elif "SequenceID" in found:
            used["SequenceID"] = _whole(found, "SequenceID", 0, 2**31 - 1)
        if name == "FRC_JointMotionJRep":
            used["SequenceID"] = _whole(found, "SequenceID", 1, 2**31 - 1)
        if name == "FRC_Connect" and used["ErrorID"] == 0:
            used["port"] = _whole(found, "PortNumber", 1, 65535)
            used["version"] = _whole(found, "MajorVersion", 1, 32767)
        return None if None in used.values() else used


def _whole(found: dict[str, Any], key: str, least: int, most: int) -> int | None:
    value = found.get(key)
    return value if type(value) is int and least <= value <= most else None


class Reader:
    """A reader of JSON, one character after the other."""

    STRING = re.compile(r'"((?:[^"\\\x00-\x1f]|\\(?:["\\/bfnrt]|u[0-9a-fA-F]{4}))*)"')
    NUMBER = re.compile(r"-?(?:0|[1-9][0-9]*)(\.[0-9]+)?([eE][+-]?[0-9]+)?")
    SHORT: ClassVar = {"b": "\b", "f": "\f", "n": "\n", "r": "\r", "t": "\t"}

    def __init__(self, text: str) -> None:
        self._text, self._at = text, 0

    def message(self) -> dict[str, Any]:
        """Parse the text as an object; raise ValueError if it is invalid."""
        found = self._value()
        self._space()
        if self._at != len(self._text) or not isinstance(found, dict):
            raise ValueError
        return found

    def _space(self) -> None:
        while self._at < len(self._text) and self._text[self._at] in " \t\r\n":
            self._at += 1

    def _next(self, wanted: str) -> bool:
        self._space()
        found = self._text[self._at : self._at + len(wanted)] == wanted
        self._at += len(wanted) if found else 0
        return found

    def _string(self) -> str:
        self._space()
        match = self.STRING.match(self._text, self._at)
        if match is None:
            raise ValueError
        self._at = match.end()
        return re.sub(r"\\(u....|.)", self._escaped, match[1])

    def _escaped(self, match: re.Match[str]) -> str:
        if match[1][0] == "u":
            return chr(int(match[1][1:], 16))
        return self.SHORT.get(match[1], match[1])

    def _value(self) -> Any:
        if self._next("{"):
            return self._object()
        if self._next("["):
            items: list[Any] = []
            while not self._next("]"):
                if items and not self._next(","):
                    raise ValueError
                items.append(self._value())
            return items
        for word, value in (("true", True), ("false", False), ("null", None)):
            if self._next(word):
                return value
        self._space()
        if self._text[self._at] == '"':
            return self._string()
        match = self.NUMBER.match(self._text, self._at)
        if match is None:
            raise ValueError
        self._at = match.end()
        return float(match[0]) if match[1] or match[2] else int(match[0])

    def _object(self) -> dict[str, Any]:
        found: dict[str, Any] = {}
        while not self._next("}"):
            if found and not self._next(","):
                raise ValueError
            key = self._string()
            if key in found or not self._next(":"):
                raise ValueError
            found[key] = self._value()
        return found


if __name__ == "__main__":
    campaign(
        __doc__,
        fuzz,
        name="rmi",
        verdict="no exception, no motion and no end of a motion but what a strict reading gives; nothing but "
        "the driver's five messages was sent",
    )
