"""Commands of HSES that write: HOLD, and a motion to pulses. Only the driver that moves the arm imports them.

Packets are those of `hses`, with data. An answer repeats the number and the service, not the command.
"""

from collections.abc import Sequence
from enum import IntEnum
from struct import Struct

from controllers.yaskawa.axes import MOST_AXES
from controllers.yaskawa.hses import (
    HEADER,
    HEADER_BYTES,
    IDENTIFIER,
    QUESTION,
    RESERVED,
    ROBOT_CONTROL,
)

WRITE_SINGLE = 0x10
"""Service that writes one value (Set_Attribute_Single)."""
WRITE_ALL = 0x02
"""Service that writes all values (Set_Attribute_All)."""
POWER = 0x83
"""Command for HOLD, servo and HLOCK."""
MOVE_PULSES = 0x8B
ON, OFF = 1, 2
JOINT_ABSOLUTE = 1
"""Instance of `MOVE_PULSES`: all axes arrive at the same time, at absolute pulses."""
PERCENT = 0
"""Class of a speed: 0.01 % of the joints' highest speeds."""
LONGEST_NUMBER = 2**31 - 1

BASE_AXES, STATION_AXES = 3, 6
MOTION = Struct(f"<4i{MOST_AXES}ii{BASE_AXES}i{STATION_AXES}i")
"""Robot, station, class of the speed, speed, pulses, tool, pulses of base and station. FS100 calls the eighth
axis reserved."""
_VALUE = Struct("<I")


class Switch(IntEnum):
    """Instance of `POWER`."""

    HOLD = 1
    SERVO = 2
    HLOCK = 3


def hold(number: int, *, on: bool) -> bytes:
    """Return the datagram that sets or ends the HOLD by command, with a number, 0 to 255."""
    return _datagram(number, POWER, Switch.HOLD, WRITE_SINGLE, _VALUE.pack(ON if on else OFF))


def motion(number: int, *, robot: int, percent: float, pulses: Sequence[int], tool: int) -> bytes:
    """Return the datagram of a motion to absolute pulses, with a number, 0 to 255.

    Args:
        robot: Number of the robot, from 1.
        percent: Speed, 0.01 to 100 percent of the joints' highest speeds.
        pulses: Eight, of all axes of the robot.
        tool: Number of the tool that is active.
    """
    speed = max(1, round(percent * 100))
    rest = [0] * (BASE_AXES + STATION_AXES)
    data = MOTION.pack(robot, 0, PERCENT, speed, *pulses, tool, *rest)
    return _datagram(number, MOVE_PULSES, JOINT_ABSOLUTE, WRITE_ALL, data)


def _datagram(number: int, command: int, instance: int, service: int, data: bytes) -> bytes:
    head = HEADER.pack(IDENTIFIER, HEADER_BYTES, len(data), 3, ROBOT_CONTROL, 0, number, 0, RESERVED)
    return head + QUESTION.pack(command, instance, 1, service, 0) + data
