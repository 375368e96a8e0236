"""Signals that the answers give, by the names that all drivers share (docs/signals.md)."""

from collections.abc import Sequence
from math import radians

from controllers.yaskawa.data import HELD, Job, Position, Status, Status1, Status2
from protocol_gateway.driver_parts.signal_names import numbered, of_placement
from protocol_gateway.seam import Signal, SignalsReceived, SignalValue
from robots.schema.poses import rotation_vector, rpy_rotation

_SERVO = Signal("robot.servo")
_MODE = Signal("robot.mode")
_STATE = Signal("program.state")
_CYCLE = Signal("program.cycle")
_ERROR = Signal("hses.error")
_TOOL = Signal("tool.number")
_POSE = of_placement("tool.pose")
_NAME, _LINE, _STEP = Signal("program.name"), Signal("program.line"), Signal("program.step")
_OVERRIDE = Signal("speed.override", "%")

_MODES = ((Status1.REMOTE, "remote"), (Status1.TEACH, "teach"), (Status1.PLAY, "play"))
_CYCLES = (
    (Status1.STEP, "step"),
    (Status1.ONE_CYCLE, "one cycle"),
    (Status1.CONTINUOUS, "continuous"),
)
# First group and number of groups of the user's inputs and outputs.
_USER = (("io.digital_in", 1, 512), ("io.digital_out", 1001, 512))


def of_status(status: Status) -> SignalsReceived:
    """Return the signals of a status."""
    first, second = status.first, status.second
    state = "held" if second & HELD else "running" if first & Status1.RUNNING else "stopped"
    return SignalsReceived(
        (
            (_SERVO, bool(second & Status2.SERVO_ON)),
            (_MODE, next((name for bit, name in _MODES if first & bit), None)),
            (_STATE, state),
            (_CYCLE, next((name for bit, name in _CYCLES if first & bit), None)),
            (_ERROR, bool(second & Status2.ERROR)),
        )
    )


def of_position(position: Position) -> SignalsReceived:
    """Return the signals of a position."""
    return SignalsReceived(((_TOOL, position.tool),))


def of_pose(position: Position) -> SignalsReceived:
    """Return the signals of a tool's pose in the robot's frame."""
    x, y, z, *angles = position.axes[:6]
    turned = rpy_rotation(*(radians(each * 1e-4) for each in angles))
    values = (x * 1e-6, y * 1e-6, z * 1e-6, *rotation_vector(turned).tolist())
    return SignalsReceived([(_TOOL, position.tool), *zip(_POSE, values, strict=True)])


def of_job(job: Job) -> SignalsReceived:
    """Return the signals of a job."""
    return SignalsReceived(
        (
            (_NAME, job.name or None),
            (_LINE, job.line),
            (_STEP, job.step),
            (_OVERRIDE, job.speed_override / 100),
        )
    )


def of_torques(signals: Sequence[Signal], used: Sequence[int], torques: Sequence[int]) -> SignalsReceived:
    """Return the load of each joint.

    Args:
        signals: One a joint.
        used: Axis of each joint, from 0.
        torques: Of all axes [% of the rated torque].
    """
    values: list[tuple[Signal, SignalValue | None]] = [
        (signal, torques[axis] if axis < len(torques) else None)
        for signal, axis in zip(signals, used, strict=True)
    ]
    return SignalsReceived(values)


def io_signals(group: int) -> tuple[Signal, ...]:
    """Return the signals of a group of eight, the lowest bit first.

    User inputs and outputs have the numbers of a job, IN#(1) and OUT#(1); others their logical number.
    """
    for name, first, count in _USER:
        if first <= group < first + count:
            number = (group - first) * 8 + 1
            return numbered(name, range(number, number + 8))
    return numbered("hses.io", range(group * 10, group * 10 + 8))
