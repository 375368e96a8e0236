"""Model of the simulated controller: arm, program, modes and measured values. No I/O; time is an argument.

The program is the demo's tour, or a client's script. The motors hold a mass at the tool against gravity and
accelerate the joints; currents follow from these torques. Temperatures rise with time. Mass, inertias,
voltages and inputs are invented.
"""

import logging
import math
from collections.abc import Callable, Collection, Iterator, Mapping
from functools import cached_property

import numpy as np

from controllers.simulated.errors import SimulatorError
from controllers.universal_robots.interfaces.modes import (
    JointMode,
    ReportLevel,
    RobotMode,
    RobotStatus,
    RuntimeState,
    SafetyMode,
    SafetyStatus,
)
from controllers.universal_robots.interfaces.primary import (
    Alarm,
    KeyMessage,
    Origin,
    Popup,
    PrimaryMessage,
    PrimaryText,
    RuntimeFault,
    SafetyModeChanged,
)
from controllers.universal_robots.interfaces.rtde_messages import Value
from controllers.universal_robots.simulated.fields import OFFERED
from controllers.universal_robots.simulated.motion_functions import pose_of
from controllers.universal_robots.simulated.programs import Programs
from controllers.universal_robots.simulated.registers import Registers
from controllers.universal_robots.simulated.script.code import compile_script
from controllers.universal_robots.simulated.script.errors import ScriptError
from controllers.universal_robots.simulated.script.machine import Pose
from controllers.universal_robots.simulated.script_functions import functions_of
from robots.descriptions.description import RobotDescription
from robots.kinematics.inverse import InverseSolver, build_solver
from robots.kinematics.joints import FloatArray, joints_of
from robots.kinematics.model import build_model, link_placements, tool_jacobian, tool_placement

logger = logging.getLogger(__name__)

JOINTS = 6

_WARM_UP_S = 1800.0
_PAYLOAD_KG = 1.2
# Of the arm's own links, as if they were at the tool.
_ARM_KG = 4.0
_GRAVITY = 9.81
# Of each joint: inertia [kg m2], friction [N m s], torque of the motor's current behind its gear [N m/A].
_INERTIAS = np.array((1.5, 1.5, 0.8, 0.05, 0.05, 0.02))
_FRICTIONS = np.array((9.0, 9.0, 6.0, 2.0, 2.0, 1.5))
_TORQUES_A = np.array((12.0, 12.0, 11.0, 9.0, 9.0, 9.0))
# Analog types: 0 current, 1 voltage; only input 1 is a current, of a sensor with 4 to 20 mA.
_ANALOG_TYPES, _SENSOR_A = 0b1101, 0.012
_CONTROLLER, _BASE = -2, 0
# Invented.
_POWER_ON_S, _BRAKE_RELEASE_S = 0.6, 0.4
_UNLOCK_AFTER_S = 5.0
_ALARM_CODE, _ALARM_ARGUMENT = 153, 0
# A script on a connection that only reads.
_ONLY_READS_CODE = 210


class UrController:
    """State of one simulated controller.

    Args:
        description: A robot of six rotary joints.
        tour: Targets [rad] of the running program; None: no program, at rest.
        powered: The motors are on; a restarted controller waits for an operator to power them.
        now_s: The clock's time at boot.
        announce: Called with each robot message for the primary interface.

    Attributes:
        joints: The arm's joints.
        model: Its kinematic model.
        registers: General purpose registers.
        programs: The program that runs, and the arm's motion.
        remote: Remote control: scripts and commands of the network are executed.
        payload_kg: Mass of the payload [kg].
        tool_offset: Tool centre point in the flange's frame: position [m], rotation vector [rad].

    Raises:
        SimulatorError: If the robot does not have six rotary joints.
    """

    def __init__(
        self,
        description: RobotDescription,
        *,
        tour: Iterator[FloatArray] | None,
        powered: bool,
        now_s: float,
        announce: Callable[[PrimaryMessage], None],
    ) -> None:
        self.joints = joints_of(description)
        if len(self.joints) != JOINTS or set(self.joints.types) != {"rotary"}:
            raise SimulatorError(
                f"robot {description.name} has {len(self.joints)} joints, "
                f"this protocol needs {JOINTS} rotary ones: simulate puma560 or another arm with six"
            )
        self._description = description
        self.model = build_model(description)
        flange_to_base = link_placements(self.model, self.joints.home)[-1]
        tool_to_base = tool_placement(self.model, self.joints.home)
        self.payload_kg = _PAYLOAD_KG
        self.tool_offset: tuple[float, ...] = pose_of(np.linalg.inv(flange_to_base) @ tool_to_base)
        self._announce = announce
        self._boot_s = now_s
        self._mode = RobotMode.RUNNING if powered else RobotMode.POWER_OFF
        self._mode_after: list[tuple[float, RobotMode]] = []
        self._stopped_s = now_s
        self._safety = SafetyMode.NORMAL
        self._slider = 1.0
        self._outputs = 0
        self._now_s = now_s
        self.remote = True
        self.registers = Registers()
        self.programs = Programs(
            self.joints, tour, self.registers, report_key=self._key, report_fault=self._report_fault
        )
        self.programs.functions = functions_of(self)

    # ------------------------------------------------------------------------ behaviour

    def tick(self, now_s: float) -> None:
        """Execute the program."""
        self._now_s = now_s
        while self._mode_after and self._mode_after[0][0] <= now_s:
            self._mode = self._mode_after.pop(0)[1]
        self.programs.tick(now_s)

    def take_script(self, source: str, now_s: float) -> None:
        """Start a program of a client instead of the one that runs; report an error in it."""
        self._now_s = now_s
        try:
            program = compile_script(source)
        except ScriptError as error:
            logger.warning("a script cannot be compiled: line %d: %s", error.line, error.text)
            self._report_fault(error.line, error.text)
            return
        logger.info("script %s", program.name)
        if self._powered and self._safety is SafetyMode.NORMAL:
            self.programs.start(program, now_s)

    def refuse_script(self, now_s: float) -> None:
        """Report a script on a connection that only reads."""
        origin = self._origin(_CONTROLLER, now_s)
        self._announce(Alarm(origin, _ONLY_READS_CODE, 0, ReportLevel.WARNING, 0, 0, ""))

    def protective_stop(self, now_s: float) -> None:
        """Stop the arm, pause the program and send an alarm."""
        self._safety = SafetyMode.PROTECTIVE_STOP
        self._stopped_s = now_s
        self.programs.pause(now_s)
        self._announce(
            Alarm(
                self._origin(_BASE, now_s),
                _ALARM_CODE,
                _ALARM_ARGUMENT,
                ReportLevel.VIOLATION,
                0,
                0,
                "position of the base deviates from its path (simulated)",
            )
        )
        self._announce_safety_mode(now_s)

    def end_protective_stop(self, now_s: float) -> None:
        """End the protective stop and continue the program, as a person at the pendant does."""
        if self._safety is SafetyMode.PROTECTIVE_STOP:
            self._set_safety(SafetyMode.NORMAL, now_s)
            if self.programs.state is RuntimeState.PAUSED:
                self.programs.play(now_s)

    def unlock(self, now_s: float) -> bool:
        """End the protective stop, not the pause of the program; return False if it is too young."""
        if self._safety is SafetyMode.PROTECTIVE_STOP:
            if now_s - self._stopped_s < _UNLOCK_AFTER_S:
                return False
            self._set_safety(SafetyMode.NORMAL, now_s)
        return True

    def violate(self, now_s: float) -> None:
        """Violate a limit of the safety system: no program and no power until it is restarted."""
        self.power_off(now_s)
        self._set_safety(SafetyMode.VIOLATION, now_s)

    def restart_safety(self, now_s: float) -> None:
        """Restart the safety system; the arm has no power afterwards."""
        self.power_off(now_s)
        self._set_safety(SafetyMode.NORMAL, now_s)

    def power_on(self, now_s: float) -> None:
        """Power the arm on, with its brakes on."""
        if self._safety is SafetyMode.NORMAL and self._mode is RobotMode.POWER_OFF:
            self._mode = RobotMode.POWER_ON
            self._mode_after = [(now_s + _POWER_ON_S, RobotMode.IDLE)]

    def power_off(self, now_s: float) -> None:
        """End the program, and take the power from the arm."""
        self.programs.stop(now_s)
        self._mode, self._mode_after = RobotMode.POWER_OFF, []

    def release_brakes(self, now_s: float) -> None:
        """Release the brakes; an arm without power is powered on."""
        self.power_on(now_s)
        if self._safety is SafetyMode.NORMAL and self._mode is not RobotMode.RUNNING:
            begin_s = max([now_s, *(at_s for at_s, _ in self._mode_after)])
            self._mode_after.append((begin_s + _BRAKE_RELEASE_S, RobotMode.RUNNING))

    def write(self, values: Mapping[str, Value], now_s: float) -> None:
        """Take a client's inputs: speed slider, digital outputs and registers; others have no effect."""
        self.registers.write_inputs(values, now_s)
        fraction = values.get("speed_slider_fraction")
        if values.get("speed_slider_mask") == 1 and isinstance(fraction, float) and 0.0 <= fraction <= 1.0:
            self._slider = fraction
            self.programs.set_speed(fraction, now_s)
        for name, first in (("standard", 0), ("configurable", 8), ("tool", 16)):
            mask, bits = values.get(f"{name}_digital_output_mask"), values.get(f"{name}_digital_output")
            if isinstance(mask, int) and isinstance(bits, int):
                self._outputs = self._outputs & ~(mask << first) | (bits & mask) << first

    def report_text(self, text: str, now_s: float) -> None:
        """Send a text of a program."""
        self._announce(PrimaryText(self._origin(_CONTROLLER, now_s), text))

    def report_popup(self, title: str, text: str, warning: bool, error: bool, now_s: float) -> None:
        """Send a popup of a program."""
        self._announce(Popup(self._origin(_CONTROLLER, now_s), title[:80], text, warning, error, False))

    def _key(self, title: str, program: str) -> None:
        self._announce(KeyMessage(self._origin(_CONTROLLER, self._now_s), 0, 0, title, program))

    def _report_fault(self, line: int, text: str) -> None:
        self._announce(RuntimeFault(self._origin(_CONTROLLER, self._now_s), line, 0, text))

    def _set_safety(self, mode: SafetyMode, now_s: float) -> None:
        self._safety = mode
        self._announce_safety_mode(now_s)

    def _announce_safety_mode(self, now_s: float) -> None:
        self._announce(SafetyModeChanged(self._origin(_CONTROLLER, now_s), 0, 0, self._safety))

    def _origin(self, source: int, now_s: float) -> Origin:
        return Origin(int(self.uptime_s(now_s) * 1e6), source)

    # ---------------------------------------------------------------------------- state

    def uptime_s(self, now_s: float) -> float:
        """Return the time since the boot [s]."""
        return now_s - self._boot_s

    @cached_property
    def solver(self) -> InverseSolver:
        """Inverse kinematics of the arm."""
        return build_solver(self._description)

    @property
    def robot_mode(self) -> RobotMode:
        """Mode of the robot."""
        return self._mode

    @property
    def _powered(self) -> bool:
        return self._mode is RobotMode.RUNNING

    @property
    def safety_mode(self) -> SafetyMode:
        """Safety mode."""
        return self._safety

    @property
    def runtime_state(self) -> RuntimeState:
        """State of the program."""
        return self.programs.state

    @property
    def speed_slider(self) -> float:
        """Position of the speed slider, 0 to 1."""
        return self._slider

    def values(self, names: Collection[str], now_s: float, *, leap_deg: float = 0.0) -> dict[str, Value]:
        """Return the values of offered fields.

        Args:
            leap_deg: The first joint is reported too high by this angle.
        """
        state = self.programs.arm(now_s)
        positions = state.positions.copy()
        positions[0] += math.radians(leap_deg)
        found = self._modes() | self._measured(state.positions, state.velocities, state.accelerations, now_s)
        found |= {
            "timestamp": self.uptime_s(now_s),
            "actual_q": _tuple(positions),
            "actual_qd": _tuple(state.velocities),
            "target_q": _tuple(state.positions),
            "target_qd": _tuple(state.velocities),
            "target_qdd": _tuple(state.accelerations),
            "script_control_line": self.programs.line,
            **self.registers.inputs,
            **self.registers.outputs,
        }
        if any("TCP_pose" in name for name in names):
            found["target_TCP_pose"] = pose_of(tool_placement(self.model, state.positions))
            found["actual_TCP_pose"] = pose_of(tool_placement(self.model, positions))
        if any("TCP_speed" in name for name in names):
            speed = _tuple(tool_jacobian(self.model, state.positions) @ state.velocities)
            found["actual_TCP_speed"] = found["target_TCP_speed"] = speed
        return {name: found.get(name, _ZEROS[OFFERED[name]]) for name in names}

    def tool_pose(self, now_s: float) -> Pose:
        """Return the tool centre point in the base frame: position [m], rotation vector [rad]."""
        return pose_of(tool_placement(self.model, self.programs.arm(now_s).positions))

    def _modes(self) -> dict[str, Value]:
        normal = self._safety is SafetyMode.NORMAL
        off = self._mode is RobotMode.POWER_OFF
        status = RobotStatus(0) if off else RobotStatus.POWER_ON
        if self.runtime_state is RuntimeState.PLAYING:
            status |= RobotStatus.PROGRAM_RUNNING
        safety = _SAFETY_BITS[self._safety]
        return {
            "joint_mode": (int(_JOINT_MODES.get(self._mode, JointMode.IDLE)),) * JOINTS,
            "robot_mode": int(self.robot_mode),
            "safety_mode": int(self._safety),
            "safety_status": int(self._safety),
            "runtime_state": int(self.runtime_state),
            "robot_status_bits": int(status),
            "safety_status_bits": int(safety),
            "speed_scaling": self._slider if normal else 0.0,
            "target_speed_fraction": self._slider,
            "actual_digital_input_bits": self.programs.leg % 2,
            "actual_digital_output_bits": self._outputs,
        }

    def _measured(
        self, positions: FloatArray, velocities: FloatArray, accelerations: FloatArray, now_s: float
    ) -> dict[str, Value]:
        """Return what sensors measure."""
        on = 1.0 if self._powered else 0.0
        warm = 1.0 - math.exp(-self.uptime_s(now_s) / _WARM_UP_S)
        # Row 2: height of the tool per joint; on a vertical axis gravity has no torque.
        lift = tool_jacobian(self.model, positions)[2]
        torques = on * (
            (self.payload_kg + _ARM_KG) * _GRAVITY * lift
            + _INERTIAS * accelerations
            + _FRICTIONS * velocities
        )
        currents = torques / _TORQUES_A
        return {
            "actual_current": _tuple(currents),
            "target_current": _tuple(currents),
            "joint_control_output": _tuple(currents),
            "target_moment": _tuple(torques),
            "joint_temperatures": _tuple(24.0 + on * warm * np.array((6.0, 8.0, 8.0, 10.0, 10.0, 11.0))),
            "actual_joint_voltage": (48.0 * on,) * JOINTS,
            "actual_tool_accelerometer": (0.0, 0.0, 9.81),
            "actual_execution_time": 0.2,
            "actual_main_voltage": 48.0,
            "actual_robot_voltage": 48.0 * on,
            "actual_robot_current": on * (0.4 + 0.3 * float(np.abs(currents).sum())),
            "standard_analog_input0": 2.5,
            "standard_analog_input1": _SENSOR_A,
            "analog_io_types": _ANALOG_TYPES,
            "tool_analog_input_types": 0b11,
            "tcp_offset": self.tool_offset,
            "tool_mode": 253 if self._powered else 255,
            "tool_output_voltage": 24 if self._powered else 0,
            "tool_output_current": 0.02 * on,
            "tool_temperature": 24.0 + on * warm * 9.0,
            "payload": self.payload_kg,
            "payload_cog": (0.0, 0.0, 0.05),
        }


_SAFETY_BITS = {
    SafetyMode.NORMAL: SafetyStatus.NORMAL_MODE,
    SafetyMode.PROTECTIVE_STOP: SafetyStatus.PROTECTIVE_STOPPED | SafetyStatus.STOPPED_DUE_TO_SAFETY,
    SafetyMode.VIOLATION: SafetyStatus.VIOLATION | SafetyStatus.STOPPED_DUE_TO_SAFETY,
}
_JOINT_MODES = {RobotMode.RUNNING: JointMode.RUNNING, RobotMode.POWER_OFF: JointMode.POWER_OFF}
_ZEROS: Mapping[str, Value] = {
    "BOOL": False,
    "UINT8": 0,
    "UINT32": 0,
    "UINT64": 0,
    "INT32": 0,
    "DOUBLE": 0.0,
    "VECTOR3D": (0.0,) * 3,
    "VECTOR6D": (0.0,) * JOINTS,
    "VECTOR6INT32": (0,) * JOINTS,
    "VECTOR6UINT32": (0,) * JOINTS,
}


def _tuple(values: FloatArray) -> tuple[float, ...]:
    return tuple(values.tolist())
