"""Conversion of old client programs' units to requests, and of refusals to ERROR numbers. No I/O.

COMMAND words, ABSOLUTE.DEG, RELATIVE.DEG   requests, executed in order, all or none
STATUS, VELOCITY.DEG, TIME, ERROR           no request; together with a target: refused as an echoed state
anything else                               refused
"""

from collections.abc import Sequence

from protocol_gateway.authority.lease_rules import Answer, Authority
from protocol_gateway.seam import Recovery
from protocol_gateway.seam.errors import UnitError
from protocol_gateway.unit_protocol.records import (
    AbsolutePositions,
    Command,
    Error,
    Record,
    RelativePositions,
    Status,
    Time,
    Unknown,
    Velocities,
    speed_percent,
)
from protocol_gateway.unit_protocol.scales import si_scales
from robomesh import reason_codes as codes
from robomesh.schemas.robomesh_pb2 import CommandRequest
from robots.kinematics.joints import Joints

TOO_MANY, MALFORMED, UNKNOWN_WORD, JOINT_COUNT, LIMIT, LOCAL_MODE, READ_ONLY, STOPPED, FAULT = range(1, 10)
_NUMBERS = {
    code.name: number
    for number, those in {
        READ_ONLY: (
            *(codes.LEASE_NONE, codes.LEASE_HELD, codes.LEASE_OTHER, codes.ROBOT_READ_ONLY),
            *(codes.COMMAND_CONTROL_ENDED, codes.COMMAND_CONTROL_ENDED_MEANWHILE),
        ),
        LOCAL_MODE: (codes.CONTROLLER_LOCAL, codes.CONTROLLER_MODE_UNKNOWN),
        STOPPED: (
            *(codes.STOP_LATCHED, codes.STOP_NOT_LATCHED, codes.STOP_OTHER, codes.STOP_MOVING),
            *(codes.CONTROLLER_STOPPED, codes.CONTROLLER_HOLDING, codes.COMMAND_HELD),
        ),
        LIMIT: (codes.SPEED_MISSING, codes.SPEED_OUTSIDE, codes.JOINTS_OUTSIDE),
    }.items()
    for code in those
}

_C = CommandRequest.Command
_WORDS = {
    "trace": _C.TRACE_ON,
    "untrace": _C.TRACE_OFF,
    "home": _C.HOME,
    "hold": _C.HOLD,
    "resume": _C.RESUME,
    "reset": _C.RESET,
}
_RECOVERIES = frozenset(each.value for each in Recovery)
# Limited, because all of them are audited before the first is executed, and other commands wait for that.
_MOST_REQUESTS = 16
# A reset must not clear a stop that was sent while the reset was in transit: its sender has not seen it.
_SEEN_AFTER_S = 1.0


def number_of(answer: Answer) -> int:
    """Return the protocol's ERROR number for a refusal by Control."""
    return FAULT if answer.reason is None else _NUMBERS.get(answer.reason.code, FAULT)


def asks_for_more(records: Sequence[Record]) -> bool:
    """Return whether a unit holds more than stops and a controller's state."""
    return not all(
        set(record.words) == {"stop"}
        if isinstance(record, Command)
        else isinstance(record, Status | Velocities | Time | Error)
        for record in records
    )


def requests_of(records: Sequence[Record], joints: Joints) -> list[CommandRequest] | Error:
    """Convert a commander's unit to requests, without its stops, which were executed before; or an Error.

    The caller fills in the lease, the ids and the stop number of a RESET.
    """
    requests: list[CommandRequest] = []
    scales = si_scales(joints.types)
    for record in records:
        match record:
            case Command(words):
                for word in words:
                    request = _word(word)
                    if isinstance(request, Error):
                        return request
                    requests += [request] if request is not None else []
            case AbsolutePositions(values) | RelativePositions(values):
                if len(values) != len(joints):
                    return Error(JOINT_COUNT, f"{len(values)} values for {len(joints)} joints")
                absolute = isinstance(record, AbsolutePositions)
                requests.append(
                    CommandRequest(
                        command=_C.MOVE_ABSOLUTE if absolute else _C.MOVE_RELATIVE,
                        joint_positions=[value * scale for value, scale in zip(values, scales, strict=True)],
                    )
                )
            case Unknown(type_name):
                return Error(UNKNOWN_WORD, f"unknown type {type_name[:40]}")
    if len(requests) > _MOST_REQUESTS:
        return Error(MALFORMED, f"{len(requests)} commands in one unit, at most {_MOST_REQUESTS} are allowed")
    if requests and any(isinstance(record, Status | Velocities | Time) for record in records):
        # A program that echoes the controller's state must never move the arm.
        return Error(READ_ONLY, "STATUS, VELOCITY.DEG and TIME come from controllers: a state is no command")
    return requests


def _word(word: str) -> CommandRequest | Error | None:
    if word == "stop":
        return None
    if word in _WORDS:
        return CommandRequest(command=_WORDS[word])
    if word == "recover" or word in _RECOVERIES:
        return Error(READ_ONLY, f"{word}: {codes.RECOVER_PROGRAM()}")
    try:
        percent = speed_percent(word)
    except UnitError as error:
        return Error(MALFORMED, f"speed {error}")
    if percent is None:
        known = " ".join([*_WORDS, "stop"])
        return Error(UNKNOWN_WORD, f"unknown word {word[:40]}, known: {known} speed=NN")
    return CommandRequest(command=_C.SPEED, speed_percent=percent)


def stop_to_reset(authority: Authority, asked_s: float) -> int | Error:
    """Return the number of the stop that a `reset` means, which the protocol does not name; 0: none latched.

    Args:
        asked_s: Time at which the unit was received (monotonic).
    """
    stop = authority.stop
    if stop is None:
        return 0
    if stop.sent_s is None or asked_s - stop.sent_s < _SEEN_AFTER_S:
        since = "has just been sent" if stop.sent_s is not None else "has not been sent yet"
        return Error(STOPPED, f"stop request {stop.id} ({stop.by}, {stop.reason}) {since}: reset it later")
    return stop.id
