"""Events of a robot's authority: requests, what the controller did, and the end of something.

Requests have results: `StopRequested` a StopAnswer, `LeaseRequested` a LeaseResult, `CommandsRequested` and
`StepRequested` an Answer, `AdmissionRequested` a Verdict.
"""

from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

from protocol_gateway.authority.lease_rules import Answer, Lease, Now
from protocol_gateway.control.effects import Program
from protocol_gateway.drivers.driver import Activity
from robomesh.reasons import Reason
from robomesh.schemas.robomesh_pb2 import CommandRequest, LeaseRequest

_A = LeaseRequest.Action
_HOLD = CommandRequest.Command.HOLD


class LeaseResult(NamedTuple):
    """Result of a lease request; `granted`: the lease for its sender, with its secret."""

    answer: Answer
    granted: Lease | None = None


@dataclass(frozen=True, kw_only=True)
class StopRequested:
    """A client, an old client program or the gateway stops the robot."""

    by: str
    reason: str
    source: str


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
    """An operator commands the robot: all commands as one unit, or none.

    Attributes:
        program: Checked program to start, for RUN_PROGRAM.
        refused: A refusal that is already known, to be audited and returned.
    """

    requests: tuple[CommandRequest, ...]
    operator: str
    source: str
    arrived: Now
    program: Program | None = None
    refused: Answer | None = None

    @property
    def is_immediate(self) -> bool:
        """True if it does not wait for earlier commands: HOLD can only slow the robot down."""
        return all(each.command == _HOLD for each in self.requests)


@dataclass(frozen=True, kw_only=True)
class StepRequested:
    """The program that runs sends its next step."""

    request: CommandRequest
    operator: str
    arrived: Now

    @property
    def is_immediate(self) -> bool:
        """False: a step waits for earlier commands."""
        return False


@dataclass(frozen=True)
class AdmissionRequested:
    """Evaluate whether commands are the holder's, in time and new, and no stop forbids them."""

    requests: tuple[CommandRequest, ...]
    operator: str


@dataclass(frozen=True)
class ProgramEnded:
    """The program that ran has ended; `problem`: reason of an abort at `line`, None: it is done."""

    name: str
    operator: str
    line: int
    problem: Reason | None


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
    | StepRequested
    | AdmissionRequested
    | ProgramEnded
    | TimePassed
    | SessionEnded
    | LeaseEnded
    | LinkLost
    | LinkRestored
    | StatusChanged
    | StatusReported
    | UnitRefused
    | MotionObserved
)
