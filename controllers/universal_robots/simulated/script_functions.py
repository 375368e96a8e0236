"""Functions that scripts may call on the simulated controller; another one ends the script with an error."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from controllers.universal_robots.simulated.motion_functions import (
    STEP_S,
    MotionFunctions,
    number,
    positive,
    vector,
)
from controllers.universal_robots.simulated.script.errors import ScriptError
from controllers.universal_robots.simulated.script.machine import (
    ControllerFunction,
    Machine,
    Pose,
    Value,
    Wait,
    text_of,
)

if TYPE_CHECKING:
    from controllers.universal_robots.simulated.controller import UrController

_MOST_MESSAGES = 20  # a second
_MOST_READ = 30


def functions_of(controller: "UrController") -> dict[str, ControllerFunction]:
    """Return the functions by their names."""
    named: dict[str, ControllerFunction] = {
        name: getattr(functions, name)
        for functions in (ScriptFunctions(controller), MotionFunctions(controller))
        for name in dir(functions)
        if not name.startswith("_")
    }
    return named | _PURE | dict.fromkeys(_WITHOUT_EFFECT, _nothing)


class ScriptFunctions:
    """Functions that need the controller; their names are those of the script language."""

    def __init__(self, controller: "UrController") -> None:
        self._controller = controller
        self._programs = controller.programs
        self._registers = controller.registers
        self._messages: list[float] = []

    # ------------------------------------------------------------------- time

    def sync(self, machine: Machine, thread: int) -> Value:
        """Wait for the next tick."""
        return Wait(lambda now_s: (None,))

    def sleep(self, machine: Machine, thread: int, t: Value) -> Value:
        """Wait."""
        end_s = machine.now_s + number(t)
        return Wait(lambda now_s: (None,) if now_s >= end_s else None)

    def get_steptime(self, machine: Machine, thread: int) -> Value:
        """Return the period of a tick [s]."""
        return STEP_S

    # ------------------------------------------------------------------- state

    def get_actual_joint_positions(self, machine: Machine, thread: int) -> Value:
        """Return the joint positions [rad]."""
        return tuple(self._programs.arm(machine.now_s).positions.tolist())

    get_joint_positions = get_target_joint_positions = get_actual_joint_positions

    def get_actual_joint_speeds(self, machine: Machine, thread: int) -> Value:
        """Return the joint speeds [rad/s]."""
        return tuple(self._programs.arm(machine.now_s).velocities.tolist())

    get_target_joint_speeds = get_actual_joint_speeds

    def get_actual_tcp_pose(self, machine: Machine, thread: int) -> Value:
        """Return the pose of the tool centre point."""
        return self._controller.tool_pose(machine.now_s)

    get_target_tcp_pose = get_actual_tcp_pose

    def get_tcp_offset(self, machine: Machine, thread: int) -> Value:
        """Return the offset of the tool centre point."""
        return Pose(self._controller.tool_offset)

    def get_target_payload(self, machine: Machine, thread: int) -> Value:
        """Return the mass of the payload."""
        return self._controller.payload_kg

    def set_tcp(self, machine: Machine, thread: int, pose: Value, tcp_name: Value = "") -> Value:
        """Set the offset of the tool centre point."""
        self._controller.tool_offset = vector(pose)
        return None

    def set_payload(self, machine: Machine, thread: int, m: Value, cog: Value = (0.0, 0.0, 0.0)) -> Value:
        """Set the mass of the payload."""
        self._controller.payload_kg = number(m)
        return None

    set_target_payload = set_payload

    # --------------------------------------------------------------- registers

    def read_input_integer_register(self, machine: Machine, thread: int, address: Value) -> Value:
        """Return an input register."""
        return self._registers.read("input", "int", address)

    def read_input_float_register(self, machine: Machine, thread: int, address: Value) -> Value:
        """Return an input register."""
        return self._registers.read("input", "double", address)

    def read_input_boolean_register(self, machine: Machine, thread: int, address: Value) -> Value:
        """Return an input register."""
        return self._registers.read("input", "bit", address)

    def read_output_integer_register(self, machine: Machine, thread: int, address: Value) -> Value:
        """Return an output register."""
        return self._registers.read("output", "int", address)

    def read_output_float_register(self, machine: Machine, thread: int, address: Value) -> Value:
        """Return an output register."""
        return self._registers.read("output", "double", address)

    def read_output_boolean_register(self, machine: Machine, thread: int, address: Value) -> Value:
        """Return an output register."""
        return self._registers.read("output", "bit", address)

    def write_output_integer_register(
        self, machine: Machine, thread: int, address: Value, value: Value
    ) -> Value:
        """Set an output register."""
        self._registers.write("int", address, value)

    def write_output_float_register(
        self, machine: Machine, thread: int, address: Value, value: Value
    ) -> Value:
        """Set an output register."""
        self._registers.write("double", address, value)

    def write_output_boolean_register(
        self, machine: Machine, thread: int, address: Value, value: Value
    ) -> Value:
        """Set an output register."""
        self._registers.write("bit", address, value)

    def rtde_set_watchdog(
        self,
        machine: Machine,
        thread: int,
        variable_name: Value,
        min_frequency: Value,
        action: Value = "pause",
    ) -> Value:
        """Watch an input of RTDE."""
        self._registers.set_watchdog(variable_name, min_frequency, action, machine.now_s)

    # ---------------------------------------------------------------- messages

    def textmsg(self, machine: Machine, thread: int, s1: Value, s2: Value = "") -> Value:
        """Write to the log."""
        if self._may_say(machine.now_s):
            self._controller.report_text(text_of(s1) + text_of(s2), machine.now_s)

    def popup(
        self,
        machine: Machine,
        thread: int,
        s: Value,
        title: Value = "Popup",
        warning: Value = False,
        error: Value = False,
        blocking: Value = False,
    ) -> Value:
        """Show a popup; a blocking one pauses the program."""
        if self._may_say(machine.now_s):
            self._controller.report_popup(
                text_of(title), text_of(s), warning is True, error is True, machine.now_s
            )
        if blocking is True:
            self._programs.pause(machine.now_s)

    def _may_say(self, now_s: float) -> bool:
        self._messages = [each for each in self._messages if now_s - each < 1.0]
        self._messages.append(now_s)
        del self._messages[:-_MOST_MESSAGES]
        return len(self._messages) < _MOST_MESSAGES


def _nothing(machine: Machine, thread: int, *given: Value, **named: Value) -> Value:
    return None


def _nothing_read(machine: Machine, thread: int, number: Value, *given: Value, **named: Value) -> Value:
    return (0,) * (1 + min(int(positive(number)), _MOST_READ))


def _of_numbers(function: Callable[..., float]) -> ControllerFunction:
    return lambda machine, thread, *given: function(*map(number, given))


def _norm(machine: Machine, thread: int, a: Value) -> Value:
    return math.hypot(*map(number, a)) if isinstance(a, tuple) else abs(number(a))


def _length(machine: Machine, thread: int, value: Value) -> Value:
    if not isinstance(value, tuple | str):
        raise ScriptError("only a list or a text has a length")
    return len(value)


_PURE: dict[str, ControllerFunction] = {
    "norm": _norm,
    "length": _length,
    "get_list_length": _length,
    "str_cat": lambda machine, thread, op1, op2: text_of(op1) + text_of(op2),
    "to_str": lambda machine, thread, val: text_of(val),
    "sqrt": _of_numbers(math.sqrt),
    "pow": _of_numbers(math.pow),
    "sin": _of_numbers(math.sin),
    "cos": _of_numbers(math.cos),
    "tan": _of_numbers(math.tan),
    "atan2": _of_numbers(math.atan2),
    "floor": _of_numbers(math.floor),
    "ceil": _of_numbers(math.ceil),
    "d2r": _of_numbers(math.radians),
    "r2d": _of_numbers(math.degrees),
    # There is no network: nothing answers.
    "socket_open": lambda machine, thread, *given, **named: False,
    "socket_read_binary_integer": _nothing_read,
}
_WITHOUT_EFFECT = (
    *(
        "force_mode_set_damping",
        "force_mode_set_gain_scaling",
        "zero_ftsensor",
        "set_gravity",
        "end_force_mode",
    ),
    *("end_freedrive_mode", "socket_close", "socket_send_int", "socket_send_string", "set_tool_voltage"),
)
