"""State of a link, and the events of its changes. No I/O."""

from dataclasses import dataclass
from enum import Enum

from robomesh.reasons import Reason
from robomesh.schemas.robomesh_pb2 import Event

_S = Event.Severity


class LinkState(Enum):
    """State of the link, as in `robomesh.ControllerState.Link`."""

    DOWN = "down"
    UP = "up"
    SILENT = "silent"


@dataclass(frozen=True, slots=True)
class LinkStatus:
    """State of the link, with its reason.

    Attributes:
        code: Code of the event that reports it; empty: `link.down`, `link.up` or `link.silent`.
        flooding: The controller sends more than the gateway publishes.
    """

    state: LinkState
    reason: Reason
    code: str = ""
    flooding: bool = False

    @property
    def text(self) -> str:
        """The reason's sentence."""
        return self.reason.text


@dataclass(frozen=True)
class TransitionEvent:
    """An event that reports a change of the link.

    Attributes:
        reason: The reason in the text, if it has one.
    """

    severity: Event.Severity
    code: str
    text: str
    reason: Reason | None = None


def transition_events(before: LinkStatus, after: LinkStatus) -> list[TransitionEvent]:
    """Return the events that report a change; none if only the text changed."""
    said: list[TransitionEvent] = []
    if before.state is not after.state or after.code not in ("", before.code):
        lost = after.state is LinkState.DOWN or before.state is LinkState.UP or after.code
        code = after.code or f"link.{after.state.value}"
        severity = _S.WARNING if lost else _S.INFO
        said.append(TransitionEvent(severity, code, f"link to the controller: {after.text}", after.reason))
    if after.flooding and not before.flooding:
        text = "the controller sends too much: only the newest data are published, the rest is counted"
        said.append(TransitionEvent(_S.WARNING, "link.flooding", text))
    if before.flooding and not after.flooding and after.state is not LinkState.DOWN:
        text = "the controller no longer sends too much"
        said.append(TransitionEvent(_S.INFO, "link.flooding_ended", text))
    return said
