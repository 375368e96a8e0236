"""Alarm state machine: one begin event and one end event a condition, without chattering.

A condition begins when it is active, and is over when it has left its deadband for a while. Pure: conditions
and the time go in, events come out.

Source: ANSI/ISA-18.2 (an alarm requires an operator's response; deadbands and delays prevent chattering).
"""

from collections.abc import Iterable
from dataclasses import dataclass, field

from robomesh.schemas.robomesh_pb2 import Event

OVER = ".over"


@dataclass(frozen=True, kw_only=True)
class Condition:
    """A condition that is active or within its deadband; callers leave out conditions beyond the deadband.

    Attributes:
        key: Stable identity of the condition.
        active: True beyond the threshold; False within the deadband, where it neither begins nor ends.
        code, severity, text: Fields of the begin event.
        over: Text of the end event.
        values: Values of both events.
        after_s: Time that it must be active before it begins.
        over_after_s: Time that it must be absent before it is over.
    """

    key: str
    active: bool
    code: str
    severity: Event.Severity
    text: str
    over: str
    values: tuple[tuple[str, str], ...] = ()
    after_s: float = 0.0
    over_after_s: float = 1.0


@dataclass
class _Tracked:
    """A condition that was active.

    Attributes:
        begins_at: Time at which its begin event is due [s].
        over_at: Time at which it is over [s]; None while it is present.
    """

    condition: Condition
    begins_at: float
    begun: bool = False
    over_at: float | None = None


@dataclass
class Alarms:
    """Tracked conditions of one robot."""

    _tracked: dict[str, _Tracked] = field(default_factory=dict)

    def judge(self, conditions: Iterable[Condition], now_s: float) -> list[Event]:
        """Return the events of conditions that began or ended.

        Args:
            now_s: Time on a monotonic clock.
        """
        near = {condition.key: condition for condition in conditions}
        events = []
        for key, condition in near.items():
            tracked = self._tracked.get(key)
            if tracked is None:
                if not condition.active:
                    continue
                tracked = self._tracked[key] = _Tracked(condition, now_s + condition.after_s)
            tracked.condition, tracked.over_at = condition, None
            if tracked.begun:
                continue
            if not condition.active:
                del self._tracked[key]
            elif now_s >= tracked.begins_at:
                tracked.begun = True
                events.append(_event(condition, condition.severity, condition.code, condition.text))
        for key in [key for key in self._tracked if key not in near]:
            tracked = self._tracked[key]
            if tracked.over_at is None:
                tracked.over_at = now_s + tracked.condition.over_after_s
            if not tracked.begun or now_s >= tracked.over_at:
                del self._tracked[key]
                if tracked.begun:
                    ended = tracked.condition
                    events.append(_event(ended, Event.Severity.INFO, ended.code + OVER, ended.over))
        return events


def _event(condition: Condition, severity: Event.Severity, code: str, text: str) -> Event:
    return Event(severity=severity, code=code, text=text, source="kinematics", values=dict(condition.values))
