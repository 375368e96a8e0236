"""Short runs of the fuzz program of OPC UA, and proof that it finds faults."""

import pytest

from controllers.opcua import driver
from controllers.opcua.joints import Joiner
from tests.controllers.opcua import fuzz_opcua
from tests.fuzz.fuzzing import assert_found, assert_strict, broken


class CarelessJoiner(Joiner):
    """Joins joints of different moments."""

    def __init__(self, axes, limit_s):
        super().__init__(axes, 1e9)


@pytest.mark.parametrize(
    ("program", "least"),
    [
        (fuzz_opcua, dict.fromkeys(("JointsReceived", "MalformedReceived", "SignalsReceived"), 500)),
    ],
)
@pytest.mark.slow
def test_changed_messages_give_nothing_but_what_a_strict_reading_gives(program, least):
    assert_strict(program, least)


@pytest.mark.parametrize(
    ("program", "owner", "attribute", "fault", "problem"),
    [
        (fuzz_opcua, driver, "Joiner", CarelessJoiner, "a strict reading gives"),
        (fuzz_opcua, driver, "decode", broken, "ZeroDivisionError"),
    ],
)
def test_a_fault_of_a_driver_is_found(program, owner, attribute, fault, problem, monkeypatch):
    monkeypatch.setattr(owner, attribute, fault)
    assert_found(program, problem)
