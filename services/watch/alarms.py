"""Alarms after ISA-18.2: a pure state machine. Events and the current time are its only inputs.

An alarm has three independent flags: active, acknowledged, shelved.

    shelved   active   acknowledged   state
    yes       -        -              SHELVED           hidden by a person for a limited time
    no        yes      no             UNACKNOWLEDGED    a person must act
    no        yes      yes            ACKNOWLEDGED      a person is acting
    no        no       no             RETURNED          cleared before anyone acknowledged it
    no        no       yes            (removed)

    input          effect
    activate       active; counted; unacknowledged unless it was active already
    clear          inactive immediately; a minute later if it was activated three times within a minute
    acknowledge    acknowledged; a latching alarm also becomes inactive
    shelve         hidden until the given time; activations and clears still count
    unshelve       the state follows from the other two flags

Source: ANSI/ISA-18.2-2016, figure 3 (states), clauses 11 (shelving), 16 (chattering: 3 in a minute; flood:
more than 10 in 10 minutes, over below 5).
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

from robomesh import reason_codes as codes
from robomesh.contract.enum_names import enum_word
from robomesh.reasons import Reason
from robomesh.schemas.robomesh_pb2 import Alarm as AlarmMessage
from robomesh.schemas.robomesh_pb2 import Reason as ReasonMessage

State = AlarmMessage.State

_CHATTERING, _CHATTERING_WITHIN_S = 3, 60.0
_FLOOD, _FLOOD_OVER, _FLOOD_WITHIN_S = 10, 5, 600.0
LONGEST_SHELF_S = 86_400.0
_MAX_ALARMS = 500
_MAX_TEXT = 500


class AlarmError(ValueError):
    """A request that the alarm's state does not allow; `reason` says why."""

    def __init__(self, reason: Reason) -> None:
        super().__init__(reason.text)
        self.reason = reason


@dataclass(frozen=True, kw_only=True)
class Alarm:
    """A condition that a person must act on. Times are seconds since the Unix epoch.

    Attributes:
        cause: The reason in the text; None if the reporter sends no code for it.
        by_state: Active while a reported state lasts; otherwise an event activated it.
        latching: No event may ever clear it, so acknowledging it clears it.
        over_after_s: Cleared if it is not activated again within this time.
        occurrences: Times of its last activations, at most three; they show chattering.
        clears_at: Time at which a pending clear takes effect.
        by: Person who acknowledged or shelved it, at the time `at`.
        reporter: Process that will report its end; empty if there is none or it is unknown.
    """

    id: str
    robot: str
    source: str
    code: str
    text: str
    priority: AlarmMessage.Priority
    since: float
    last: float
    advice: str = ""
    values: tuple[tuple[str, str], ...] = ()
    cause: ReasonMessage | None = None
    by_state: bool = False
    latching: bool = False
    over_after_s: float | None = None
    count: int = 1
    active: bool = True
    acknowledged: bool = False
    occurrences: tuple[float, ...] = ()
    clears_at: float | None = None
    returned: float | None = None
    by: str = ""
    at: float | None = None
    shelved_until: float | None = None
    reason: str = ""
    reporter: str = ""

    @property
    def state(self) -> State:
        """Return the state by the table above. Inactive, acknowledged alarms are removed, so have none."""
        if self.shelved_until is not None:
            return State.SHELVED
        if not self.active:
            return State.RETURNED
        return State.ACKNOWLEDGED if self.acknowledged else State.UNACKNOWLEDGED


@dataclass
class Alarms:
    """A site's alarms, except those that are both cleared and acknowledged."""

    by_id: dict[str, Alarm] = field(default_factory=dict)
    # Times at which alarms became unacknowledged.
    _annunciations: list[float] = field(default_factory=list)
    flooding: bool = False

    def active(self) -> dict[tuple[str, ...], float]:
        """Return 1 for robot, name and priority of each active alarm that is not shelved; on any thread."""
        return {
            (each.robot, each.code, enum_word(AlarmMessage.Priority, each.priority)): 1.0
            for each in tuple(self.by_id.values())
            if each.active and each.shelved_until is None
        }

    def active_by_priority(self) -> dict[str, float]:
        """Return the number of active alarms that are not shelved, by priority; on any thread."""
        shown = [each for each in tuple(self.by_id.values()) if each.active and each.shelved_until is None]
        return {
            name.lower(): float(sum(each.priority == priority for each in shown))
            for name, priority in AlarmMessage.Priority.items()
            if priority
        }

    def activate(self, alarm: Alarm, now: float) -> None:
        """Activate an alarm, or count another activation of it."""
        before = self.by_id.get(alarm.id)
        clears_at = None if alarm.over_after_s is None else now + alarm.over_after_s
        occurrences = (*(before.occurrences if before else ()), now)[-_CHATTERING:]
        alarm = replace(
            alarm,
            text=alarm.text[:_MAX_TEXT],
            since=now,
            last=now,
            occurrences=occurrences,
            clears_at=clears_at,
        )
        if before is not None:
            kept = {name: getattr(before, name) for name in ("by", "at", "shelved_until", "reason")}
            acknowledged = before.acknowledged and before.active
            since = before.since if before.active else now
            alarm = replace(alarm, count=before.count + 1, since=since, acknowledged=acknowledged, **kept)
        if alarm.state is State.UNACKNOWLEDGED and (before is None or before.state is not alarm.state):
            self._annunciations.append(now)
        self.by_id[alarm.id] = alarm
        self._evict()

    def change(
        self,
        identity: str,
        code: str,
        text: str,
        values: tuple[tuple[str, str], ...],
        cause: ReasonMessage | None = None,
    ) -> None:
        """Replace the text of an active alarm, and the reason in it."""
        alarm = self.by_id.get(identity)
        if alarm is not None:
            self.by_id[identity] = replace(
                alarm, code=code, text=text[:_MAX_TEXT], values=values, cause=cause
            )

    def clear(self, identity: str, now: float) -> None:
        """Clear an alarm; a chattering one is cleared later."""
        alarm = self.by_id.get(identity)
        if alarm is None or not alarm.active:
            return
        chattering = (
            len(alarm.occurrences) == _CHATTERING and now - alarm.occurrences[0] < _CHATTERING_WITHIN_S
        )
        self.by_id[identity] = replace(alarm, clears_at=now + _CHATTERING_WITHIN_S if chattering else now)
        self.update(now)

    def lose_reporter(self, identity: str, now: float) -> None:
        """Clear an alarm after its reporter was replaced; the new process does not know of it."""
        self.by_id[identity] = replace(self.by_id[identity], reporter="")
        self.clear(identity, now)

    def update(self, now: float) -> None:
        """Apply pending clears and expired shelves, and update the flood flag. Call it regularly."""
        for alarm in tuple(self.by_id.values()):
            alarm = _limit_times(alarm, now)
            if alarm.shelved_until is not None and now >= alarm.shelved_until:
                alarm = replace(alarm, shelved_until=None, reason="", acknowledged=False)
                if alarm.active:
                    self._annunciations.append(now)
            if alarm.active and alarm.clears_at is not None and now >= alarm.clears_at:
                alarm = replace(alarm, active=False, clears_at=None, returned=now)
            self._store(alarm)
        self._annunciations = [at for at in self._annunciations if abs(now - at) < _FLOOD_WITHIN_S]
        self.flooding = len(self._annunciations) >= (_FLOOD_OVER if self.flooding else _FLOOD + 1)

    def acknowledge(self, identities: Iterable[str], by: str, now: float) -> None:
        """Acknowledge alarms.

        Raises:
            AlarmError: If an alarm does not exist; then nothing changes.
        """
        for alarm in self._find(identities):
            self._store(
                replace(alarm, acknowledged=True, by=by, at=now, active=alarm.active and not alarm.latching)
            )

    def shelve(self, identities: Iterable[str], by: str, now: float, *, for_s: float, reason: str) -> None:
        """Hide alarms for a limited time.

        Raises:
            AlarmError: If the reason is missing, the time exceeds a day or an alarm does not exist; then
                nothing changes.
        """
        if not reason.strip():
            raise AlarmError(codes.ALARM_NO_REASON())
        if not 0.0 < for_s <= LONGEST_SHELF_S:
            raise AlarmError(codes.ALARM_SHELF_TIME(seconds=for_s, most=LONGEST_SHELF_S))
        for alarm in self._find(identities):
            self.by_id[alarm.id] = replace(
                alarm, shelved_until=now + for_s, by=by, at=now, reason=reason[:_MAX_TEXT]
            )

    def unshelve(self, identities: Iterable[str], by: str, now: float) -> None:
        """Show shelved alarms again.

        Raises:
            AlarmError: If an alarm is not shelved or does not exist; then nothing changes.
        """
        alarms = self._find(identities)
        for alarm in alarms:
            if alarm.shelved_until is None:
                raise AlarmError(codes.ALARM_NOT_SHELVED(id=alarm.id))
        for alarm in alarms:
            self._store(replace(alarm, shelved_until=None, reason="", by=by, at=now))

    def sorted(self) -> list[Alarm]:
        """Return the alarms, most urgent first, then newest first."""
        order = (State.UNACKNOWLEDGED, State.ACKNOWLEDGED, State.RETURNED, State.SHELVED)
        return sorted(
            self.by_id.values(),
            key=lambda each: (order.index(each.state), -each.priority, -each.since, each.id),
        )

    def _find(self, identities: Iterable[str]) -> list[Alarm]:
        wanted = list(dict.fromkeys(identities))
        if not wanted:
            raise AlarmError(codes.ALARM_NONE_NAMED())
        for identity in wanted:
            if identity not in self.by_id:
                raise AlarmError(codes.ALARM_UNKNOWN(id=identity[:80]))
        return [self.by_id[identity] for identity in wanted]

    def _store(self, alarm: Alarm) -> None:
        if alarm.shelved_until is None and not alarm.active and alarm.acknowledged:
            self.by_id.pop(alarm.id, None)
        else:
            self.by_id[alarm.id] = alarm

    def _evict(self) -> None:
        """Remove the least urgent alarms above the maximum."""
        for alarm in self.sorted()[_MAX_ALARMS:] if len(self.by_id) > _MAX_ALARMS else ():
            del self.by_id[alarm.id]


def _limit_times(alarm: Alarm, now: float) -> Alarm:
    """Limit an alarm's future times to their longest delays, in case the clock was set back."""
    if alarm.clears_at is not None:
        longest_s = max(alarm.over_after_s or 0.0, _CHATTERING_WITHIN_S)
        alarm = replace(alarm, clears_at=min(alarm.clears_at, now + longest_s))
    if alarm.shelved_until is not None:
        alarm = replace(alarm, shelved_until=min(alarm.shelved_until, now + LONGEST_SHELF_S))
    return alarm
