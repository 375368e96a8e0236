"""Events of a robot's authority: requests, what the controller did, and the end of something.

Requests have results: `StopRequested` a StopResult, `LeaseRequested` a LeaseResult, `CommandsRequested` an
Answer.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import degrees
from typing import NamedTuple, TypeAlias

from protocol_gateway.authority.decisions import CheckVerdict, PlannedProgram
from protocol_gateway.authority.lease_rules import MOTION_COMMANDS, Answer, Lease, Now
from protocol_gateway.seam import Activity
from robomesh import reason_codes as codes
from robomesh.contract.enum_names import enum_name
from robomesh.reasons import Reason
from robomesh.schemas.robomesh_pb2 import CommandRequest, LeaseRequest

_A = LeaseRequest.Action
_C = CommandRequest.Command


class StopResult(NamedTuple):
    """Result of a stop; `id`: its number, 0 if it is not latched; `sent`: its unit is on the wire."""

    reason: Reason
    id: int = 0
    sent: bool = False


class LeaseResult(NamedTuple):
    """Result of a lease request; `granted`: the lease for its sender, with its secret."""

    answer: Answer
    granted: Lease | None = None


@dataclass(frozen=True, kw_only=True)
class StopRequested:
    """A client, an old client program or the gateway stops the robot.

    Attributes:
        reason: The gateway's has a code.
        page: Values of the audit entry that the sender's page reports.
    """

    by: str
    reason: str | Reason
    source: str
    page: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class LeaseRequested:
    """An operator requests, renews, hands over or releases control.

    Attributes:
        secret: New secret for the lease, if one is granted.
    """

    request: LeaseRequest
    operator: str
    source: str
    secret: str

    @property
    def is_immediate(self) -> bool:
        """True if it is applied before its audit entry is on disk: it moves nothing, or is urgent."""
        return self.request.action in (_A.RENEW, _A.RELEASE, _A.ASK)


@dataclass(frozen=True, kw_only=True)
class CommandsRequested:
    """An operator, or the program that runs, commands the robot: all commands as one unit, or none.

    Attributes:
        program: Checked program to start, for RUN_PROGRAM.
        refused: A refusal that is already known, to be audited and returned.
        step: The command is the next step of the program that runs, so it has no id.
        held_up: It may have arrived while the gateway did not run.
    """

    requests: tuple[CommandRequest, ...]
    operator: str
    source: str
    arrived: Now
    program: PlannedProgram | None = None
    refused: Answer | None = None
    step: bool = False
    held_up: bool = False

    @property
    def is_immediate(self) -> bool:
        """True if it does not wait for earlier commands: HOLD can only slow the robot down."""
        return not self.step and all(each.command == _C.HOLD for each in self.requests)

    @property
    def moves(self) -> bool:
        """True if a command moves the robot."""
        return any(each.command in MOTION_COMMANDS for each in self.requests)

    @property
    def names(self) -> str:
        """Names of the commands."""
        return ", ".join(enum_name(_C, each.command) for each in self.requests)


@dataclass(frozen=True, kw_only=True)
class JogPartReady:
    """The next part of the jog that runs is planned and checked; its result: why it was not sent, or None.

    Attributes:
        secret: Secret of the lease under which it runs.
        target: [rad] or [m].
    """

    operator: str
    secret: str
    target: tuple[float, ...]
    percent: float
    check_verdict: CheckVerdict


@dataclass(frozen=True)
class JogEnding:
    """The jog that runs must end now.

    Attributes:
        hold: Hold the robot; False: it rests at the end of its line.
    """

    why: Reason
    hold: bool = True


@dataclass(frozen=True)
class JogHeld:
    """The robot rests at the end of a jog: give the rest up, and set the operator's speed again.

    Attributes:
        percent: Speed before the jog; None: unknown.
    """

    percent: float | None


@dataclass(frozen=True, kw_only=True)
class JogEnded:
    """The jog that ran has ended, and the robot rests, as far as is known.

    Attributes:
        moved: [m], or [rad] if `rotary`.
        failed: It was not the operator who ended it, nor the end of the line.
    """

    name: str
    operator: str
    moved: float
    rotary: bool
    duration_s: float
    keep_alives: int
    why: Reason
    failed: bool

    @property
    def distance(self) -> str:
        """Distance for people."""
        return f"{degrees(self.moved):.2f}°" if self.rotary else f"{self.moved * 1000:.1f} mm"

    @property
    def outcome(self) -> Reason:
        """Reason of the end."""
        return codes.JOG_ENDED(self.why, name=self.name, distance=self.distance)


@dataclass(frozen=True)
class ProgramEnded:
    """The program that ran has ended; `problem`: reason of an abort at `line`, None: it is done."""

    name: str
    operator: str
    line: int
    problem: Reason | None

    @property
    def outcome(self) -> Reason:
        """End of it."""
        if self.problem is None:
            return codes.PROGRAM_DONE(program=self.name)
        return codes.PROGRAM_ENDED(self.problem, program=self.name, line=self.line)


@dataclass(frozen=True)
class TimePassed:
    """The timer has expired, or the regular poll is due."""


@dataclass(frozen=True)
class SessionEnded:
    """The session of a program or page has ended."""

    session: str


@dataclass(frozen=True)
class LeaseEnded:
    """The gateway ends the lease, if there is one."""

    why: Reason


@dataclass(frozen=True)
class LinkLost:
    """The link to the controller is lost or silent."""

    why: str


@dataclass(frozen=True)
class LinkRestored:
    """Units can be sent again."""


@dataclass(frozen=True)
class FateUnknown:
    """The driver does not know what became of a motion, or what the arm does now."""

    why: Reason


@dataclass(frozen=True)
class StatusChanged:
    """The controller's status has changed: after it, a stop or fault is not the one that was reset."""


@dataclass(frozen=True)
class StatusReported:
    """The controller sent a status unit.

    Attributes:
        dated_s: The older time stamp of the unit and the newest positions (monotonic).
    """

    activity: Activity | None
    dated_s: float


@dataclass(frozen=True)
class UnitRefused:
    """The controller refused a unit."""


@dataclass(frozen=True)
class MotionObserved:
    """The robot moves, or rests; several times a second."""

    moving: bool


Event: TypeAlias = (
    StopRequested
    | LeaseRequested
    | CommandsRequested
    | JogPartReady
    | JogEnding
    | JogHeld
    | JogEnded
    | ProgramEnded
    | TimePassed
    | SessionEnded
    | LeaseEnded
    | LinkLost
    | LinkRestored
    | FateUnknown
    | StatusChanged
    | StatusReported
    | UnitRefused
    | MotionObserved
)
