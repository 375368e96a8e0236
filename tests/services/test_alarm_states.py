"""Alarms after ISA-18.2: the state machine, with the time as an argument."""

import json
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robomesh import reason_codes as codes
from robomesh.contract.keys import parse_key
from robomesh.contract.messages import reason_message
from robomesh.schemas.robomesh_pb2 import Alarm as Message
from robomesh.schemas.robomesh_pb2 import Event
from services.watch import alarm_store
from services.watch.alarms import LONGEST_SHELF_S, Alarm, AlarmError, Alarms
from services.watch.subscriptions import EventHandler

UNACKNOWLEDGED, ACKNOWLEDGED = Message.UNACKNOWLEDGED, Message.ACKNOWLEDGED
RETURNED, SHELVED = Message.RETURNED, Message.SHELVED


def alarm(name: str = "arm:link", **values: object) -> Alarm:
    given = {"priority": Message.HIGH, "since": 0.0, "last": 0.0, "by_state": True} | values
    return Alarm(id=name, robot="arm", source="gateway", code="link.down", text="down", **given)


def states(alarms: Alarms) -> dict[str, int]:
    return {each.id: each.state for each in alarms.sorted()}


# Inputs, and the state that follows; None: the alarm is removed.
WAYS = (
    (("come",), UNACKNOWLEDGED),
    (("come", "come"), UNACKNOWLEDGED),
    (("come", "ack"), ACKNOWLEDGED),
    (("come", "ack", "come"), ACKNOWLEDGED),
    (("come", "go"), RETURNED),
    (("come", "go", "come"), UNACKNOWLEDGED),
    (("come", "go", "ack"), None),
    (("come", "ack", "go"), None),
    (("come", "ack", "go", "come"), UNACKNOWLEDGED),
    (("come", "shelve"), SHELVED),
    (("come", "shelve", "come"), SHELVED),
    (("come", "shelve", "go"), SHELVED),
    (("come", "shelve", "unshelve"), UNACKNOWLEDGED),
    (("come", "ack", "shelve", "unshelve"), ACKNOWLEDGED),
    (("come", "shelve", "go", "unshelve"), RETURNED),
    (("come", "shelve", "ack", "unshelve"), ACKNOWLEDGED),
    (("come", "ack", "shelve", "go", "unshelve"), None),
    (("come", "shelve", "an hour"), UNACKNOWLEDGED),
    (("come", "shelve", "go", "an hour"), RETURNED),
)


@pytest.mark.parametrize(
    ("happens", "state"),
    WAYS,
    ids=lambda each: "-".join(each) if each and isinstance(each, tuple) else str(each),
)
def test_the_table_of_states_is_so(happens, state):
    alarms, now = Alarms(), 1000.0
    for what in happens:
        now += 100.0
        do(alarms, what, now)
    assert states(alarms).get("arm:link") == state


def do(alarms: Alarms, what: str, now: float) -> None:
    name = ["arm:link"]
    match what:
        case "come":
            alarms.activate(alarm(), now)
        case "go":
            alarms.clear("arm:link", now)
        case "ack":
            alarms.acknowledge(name, "li", now)
        case "shelve":
            alarms.shelve(name, "li", now, for_s=3600.0, reason="service")
        case "unshelve":
            alarms.unshelve(name, "li", now)
        case "an hour":
            alarms.update(now + 3600.0)


def test_an_alarm_that_comes_and_goes_is_counted_and_not_repeated():
    alarms = Alarms()
    alarms.activate(alarm(), 0.0)
    alarms.acknowledge(["arm:link"], "li", 1.0)
    # Acknowledged and cleared, it is removed and can start again; three times in a minute is chattering.
    alarms.clear("arm:link", 2.0)
    alarms.activate(alarm(), 3.0)
    for second in range(5, 60, 5):
        alarms.clear("arm:link", second)
        alarms.activate(alarm(), second + 1.0)
    alarms.acknowledge(["arm:link"], "li", 61.0)
    for second in range(62, 120, 5):
        alarms.clear("arm:link", second)
        alarms.activate(alarm(), second + 1.0)
        assert states(alarms) == {"arm:link": ACKNOWLEDGED}
    assert alarms.by_id["arm:link"].count == 1 + 11 + 12
    alarms.clear("arm:link", 125.0)
    alarms.update(180.0)
    assert states(alarms) == {"arm:link": ACKNOWLEDGED}
    alarms.update(186.0)
    assert states(alarms) == {}


def test_a_latching_alarm_is_active_until_acknowledged():
    alarms = Alarms()
    alarms.activate(alarm(by_state=False, latching=True), 0.0)
    alarms.update(1e6)
    assert states(alarms) == {"arm:link": UNACKNOWLEDGED}
    alarms.acknowledge(["arm:link"], "li", 1e6)
    assert states(alarms) == {}


def test_an_alarm_that_ends_by_silence_clears_after_its_time():
    alarms = Alarms()
    alarms.activate(alarm(by_state=False, over_after_s=60.0), 0.0)
    alarms.activate(alarm(by_state=False, over_after_s=60.0), 50.0)
    alarms.update(109.0)
    assert states(alarms) == {"arm:link": UNACKNOWLEDGED}
    alarms.update(111.0)
    assert states(alarms) == {"arm:link": RETURNED}
    assert alarms.by_id["arm:link"].returned == 111.0


def test_more_than_ten_in_ten_minutes_is_a_flood_until_they_are_few():
    alarms = Alarms()
    for number in range(10):
        alarms.activate(alarm(f"arm:{number}"), float(number))
    alarms.update(10.0)
    assert not alarms.flooding
    alarms.activate(alarm("arm:10"), 11.0)
    alarms.update(12.0)
    assert alarms.flooding
    alarms.update(604.0)
    assert alarms.flooding  # seven of them are not ten minutes old
    alarms.update(609.5)
    assert not alarms.flooding


def test_alarms_are_sorted_by_urgency_with_shelved_ones_last():
    alarms = Alarms()
    for number, priority in enumerate((Message.LOW, Message.CRITICAL, Message.HIGH, Message.CRITICAL)):
        alarms.activate(alarm(f"arm:{number}", priority=priority), float(number))
    alarms.acknowledge(["arm:3"], "li", 10.0)
    alarms.shelve(["arm:1"], "li", 10.0, for_s=60.0, reason="service")
    assert [each.id for each in alarms.sorted()] == ["arm:2", "arm:0", "arm:3", "arm:1"]


@pytest.mark.parametrize(
    ("for_s", "reason", "expected"),
    [
        (60.0, " ", "reason"),
        (0.0, "service", "more than 0"),
        (-1.0, "service", "more than 0"),
        (LONGEST_SHELF_S + 1, "service", "86400"),
        (math.nan, "service", "nan"),
    ],
)
def test_a_shelf_needs_a_reason_and_an_end(for_s, reason, expected):
    alarms = Alarms()
    alarms.activate(alarm(), 0.0)
    with pytest.raises(AlarmError, match=expected):
        alarms.shelve(["arm:link"], "li", 1.0, for_s=for_s, reason=reason)
    assert states(alarms) == {"arm:link": UNACKNOWLEDGED}


def test_a_name_that_is_no_alarm_changes_nothing_of_the_others():
    alarms = Alarms()
    alarms.activate(alarm(), 0.0)
    with pytest.raises(AlarmError, match="arm:nothing"):
        alarms.acknowledge(["arm:link", "arm:nothing"], "li", 1.0)
    with pytest.raises(AlarmError, match="name at least one"):
        alarms.acknowledge([], "li", 1.0)
    with pytest.raises(AlarmError, match="not shelved"):
        alarms.unshelve(["arm:link"], "li", 1.0)
    assert states(alarms) == {"arm:link": UNACKNOWLEDGED}


def test_the_least_urgent_alarms_are_evicted_first():
    alarms = Alarms()
    alarms.activate(alarm("arm:urgent", priority=Message.CRITICAL), 0.0)
    for number in range(600):
        alarms.activate(alarm(f"arm:{number}", priority=Message.LOW), float(number))
    assert len(alarms.by_id) == 500
    assert "arm:urgent" in alarms.by_id


STEPS = st.lists(
    st.tuples(
        st.sampled_from(["come", "go", "ack", "shelve", "unshelve", "look"]),
        st.sampled_from(["a", "b"]),
        st.floats(0.0, 200.0),
    ),
    max_size=40,
)


@settings(max_examples=200)
@given(STEPS)
def test_whatever_happens_nothing_unseen_is_forgotten(steps):
    """Compare with a naive reference: an alarm activated since its last acknowledgement is listed."""
    alarms, now = Alarms(), 0.0
    unseen, counts = set(), {"a": 0, "b": 0}
    for what, name, passes in steps:
        now += passes
        alarms.update(now)
        counts[name] = counts[name] if name in alarms.by_id else 0
        match what:
            case "come":
                standing = name in alarms.by_id and alarms.by_id[name].active
                if not (standing and alarms.by_id[name].acknowledged):
                    unseen.add(name)
                alarms.activate(alarm(name), now)
                counts[name] += 1
            case "go":
                alarms.clear(name, now)
            case "look":
                alarms.update(now)
            case _:
                try:
                    if what == "ack":
                        alarms.acknowledge([name], "li", now)
                        unseen.discard(name)
                    elif what == "shelve":
                        alarms.shelve([name], "li", now, for_s=500.0, reason="service")
                    else:
                        alarms.unshelve([name], "li", now)
                except AlarmError:
                    pass
        assert unseen <= alarms.by_id.keys()
        for held in alarms.by_id.values():
            assert held.count == counts[held.id]
            assert held.shelved_until is None or held.shelved_until > now - 1e-9
            assert held.active or not held.acknowledged or held.shelved_until is not None


def test_alarms_survive_in_their_file_as_they_were(tmp_path):
    path = tmp_path / "watch" / "site.json"
    alarms = Alarms()
    cause = reason_message(codes.LINK_DOWN(codes.LINK_NO_ANSWER(where="10.0.0.7:5400")))
    alarms.activate(alarm(values=(("joint", "Hüfte"),), cause=cause), 5.0)
    alarms.acknowledge(["arm:link"], "li", 6.0)
    alarm_store.save(path, alarms.by_id.values(), {"arm/events": 12345})
    assert alarm_store.load(path) == (alarms.by_id, {"arm/events": 12345})


@pytest.mark.parametrize("text", ["", "{}", "[]", '{"alarms": [{}], "told_ns": {}}', '{"alarms": 3}', "\x00"])
def test_an_invalid_file_of_alarms_is_named(tmp_path, text):
    path = tmp_path / "site.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=r"site\.json: not a file of alarms"):
        alarm_store.load(path)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("since", "yesterday"),
        ("since", 1e300),
        ("last", math.nan),
        ("returned", False),
        ("priority", None),
        ("priority", 9),
        ("count", -1),
        ("stands", "no"),
        ("robot", 3),
        ("text", ["down"]),
        ("text", "\ud800"),
        ("cause", "link.down"),
        ("cause", {"code": 3}),
    ],
    ids=str,
)
def test_a_file_of_alarms_with_a_value_that_cannot_be_is_named(tmp_path, name, value):
    path = tmp_path / "site.json"
    alarm_store.save(path, [alarm()], {})
    values = json.loads(path.read_text(encoding="utf-8"))
    values["alarms"][0][name] = value
    path.write_text(json.dumps(values), encoding="utf-8")
    with pytest.raises(ValueError, match=r"site\.json: not a file of alarms"):
        alarm_store.load(path)


def test_a_file_of_an_earlier_version_has_alarms_without_a_cause(tmp_path):
    path = tmp_path / "site.json"
    alarm_store.save(path, [alarm()], {})
    values = json.loads(path.read_text(encoding="utf-8"))
    del values["alarms"][0]["cause"]
    path.write_text(json.dumps(values), encoding="utf-8")
    assert alarm_store.load(path)[0] == {"arm:link": alarm()}


def test_a_clock_that_is_set_back_keeps_no_alarm_standing_for_longer():
    alarms, now = Alarms(), 1_000_000.0
    alarms.activate(alarm("arm:refused", over_after_s=300.0, by_state=False), now)
    alarms.activate(alarm("arm:shelved"), now)
    alarms.shelve(["arm:shelved"], "li", now, for_s=LONGEST_SHELF_S, reason="service")
    now -= 500_000.0
    alarms.update(now)
    alarms.update(now + 299.0)
    assert states(alarms)["arm:refused"] == UNACKNOWLEDGED
    alarms.update(now + 301.0)
    assert states(alarms)["arm:refused"] == RETURNED
    alarms.update(now + LONGEST_SHELF_S + 1.0)
    assert states(alarms)["arm:shelved"] == UNACKNOWLEDGED


def test_an_event_with_an_invalid_time_is_an_alarm():
    key, events = parse_key("robomesh/s/arm/events"), EventHandler(Alarms())
    event = Event(severity=Event.ERROR, code="live")
    event.timestamp.nanos = 2_000_000_000
    behind = Event(severity=Event.ERROR, code="behind")
    behind.timestamp.FromSeconds(1001)
    events.handle(key, event, 1000.0)
    events.handle_history(key, [event, behind], 1002.0, wall_s=1002.0)
    assert {"arm:live", "arm:behind"} == events.alarms.by_id.keys()


def test_an_event_dated_in_the_future_hides_and_repeats_none():
    now, key = 1000.0, parse_key("robomesh/s/arm/events")
    events = EventHandler(Alarms())

    def event(code: str, at_s: int) -> Event:
        event = Event(severity=Event.ERROR, code=code)
        event.timestamp.FromSeconds(at_s)
        return event

    before, ahead, away = event("before", 900), event("ahead", 5000), event("while.away", 1010)
    events.handle(key, before, now)
    events.handle(key, ahead, now)
    events.handle_history(key, [before, ahead, away], now + 20.0, wall_s=now + 20.0)
    counts = {each.code: each.count for each in events.alarms.by_id.values()}
    assert counts == {"before": 1, "ahead": 1, "while.away": 1}
    # Nor when the list no longer contains it.
    events.handle(key, ahead, now + 30.0)
    events.handle_history(key, [event("later", 1040)], now + 50.0, wall_s=now + 50.0)
    assert "arm:later" in events.alarms.by_id


def test_active_alarms_are_counted_by_priority_without_shelved_and_ended_ones():
    alarms = Alarms()
    assert alarms.active_by_priority() == {"low": 0, "medium": 0, "high": 0, "critical": 0}
    for name in ("a", "b", "shelved", "ended"):
        alarms.activate(alarm(name), 1.0)
    alarms.activate(alarm("c", priority=Message.CRITICAL), 1.0)
    alarms.acknowledge(["b"], "li", 2.0)
    alarms.shelve(["shelved"], "li", 2.0, for_s=60.0, reason="tested")
    alarms.clear("ended", 2.0)
    assert alarms.active_by_priority() == {"low": 0, "medium": 0, "high": 2, "critical": 1}
    assert alarms.active() == {("arm", "link.down", each): 1.0 for each in ("high", "critical")}
