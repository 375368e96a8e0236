"""Floods in the audit log: entries that are written, entries that are counted, and no lost request."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol_gateway.audit.flood_counter import IN_FULL, MOST_KINDS, FloodCounter
from protocol_gateway.audit.log import Entry, Outcome
from tests.protocol_gateway.audit_state import state_after


def entry(operator="li", request="HOME", outcome=Outcome.REFUSED, text="no", **values):
    return Entry(
        time_ns=1,
        operator=operator,
        source="mesh",
        request=request,
        outcome=outcome,
        text=text,
        values={name: str(value) for name, value in values.items()},
    )


def test_the_first_five_of_a_second_are_written_the_rest_is_one_entry_a_second():
    floods = FloodCounter()
    assert [floods.admits(entry(), 0.01 * n) for n in range(50)] == [True] * IN_FULL + [False] * 45
    (counted,) = floods.counts(1.0)
    assert (counted.repeated, counted.text) == (44, "no")
    # The flood continues: only counts, until it pauses for a second.
    assert not any(floods.admits(entry(), 1.0 + 0.1 * n) for n in range(10))
    (counted,) = floods.counts(2.0)
    assert counted.repeated == 9
    assert list(floods.counts(3.5)) == []
    assert floods.admits(entry(), 3.6)


def test_a_single_excess_entry_is_written_unchanged():
    floods = FloodCounter()
    written = [floods.admits(entry(text=str(n)), 0.0) for n in range(IN_FULL + 1)]
    assert not written[-1]
    (last,) = floods.counts(0.5)
    assert (last.text, last.repeated) == (str(IN_FULL), 0)


@pytest.mark.parametrize("outcome", [Outcome.ACCEPTED, Outcome.FAILED])
def test_accepted_requests_are_never_counted(outcome):
    floods = FloodCounter()
    assert all(floods.admits(entry(outcome=outcome), 0.0) for _ in range(1000))


def test_kinds_do_not_hide_each_other():
    floods = FloodCounter()
    for number in range(100):
        floods.admits(entry("li", "HOME"), 0.001 * number)
    assert floods.admits(entry("li", "ACQUIRE"), 0.5)
    assert floods.admits(entry("wang", "HOME"), 0.5)


def test_a_flood_under_new_names_fills_neither_memory_nor_disk():
    floods, written = FloodCounter(), 0
    flood = 20_000
    for number in range(flood):
        written += floods.admits(entry(f"name-{number}"), 0.0001 * number)
        if number % 10_000 == 9_999:
            counted = list(floods.counts(0.0001 * number))
            assert len(counted) <= MOST_KINDS + 2
            written += sum(1 + each.repeated for each in counted)
            assert any(each.text == "no (the last of many callers)" for each in counted)
    assert written == flood


def test_a_long_text_leaves_room_for_the_count():
    floods = FloodCounter()
    for number in range(MOST_KINDS + 20):
        floods.admits(entry(f"name-{number}", text="x" * 800), 0.0)
    (counted,) = floods.counts(1.0)
    assert len(counted.text) <= 800
    assert counted.text.endswith("… (the last of many callers)")


def test_a_new_connection_of_a_host_is_counted_with_the_previous_one():
    floods = FloodCounter()
    asked = [
        replace(entry(), source=f"legacy {host}:{port}")
        for host in ("10.0.0.9", "::1")
        for port in range(4000, 4010)
    ]
    assert sum(floods.admits(each, 0.0) for each in asked) == 2 * IN_FULL
    assert [(each.source, each.repeated) for each in floods.counts(1.0)] == [
        ("legacy 10.0.0.9:4009", 4),
        ("legacy ::1:4009", 4),
    ]


@given(
    st.lists(
        st.tuples(
            st.sampled_from(["li", "wang", "zhao", *(f"name-{n}" for n in range(40))]),
            st.sampled_from(["STOP", "STOP", "HOME"]),
            st.sampled_from([0.0, 0.0, 0.01, 0.4, 1.1]),
        ),
        max_size=300,
    )
)
def test_every_request_is_counted_once_and_the_last_stop_is_remembered(asked):
    floods, now_s, stop, written = FloodCounter(), 0.0, 0, []
    looked_s = 0.0
    for operator, request, wait_s in asked:
        now_s += wait_s
        if now_s - looked_s >= 1.0:
            looked_s = now_s
            written += floods.counts(now_s)
        accepted = request == "STOP"
        stop += accepted
        one = entry(operator, request, Outcome.ACCEPTED if accepted else Outcome.REFUSED, stop_id=stop)
        if floods.admits(one, now_s):
            written.append(one)
    # Entries before a RESET in the log.
    written += floods.counts(now_s, request="STOP")
    latched = state_after(written).stop
    assert (latched.id if latched else 0) == stop
    assert state_after(written).last_stop_id == stop
    written += floods.counts(now_s)
    for request in ("STOP", "HOME"):
        counted = sum(1 + each.repeated for each in written if each.request == request)
        assert counted == sum(each[1] == request for each in asked)
