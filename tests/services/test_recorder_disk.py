"""Disk of a recorder: a write error ends one file and no other."""

import errno
import threading

import pytest

from robomesh.contract.header import Header
from robomesh.contract.topics import topic
from robomesh.recordings.recovery.recover import State, state_of
from robomesh.recordings.writing.capture import Capture
from services.recorder.disk import Disk
from services.recorder.settings import FreeSpace

KEY = "robomesh/site/arm/joints"
FULL = OSError(errno.ENOSPC, "No space left on device")
WITHIN_S = 20.0


@pytest.fixture
def failed():
    return []


@pytest.fixture
def disk(tmp_path, failed):
    no_limits = FreeSpace(warn_mib=0, video_mib=0, states_mib=0)
    disk = Disk(tmp_path, no_limits, lambda capture, _: failed.append(capture))
    yield disk
    disk.end()


def opened(disk, name):
    capture = Capture(disk.folder / name, {}, start_ns=1)
    capture.add(KEY, topic("joints"), Header(1, 1, 1), b"AAAA", received_ns=5)
    capture.hand_over()
    disk.open(capture)
    return capture


def refuse(capture, monkeypatch, attempt="write_out"):
    """Make writes of a file fail from now on, and wait until the disk has noticed."""
    noticed = threading.Event()
    give_up = capture.give_up

    def fail():
        raise FULL

    def give_up_and_notify(error=None):
        give_up(error)
        noticed.set()

    monkeypatch.setattr(capture, "give_up", give_up_and_notify)
    monkeypatch.setattr(capture, attempt, fail)
    assert noticed.wait(WITHIN_S)


def test_a_failed_file_is_closed_without_a_byte_in_the_next_one(disk, failed, monkeypatch):
    first = opened(disk, "a.mcap")
    while first.waiting_bytes:
        first.write_out()
    refuse(first, monkeypatch)
    second = opened(disk, "b.mcap")  # reuses the first one's descriptor
    with pytest.raises(OSError, match="No space left"):
        disk.close(first, {})
    disk.close(second, {})
    assert failed == [first]
    assert state_of(first.path) is State.CLOSED, "the file was not repaired"
    assert state_of(second.path) is State.CLOSED
    assert second.path.read_bytes().count(b"AAAA") == 1


def test_a_file_without_content_is_removed(disk, monkeypatch):
    capture = Capture(disk.folder / "a.mcap", {}, start_ns=1)

    def fail(missed):
        raise FULL

    monkeypatch.setattr(capture, "write_out", lambda: None)
    monkeypatch.setattr(capture, "finish", fail)
    disk.open(capture)
    with pytest.raises(OSError, match="No space left"):
        disk.close(capture, {})
    assert not capture.path.exists()


def test_a_file_can_be_opened_while_the_disk_hangs(disk, monkeypatch):
    hangs, resume = threading.Event(), threading.Event()
    first = Capture(disk.folder / "a.mcap", {}, start_ns=1)

    def hang():
        hangs.set()
        resume.wait(WITHIN_S)

    monkeypatch.setattr(first, "write_out", hang)
    disk.open(first)
    assert hangs.wait(WITHIN_S)
    opening = threading.Thread(target=disk.open, args=(Capture(disk.folder / "b.mcap", {}, start_ns=1),))
    opening.start()
    opening.join(WITHIN_S)
    blocked = opening.is_alive() or resume.is_set()
    resume.set()
    opening.join()
    assert not blocked
