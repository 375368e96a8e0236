"""Status and signals that the files give, by the names that all drivers share (docs/signals.md)."""

from collections.abc import Collection, Mapping, Sequence

from controllers.fanuc.axes import SignalBits
from controllers.fanuc.driver import activity_of, mode_of
from controllers.fanuc.ftp.files import FilePosition, Tools, values_of
from controllers.fanuc.signals import FRAME, OFFSET, POSE, TOOL, Operator, of_frame, register
from protocol_gateway.seam import (
    Activity,
    Mode,
    Signal,
    SignalsReceived,
    SignalValue,
    StatusReceived,
    homed_by_nature,
)

_CONFIGURATION = Signal("fanuc_ftp.configuration")
_SERVO = Signal("robot.servo")
_EMERGENCY = Signal("safety.emergency_stop")
_SAFEGUARD = Signal("safety.safeguard_stop")
_ENABLING = Signal("safety.enabling_device")
_EMERGENCY_STOPS = ("External ESTOP", "SOP Estop", "TP ESTOP")
# Without one of these outputs, the activity is not known.
_OF_ACTIVITY = (
    *(Operator.SYSTEM_READY, Operator.PROGRAM_RUNNING, Operator.PAUSED, Operator.HELD, Operator.FAULT),
    Operator.PENDANT_ENABLED,
)


def of_position(position: FilePosition, valid_for_s: float) -> SignalsReceived:
    """Return the signals of a position."""
    configuration = None if position.place is None else position.place.configuration or None
    values: list[tuple[Signal, SignalValue | None]] = [
        *of_frame(POSE, position.place),
        (_CONFIGURATION, configuration),
        (FRAME, position.frame),
        (TOOL, position.tool),
    ]
    return SignalsReceived(values, valid_for_s=valid_for_s)


def of_tools(tools: Tools, listed: Collection[int], valid_for_s: float) -> SignalsReceived:
    """Return the active tool's frame in that of the flange; tool 0 is the flange itself.

    Args:
        listed: Numbers of the tools that the site file names.
    """
    if tools.active == 0:
        return SignalsReceived([(each, 0.0) for each in OFFSET], valid_for_s=valid_for_s)
    frame = tools.frames.get(tools.active) if tools.active in listed and tools.active is not None else None
    return SignalsReceived(of_frame(OFFSET, frame), valid_for_s=valid_for_s)


def unknown_tool() -> SignalsReceived:
    """Return that the active tool's frame is not known."""
    return SignalsReceived(of_frame(OFFSET, None))


def status_of(known: Mapping[tuple[str, int], bool]) -> StatusReceived:
    """Return the status by the operator panel's outputs; those that are not assigned are not in the file."""
    bits = sum(1 << each for each in Operator if known.get(("UO", each + 1)))

    def has(output: Operator) -> bool:
        return ("UO", output + 1) in known

    whole = all(map(has, _OF_ACTIVITY))
    fault = Activity.FAULT if known.get(("UO", Operator.FAULT + 1)) else None
    mode = mode_of(bits) if has(Operator.PENDANT_ENABLED) and has(Operator.COMMANDS_ENABLED) else None
    local = Mode.LOCAL if known.get(("UO", Operator.PENDANT_ENABLED + 1)) else None
    if not any(kind == "UO" for kind, _ in known):
        return StatusReceived()
    activity = activity_of(bits) if whole else fault
    return StatusReceived(activity, mode or local, homed_by_nature(activity))


def of_inputs_and_outputs(
    known: Mapping[tuple[str, int], bool],
    declared: Mapping[SignalBits, Sequence[Signal]],
    valid_for_s: float,
) -> SignalsReceived:
    """Return the inputs and outputs that the site file names."""
    values: list[tuple[Signal, SignalValue | None]] = [(_SERVO, known.get(("UO", Operator.SYSTEM_READY + 1)))]
    for bits, names in declared.items():
        values += zip(names, values_of(bits, known), strict=True)
    return SignalsReceived(values, valid_for_s=valid_for_s)


def of_safety(known: Mapping[str, bool], valid_for_s: float) -> SignalsReceived:
    """Return the stop signals."""
    stops = [known[name] for name in _EMERGENCY_STOPS if name in known]
    # "TP Deadman" is true while it is released, and says nothing while the pendant is off.
    pendant, released = known.get("TP Enable"), known.get("TP Deadman")
    values: list[tuple[Signal, SignalValue | None]] = [
        (_EMERGENCY, any(stops) if stops else None),
        (_SAFEGUARD, known.get("Fence Open")),
        (_ENABLING, None if not pendant or released is None else not released),
    ]
    return SignalsReceived(values, valid_for_s=valid_for_s)


def of_registers(
    known: Mapping[int, float | None], numbers: Sequence[int], valid_for_s: float
) -> SignalsReceived:
    """Return the registers that the site file names."""
    return SignalsReceived([(register(each), known.get(each)) for each in numbers], valid_for_s=valid_for_s)
