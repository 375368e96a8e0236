"""Signals that the answers give, by the names that all drivers share (docs/signals.md)."""

import math
from collections.abc import Mapping, Sequence
from enum import IntEnum

from controllers.fanuc import data
from controllers.fanuc.assignments import (
    MasterTask,
    SystemVariable,
    Table,
    ToolFrame,
    Variable,
)
from controllers.fanuc.axes import SignalBits
from controllers.fanuc.data import Cartesian
from protocol_gateway.driver_parts.signal_names import numbered, of_axes
from protocol_gateway.seam import Signal, SignalsReceived, SignalValue
from robots.schema.poses import rotation_vector, rpy_rotation


class Operator(IntEnum):
    """Outputs of the operator panel, UO: the number of the bit in their answer."""

    COMMANDS_ENABLED = 0
    SYSTEM_READY = 1
    PROGRAM_RUNNING = 2
    PAUSED = 3
    HELD = 4
    FAULT = 5
    PENDANT_ENABLED = 7
    BATTERY_ALARM = 8
    BUSY = 9


_OPERATOR = (
    (Signal("robot.servo"), Operator.SYSTEM_READY),
    (Signal("snpx.commands_enabled"), Operator.COMMANDS_ENABLED),
    (Signal("snpx.pendant_enabled"), Operator.PENDANT_ENABLED),
    (Signal("snpx.held"), Operator.HELD),
    (Signal("snpx.busy"), Operator.BUSY),
    (Signal("snpx.battery_alarm"), Operator.BATTERY_ALARM),
)
POSE = (*of_axes("tool.pose", "m"), *of_axes("tool.pose", "rad", "rx ry rz"))
OFFSET = (*of_axes("tool.offset", "m"), *of_axes("tool.offset", "rad", "rx ry rz"))
_CONFIGURATION = Signal("snpx.configuration")
TOOL, FRAME = Signal("tool.number"), Signal("frame.number")
_OVERRIDE = Signal("speed.override", "%")
_NAME, _LINE, _STATE = Signal("program.name"), Signal("program.line"), Signal("program.state")
_CALLER = Signal("snpx.caller")
_STATES = ("ended", "paused", "running")
_KINDS = {
    "DI": "io.digital_in",
    "DO": "io.digital_out",
    # At the connector of the end effector.
    "RI": "io.tool_in",
    "RO": "io.tool_out",
    "UI": "snpx.ui",
    "UO": "snpx.uo",
}


def of_operator(bits: int) -> SignalsReceived:
    """Return the signals of the operator panel's outputs, which are not all off."""
    return SignalsReceived([(signal, bool(bits >> bit & 1)) for signal, bit in _OPERATOR])


def unknown_operator() -> SignalsReceived:
    """Return that the operator panel's outputs are not known."""
    return SignalsReceived([(signal, None) for signal, _ in _OPERATOR])


def of_pose(cartesian: Cartesian | None) -> SignalsReceived:
    """Return the signals of the Cartesian position; None: the controller cannot compute it."""
    configuration = None if cartesian is None else cartesian.configuration
    return SignalsReceived([*of_frame(POSE, cartesian), (_CONFIGURATION, configuration)])


def of_state(table: Table, values: Mapping[Variable, bytes], refused: frozenset[Variable]) -> SignalsReceived:
    """Return the signals of the block `Table.state`.

    Args:
        refused: Variables that the controller did not assign; their words are 0 without a meaning.
    """

    def integer(variable: Variable) -> int | None:
        return None if variable in refused else data.integer(values[variable])

    tool = integer(table.tool_number)
    found: list[tuple[Signal, SignalValue | None]] = [
        (_OVERRIDE, integer(SystemVariable.SPEED_OVERRIDE)),
        (FRAME, integer(table.frame_number)),
        (TOOL, tool),
        *_of_task(None if MasterTask() in refused else values[MasterTask()]),
        *_of_offset(tool, table.tools, values, refused),
    ]
    for each in table.registers:
        value = data.number(values[each]) if each not in refused else None
        found.append((register(each.number), value))
    return SignalsReceived(found)


def _of_task(raw: bytes | None) -> list[tuple[Signal, SignalValue | None]]:
    task = None if raw is None else data.task(raw)
    if task is None or not task.program:
        return [(each, None) for each in (_NAME, _LINE, _STATE, _CALLER)]
    state = _STATES[task.state] if 0 <= task.state < len(_STATES) else None
    return [(_NAME, task.program), (_LINE, task.line), (_STATE, state), (_CALLER, task.caller or None)]


def _of_offset(
    number: int | None,
    tools: Sequence[ToolFrame],
    values: Mapping[Variable, bytes],
    refused: frozenset[Variable],
) -> list[tuple[Signal, SignalValue | None]]:
    """Return the active tool's frame; tool 0 is the flange itself."""
    if number == 0:
        return [(each, 0.0) for each in OFFSET]
    active = next((each for each in tools if each.number == number and each not in refused), None)
    return of_frame(OFFSET, None if active is None else data.cartesian(values[active]))


def of_frame(signals: Sequence[Signal], frame: Cartesian | None) -> list[tuple[Signal, SignalValue | None]]:
    """Return the values of a position and a rotation vector; None: not known."""
    if frame is None:
        return [(each, None) for each in signals]
    x, y, z, w, p, r = frame.values
    rotation = rotation_vector(rpy_rotation(*(math.radians(each) for each in (w, p, r))))
    return [*zip(signals, (x / 1000, y / 1000, z / 1000, *rotation.tolist()), strict=True)]


def register(number: int) -> Signal:
    """Return the signal of a register."""
    return Signal(f"io.register.{number}")


def io_signals(bits: SignalBits) -> tuple[Signal, ...]:
    """Return the signals of inputs or outputs, by their numbers on the pendant."""
    return numbered(_KINDS[bits.kind], range(bits.first, bits.last + 1))
