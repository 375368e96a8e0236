"""Decisions of a robot's authority, performed by `execution.control`.

    decision                              result
    ------------------------------------  ---------------------------------------------------
    Send                                  reason of a failure, or None
    Recheck                               reason for a change, or None
    EnterCell, CheckMotion, Append        awaited: Snapshot; CheckVerdict; (reason or None, Snapshot)
    NumberStop                            number of the stop; None: the next one
    CancelPrograms                        whether a program was cancelled
    AppendLater, KeepLatch,               none
      PublishState, PublishEvent,
      SetTimer, Controlled

If a decision of the last three rows fails, that is logged, and the next one is performed.
Only commands and lease requests may yield an awaited decision. A stop yields none.
"""

from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias, TypeVar

from protocol_gateway.authority.audit_entry import Entry
from protocol_gateway.authority.lease_rules import Answer, LatchedStop, Now
from protocol_gateway.authority.preconditions import ControllerState
from protocol_gateway.checking.worker_messages import Positions
from robomesh.reasons import Reason
from robomesh.schemas.robomesh_pb2 import CommandRequest, Event


@dataclass(frozen=True, kw_only=True)
class Snapshot:
    """Present time and state of the controller.

    Attributes:
        latch_problem: Reason why a restart would lose a stop now; None: it would not.
        closed: Reason why the robot may not be controlled or moved now, whatever its state; None: it may.
    """

    now: Now
    controller: ControllerState
    latch_problem: Reason | None = None
    closed: Reason | None = None


@dataclass(frozen=True, kw_only=True)
class CheckVerdict:
    """Refusal or permission of commands by their check, with its conditions.

    Attributes:
        refusal: Refusal of the commands; None: they may be sent.
        warning: Warning about them; None: no warning.
        code: Code of the warning's event. "check.warning": something is close; "check.failed": a failure that
            "require" refuses; "check.skipped": something was not checked.
        start: Positions at which the robot must still be when the commands are sent; None: anywhere.
        others: Paths of the other robots, which must still be valid; None: not required.
    """

    refusal: Answer | None = None
    warning: Reason | None = None
    code: str = "check.warning"
    start: Positions | None = None
    others: Mapping[str, tuple[Positions, ...]] | None = None

    @property
    def is_violation(self) -> bool:
        """True if the policy "require" would have refused the commands."""
        return self.code != "check.warning"


@dataclass(frozen=True, kw_only=True)
class PlannedProgram:
    """A planned and checked program, or a jog, ready to run.

    Attributes:
        targets: Its targets in order [rad] or [m].
        start: Positions at which the robot must rest when it starts; None: anywhere.
        is_jog: A jog, whose targets are planned while it runs.
    """

    name: str
    targets: tuple[Positions, ...]
    start: Positions | None = None
    is_jog: bool = False


@dataclass(frozen=True)
class Send:
    """Write a unit to the controller's socket now.

    Attributes:
        urgent: It is a stop, which must be latched and audited whatever happens to its unit.
    """

    unit: object
    urgent: bool = False


@dataclass(frozen=True)
class Append:
    """Write audit entries, and continue when they are on disk."""

    entries: tuple[Entry, ...]


@dataclass(frozen=True)
class AppendLater:
    """Write an audit entry, without waiting for the disk."""

    entry: Entry


@dataclass(frozen=True)
class NumberStop:
    """Return the number of the next stop, above `last`."""

    last: int


@dataclass(frozen=True)
class KeepLatch:
    """Write the latched stop and the newest number to the latch file soon."""

    stop: LatchedStop | None
    last_stop_id: int


@dataclass(frozen=True)
class PublishState:
    """Publish the state of lease, stop and program."""


@dataclass(frozen=True)
class ConfirmSetUp:
    """Take tool, payload and frame as they are now for right."""


@dataclass(frozen=True)
class PublishEvent:
    """Publish an event."""

    severity: Event.Severity
    code: str
    text: str
    why: Reason | None = None
    values: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True)
class SetTimer:
    """Hand over `TimePassed` at a monotonic time [s]; None: clear the timer."""

    at_s: float | None


@dataclass(frozen=True)
class Controlled:
    """Notify the driver of the begin of control by an operator, also after another one, or of its end."""

    taken: bool


@dataclass(frozen=True)
class EnterCell:
    """Wait until no other robot of the cell has a motion checked, if these commands move the robot."""

    requests: Sequence[CommandRequest]


@dataclass(frozen=True)
class CheckMotion:
    """Check the motions of commands against the present state of the cell."""

    requests: Sequence[CommandRequest]


@dataclass(frozen=True)
class Recheck:
    """Return the reason if the robot or its cell has changed since a check; None: unchanged."""

    check_verdict: CheckVerdict


@dataclass(frozen=True)
class CancelPrograms:
    """Cancel the programs that have not started."""

    why: Reason


Decision: TypeAlias = (
    Send
    | Append
    | AppendLater
    | NumberStop
    | KeepLatch
    | PublishState
    | ConfirmSetUp
    | PublishEvent
    | SetTimer
    | Controlled
    | EnterCell
    | CheckMotion
    | Recheck
    | CancelPrograms
)

R = TypeVar("R")
Decisions: TypeAlias = Generator[Decision, Any, R]
