"""When a simulated controller shows its faults."""

from controllers.simulated.faults import Faults


def test_a_fault_that_is_over_before_a_busy_machine_looks_is_active_for_one_look():
    faults = Faults([])
    faults.begin("restart+0.3", 10.0)
    faults.begin("freeze@5+1", 10.0)
    active, begun, ended = faults.changes(frozenset(), 11.0)
    assert (active, begun, ended) == ({"restart"}, {"restart"}, set())
    active, begun, ended = faults.changes(active, 11.1)
    assert (active, begun, ended) == (set(), set(), {"restart"})
    active, begun, _ = faults.changes(active, 15.5)
    assert (active, begun) == ({"freeze"}, {"freeze"})
    faults.end("freeze")
    assert faults.changes(active, 15.6) == (set(), set(), {"freeze"})
