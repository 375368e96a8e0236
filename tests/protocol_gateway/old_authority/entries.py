"""Entries without their time, because both controls must write the same ones."""

from functools import partial

from tests.protocol_gateway.old_authority import frozen_entries as entries

entry_of = partial(entries.entry_of, time_ns=0)
lease_entry = partial(entries.lease_entry, time_ns=0)
command_entry = partial(entries.command_entry, time_ns=0)
