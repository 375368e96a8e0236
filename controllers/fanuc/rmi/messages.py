"""Messages of RMI, FANUC's Remote Motion Interface (B-84184EN/03): one JSON object a line. No I/O, no state.

The driver has these messages and no other: it can neither reset errors, nor set the override, frames, tools,
registers or outputs, nor call a program.
"""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from controllers.fanuc.data import AXES
from protocol_gateway.seam.errors import CommandError
from robomesh import bounded_json

PORT = 16001
"""Port of `FRC_Connect`; its answer names the port of the session."""
END = b"\r\n"
LONGEST_LINE = 4096
FIRST_SEQUENCE = 1
"""Number of the first instruction after each `FRC_Initialize`."""
WAIT_FOR_COMMAND = 2556955
"""RMIT-027: an earlier command is not answered yet."""
NOT_RUNNING = frozenset({2556937, 2556942, 2556943})
"""RMIT-009, 014 and 015: answers to `FRC_Abort` while RMI_MOVE does not run."""
_NAMES = {
    2556934: "RMIT-006 Cannot execute TP program",
    2556935: "RMIT-007 Controller servo is off",
    2556936: "RMIT-008 Teach pendant is enabled",
    2556937: "RMIT-009 RMI is not running",
    2556942: "RMIT-014 RMI command failed",
    2556943: "RMIT-015 Invalid controller state",
    2556944: "RMIT-016 Please cycle power",
    2556951: "RMIT-023 Invalid position data",
    2556952: "RMIT-024 RMI is in HOLD state",
    2556954: "RMIT-026 Robot is already connected",
    2556955: "RMIT-027 Wait for command done",
    2556956: "RMIT-028 Wait for instruction done",
    2556957: "RMIT-029 Invalid sequence ID number",
    2556959: "RMIT-031 Invalid speed value",
    2556964: "RMIT-036 Invalid destination position",
    2556968: "RMIT-040 Invalid group mask",
    2556971: "RMIT-043 Robot in single step mode",
    2556977: "RMIT-049 Invalid instruction packet",
    7004: "MEMO-004 Specified program is in use",
    7015: "MEMO-015 Program already exists",
}
_LARGEST = 2**31 - 1


class Kind(StrEnum):
    """Key of a message's name."""

    COMMUNICATION = "Communication"
    COMMAND = "Command"
    INSTRUCTION = "Instruction"


CONNECT, DISCONNECT, TERMINATE = "FRC_Connect", "FRC_Disconnect", "FRC_Terminate"
SYSTEM_FAULT, INITIALIZE, ABORT, JOINT_MOTION = (
    "FRC_SystemFault",
    "FRC_Initialize",
    "FRC_Abort",
    "FRC_JointMotionJRep",
)
_KINDS = {
    CONNECT: Kind.COMMUNICATION,
    DISCONNECT: Kind.COMMUNICATION,
    TERMINATE: Kind.COMMUNICATION,
    SYSTEM_FAULT: Kind.COMMUNICATION,
    INITIALIZE: Kind.COMMAND,
    ABORT: Kind.COMMAND,
    JOINT_MOTION: Kind.INSTRUCTION,
}
# The controller sends these without a question, and without an error number.
_UNASKED = frozenset({TERMINATE, SYSTEM_FAULT})


def connect() -> bytes:
    """Return the only message that is sent to `PORT`."""
    return _line(CONNECT)


def disconnect() -> bytes:
    """Return the last message of a session."""
    return _line(DISCONNECT)


def initialize(group: int) -> bytes:
    """Return the message that creates and starts the program RMI_MOVE.

    Args:
        group: Number of the motion group, 1 to 8.
    """
    return _line(INITIALIZE, GroupMask=1 << (group - 1))


def abort() -> bytes:
    """Return the message that ends RMI_MOVE and discards its instructions."""
    return _line(ABORT)


def joint_motion(sequence: int, axes: Sequence[float], *, percent: int) -> bytes:
    """Return the instruction of a joint motion to absolute values, without blending.

    Args:
        axes: Nine values [degree] or [mm].
        percent: Speed in percent of the arm's greatest, 1 to 100.

    Raises:
        CommandError: If a value is not finite.
    """
    if len(axes) != AXES or not all(map(math.isfinite, axes)):
        raise CommandError("numbers must be finite")
    return _line(
        JOINT_MOTION,
        SequenceID=sequence,
        JointAngle={f"J{number}": value for number, value in enumerate(axes, 1)},
        SpeedType="Percent",
        Speed=percent,
        TermType="FINE",
        TermValue=0,
    )


def _line(name: str, **values: object) -> bytes:
    # The manual asks for the kind as the first key.
    return json.dumps({_KINDS[name].value: name, **values}, allow_nan=False).encode() + END


@dataclass(frozen=True, slots=True)
class Answer:
    """A message of the controller.

    Attributes:
        name: Such as FRC_Abort.
        error: 0: done. Messages without a question have none, which is 0.
        sequence: Number of the instruction; 0: the message has none.
        port: Port of the session, in the answer to `FRC_Connect` without an error; otherwise 0.
        version: The protocol's major version there; otherwise 0.
    """

    name: str
    error: int = 0
    sequence: int = 0
    port: int = 0
    version: int = 0

    @property
    def problem(self) -> str:
        """The error in words."""
        return _NAMES.get(self.error, f"error {self.error}")


def read(line: bytes) -> Answer:
    """Read a line without its end.

    Raises:
        ValueError: If it is not a message that the driver knows.
    """
    try:
        found = bounded_json.loads(
            line.decode("ascii"), object_pairs_hook=_pairs, parse_constant=_no_constant
        )
    except RecursionError:
        raise ValueError("the text is nested too deeply") from None
    if not isinstance(found, dict):
        raise ValueError("the text is not an object")
    # In a manual's answer it is the first key; a simulator of others sends it anywhere.
    kinds = [each for each in Kind if each in found]
    name = found[kinds[0]] if len(kinds) == 1 else None
    if not isinstance(name, str) or _KINDS.get(name) != kinds[0]:
        raise ValueError("the text is not a known message")
    if name in _UNASKED:
        sequence = _integer(found, "SequenceID", 0, _LARGEST) if "SequenceID" in found else 0
        return Answer(name, sequence=sequence)
    error = _integer(found, "ErrorID", 0, _LARGEST)
    if name == CONNECT and error == 0:
        return Answer(
            name,
            port=_integer(found, "PortNumber", 1, 65535),
            version=_integer(found, "MajorVersion", 1, 32767),
        )
    if name == JOINT_MOTION:
        return Answer(name, error, _integer(found, "SequenceID", FIRST_SEQUENCE, _LARGEST))
    return Answer(name, error)


def _pairs(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) != len(pairs):
        raise ValueError("a key occurs twice")
    return found


def _no_constant(name: str) -> float:
    raise ValueError(f"{name} is not a number")


def _integer(found: dict[str, Any], key: str, least: int, most: int) -> int:
    value = found.get(key)
    if type(value) is not int or not least <= value <= most:
        raise ValueError(f"{key} is not a number from {least} to {most}")
    return value


class LineStream:
    """Lines in the bytes of one connection, split anywhere.

    Attributes:
        broken: A line is too long; nothing more can be read.
    """

    def __init__(self) -> None:
        self._rest = b""
        self.broken = False

    def receive(self, data: bytes) -> list[bytes]:
        """Return the lines that are complete now, without their ends; empty ones are left out."""
        if self.broken:
            return []
        *lines, self._rest = (self._rest + data).split(END)
        self.broken = len(self._rest) > LONGEST_LINE or any(len(each) > LONGEST_LINE for each in lines)
        if self.broken:
            self._rest = b""
            lines = [each for each in lines if len(each) <= LONGEST_LINE]
        # Manuals show a space before the end of a line.
        return [each.strip(b" ") for each in lines if each.strip(b" ")]
