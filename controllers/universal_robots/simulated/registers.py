"""General purpose registers of a controller, and the watchdogs of their inputs."""

from collections.abc import Mapping
from dataclasses import dataclass

from controllers.universal_robots.interfaces.rtde_messages import Value
from controllers.universal_robots.simulated.fields import INPUTS, OFFERED
from controllers.universal_robots.simulated.script.errors import ScriptError


@dataclass(frozen=True)
class Watchdog:
    """Watchdog of an input; `action`: "ignore", "pause" or "stop"."""

    period_s: float
    action: str
    begin_s: float


class Registers:
    """Registers of one controller; they keep their values."""

    def __init__(self) -> None:
        self.inputs: dict[str, Value] = {}
        self.outputs: dict[str, Value] = {}
        self._written_s: dict[str, float] = {}
        self._watchdogs: dict[str, Watchdog] = {}

    def write_inputs(self, values: Mapping[str, Value], now_s: float) -> None:
        """Take a client's inputs."""
        self._written_s.update(dict.fromkeys(values, now_s))
        self.inputs.update({name: value for name, value in values.items() if name.startswith("input_")})

    # -------------------------------------------------------------- for scripts

    def read(self, direction: str, kind: str, number: object) -> Value:
        """Return a register; `kind`: "int", "double" or "bit".

        Raises:
            ScriptError: If there is no such register.
        """
        values = self.inputs if direction == "input" else self.outputs
        if kind == "bit" and isinstance(number, int) and number < 64:
            packed = f"{direction}_bit_registers{'0_to_31' if number < 32 else '32_to_63'}"
            bits = values.get(packed, 0)
            assert isinstance(bits, int)
            return bool(bits >> number % 32 & 1)
        name = _register(direction, kind, number)
        return values.get(name, {"int": 0, "double": 0.0, "bit": False}[kind])

    def write(self, kind: str, number: object, value: object) -> None:
        """Set an output register.

        Raises:
            ScriptError: If there is no such register, or the value does not fit.
        """
        if kind == "bit" and isinstance(number, int) and number < 64:
            packed = f"output_bit_registers{'0_to_31' if number < 32 else '32_to_63'}"
            bits = self.outputs.get(packed, 0)
            assert isinstance(bits, int)
            bit = 1 << number % 32
            self.outputs[packed] = bits | bit if value else bits & ~bit
            return
        name = _register("output", kind, number)
        if not isinstance(value, int | float) or isinstance(value, bool) is not (kind == "bit"):
            raise ScriptError(f"{name} cannot be {str(value)[:40]}")
        if kind == "int" and not -(2**31) <= value < 2**31:
            raise ScriptError(f"{name} cannot be {value:g}")
        self.outputs[name] = {"int": int, "double": float, "bit": bool}[kind](value)

    def set_watchdog(self, name: object, frequency_hz: object, action: object, now_s: float) -> None:
        """Watch an input.

        Raises:
            ScriptError: If an argument is invalid.
        """
        if name not in INPUTS:
            raise ScriptError(f"{str(name)[:60]} is no input of RTDE")
        if action not in ("ignore", "pause", "stop"):
            raise ScriptError("the action of a watchdog is ignore, pause or stop")
        if not isinstance(frequency_hz, int | float) or not 0.0 <= frequency_hz <= 500.0:
            raise ScriptError("the frequency of a watchdog is 0 to 500")
        assert isinstance(name, str)
        assert isinstance(action, str)
        if frequency_hz == 0.0:
            self._watchdogs.pop(name, None)
        else:
            self._watchdogs[name] = Watchdog(1.0 / frequency_hz, action, now_s)

    def forget_watchdogs(self) -> None:
        """Remove all: a program has ended."""
        self._watchdogs.clear()

    def starved(self, now_s: float) -> str:
        """Return the action of an expired watchdog, once; empty: none has expired."""
        for name, watchdog in tuple(self._watchdogs.items()):
            last_s = max(self._written_s.get(name, 0.0), watchdog.begin_s)
            if watchdog.action != "ignore" and now_s - last_s > watchdog.period_s:
                del self._watchdogs[name]
                return watchdog.action
        return ""


def _register(direction: str, kind: str, number: object) -> str:
    name = f"{direction}_{kind}_register_{number}"
    if isinstance(number, bool) or not isinstance(number, int) or name not in OFFERED:
        raise ScriptError(f"register {str(number)[:40]} is unknown")
    return name
