"""Events that begin and end once, however much a value trembles about its threshold.

A condition begins when it is met, and is over when it has not been near for a while. Pure: what is near
and the time go in, events come out.

Source: ANSI/ISA-18.2 (an alarm asks somebody to act; deadbands and delays against chattering).
"""

from collections.abc import Iterable
from dataclasses import dataclass, field

from robomesh.schemas.robomesh_pb2 import Event

OVER = ".over"


@dataclass(frozen=True, kw_only=True)
class Condition:
    """Something that is so, or nearly: what is further away than its deadband is no condition.

    Attributes:
        key: What it is of, the same each time.
        met: Whether it is so; else it begins nothing, and what has begun is not over.
        code, severity, text: Of the event that it begins with.
        over: Text of the event that it ends with.
        values: Of both events.
        after_s: So long it must be met to begin.
        over_after_s: So long it must not be near to be over.
    """

    key: str
    met: bool
    code: str
    severity: Event.Severity
    text: str
    over: str
    values: tuple[tuple[str, str], ...] = ()
    after_s: float = 0.0
    over_after_s: float = 1.0


@dataclass
class _Standing:
    """A condition that was met.

    Attributes:
        begins_at: When it is told [s].
        over_at: When it is over [s]; None: it is near.
    """

    condition: Condition
    begins_at: float
    begun: bool = False
    over_at: float | None = None


@dataclass
class Alarms:
    """What is so of one robot, as far as it was told."""

    _standing: dict[str, _Standing] = field(default_factory=dict)

    def judge(self, conditions: Iterable[Condition], now_s: float) -> list[Event]:
        """The events of what has begun, and of what is over.

        Args:
            now_s: On a clock that never goes back.
        """
        near = {condition.key: condition for condition in conditions}
        events = []
        for key, condition in near.items():
            standing = self._standing.get(key)
            if standing is None:
                if not condition.met:
                    continue
                standing = self._standing[key] = _Standing(condition, now_s + condition.after_s)
            standing.condition, standing.over_at = condition, None
            if standing.begun:
                continue
            if not condition.met:
                del self._standing[key]
            elif now_s >= standing.begins_at:
                standing.begun = True
                events.append(_event(condition, condition.severity, condition.code, condition.text))
        for key in [key for key in self._standing if key not in near]:
            standing = self._standing[key]
            if standing.over_at is None:
                standing.over_at = now_s + standing.condition.over_after_s
            if not standing.begun or now_s >= standing.over_at:
                del self._standing[key]
                if standing.begun:
                    gone = standing.condition
                    events.append(_event(gone, Event.Severity.INFO, gone.code + OVER, gone.over))
        return events


def _event(condition: Condition, severity: Event.Severity, code: str, text: str) -> Event:
    return Event(severity=severity, code=code, text=text, source="kinematics", values=dict(condition.values))
