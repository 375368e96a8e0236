"""Moving HSES driver, stepped without a network."""

import struct

import pytest

from protocol_gateway.drivers.driver import Send, Stop
from protocol_gateway.drivers.yaskawa.motion_driver import HSES, STOP, HsesMotionDriver
from robots.joints import JointType
from tests.protocol_gateway.hses_site import HOLD, MOTION, command


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
        self.driver.started(self.now_s)

    def sent(self, effects):
        return [each for each in effects if isinstance(each, Send)]

    def connect(self, version=None):
        """Open both sockets; answer which software the controller has."""
        sent = self.sent(self.driver.opened(HSES, self.now_s))
        self.driver.opened(STOP, self.now_s)
        while version is not None and command(sent[-1].data) != 0x89:
            self.now_s += 0.31
            sent = self.sent(self.driver.timer_ended(self.now_s)) or sent
        if version is not None:
            self.driver.received(HSES, answer(sent[-1].data, software(version)), self.now_s)

    def holds(self, seconds=2.0):
        """Return the number of HOLD within some time."""
        end_s, found = self.now_s + seconds, 0
        while self.now_s < end_s:
            self.now_s += 0.05
            effects = self.sent(self.driver.timer_ended(self.now_s))
            found += sum(command(each.data) == HOLD for each in effects)
        return found


@pytest.mark.parametrize(("later", "again"), [("A", True), ("B", False), (None, False)])
def test_hold_is_repeated_to_the_controller_whose_stop_it_was_only(later, again):
    stepped = Stepped()
    stepped.connect("A")
    stop = stepped.sent(stepped.driver.command(stepped.driver.encode(Stop()), stepped.now_s))
    assert [(command(each.data), each.channel) for each in stop] == [(HOLD, STOP), (HOLD, HSES)]
    assert stepped.holds() >= 10
    for channel in (HSES, STOP):
        stepped.driver.closed(channel, stepped.now_s)
    stepped.connect(later)
    assert (stepped.holds() > 0) is again
