"""Fields that the simulated controller offers by RTDE, with their types."""

from collections.abc import Mapping
from types import MappingProxyType

from controllers.universal_robots.interfaces.state import OUTPUTS

_MORE = {
    "target_qd": "VECTOR6D",
    "target_qdd": "VECTOR6D",
    "target_current": "VECTOR6D",
    "joint_control_output": "VECTOR6D",
    "actual_joint_voltage": "VECTOR6D",
    "target_TCP_pose": "VECTOR6D",
    "target_TCP_speed": "VECTOR6D",
    "actual_tool_accelerometer": "VECTOR3D",
    "actual_execution_time": "DOUBLE",
    "actual_momentum": "DOUBLE",
    "actual_main_voltage": "DOUBLE",
    "joint_position_deviation_ratio": "DOUBLE",
    "payload_inertia": "VECTOR6D",
    "ft_raw_wrench": "VECTOR6D",
    "tcp_force_scalar": "DOUBLE",
    "actual_current_window": "VECTOR6D",
    "elbow_position": "VECTOR3D",
    "elbow_velocity": "VECTOR3D",
    "io_current": "DOUBLE",
    "tool_output_mode": "UINT8",
    "tool_digital_output0_mode": "UINT8",
    "tool_digital_output1_mode": "UINT8",
    "actual_configurable_digital_input_bits": "UINT64",
    "actual_configurable_digital_output_bits": "UINT64",
}

_REGISTERS = {
    "bit_registers0_to_31": "UINT32",
    "bit_registers32_to_63": "UINT32",
    **{f"bit_register_{number}": "BOOL" for number in range(64, 128)},
    **{f"int_register_{number}": "INT32" for number in range(48)},
    **{f"double_register_{number}": "DOUBLE" for number in range(48)},
}

INPUTS: Mapping[str, str] = MappingProxyType(
    {
        "speed_slider_mask": "UINT32",
        "speed_slider_fraction": "DOUBLE",
        "standard_digital_output_mask": "UINT8",
        "standard_digital_output": "UINT8",
        "configurable_digital_output_mask": "UINT8",
        "configurable_digital_output": "UINT8",
        "tool_digital_output_mask": "UINT8",
        "tool_digital_output": "UINT8",
        "standard_analog_output_mask": "UINT8",
        "standard_analog_output_type": "UINT8",
        "standard_analog_output_0": "DOUBLE",
        "standard_analog_output_1": "DOUBLE",
        **{f"input_{name}": kind for name, kind in _REGISTERS.items()},
    }
)
"""Fields that a client can write. A field has at most one client."""

OFFERED: Mapping[str, str] = MappingProxyType(
    {
        **OUTPUTS,
        **_MORE,
        **{f"output_{name}": kind for name, kind in _REGISTERS.items()},
        **{f"input_{name}": kind for name, kind in _REGISTERS.items()},
    }
)
"""Fields that a client can read."""

NOT_ON_CB3 = frozenset({"ft_raw_wrench"})
"""Fields that the software of CB3 (version 3) does not have."""
