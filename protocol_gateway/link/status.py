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


def transition_events(before: LinkStatus, after: LinkStatus) -> list[tuple[Event.Severity, str, str]]:
    """Return severity, code and text of the events that report a change; none if only the text changed."""
    said: list[tuple[Event.Severity, str, str]] = []
    if before.state is not after.state or after.code not in ("", before.code):
        lost = after.state is LinkState.DOWN or before.state is LinkState.UP or after.code
        code = after.code or f"link.{after.state.value}"
        said.append((_S.WARNING if lost else _S.INFO, code, f"link to the controller: {after.text}"))
    if after.flooding and not before.flooding:
        text = "the controller sends too much: only the newest data are published, the rest is counted"
        said.append((_S.WARNING, "link.flooding", text))
    if before.flooding and not after.flooding and after.state is not LinkState.DOWN:
        said.append((_S.INFO, "link.flooding_ended", "the controller no longer sends too much"))
    return said
