"""Turns events into alarms by the rules; skips events that were handled before a restart."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from robomesh.contract.keys import Key
from robomesh.schemas.robomesh_pb2 import Event
from services.watch.alarms import Alarm, Alarms
from services.watch.conditions import Condition, alarm_id
from services.watch.rules import LOW, RULES, ends, rule_of

# Alarms by state: `conditions.py` keeps them active, so their events are skipped.
_BY_STATE = frozenset(
    {"link.down", "link.silent", "link.flooding", "controller.fault", "controller.local", "stop.latched"}
)
# A watch's first start handles events from the site's own start.
_START_S = 600.0
_WARNING = Event.WARNING


@dataclass
class EventHandler:
    """Handler of events.

    Attributes:
        last_event_ns: By topic, the time of the last handled event, by its publisher's clock.
    """

    alarms: Alarms
    last_event_ns: dict[str, int] = field(default_factory=dict)

    def handle(self, key: Key, event: Event, now: float, *, reporter: str = "") -> None:
        """Handle a new event; `reporter` is its process, where it is known."""
        self.last_event_ns[_name(key)] = _time_ns(event)
        self._apply(key.robot, event, now, reporter)

    def handle_history(
        self, key: Key, events: Sequence[Event], now: float, *, wall_s: float, reporter: str = ""
    ) -> None:
        """Handle those events of a publisher's history that are new; oldest first.

        Args:
            wall_s: Wall clock, for the comparison with the publisher's, which may have been set back with it.
        """
        last_event_ns = self.last_event_ns.get(_name(key), round((now - _START_S) * 1e9))
        times_ns = [_time_ns(event) for event in events]
        if last_event_ns in times_ns:
            # By order, not by time: clocks may be set.
            new = events[len(times_ns) - times_ns[::-1].index(last_event_ns) :]
        elif last_event_ns > wall_s * 1e9:
            new = events  # a date in the future cannot separate old from new
        else:
            new = [event for event, at_ns in zip(events, times_ns, strict=True) if at_ns > last_event_ns]
        for event in new:
            self.handle(key, event, now, reporter=reporter)

    def _apply(self, robot: str, event: Event, now: float, reporter: str) -> None:
        if event.source == "watch" or event.code in _BY_STATE:
            return
        values = dict(event.values)
        rule = rule_of(event.code, event.severity)
        if event.severity < _WARNING:
            for code in ends(event.code):
                each = values.get(RULES[code].each, "") if code in RULES else ""
                self.alarms.clear(alarm_id(robot, code, each.partition("/")[0]), now)
        if event.severity < _WARNING or rule.priority is None:
            return
        for code in ends(event.code) - {event.code}:
            self.alarms.clear(alarm_id(robot, code), now)
        each = values.get(rule.each, "").partition("/")[0]
        self.alarms.activate(
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
                cause=event.reason if event.HasField("reason") else None,
                latching=rule.over_after_s is None and not _end_is_reported(event.code),
                over_after_s=rule.over_after_s,
                reporter=reporter if _end_is_reported(event.code) else "",
            ),
            now,
        )


def alarm_of(condition: Condition, now: float) -> Alarm:
    """Return the alarm that a condition begins."""
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
        cause=condition.cause,
        by_state=True,
        latching=condition.latching,
    )


def _end_is_reported(code: str) -> bool:
    """Return whether an event will report the alarm's end."""
    return bool(RULES[code].ended_by) or code.startswith(_END_IS_REPORTED) if code in RULES else False


def _name(key: Key) -> str:
    return f"{key.robot}/{key.topic}"


def _time_ns(event: Event) -> int:
    """Return the time of an event by its publisher's clock; 0 if it has no valid time."""
    try:
        return event.timestamp.ToNanoseconds()
    except ValueError:
        return 0


_END_IS_REPORTED = (
    "kinematics.",
    "recorder.gives_up",
    "recorder.disk_slow",
    "recorder.space",
    "recorder.failed",
)
