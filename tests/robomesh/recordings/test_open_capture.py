"""The lock and the descriptor of an open capture."""

import errno

import pytest

from robomesh.contract.header import Header
from robomesh.contract.topics import topic
from robomesh.recordings.writing.capture import Capture, is_being_written

KEY = "robomesh/site/arm/joints"


def add(capture):
    capture.add(KEY, topic("joints"), Header(1, 1, 1), b"AAAA", received_ns=5)


def test_file_counts_as_being_written_until_it_is_closed_or_given_up(tmp_path):
    closed, failed = (Capture(tmp_path / name, {}, start_ns=1) for name in ("a.mcap", "b.mcap"))
    assert is_being_written(closed.path)
    assert is_being_written(failed.path)
    closed.finish({})
    failed.give_up()
    assert not is_being_written(closed.path)
    assert not is_being_written(failed.path)


def test_abandoned_capture_does_not_write_into_a_reused_descriptor(tmp_path):
    first = Capture(tmp_path / "a.mcap", {}, start_ns=1)
    first.give_up(OSError(errno.ENOSPC, "full"))
    second = Capture(tmp_path / "b.mcap", {}, start_ns=1)
    add(first)
    for refused in (first.write_out, first.sync, lambda: first.finish({})):
        with pytest.raises(OSError, match=r"a\.mcap is closed"):
            refused()
    first.give_up()
    second.finish({})
    assert b"AAAA" not in second.path.read_bytes()
    assert first.failure.errno == errno.ENOSPC
