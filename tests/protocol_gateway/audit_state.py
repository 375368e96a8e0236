"""State that a restart takes from an audit log."""

from collections.abc import Iterable
from functools import reduce

from protocol_gateway.authority.audit_entry import Entry
from protocol_gateway.persistence.persisted_state import EMPTY, PersistedState, apply_entry


def state_after(entries: Iterable[Entry]) -> PersistedState:
    return reduce(apply_entry, entries, EMPTY)
