"""A robot's events, published and logged: each kind at a limited rate, the rest counted."""

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass

from protocol_gateway.seam.text_limits import LONGEST_SENTENCE
from robomesh.contract.messages import reason_message
from robomesh.publications.publisher import Publisher
from robomesh.reasons import Reason
from robomesh.schemas.robomesh_pb2 import Event
from robomesh.texts import one_line

log = logging.getLogger(__name__)

# A controller that sends rubbish must fill neither the log nor the hundred events that a late joiner gets.
# Token bucket for each kind: a burst of 5, then one each 5 s.
_BURST = 5.0
_REFILL_S = 5.0
_MOST_APART = 16

_LEVELS = {
    Event.Severity.DEBUG: logging.DEBUG,
    Event.Severity.INFO: logging.INFO,
    Event.Severity.WARNING: logging.WARNING,
    Event.Severity.ERROR: logging.ERROR,
    Event.Severity.CRITICAL: logging.CRITICAL,
}


@dataclass
class _Kind:
    """Token bucket of one kind of event: `tokens` at the time `at_s`."""

    at_s: float
    tokens: float = _BURST
    suppressed: int = 0


class Journal:
    """Reporter of one robot's events, on its `events` topic."""

    def __init__(
        self, publisher: Publisher, robot: str, *, monotonic_s: Callable[[], float] = time.monotonic
    ) -> None:
        self._publisher = publisher
        self._robot = robot
        self._monotonic_s = monotonic_s
        self._kinds: dict[tuple[str, str], _Kind] = {}

    def report(
        self,
        severity: Event.Severity,
        code: str,
        text: str,
        *,
        apart: object = "",
        why: Reason | None = None,
        **values: object,
    ) -> None:
        """Publish an event; of a flood of one kind, publish one each 5 s with the count of the others.

        Args:
            code: Stable code for programs: "unit.malformed".
            text: Sentence for people.
            apart: Events of one code with another value are another kind: 16 such kinds at a time.
            why: The reason that the text contains.
            values: Further values of the event.
        """
        now_s = self._monotonic_s()
        kind = self._kind(code, str(apart), now_s)
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

    def _kind(self, code: str, apart: str, now_s: float) -> _Kind:
        if apart and (code, apart) not in self._kinds:
            full_again_s = now_s - _BURST * _REFILL_S
            self._kinds = {
                key: kind for key, kind in self._kinds.items() if kind.at_s > full_again_s or kind.suppressed
            }
            if sum(bool(other) for _, other in self._kinds) >= _MOST_APART:
                apart = ""
        return self._kinds.setdefault((code, apart), _Kind(now_s))
