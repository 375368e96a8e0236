"""Events as they come, made alarms by the rules; what was told before the watch came is not told twice."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from robomesh.keys import Key
from robomesh.schemas.robomesh_pb2 import Event
from services.watch.alarms import Alarm, Alarms
from services.watch.conditions import Condition, alarm_id
from services.watch.rules import LOW, RULES, ends, rule_of

# Held by states, for as long as they are so: their events are not needed.
_BY_STATE = frozenset(
    {"link.down", "link.silent", "link.flooding", "controller.fault", "controller.local", "stop.latched"}
)
# A watch that starts for the first time takes what was told while the site started.
_NEWS_S = 600.0
_WARNING = Event.WARNING


@dataclass
class Intake:
    """What came until now.

    Attributes:
        told_ns: By topic, the time of the event that came last, by its publisher's clock.
    """

    alarms: Alarms
    told_ns: dict[str, int] = field(default_factory=dict)

    def live(self, key: Key, event: Event, now: float, *, told_by: str = "") -> None:
        """An event that has just come; `told_by`: the process, where it is known."""
        self.told_ns[_name(key)] = _time_ns(event)
        self._take(key.robot, event, now, told_by)

    def remembered(self, key: Key, events: Sequence[Event], now: float, *, told_by: str = "") -> None:
        """Events that its publisher tells who comes late, the oldest first."""
        told_ns = self.told_ns.get(_name(key), round((now - _NEWS_S) * 1e9))
        times_ns = [_time_ns(event) for event in events]
        if told_ns in times_ns:
            # Whatever clocks do: the order holds.
            new = events[len(times_ns) - times_ns[::-1].index(told_ns) :]
        elif told_ns > now * 1e9:
            new = events  # dated in the future it says nothing about those that came after it
        else:
            new = [event for event, at_ns in zip(events, times_ns, strict=True) if at_ns > told_ns]
        for event in new:
            self.live(key, event, now, told_by=told_by)

    def _take(self, robot: str, event: Event, now: float, told_by: str) -> None:
        if event.source == "watch" or event.code in _BY_STATE:
            return
        values = dict(event.values)
        rule = rule_of(event.code, event.severity)
        if event.severity < _WARNING:
            for code in ends(event.code):
                each = values.get(RULES[code].each, "") if code in RULES else ""
                self.alarms.go(alarm_id(robot, code, each.partition("/")[0]), now)
        if event.severity < _WARNING or rule.priority is None:
            return
        for code in ends(event.code) - {event.code}:
            self.alarms.go(alarm_id(robot, code), now)
        each = values.get(rule.each, "").partition("/")[0]
        self.alarms.come(
            Alarm(
                id=alarm_id(robot, event.code, each),
                robot=robot,
                source=event.source,
                code=event.code,
                text=event.text,
                priority=rule.priority,
                advice=rule.advice,
                since=now,
                last=now,
                values=tuple(values.items()),
                latching=rule.over_after_s is None and not _is_ended(event.code),
                over_after_s=rule.over_after_s,
                told_by=told_by if _is_ended(event.code) else "",
            ),
            now,
        )


def alarm_of(condition: Condition, now: float) -> Alarm:
    """The alarm that a condition begins."""
    rule = rule_of(condition.code, _WARNING)
    return Alarm(
        id=condition.id,
        robot=condition.robot,
        source=condition.source,
        code=condition.code,
        text=condition.text,
        priority=rule.priority or LOW,
        advice=rule.advice,
        since=now,
        last=now,
        values=condition.values,
        by_state=True,
        latching=condition.latching,
    )


def _is_ended(code: str) -> bool:
    """Whether anything will say that it is over."""
    return bool(RULES[code].ended_by) or code.startswith(_OVER_IS_TOLD) if code in RULES else False


def _name(key: Key) -> str:
    return f"{key.robot}/{key.topic}"


def _time_ns(event: Event) -> int:
    """When an event was, by its publisher's clock; 0: it tells no time that there is."""
    try:
        return event.timestamp.ToNanoseconds()
    except ValueError:
        return 0


_OVER_IS_TOLD = (
    "kinematics.",
    "recorder.gives_up",
    "recorder.disk_slow",
    "recorder.space",
    "recorder.failed",
)
