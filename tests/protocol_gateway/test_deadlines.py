"""Times of arrival of commands at a gateway that does not always run."""

from protocol_gateway.execution.deadlines import CommandArrivals


def test_commands_arrive_when_they_are_received_while_the_gateway_runs():
    arrivals = CommandArrivals()
    assert arrivals.arrived_s(100.0) == 100.0  # before it has run
    for tenth in range(30):
        arrivals.note_running(200.0 + tenth / 10)
        assert arrivals.arrived_s(200.05 + tenth / 10) == 200.05 + tenth / 10


def test_what_was_kept_for_a_suspended_gateway_has_arrived_when_it_stopped_to_run():
    arrivals = CommandArrivals()
    arrivals.note_running(200.0)
    # Received before anything else, and after it is known that the gateway runs again.
    assert arrivals.arrived_s(202.5) == 200.0
    arrivals.note_running(202.6)
    assert arrivals.arrived_s(203.4) == 200.0
    assert arrivals.arrived_s(203.6) == 203.6


def test_a_gateway_that_is_busy_for_a_second_was_not_suspended():
    arrivals = CommandArrivals()
    arrivals.note_running(200.0)
    assert arrivals.arrived_s(201.0) == 201.0
