"""A robot's events, on the mesh and in the log: each kind at a limited rate, the rest counted."""

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass

from protocol_gateway.foreign_text import LONGEST_SENTENCE, one_line
from robomesh.messages import reason_message
from robomesh.publisher import Publisher
from robomesh.reasons import Reason
from robomesh.schemas.robomesh_pb2 import Event

log = logging.getLogger(__name__)

# A controller that sends rubbish must fill neither logs nor the hundred events that a late joiner is told:
# so many of a kind at once, then one in so long.
_AT_ONCE = 5.0
_THEN_EACH_S = 5.0

_LEVELS = {
    Event.Severity.DEBUG: logging.DEBUG,
    Event.Severity.INFO: logging.INFO,
    Event.Severity.WARNING: logging.WARNING,
    Event.Severity.ERROR: logging.ERROR,
    Event.Severity.CRITICAL: logging.CRITICAL,
}


@dataclass
class _Kind:
    """`may_say`: so many more at once, at the time `at_s`."""

    at_s: float
    may_say: float = _AT_ONCE
    left_out: int = 0


class Journal:
    """Says events of one robot on its `events` topic."""

    def __init__(
        self, publisher: Publisher, robot: str, *, monotonic_s: Callable[[], float] = time.monotonic
    ) -> None:
        self._publisher = publisher
        self._robot = robot
        self._monotonic_s = monotonic_s
        self._kinds: dict[str, _Kind] = {}

    def say(
        self,
        severity: Event.Severity,
        code: str,
        text: str,
        *,
        why: Reason | None = None,
        **values: object,
    ) -> None:
        """Publish an event; of many of one code one each 5 s, which counts the others.

        Args:
            code: Stable, for programs: "unit.malformed".
            text: For people.
            why: The reason that the text holds.
        """
        now_s = self._monotonic_s()
        kind = self._kinds.setdefault(code, _Kind(now_s))
        kind.may_say = min(kind.may_say + (now_s - kind.at_s) / _THEN_EACH_S, _AT_ONCE)
        kind.at_s = now_s
        if kind.may_say < 1.0:
            kind.left_out += 1
            return
        kind.may_say -= 1.0
        if kind.left_out:
            values["left_out"] = kind.left_out
            text = f"{text} (and {kind.left_out} more like it before)"
            kind.left_out = 0
        text = one_line(text, LONGEST_SENTENCE)
        event = Event(severity=severity, code=code, text=text, source="gateway")
        event.timestamp.GetCurrentTime()
        if why is not None:
            event.reason.CopyFrom(reason_message(why))
        for name, value in values.items():
            event.values[name] = one_line(str(value))
        self._publisher.put(event)
        log.log(_LEVELS[severity], "%s: %s", self._robot, text)
