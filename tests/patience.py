"""Limits of time of the gateway that a busy machine exceeds, longer where a test has another subject."""

import importlib
from collections.abc import Callable

_GATEWAY = "protocol_gateway"
# The longest time that a command waits, for the disk of the audit log too.
_WAITS = (
    "authority.admission",
    "execution.audit_trail",
    "execution.deadlines",
    "execution.motion_checks",
)
PATIENCE_S = 30.0
# Of an old client's command: a deadline, which must not be more than 5 s away.
_LEGACY_WAIT_S = 4.0
# Of pages and programs, which take leases of 2 s to 5 s, and of links. Some tests wait for the end of one.
LEAST_LEASE_S = 10.0

Put = Callable[[object, str, float], None]


def wait_patiently(put: Put) -> None:
    """Let commands wait, and leases that are taken for so long last, for `PATIENCE_S`."""
    for module in _WAITS:
        put(importlib.import_module(f"{_GATEWAY}.{module}"), "LONGEST_WAIT_S", PATIENCE_S)
    put(importlib.import_module(f"{_GATEWAY}.legacy.commander"), "LONGEST_WAIT_S", _LEGACY_WAIT_S)
    put(importlib.import_module(f"{_GATEWAY}.authority.lease_rules"), "LONGEST_TTL_S", PATIENCE_S)


def be_patient(put: Put = setattr) -> None:
    """Let commands wait for `PATIENCE_S`, and each lease, also of links, last for `LEAST_LEASE_S`."""
    wait_patiently(put)
    put(importlib.import_module("robomesh.contract.endpoints"), "LINK_LEASE_MS", round(LEAST_LEASE_S * 1e3))
    put(importlib.import_module(f"{_GATEWAY}.authority.lease_rules"), "SHORTEST_TTL_S", LEAST_LEASE_S)
