"""Moving HSES driver, stepped without a network."""

import struct

import pytest

from controllers.yaskawa.motion_driver import HSES, STOP, HsesMotionDriver
from controllers.yaskawa.motion_driver import MOTION as MOTIONS
from protocol_gateway.link.timers import Timers
from protocol_gateway.seam import (
    Activity,
    MoveAbsolute,
    Report,
    Reset,
    Send,
    SetTimer,
    StatusReceived,
    Stop,
)
from protocol_gateway.seam.errors import CommandError, NotReadyError
from robots.kinematics.joints import JointType
from tests.controllers.yaskawa.hses_site import HOLD, MOTION, MOVE, command


def answer(question, data):
    """Return the answer to a question."""
    head = struct.pack("<4sHHBBBBI8s", b"YERC", 32, len(data), 3, 1, 1, question[11], 1 << 31, b"99999999")
    return head + struct.pack("<BBBxHH", question[29] + 0x80, 0, 0, 0, 0) + data


def software(version):
    return version.encode().ljust(24, b"\0") + b"ES".ljust(16, b"\0") + b"1\0\0\0\0\0\0\0"


class Stepped:
    """A driver whose question for the software a test answers; the others have no answer."""

    def __init__(self):
        self.driver = HsesMotionDriver((JointType.ROTARY,) * 6, {}, options=MOTION)
        self.now_s = 100.0
        self.timers = Timers()
        self.sent(self.driver.started(self.now_s))

    def sent(self, effects):
        for each in effects:
            if isinstance(each, SetTimer):
                self.timers.set(each)
        return [each for each in effects if isinstance(each, Send)]

    def connect(self, version=None):
        """Open both sockets; answer which software the controller has."""
        sent = self.sent(self.driver.opened(HSES, self.now_s))
        self.sent(self.driver.opened(STOP, self.now_s))
        while version is not None and command(sent[-1].data) != 0x89:
            self.now_s += 0.31
            sent = self.sent(self.driver.timer_ended(self.timers.take(self.now_s), self.now_s)) or sent
        if version is not None:
            self.sent(self.driver.received(HSES, answer(sent[-1].data, software(version)), self.now_s))

    def holds(self, seconds=2.0):
        """Return the number of HOLD within some time."""
        end_s, found = self.now_s + seconds, 0
        while self.now_s < end_s:
            self.now_s += 0.05
            effects = self.sent(self.driver.timer_ended(self.timers.take(self.now_s), self.now_s))
            found += sum(command(each.data) == HOLD for each in effects)
        return found


@pytest.mark.parametrize(("later", "again"), [("A", True), ("B", False), (None, False)])
def test_hold_is_repeated_to_the_controller_whose_stop_it_was_only(later, again):
    stepped = Stepped()
    stepped.connect("A")
    stop = stepped.sent(stepped.driver.command(stepped.driver.prepare(Stop()), stepped.now_s))
    assert [(command(each.data), each.channel) for each in stop] == [(HOLD, STOP), (HOLD, HSES)]
    assert stepped.holds() >= 10
    for channel in (HSES, STOP):
        stepped.driver.closed(channel, stepped.now_s)
    stepped.connect(later)
    assert (stepped.holds() > 0) is again


class Answered(Stepped):
    """A driver whose questions a controller answers; the test changes what it answers."""

    def __init__(self, **given):
        super().__init__()
        self.first, self.second, self.pulses, self.tool = 0x84, 0x40, [0] * 8, 0
        self.names = b"".join(bytes((each, 0, 0, 0)) for each in b"SLURBT\0\0")
        for name, value in given.items():
            setattr(self, name, value)
        self.events, self.written = [], []
        for channel in (HSES, STOP, MOTIONS):
            self.do(self.driver.opened(channel, self.now_s))
        self.run(2.0)

    def do(self, effects):
        for effect in effects:
            if isinstance(effect, SetTimer):
                self.timers.set(effect)
            if isinstance(effect, Report):
                self.events += effect.events
            if isinstance(effect, Send) and effect.data[29] not in (1, 0x0E):
                self.written.append((effect.channel, command(effect.data)))
            elif isinstance(effect, Send):
                data = answer(effect.data, self.data(effect.data))
                self.do(self.driver.received(effect.channel, data, self.now_s))

    def data(self, question):
        """Return what answers a question; empty: nothing of use."""
        match command(question), question[26]:
            case 0x72, 1:
                return struct.pack("<2I", self.first, self.second)
            case 0x75, 1 if self.pulses is not None:
                return struct.pack("<5I8i", 0, 0, self.tool, 0, 0, *self.pulses)
            case 0x74, 1:
                return self.names
            case 0x74, 11:
                return bytes(32)
            case 0x89, 11:
                return software("A")
        return b""

    def run(self, seconds):
        """Let time pass."""
        end_s = self.now_s + seconds
        while self.timers and self.timers.next_s <= end_s:
            self.now_s = max(self.now_s, self.timers.next_s) + 1e-6
            self.do(self.driver.timer_ended(self.timers.take(self.now_s), self.now_s))
        self.now_s = end_s

    def command(self, *commands):
        self.do(self.driver.command(self.driver.prepare(*commands), self.now_s))

    def activities(self, seconds):
        self.events = []
        self.run(seconds)
        return {each.activity for each in self.events if isinstance(each, StatusReceived)}


NEAR = MoveAbsolute((0.1, 0.0, 0.0, 0.0, 0.0, 0.0))


def test_a_motion_that_is_refused_leaves_hold_as_it_was():
    stepped = Answered()
    stepped.command(Stop())
    stepped.second |= 8
    stepped.run(0.5)
    with pytest.raises(NotReadyError):
        stepped.command(Reset(), NEAR)
    # HOLD is lost, so it is sent again.
    stepped.second &= ~8
    stepped.written.clear()
    stepped.run(1.0)
    assert (STOP, HOLD) in stepped.written
    # Nothing is on HOLD now, and the driver wants none any longer: both can be done.
    stepped.command(Reset(), NEAR)
    assert stepped.written[-1] == (MOTIONS, MOVE)


def test_a_refused_motion_is_given_up_if_no_position_shows_whether_a_copy_of_it_moves_the_arm():
    stepped = Answered()
    effects = stepped.driver.command(stepped.driver.prepare(NEAR), stepped.now_s)
    stepped.do(effects)
    refused = bytearray(answer(effects[-1].data, b""))
    refused[25] = 0x1F
    stepped.pulses = None
    stepped.do(stepped.driver.received(MOTIONS, bytes(refused), stepped.now_s))
    stepped.run(0.8)
    assert stepped.written == [(MOTIONS, MOVE)]
    stepped.run(0.4)
    assert stepped.written[1:3] == [(STOP, HOLD), (HSES, HOLD)]


def test_a_stop_is_sent_alone():
    with pytest.raises(CommandError, match="alone"):
        Answered().driver.prepare(Stop(), NEAR)


@pytest.mark.parametrize("lost", [None, 0.06, 0.11, 0.16, 0.21])
def test_rest_after_a_stop_is_shown_only_by_positions_since_then(lost):
    stepped = Answered()
    assert stepped.activities(1.0) == {Activity.IDLE}
    stepped.command(NEAR)
    stepped.command(Stop())
    stepped.second |= 8
    if lost is not None:
        # One position, and none for half a second: the arm may move.
        stepped.pulses = [5000] + [0] * 7
        stepped.run(lost)
        stepped.pulses = None
        assert stepped.activities(2.0) == {Activity.MOVING}
        stepped.pulses = [9000] + [0] * 7
    assert stepped.activities(0.45) == {Activity.MOVING}
    stepped.run(0.5)
    assert stepped.activities(0.5) == {Activity.HOLDING}


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"names": b"".join(bytes((each, 0, 0, 0)) for each in b"SLURBT\x01\0")}, r"axis \?"),
        ({"tool": 2**31}, "tool 2147483648"),
    ],
)
def test_a_motion_is_refused_if_it_could_move_more_than_is_known(given, text):
    stepped = Answered(**given)
    with pytest.raises(NotReadyError, match=text):
        stepped.command(NEAR)
    assert not stepped.written
