"""Files in which the simulated controller writes its state, in the form of a controller with V9.30."""

import re
from collections.abc import Callable, Collection, Mapping
from datetime import datetime

from controllers.fanuc import data
from controllers.fanuc.axes import SignalBits
from controllers.fanuc.data import Cartesian
from controllers.fanuc.ftp.files import KINDS
from controllers.fanuc.ftp.protocol import File
from controllers.fanuc.signals import Operator
from controllers.fanuc.simulated import memory
from controllers.fanuc.simulated.controller import SOFTWARE, SnpxController

_MOST_REGISTERS, _MOST_TOOLS = 200, 10
_MONTHS = ("JAN", "FEB", "MAR", "APR", "MAY", "JUN", "JUL", "AUG", "SEP", "OCT", "NOV", "DEC")
_INPUTS_AND_OUTPUTS = (
    SignalBits("DI", 1, 32),
    SignalBits("DO", 1, 32),
    SignalBits("UI", 1, 18),
    SignalBits("UO", 1, 20),
    SignalBits("RI", 1, 8),
    SignalBits("RO", 1, 8),
)


def content(file: File, controller: SnpxController, now_s: float, active: Collection[str] = ()) -> str:
    """Return the content of a file now.

    Args:
        active: The active faults.
    """
    now = datetime.now().astimezone()
    date = f"{now:%d}-{_MONTHS[now.month - 1]}-{now:%y %H:%M:%S}"
    write = _WRITERS[file]
    return write(controller, now_s, active, date)


def _head(date: str) -> str:
    version = f"VERSION : Simulated           \n$VERSION: {SOFTWARE}\n"
    return f"F Number: F00000\n{version}DATE:     {date[:-3]} \n\n"


def _number(value: float, width: int = 10, decimals: int = 2) -> str:
    """Return a number as the controller writes it: without a zero before the point, or as stars."""
    text = re.sub(r"^(-?)0\.", r"\1.", f"{value:.{decimals}f}")
    return text.rjust(width) if len(text) <= width else "*" * width


def _position(controller: SnpxController, now_s: float, active: Collection[str], date: str) -> str:
    position = data.position(controller.position(now_s, active))
    axes = position.axes or ()
    count = controller.axis_count
    last = max((number for number, value in enumerate(axes, start=1) if value), default=0)
    joints = "".join(f"Joint{number + 1:4}:{_number(axes[number])}\n" for number in range(count))
    extended = enumerate(axes[count:last], start=1)
    extra = "".join(f"EXTAXS:{number:2}:{_number(value)}\n" for number, value in extended)
    place = _place(position.cartesian) + extra
    frame = controller.numbers()[f"$MNUFRAMENUM[{controller.group}]"]
    return (
        f"{_head(date)}CURRENT ROBOT POSITION::\nGroup #: {controller.group:2}\n \n"
        f"CURRENT JOINT POSITION:\n{joints}{extra}\n\n"
        f"Frame #: {frame:3}  Tool #: {controller.tool_number:3}\nCURRENT USER FRAME POSITION:\n{place}\n\n"
        f"Tool #: {controller.tool_number:3}\nCURRENT WORLD POSITION:\n{place}\n"
    )


def _place(place: Cartesian | None) -> str:
    if place is None:
        return "Cartesian position cannot be calculated\n"
    values = "".join(f"{axis}:{_number(value)}\n" for axis, value in zip("XYZWPR", place.values, strict=True))
    return f"CFG: {place.configuration}\n{values}"


def _signals(controller: SnpxController, now_s: float, active: Collection[str], date: str) -> str:
    lines = []
    for each in _INPUTS_AND_OUTPUTS:
        outputs = each.kind.endswith("O")
        first = each.first_bit // 8 * 8
        found = memory.bits(controller, outputs=outputs, first=first, count=64, active=active)
        shifted = int.from_bytes(found, "little") >> (each.first_bit - first)
        name = KINDS.get(each.kind, each.kind)
        for number in range(each.first, each.last + 1):
            on = "ON" if shifted >> (number - each.first) & 1 else "OFF"
            lines.append(f"{name}[{number:4}] {on:>3}  \n")
    return f"{_head(date)}IO STATUS::\n\n{''.join(lines)}"


def _safety(controller: SnpxController, now_s: float, active: Collection[str], date: str) -> str:
    stopped = bool(controller.newest_alarms)
    pendant = bool(controller.operator_outputs(active) >> Operator.PENDANT_ENABLED & 1)
    values = {
        "External ESTOP": False,
        "SOP Estop": stopped,
        "TP ESTOP": False,
        "Hand Broken": False,
        "OverTravel": False,
        "Low Air Alarm": False,
        "Fence Open": False,
        "Belt Broken": False,
        "TP Enable": pendant,
        "TP Deadman": pendant,
        "SVOFF Detect": False,
        "Non Teacher Enb": False,
    }
    lines = "".join(f"{name:<16} {str(value).upper():<5}\n" for name, value in values.items())
    return f"{_head(date)}STOP SIGNALS::\n\n{lines}"


def _alarms(controller: SnpxController, now_s: float, active: Collection[str], date: str) -> str:
    lines = []
    for number, each in enumerate(controller.newest_alarms, start=1):
        year, month, day, hour, minute, second = each.time
        time = f"{day:02}-{_MONTHS[month - 1]}-{year % 100:02} {hour:02}:{minute:02}:{second:02}"
        severity = f"{each.severity_name:<30}00110110"
        lines.append(f'{number}" {time} " {each.message:<50}" {each.cause}" {severity}" \n')
    return f"ERRACT.LS      Robot Name SIMULATED {date}  \n\n{''.join(lines)}"


def _registers(controller: SnpxController, now_s: float, active: Collection[str], date: str) -> str:
    lines = []
    for number in range(1, _MOST_REGISTERS + 1):
        value = controller.registers.get(number, 0.0)
        text = f"{value:.0f}" if value == round(value) else _number(value, 20, 6).strip()
        lines.append(f"  [{number}] = {text}  '' \n")
    kind = f"ARRAY[{_MOST_REGISTERS}] OF Numeric Reg"
    title = f"[*NUMREG*]$NUMREG  Storage: SHADOW  Access: RW  : {kind}\n"
    most = f"[*NUMREG*]$MAXREGNUM  Storage: CMOS  Access: RW  : INTEGER = {_MOST_REGISTERS}\n"
    return f"{title}{''.join(lines)}{most}"


def _frames(controller: SnpxController, now_s: float, active: Collection[str], date: str) -> str:
    group = controller.group
    tool = data.cartesian(controller.tool()[:52])
    lines = []
    for number in range(1, _MOST_TOOLS + 1):
        values = tool.values if tool is not None and number == 1 else (0.0,) * 6
        x, y, z, w, p, r = (_number(value, 10, 3) for value in values)
        lines.append(
            f"    [{group},{number}] = \n  Group: {group}   Config: N D B, 0, 0, 0\n"
            f"  X:{x}   Y:{y}   Z:{z}\n  W:{w}   P:{p}   R:{r}\n"
        )
    kind = "Storage: SHADOW  Access: RW  : "
    numbers = f"  [{group}] = {controller.tool_number}\n"
    return (
        f"[*SYSTEM*]$MNUTOOL  {kind}ARRAY[{group},{_MOST_TOOLS}] OF POSITION\n{''.join(lines)}\n"
        f"[*SYSTEM*]$MNUTOOLNUM  {kind}ARRAY[{group}] OF BYTE\n{numbers}\n"
    )


_WRITERS: Mapping[File, Callable[[SnpxController, float, Collection[str], str], str]] = {
    File.POSITION: _position,
    File.SIGNALS: _signals,
    File.SAFETY: _safety,
    File.ALARMS: _alarms,
    File.REGISTERS: _registers,
    File.FRAMES: _frames,
}
