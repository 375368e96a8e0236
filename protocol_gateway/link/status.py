"""State of a link in words, and what is said when it changes. No I/O."""

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
    """State of the link, and why.

    Attributes:
        code: Of the event that says so; empty: `link.down`, `link.up` or `link.silent`.
        flooding: More comes than is taken.
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
    """Severity, code and text of the events that tell a change; none where only words changed."""
    said: list[tuple[Event.Severity, str, str]] = []
    if before.state is not after.state or after.code not in ("", before.code):
        lost = after.state is LinkState.DOWN or before.state is LinkState.UP or after.code
        code = after.code or f"link.{after.state.value}"
        said.append((_S.WARNING if lost else _S.INFO, code, f"link to the controller: {after.text}"))
    if after.flooding and not before.flooding:
        text = "the controller sends far too much: only the newest of it is published, the rest is counted"
        said.append((_S.WARNING, "link.flooding", text))
    if before.flooding and not after.flooding and after.state is not LinkState.DOWN:
        said.append((_S.INFO, "link.flooding_ended", "the controller does not send too much any more"))
    return said
