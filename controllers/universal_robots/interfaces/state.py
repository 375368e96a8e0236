"""Output fields that robomesh reads by RTDE, and the controller's state that they give."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from controllers.universal_robots.interfaces.modes import RobotStatus, SafetyStatus
from controllers.universal_robots.interfaces.rtde_messages import Value

REQUIRED = ("timestamp", "actual_q")
"""Fields that every controller has and without which there is nothing to show."""

OUTPUTS: Mapping[str, str] = MappingProxyType(
    {
        "timestamp": "DOUBLE",
        "actual_q": "VECTOR6D",
        "actual_qd": "VECTOR6D",
        "target_q": "VECTOR6D",
        "actual_current": "VECTOR6D",
        "target_moment": "VECTOR6D",
        "joint_temperatures": "VECTOR6D",
        "joint_mode": "VECTOR6INT32",
        "robot_mode": "INT32",
        "safety_mode": "INT32",
        "safety_status": "INT32",
        "runtime_state": "UINT32",
        "robot_status_bits": "UINT32",
        "safety_status_bits": "UINT32",
        "speed_scaling": "DOUBLE",
        "target_speed_fraction": "DOUBLE",
        "actual_digital_input_bits": "UINT64",
        "actual_digital_output_bits": "UINT64",
        "standard_analog_input0": "DOUBLE",
        "standard_analog_input1": "DOUBLE",
        "standard_analog_output0": "DOUBLE",
        "standard_analog_output1": "DOUBLE",
        "analog_io_types": "UINT32",
        "tool_analog_input0": "DOUBLE",
        "tool_analog_input1": "DOUBLE",
        "tool_analog_input_types": "UINT32",
        "actual_TCP_pose": "VECTOR6D",
        "actual_TCP_speed": "VECTOR6D",
        "actual_TCP_force": "VECTOR6D",
        "tcp_offset": "VECTOR6D",
        "tool_mode": "UINT32",
        "tool_output_voltage": "INT32",
        "tool_output_current": "DOUBLE",
        "tool_temperature": "DOUBLE",
        "payload": "DOUBLE",
        "payload_cog": "VECTOR3D",
        "script_control_line": "UINT32",
        "actual_robot_voltage": "DOUBLE",
        "actual_robot_current": "DOUBLE",
    }
)
"""Fields that robomesh asks for, with their types. Older software does not have all of them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerState:
    """State of a controller at one moment; None: the controller does not have the field.

    Attributes:
        timestamp_s: Time since the controller's start [s].
        positions: Actual joint positions [rad].
        velocities: Actual joint velocities [rad/s].
        target_positions: Target joint positions [rad].
        currents_a: Actual joint currents [A].
        target_torques: Torques that the controller computes for its motion [N·m].
        temperatures_c: Joint temperatures [°C].
        joint_modes: One a joint, see `JointMode`.
        robot_mode: See `RobotMode`.
        safety_mode: `safety_status`, or `safety_mode` on older software; see `SafetyMode`.
        runtime_state: State of the program, see `RuntimeState`.
        speed_scaling: Fraction of the programmed speed at which the arm moves, 0 to 1.
        target_speed_fraction: Position of the speed slider, 0 to 1.
        digital_inputs, digital_outputs: Bits 0 to 7 standard, 8 to 15 configurable, 16 and 17 tool.
        analog_inputs, analog_outputs: Two each [V] or [A]; None: unknown.
        analog_types: Bits 0 and 1 inputs, 2 and 3 outputs; 0: [A], 1: [V].
        tool_analog_inputs: Two [V] or [A]; None: unknown.
        tool_analog_types: Bits 0 and 1; 0: [A], 1: [V].
        tool_pose: Tool centre point in the base frame: position [m], rotation vector [rad].
        tool_speed: Linear [m/s] and angular velocity [rad/s] of the tool centre point.
        tool_force: Force [N] and torque [N·m] at the tool centre point, in the base frame.
        tool_offset: Tool centre point in the flange's frame: position [m], rotation vector [rad].
        tool_mode: Mode of the tool's board.
        tool_voltage_v: Output voltage of the tool connector: 0, 12 or 24 [V].
        payload_kg: Mass of the payload [kg].
        payload_centre_m: Centre of mass of the payload in the flange's frame [m].
        script_line: Line of the running script; 0: no thread of it has the robot.
        robot_voltage_v: Voltage of the arm's supply [V].
        robot_current_a: Current of the arm's supply [A].
        registers: Integer registers by their names, those that were asked for.
    """

    timestamp_s: float
    positions: tuple[float, ...]
    velocities: tuple[float, ...] | None = None
    target_positions: tuple[float, ...] | None = None
    currents_a: tuple[float, ...] | None = None
    target_torques: tuple[float, ...] | None = None
    temperatures_c: tuple[float, ...] | None = None
    joint_modes: tuple[int, ...] | None = None
    robot_mode: int | None = None
    safety_mode: int | None = None
    runtime_state: int | None = None
    robot_status: RobotStatus | None = None
    safety_status: SafetyStatus | None = None
    speed_scaling: float | None = None
    target_speed_fraction: float | None = None
    digital_inputs: int | None = None
    digital_outputs: int | None = None
    analog_inputs: tuple[float | None, float | None] = (None, None)
    analog_outputs: tuple[float | None, float | None] = (None, None)
    analog_types: int | None = None
    tool_analog_inputs: tuple[float | None, float | None] = (None, None)
    tool_analog_types: int | None = None
    tool_pose: tuple[float, ...] | None = None
    tool_speed: tuple[float, ...] | None = None
    tool_force: tuple[float, ...] | None = None
    tool_offset: tuple[float, ...] | None = None
    tool_mode: int | None = None
    tool_voltage_v: int | None = None
    tool_current_a: float | None = None
    tool_temperature_c: float | None = None
    payload_kg: float | None = None
    payload_centre_m: tuple[float, ...] | None = None
    script_line: int | None = None
    robot_voltage_v: float | None = None
    robot_current_a: float | None = None
    registers: Mapping[str, int] = field(default_factory=dict)


def controller_state(values: Mapping[str, Value], registers: Sequence[str] = ()) -> ControllerState:
    """Return the state that the values of a recipe with the REQUIRED fields give.

    Args:
        registers: Names of fields that are integer registers.
    """
    found: Mapping[str, Any] = values
    robot_status = found.get("robot_status_bits")
    safety_status = found.get("safety_status_bits")
    return ControllerState(
        timestamp_s=found["timestamp"],
        positions=found["actual_q"],
        velocities=found.get("actual_qd"),
        target_positions=found.get("target_q"),
        currents_a=found.get("actual_current"),
        target_torques=found.get("target_moment"),
        temperatures_c=found.get("joint_temperatures"),
        joint_modes=found.get("joint_mode"),
        robot_mode=found.get("robot_mode"),
        safety_mode=found.get("safety_status", found.get("safety_mode")),
        runtime_state=found.get("runtime_state"),
        robot_status=None if robot_status is None else RobotStatus(robot_status),
        safety_status=None if safety_status is None else SafetyStatus(safety_status),
        speed_scaling=found.get("speed_scaling"),
        target_speed_fraction=found.get("target_speed_fraction"),
        digital_inputs=found.get("actual_digital_input_bits"),
        digital_outputs=found.get("actual_digital_output_bits"),
        analog_inputs=_pair(found, "standard_analog_input"),
        analog_outputs=_pair(found, "standard_analog_output"),
        analog_types=found.get("analog_io_types"),
        tool_analog_inputs=_pair(found, "tool_analog_input"),
        tool_analog_types=found.get("tool_analog_input_types"),
        tool_pose=found.get("actual_TCP_pose"),
        tool_speed=found.get("actual_TCP_speed"),
        tool_force=found.get("actual_TCP_force"),
        tool_offset=found.get("tcp_offset"),
        tool_mode=found.get("tool_mode"),
        tool_voltage_v=found.get("tool_output_voltage"),
        tool_current_a=found.get("tool_output_current"),
        tool_temperature_c=found.get("tool_temperature"),
        payload_kg=found.get("payload"),
        payload_centre_m=found.get("payload_cog"),
        script_line=found.get("script_control_line"),
        robot_voltage_v=found.get("actual_robot_voltage"),
        robot_current_a=found.get("actual_robot_current"),
        registers={name: found[name] for name in registers if name in found},
    )


def _pair(found: Mapping[str, Any], name: str) -> tuple[float | None, float | None]:
    return found.get(f"{name}0"), found.get(f"{name}1")
