"""Signals from a server's variables, by the names that all drivers share (docs/signals.md)."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from controllers.opcua.facts import DECLARED, MOTOR, Item, Value
from controllers.opcua.settings import OpcUaSignal
from controllers.opcua.units import scale_of
from protocol_gateway.driver_parts.signal_names import unit_of
from protocol_gateway.seam import Signal

JOINTS = Signal("opcua.joints")
"""Text: `shown`, or why the joints are unknown."""
SPREAD = Signal("opcua.joints.spread", "s")
"""Difference of the axes' times that were joined last."""
WITHOUT_UNIT = Signal("opcua.without_unit")
"""Text: names of the signals that are not shown, because their unit is unknown; None: there is none."""
_LONGEST_UNIT = 16

_MODES = ("other", "manual reduced speed", "manual high speed", "automatic", "automatic external")
_EXECUTIONS = ("cycle", "continuous", "step")


@dataclass(frozen=True, slots=True)
class Source:
    """Signal, and how its value follows from the server's.

    Attributes:
        without_unit: Its number has no known unit, so that it has no value.
    """

    signal: Signal
    convert: Callable[[Value], Value]
    without_unit: bool = False

    def of(self, value: Value) -> tuple[Signal, Value]:
        """Return the signal with the server's value; None: unknown."""
        return self.signal, None if value is None else self.convert(value)


def _boolean(value: Value) -> Value:
    return value if isinstance(value, bool) else None


def _text(value: Value) -> Value:
    return value if isinstance(value, str) else None


def _name_in(names: Sequence[str]) -> Callable[[Value], Value]:
    def name(value: Value) -> Value:
        if isinstance(value, bool | str) or value is None:
            return None
        known = value.is_integer() and 0 <= value < len(names)
        return names[int(value)] if known else f"unknown {value:g}"

    return name


def _number(item: Item, unit: str) -> Callable[[Value], Value] | None:
    """Return the conversion of a number to a unit; None: the server states no unit that can be converted."""
    scale = scale_of(item.unit)
    if scale is None or scale.unit != unit:
        return None
    factor, offset = scale.factor, scale.offset

    def number(value: Value) -> Value:
        return None if isinstance(value, bool | str) or value is None else value * factor + offset

    return number


def _percent(value: Value) -> Value:
    return None if isinstance(value, bool | str) else value


_KINDS: Mapping[str, tuple[str, str, Callable[[Value], Value] | None]] = {
    # Name of the first of its kind and of the others, conversion; None: a number in the server's unit.
    # OPC 40010-1 says that it is in percent.
    "override": ("speed.override", "opcua.device_{}.override", _percent),
    "in_control": ("robot.servo", "opcua.device_{}.in_control", _boolean),
    "on_path": ("opcua.on_path", "opcua.device_{}.on_path", _boolean),
    "mass": ("payload.mass", "opcua.load_{}.mass", None),
    "mode": ("robot.mode", "opcua.safety_{}.mode", _name_in(_MODES)),
    "emergency_stop": ("safety.emergency_stop", "opcua.safety_{}.emergency_stop", _boolean),
    "protective_stop": ("safety.protective_stop", "opcua.safety_{}.protective_stop", _boolean),
    "program": ("program.name", "opcua.task_{}.program", _text),
    "loaded": ("opcua.program_loaded", "opcua.task_{}.loaded", _boolean),
    "execution": ("program.cycle", "opcua.task_{}.cycle", _name_in(_EXECUTIONS)),
    "temperature": ("cabinet.temperature", "opcua.controller_{}.temperature", None),
}


def signals_of(
    items: Sequence[Item], axes: Sequence[str], declared: Sequence[OpcUaSignal]
) -> tuple[dict[int, Source], tuple[str, ...]]:
    """Return the signal of each item that has one, by its number, and the names of those without a unit.

    A number whose unit is unknown has no value: a signal's name promises its unit.

    Args:
        axes: Name of each joint's axis; empty: joints are not shown.
        declared: The site file's signals.
    """
    names = {each.name: each for each in declared}
    count: Counter[str] = Counter()
    found: dict[int, Source] = {}
    without_unit: list[str] = []
    for number, item in enumerate(items):
        count[item.kind] += 1
        if item.kind == DECLARED and item.name in names:
            source = _declared(item, names[item.name])
        elif item.kind == MOTOR and item.name in axes:
            source = _of_server(item, Signal("joint.temperature", "°C", axes.index(item.name)))
        elif item.kind == MOTOR:
            source = _of_server(item, Signal(f"opcua.motor_{count[MOTOR]}.temperature", "°C"))
        elif item.kind in _KINDS:
            first, other, convert = _KINDS[item.kind]
            name = first if count[item.kind] == 1 else other.format(count[item.kind])
            unit = unit_of(first)
            source = Source(Signal(name, unit), convert) if convert else _of_server(item, Signal(name, unit))
        else:
            continue
        found[number] = source
        if source.without_unit:
            motor = item.kind == MOTOR
            without_unit.append(f"temperature of {item.name}" if motor else source.signal.name)
    return found, tuple(without_unit)


def _of_server(item: Item, signal: Signal) -> Source:
    """Return a number in the server's unit, converted to the signal's."""
    number = _number(item, signal.unit)
    return Source(signal, number) if number else Source(signal, lambda value: None, without_unit=True)


def _declared(item: Item, declared: OpcUaSignal) -> Source:
    """Return a signal of the site file: in its unit if it has one, else in SI of the server's."""
    if declared.unit:
        return Source(Signal(declared.name, declared.unit), lambda value: value)
    scale, shared = scale_of(item.unit), unit_of(declared.name)
    if scale is None and shared:
        signal = Signal(declared.name, shared)
        return Source(
            signal, lambda value: value if isinstance(value, bool | str) else None, without_unit=True
        )
    if scale is None:
        # Such a name promises no unit, so the number has the server's, or none.
        return Source(Signal(declared.name, item.unit.text.strip()[:_LONGEST_UNIT]), lambda value: value)
    number = _number(item, scale.unit)
    assert number is not None
    return Source(
        Signal(declared.name, scale.unit),
        lambda value: value if isinstance(value, bool | str) else number(value),
    )
