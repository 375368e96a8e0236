"""Rate limit of repeated events."""

from protocol_gateway.telemetry.journal import Journal
from robomesh.schemas.robomesh_pb2 import Event


class Heard:
    def __init__(self):
        self.events = []

    def put(self, event):
        self.events.append(event)


def test_a_flood_of_events_is_five_then_one_each_five_seconds():
    heard, now_s = Heard(), 100.0
    journal = Journal(heard, "arm", monotonic_s=lambda: now_s)
    for _ in range(1000):  # 100 s of ten a second
        journal.report(Event.WARNING, "unit.malformed", "a unit is malformed")
        now_s += 0.1
    assert 23 <= len(heard.events) <= 26
    said = len(heard.events) + sum(int(event.values.get("left_out", 0)) for event in heard.events)
    assert 950 <= said <= 1000
    more = heard.events[6].values["left_out"]
    assert heard.events[6].text == f"a unit is malformed (and {more} more like it before)"


def test_a_flood_of_one_kind_suppresses_no_other():
    heard, now_s = Heard(), 100.0
    journal = Journal(heard, "arm", monotonic_s=lambda: now_s)
    for _ in range(100):
        journal.report(Event.WARNING, "unit.malformed", "a unit is malformed")
    journal.report(Event.WARNING, "stop.latched", "stop request 1")
    assert [event.code for event in heard.events] == ["unit.malformed"] * 5 + ["stop.latched"]


def test_after_a_pause_the_burst_is_allowed_again():
    heard, now_s = Heard(), 100.0
    journal = Journal(heard, "arm", monotonic_s=lambda: now_s)
    for _ in range(10):
        journal.report(Event.INFO, "link.up", "up")
    now_s += 60.0
    for _ in range(10):
        journal.report(Event.INFO, "link.up", "up")
    assert len(heard.events) == 10
    assert heard.events[5].values["left_out"] == "5"


def test_alarms_of_different_numbers_are_all_published_and_a_flood_of_numbers_is_limited():
    heard, now_s = Heard(), 100.0
    journal = Journal(heard, "arm", monotonic_s=lambda: now_s)

    def alarms(*numbers):
        for number in numbers:
            journal.report(Event.WARNING, "controller.alarm", "servo", apart=str(number), number=number)

    alarms(*range(20))
    assert len(heard.events) == 20
    alarms(*range(20, 100_000))
    assert len(heard.events) == 21
    now_s += 60.0  # other numbers than a minute ago
    alarms(*range(20, 36))
    assert len(heard.events) == 37
