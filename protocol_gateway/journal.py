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
_BURST = 5.0
_REFILL_S = 5.0

_LEVELS = {
    Event.Severity.DEBUG: logging.DEBUG,
    Event.Severity.INFO: logging.INFO,
    Event.Severity.WARNING: logging.WARNING,
    Event.Severity.ERROR: logging.ERROR,
    Event.Severity.CRITICAL: logging.CRITICAL,
}


@dataclass
class _Kind:
    """`tokens`: so many more at once, at the time `at_s`."""

    at_s: float
    tokens: float = _BURST
    suppressed: int = 0


class Journal:
    """Says events of one robot on its `events` topic."""

    def __init__(
        self, publisher: Publisher, robot: str, *, monotonic_s: Callable[[], float] = time.monotonic
    ) -> None:
        self._publisher = publisher
        self._robot = robot
        self._monotonic_s = monotonic_s
        self._kinds: dict[str, _Kind] = {}

    def report(
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
        kind.tokens = min(kind.tokens + (now_s - kind.at_s) / _REFILL_S, _BURST)
        kind.at_s = now_s
        if kind.tokens < 1.0:
            kind.suppressed += 1
            return
        kind.tokens -= 1.0
        if kind.suppressed:
            values["left_out"] = kind.suppressed
            text = f"{text} (and {kind.suppressed} more like it before)"
            kind.suppressed = 0
        text = one_line(text, LONGEST_SENTENCE)
        event = Event(severity=severity, code=code, text=text, source="gateway")
        event.timestamp.GetCurrentTime()
        if why is not None:
            event.reason.CopyFrom(reason_message(why))
        for name, value in values.items():
            event.values[name] = one_line(str(value))
        self._publisher.put(event)
        log.log(_LEVELS[severity], "%s: %s", self._robot, text)
