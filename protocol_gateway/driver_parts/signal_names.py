"""Names of signals that all drivers share, and their units: a program reads every vendor's robots alike.

docs/signals.md explains them. A value for which no name fits gets one that begins with the protocol's name:
"PROTOCOL.tool_mode".
"""

import re
from collections.abc import Mapping, Sequence
from types import MappingProxyType

from protocol_gateway.seam.events import Signal, SignalsReceived

TEXT, BOOLEAN = "text", "boolean"

SHARED: Mapping[str, str] = MappingProxyType(
    {
        # Of a joint: the joint's name replaces the asterisk.
        "joint.*.current": "A",
        "joint.*.voltage": "V",
        "joint.*.torque": "N·m",
        "joint.*.target_torque": "N·m",
        "joint.*.load": "%",
        "joint.*.temperature": "°C",
        "joint.*.mode": TEXT,
        # A number in place of *, as the controller counts.
        "io.digital_in.*": BOOLEAN,
        "io.digital_out.*": BOOLEAN,
        "io.configurable_in.*": BOOLEAN,
        "io.configurable_out.*": BOOLEAN,
        "io.tool_in.*": BOOLEAN,
        "io.tool_out.*": BOOLEAN,
        "io.analog_in.*": "V or A",
        "io.analog_out.*": "V or A",
        "io.tool_analog_in.*": "V or A",
        "io.register.*": "",
        "counter.*": "",
        # The tool, its centre point in the active frame and in the flange's frame, and the force at it in
        # the base frame.
        "tool.number": "",
        "tool.name": TEXT,
        "tool.pose.x": "m",
        "tool.pose.y": "m",
        "tool.pose.z": "m",
        "tool.pose.rx": "rad",
        "tool.pose.ry": "rad",
        "tool.pose.rz": "rad",
        "tool.offset.x": "m",
        "tool.offset.y": "m",
        "tool.offset.z": "m",
        "tool.offset.rx": "rad",
        "tool.offset.ry": "rad",
        "tool.offset.rz": "rad",
        "tool.force.x": "N",
        "tool.force.y": "N",
        "tool.force.z": "N",
        "tool.torque.x": "N·m",
        "tool.torque.y": "N·m",
        "tool.torque.z": "N·m",
        "tool.voltage": "V",
        "tool.current": "A",
        "tool.temperature": "°C",
        # The payload: its centre of mass in the flange's frame.
        "payload.number": "",
        "payload.mass": "kg",
        "payload.x": "m",
        "payload.y": "m",
        "payload.z": "m",
        # The active user frame.
        "frame.number": "",
        "frame.name": TEXT,
        # The operator's override, and what the controller makes of it now.
        "speed.override": "%",
        "speed.scaling": "%",
        "program.name": TEXT,
        "program.line": "",
        "program.step": "",
        "program.state": TEXT,
        "program.cycle": TEXT,
        # Modes in the vendor's words.
        "robot.mode": TEXT,
        "robot.power": BOOLEAN,
        "robot.servo": BOOLEAN,
        "robot.voltage": "V",
        "robot.current": "A",
        "robot.power_on_time": "s",
        "robot.servo_on_time": "s",
        "safety.mode": TEXT,
        "safety.protective_stop": BOOLEAN,
        "safety.emergency_stop": BOOLEAN,
        "safety.safeguard_stop": BOOLEAN,
        "safety.enabling_device": BOOLEAN,
        "cabinet.temperature": "°C",
    }
)
"""Pattern of each name, with its unit or kind."""
_PATTERNS = [
    (re.compile(re.escape(name).replace(r"\*", "[a-z0-9_]+")), "" if kind in (TEXT, BOOLEAN) else kind)
    for name, kind in SHARED.items()
]


def unit_of(name: str) -> str:
    """Return the unit that a name promises; empty: none, or the name is not a shared one."""
    return next((unit for pattern, unit in _PATTERNS if pattern.fullmatch(name)), "")


def of_placement(name: str) -> tuple[Signal, ...]:
    """Return the signals of a position and a rotation vector: "tool.pose" becomes "tool.pose.x", ..."""
    return (*of_axes(name, "m"), *of_axes(name, "rad", "rx ry rz"))


def of_joints(quantity: str, unit: str, joints: int) -> tuple[Signal, ...]:
    """Return the signals of a quantity of each joint: "current" becomes "joint.waist.current", ..."""
    return tuple(Signal(f"joint.{quantity}", unit, joint) for joint in range(joints))


def numbered(name: str, numbers: range, unit: str = "") -> tuple[Signal, ...]:
    """Return the signals with these numbers: "io.digital_in" becomes "io.digital_in.0", ..."""
    return tuple(Signal(f"{name}.{number}", unit) for number in numbers)


def of_axes(name: str, unit: str, axes: str = "x y z") -> tuple[Signal, ...]:
    """Return the signals of a vector: "tool.force" becomes "tool.force.x", ..."""
    return tuple(Signal(f"{name}.{axis}", unit) for axis in axes.split())


def of_bits(signals: Sequence[Signal], value: int) -> SignalsReceived:
    """Return the values of signals in the bits of a number, the first in the lowest bit."""
    return SignalsReceived([(signal, bool(value >> bit & 1)) for bit, signal in enumerate(signals)])
