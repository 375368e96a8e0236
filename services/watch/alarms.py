"""Alarms after ISA-18.2, as a pure state machine: what happened and the time go in.

Of an alarm three things are known: whether it stands, whether somebody has seen it, whether it is shelved.

    shelved   stands   seen     state
    yes       -        -        SHELVED           put aside by a person, for a while
    no        yes      no       UNACKNOWLEDGED    act
    no        yes      yes      ACKNOWLEDGED      somebody does
    no        no       no       RETURNED          gone by itself, nobody saw it
    no        no       yes      (forgotten)

    happens        does
    comes          stands; counted; unseen, unless it stood already
    goes           stands no more, at once; one that came three times in a minute a minute later
    acknowledged   seen; what nothing ends (latching) stands no more
    shelved        out of sight until then; it comes and goes and is counted meanwhile
    unshelved      as its other two say

Source: ANSI/ISA-18.2-2016, figure 3 (states), clauses 11 (shelving), 16 (chattering: 3 in a minute; flood:
more than 10 in 10 minutes, over below 5).
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

from robomesh import reason_codes as codes
from robomesh.reasons import Reason
from robomesh.schemas.robomesh_pb2 import Alarm as AlarmMessage

State = AlarmMessage.State

_CHATTERS, _CHATTERS_WITHIN_S = 3, 60.0
_FLOOD, _FLOOD_OVER, _FLOOD_WITHIN_S = 10, 5, 600.0
LONGEST_SHELF_S = 86_400.0
_MOST = 500
_LONGEST_TEXT = 500


class AlarmError(ValueError):
    """Something that cannot be done with an alarm; `reason` says why."""

    def __init__(self, reason: Reason) -> None:
        super().__init__(reason.text)
        self.reason = reason


@dataclass(frozen=True, kw_only=True)
class Alarm:
    """Something that a person must act on. Times are seconds since the Unix epoch.

    Attributes:
        by_state: It is so for as long as something is; else it happened.
        latching: Nothing will say that it is over, or it may stay so for good: to acknowledge it ends it.
        over_after_s: Over when it has not come for so long.
        came: Its last comings, at most three: what chatters.
        going_at: It has gone, and is taken for gone from then on.
        by: Who acknowledged or shelved it, `at` then.
        told_by: The process that will say that it is over; empty: none, or it is not known which.
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
    by_state: bool = False
    latching: bool = False
    over_after_s: float | None = None
    count: int = 1
    stands: bool = True
    seen: bool = False
    came: tuple[float, ...] = ()
    going_at: float | None = None
    returned: float | None = None
    by: str = ""
    at: float | None = None
    shelved_until: float | None = None
    reason: str = ""
    told_by: str = ""

    @property
    def state(self) -> State:
        """As the table above says; what is neither standing nor unseen is forgotten by then."""
        if self.shelved_until is not None:
            return State.SHELVED
        if not self.stands:
            return State.RETURNED
        return State.ACKNOWLEDGED if self.seen else State.UNACKNOWLEDGED


@dataclass
class Alarms:
    """The alarms of a site that are not over and seen."""

    held: dict[str, Alarm] = field(default_factory=dict)
    # When alarms began to ask for somebody.
    _rings: list[float] = field(default_factory=list)
    flooding: bool = False

    def come(self, alarm: Alarm, now: float) -> None:
        """It is so, or has happened, once more."""
        before = self.held.get(alarm.id)
        going_at = None if alarm.over_after_s is None else now + alarm.over_after_s
        came = (*(before.came if before else ()), now)[-_CHATTERS:]
        alarm = replace(
            alarm, text=alarm.text[:_LONGEST_TEXT], since=now, last=now, came=came, going_at=going_at
        )
        if before is not None:
            kept = {name: getattr(before, name) for name in ("by", "at", "shelved_until", "reason")}
            seen = before.seen and before.stands
            since = before.since if before.stands else now
            alarm = replace(alarm, count=before.count + 1, since=since, seen=seen, **kept)
        if alarm.state is State.UNACKNOWLEDGED and (before is None or before.state is not alarm.state):
            self._rings.append(now)
        self.held[alarm.id] = alarm
        self._make_room()

    def change(self, identity: str, code: str, text: str, values: tuple[tuple[str, str], ...]) -> None:
        """It stands as before, and its words have changed."""
        alarm = self.held.get(identity)
        if alarm is not None:
            self.held[identity] = replace(alarm, code=code, text=text[:_LONGEST_TEXT], values=values)

    def go(self, identity: str, now: float) -> None:
        """It is over, unless it chatters."""
        alarm = self.held.get(identity)
        if alarm is None or not alarm.stands:
            return
        chatters = len(alarm.came) == _CHATTERS and now - alarm.came[0] < _CHATTERS_WITHIN_S
        self.held[identity] = replace(alarm, going_at=now + _CHATTERS_WITHIN_S if chatters else now)
        self.look(now)

    def orphan(self, identity: str, now: float) -> None:
        """Who would say that it is over has been replaced: it is over, unless that process says so too."""
        self.held[identity] = replace(self.held[identity], told_by="")
        self.go(identity, now)

    def look(self, now: float) -> None:
        """What time alone changes; to be called now and then."""
        for alarm in tuple(self.held.values()):
            alarm = _in_reach(alarm, now)
            if alarm.shelved_until is not None and now >= alarm.shelved_until:
                alarm = replace(alarm, shelved_until=None, reason="", seen=False)
                if alarm.stands:
                    self._rings.append(now)
            if alarm.stands and alarm.going_at is not None and now >= alarm.going_at:
                alarm = replace(alarm, stands=False, going_at=None, returned=now)
            self._keep(alarm)
        self._rings = [at for at in self._rings if abs(now - at) < _FLOOD_WITHIN_S]
        self.flooding = len(self._rings) >= (_FLOOD_OVER if self.flooding else _FLOOD + 1)

    def acknowledge(self, identities: Iterable[str], by: str, now: float) -> None:
        """Somebody has seen them.

        Raises:
            AlarmError: If there is no such alarm; then nothing is changed.
        """
        for alarm in self._named(identities):
            self._keep(replace(alarm, seen=True, by=by, at=now, stands=alarm.stands and not alarm.latching))

    def shelve(self, identities: Iterable[str], by: str, now: float, *, for_s: float, reason: str) -> None:
        """Somebody puts them aside for a while.

        Raises:
            AlarmError: Without a reason, for longer than a day, or of no such alarm; nothing is changed then.
        """
        if not reason.strip():
            raise AlarmError(codes.ALARM_NO_REASON())
        if not 0.0 < for_s <= LONGEST_SHELF_S:
            raise AlarmError(codes.ALARM_SHELF_TIME(seconds=for_s, most=LONGEST_SHELF_S))
        for alarm in self._named(identities):
            self.held[alarm.id] = replace(
                alarm, shelved_until=now + for_s, by=by, at=now, reason=reason[:_LONGEST_TEXT]
            )

    def unshelve(self, identities: Iterable[str], by: str, now: float) -> None:
        """Back in sight.

        Raises:
            AlarmError: If one is not shelved, or there is none; then nothing is changed.
        """
        alarms = self._named(identities)
        for alarm in alarms:
            if alarm.shelved_until is None:
                raise AlarmError(codes.ALARM_NOT_SHELVED(id=alarm.id))
        for alarm in alarms:
            self._keep(replace(alarm, shelved_until=None, reason="", by=by, at=now))

    def sorted(self) -> list[Alarm]:
        """The most urgent first; of equals the newest."""
        order = (State.UNACKNOWLEDGED, State.ACKNOWLEDGED, State.RETURNED, State.SHELVED)
        return sorted(
            self.held.values(),
            key=lambda each: (order.index(each.state), -each.priority, -each.since, each.id),
        )

    def _named(self, identities: Iterable[str]) -> list[Alarm]:
        wanted = list(dict.fromkeys(identities))
        if not wanted:
            raise AlarmError(codes.ALARM_NONE_NAMED())
        for identity in wanted:
            if identity not in self.held:
                raise AlarmError(codes.ALARM_UNKNOWN(id=identity[:80]))
        return [self.held[identity] for identity in wanted]

    def _keep(self, alarm: Alarm) -> None:
        if alarm.shelved_until is None and not alarm.stands and alarm.seen:
            self.held.pop(alarm.id, None)
        else:
            self.held[alarm.id] = alarm

    def _make_room(self) -> None:
        """The least urgent go first, should there ever be too many."""
        for alarm in self.sorted()[_MOST:] if len(self.held) > _MOST else ():
            del self.held[alarm.id]


def _in_reach(alarm: Alarm, now: float) -> Alarm:
    """An alarm whose times to come are as near as they were, should the clock have been set back."""
    if alarm.going_at is not None:
        longest_s = max(alarm.over_after_s or 0.0, _CHATTERS_WITHIN_S)
        alarm = replace(alarm, going_at=min(alarm.going_at, now + longest_s))
    if alarm.shelved_until is not None:
        alarm = replace(alarm, shelved_until=min(alarm.shelved_until, now + LONGEST_SHELF_S))
    return alarm
