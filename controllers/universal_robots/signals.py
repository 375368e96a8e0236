"""Signals of a controller of Universal Robots, from the state that RTDE reports."""

from collections.abc import Iterable, Sequence
from enum import IntEnum

from controllers.universal_robots.interfaces.modes import (
    JointMode,
    RobotMode,
    RobotStatus,
    RuntimeState,
    SafetyMode,
    SafetyStatus,
    name_of,
)
from controllers.universal_robots.interfaces.state import ControllerState
from protocol_gateway.driver_parts.signal_names import numbered, of_axes, of_joints, of_placement
from protocol_gateway.seam import Signal, SignalsReceived, SignalValue

JOINTS = 6
EACH_S = 0.1
"""Time between reports if only numbers have changed [s]."""

_CURRENTS = of_joints("current", "A", JOINTS)
_TARGET_TORQUES = of_joints("target_torque", "N·m", JOINTS)
_TEMPERATURES = of_joints("temperature", "°C", JOINTS)
_MODES = of_joints("mode", "", JOINTS)
# Bits 0 to 7 standard, 8 to 15 configurable, 16 and 17 tool.
_DIGITAL_INPUTS, _DIGITAL_OUTPUTS = (
    (
        *numbered(f"io.digital_{way}", range(8)),
        *numbered(f"io.configurable_{way}", range(8)),
        *numbered(f"io.tool_{way}", range(2)),
    )
    for way in ("in", "out")
)
# By the installation a current or a voltage.
_ANALOG_UNITS = ("A", "V")
_ANALOG = {
    unit: (
        *numbered("io.analog_in", range(2), unit),
        *numbered("io.analog_out", range(2), unit),
        *numbered("io.tool_analog_in", range(2), unit),
    )
    for unit in _ANALOG_UNITS
}
_FORCES = (*of_axes("tool.force", "N"), *of_axes("tool.torque", "N·m"))
_OFFSETS = of_placement("tool.offset")
_POSES = of_placement("tool.pose")
_CENTRE = of_axes("payload", "m")
_TOOL_VOLTAGE = Signal("tool.voltage", "V")
_TOOL_CURRENT = Signal("tool.current", "A")
_TOOL_TEMPERATURE = Signal("tool.temperature", "°C")
_PAYLOAD = Signal("payload.mass", "kg")
_OVERRIDE = Signal("speed.override", "%")
_SCALING = Signal("speed.scaling", "%")
_PROGRAM_LINE = Signal("program.line")
_PROGRAM_STATE = Signal("program.state")
_ROBOT_MODE = Signal("robot.mode")
_SAFETY_MODE = Signal("safety.mode")
_POWER = Signal("robot.power")
_ROBOT_VOLTAGE = Signal("robot.voltage", "V")
_ROBOT_CURRENT = Signal("robot.current", "A")
_STOPS = (
    (Signal("safety.protective_stop"), SafetyStatus.PROTECTIVE_STOPPED),
    (Signal("safety.emergency_stop"), SafetyStatus.EMERGENCY_STOPPED),
    (Signal("safety.safeguard_stop"), SafetyStatus.SAFEGUARD_STOPPED),
    (Signal("safety.enabling_device"), SafetyStatus.THREE_POSITION_INPUT_ACTIVE),
)

Values = list[tuple[Signal, SignalValue | None]]


class SignalReports:
    """Choice of the states of one connection that are reported: each with a changed mode, input or output.

    Of the others one in each `EACH_S` is reported.
    """

    def __init__(self) -> None:
        self._states: tuple[object, ...] | None = None
        self._at_s = float("-inf")

    def of(self, state: ControllerState) -> SignalsReceived | None:
        """Return the report of a state; None: nothing to report yet."""
        states = (
            state.digital_inputs,
            state.digital_outputs,
            state.robot_mode,
            state.safety_mode,
            state.runtime_state,
            state.robot_status,
            state.safety_status,
            state.joint_modes,
            state.payload_kg,
            state.tool_offset,
        )
        # The clock of a controller that restarts goes back.
        if states == self._states and 0.0 <= state.timestamp_s - self._at_s < EACH_S:
            return None
        self._states, self._at_s = states, state.timestamp_s
        return SignalsReceived(signals_of(state), state.timestamp_s)


def signals_of(state: ControllerState) -> Values:
    """Return the signals of a state; a value that the controller does not have is left out."""
    found: Values = []
    for signals, values in (
        (_CURRENTS, state.currents_a),
        (_TARGET_TORQUES, state.target_torques),
        (_TEMPERATURES, state.temperatures_c),
        (_FORCES, state.tool_force),
        (_OFFSETS, state.tool_offset),
        (_POSES, state.tool_pose),
        (_CENTRE, state.payload_centre_m),
    ):
        if values is not None:
            found += zip(signals, values, strict=True)
    if state.joint_modes is not None:
        found += zip(_MODES, (_word(JointMode, mode) for mode in state.joint_modes), strict=True)
    found += _digital(_DIGITAL_INPUTS, state.digital_inputs)
    found += _digital(_DIGITAL_OUTPUTS, state.digital_outputs)
    found += _analog((*state.analog_inputs, *state.analog_outputs), state.analog_types, 0)
    found += _analog(state.tool_analog_inputs, state.tool_analog_types, 4)
    for signal, value in (
        (_TOOL_VOLTAGE, state.tool_voltage_v),
        (_TOOL_CURRENT, state.tool_current_a),
        (_TOOL_TEMPERATURE, state.tool_temperature_c),
        (_PAYLOAD, state.payload_kg),
        (_OVERRIDE, _percent(state.target_speed_fraction)),
        (_SCALING, _percent(state.speed_scaling)),
        (_ROBOT_VOLTAGE, state.robot_voltage_v),
        (_ROBOT_CURRENT, state.robot_current_a),
    ):
        if value is not None:
            found.append((signal, float(value)))
    if state.script_line is not None:
        # 0: no line of a script has the robot.
        found.append((_PROGRAM_LINE, state.script_line or None))
    for signal, kind, mode in (
        (_PROGRAM_STATE, RuntimeState, state.runtime_state),
        (_ROBOT_MODE, RobotMode, state.robot_mode),
        (_SAFETY_MODE, SafetyMode, state.safety_mode),
    ):
        if mode is not None:
            found.append((signal, _word(kind, mode)))
    if state.robot_status is not None:
        found.append((_POWER, RobotStatus.POWER_ON in state.robot_status))
    if state.safety_status is not None:
        found += [(signal, bit in state.safety_status) for signal, bit in _STOPS]
    return found


def _digital(signals: Sequence[Signal], bits: int | None) -> Iterable[tuple[Signal, bool]]:
    if bits is None:
        return ()
    return ((signal, bool(bits >> place & 1)) for place, signal in enumerate(signals))


def _analog(values: Sequence[float | None], types: int | None, first: int) -> Values:
    """Return analog values; without their types the units are unknown, so they are left out.

    Args:
        first: Place of the first one in `_ANALOG`; its type is bit 0.
    """
    if types is None:
        return []
    return [
        (_ANALOG[_ANALOG_UNITS[types >> number & 1]][first + number], value)
        for number, value in enumerate(values)
        if value is not None
    ]


def _percent(fraction: float | None) -> float | None:
    return None if fraction is None else 100.0 * fraction


def _word(kind: type[IntEnum], value: int) -> str:
    return name_of(kind, value).lower()
