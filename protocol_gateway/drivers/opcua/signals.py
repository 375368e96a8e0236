"""Signals from a server's variables, by the names that all drivers share (docs/signals.md)."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from protocol_gateway.drivers.driver import Signal
from protocol_gateway.drivers.opcua.facts import DECLARED, MOTOR, Item, Value
from protocol_gateway.drivers.opcua.settings import OpcUaSignal
from protocol_gateway.drivers.opcua.units import scale_of
from protocol_gateway.drivers.signal_names import BOOLEAN, SHARED, TEXT

JOINTS = Signal("opcua.joints")
"""Text: `shown`, or why the joints are unknown."""
SPREAD = Signal("opcua.joints.spread", "s")
"""Difference of the axes' times that were joined last."""

_MODES = ("other", "manual reduced speed", "manual high speed", "automatic", "automatic external")
_EXECUTIONS = ("cycle", "continuous", "step")


@dataclass(frozen=True, slots=True)
class Source:
    """Signal, and how its value follows from the server's."""

    signal: Signal
    convert: Callable[[Value], Value]

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


def _number(item: Item, unit: str) -> Callable[[Value], Value]:
    """Return the conversion of a number to a unit; without a unit of the server it is in that unit."""
    scale = scale_of(item.unit) if item.unit else None

    def number(value: Value) -> Value:
        if isinstance(value, bool | str) or value is None:
            return None
        if scale is None:
            return None if item.unit else value
        return value * scale.factor + scale.offset if scale.unit == unit else None

    return number


_KINDS: Mapping[str, tuple[str, str, Callable[[Value], Value] | None]] = {
    # Name of the first of its kind and of the others, conversion; None: a number.
    "override": ("speed.override", "opcua.device_{}.override", None),
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
) -> dict[int, Source]:
    """Return the signal of each item that has one, by the item's number.

    Args:
        axes: Name of each joint's axis; empty: joints are not shown.
        declared: The site file's signals.
    """
    names = {each.name: each for each in declared}
    count: Counter[str] = Counter()
    found: dict[int, Source] = {}
    for number, item in enumerate(items):
        count[item.kind] += 1
        if item.kind == DECLARED and item.name in names:
            found[number] = _declared(item, names[item.name])
        elif item.kind == MOTOR and item.name in axes:
            signal = Signal("joint.temperature", "°C", axes.index(item.name))
            found[number] = Source(signal, _number(item, "°C"))
        elif item.kind == MOTOR:
            signal = Signal(f"opcua.motor_{count[MOTOR]}.temperature", "°C")
            found[number] = Source(signal, _number(item, "°C"))
        elif item.kind in _KINDS:
            first, other, convert = _KINDS[item.kind]
            name = first if count[item.kind] == 1 else other.format(count[item.kind])
            unit = "" if convert else SHARED[first]
            found[number] = Source(Signal(name, unit), convert or _number(item, unit))
    return found


def _declared(item: Item, declared: OpcUaSignal) -> Source:
    """Return a signal of the site file: in its unit if it has one, else in SI of the server's."""
    if declared.unit:
        return Source(Signal(declared.name, declared.unit), lambda value: value)
    shared = SHARED.get(declared.name, "")
    scale = scale_of(item.unit)
    if scale is None:
        return Source(Signal(declared.name, "" if shared in (TEXT, BOOLEAN) else shared), lambda value: value)
    convert = _number(item, scale.unit)
    return Source(
        Signal(declared.name, scale.unit),
        lambda value: value if isinstance(value, bool | str) else convert(value),
    )
