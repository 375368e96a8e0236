"""Atomic file writes: the old content or the new, with the mode that the caller chose."""

import os
import stat

import pytest

from robomesh.files.atomic_write import open_atomically, write_atomically


def test_a_write_replaces_the_content_and_leaves_no_temporary_file(tmp_path):
    path = tmp_path / "state.json"
    write_atomically(path, b"first")
    write_atomically(path, b"second")
    assert path.read_bytes() == b"second"
    assert [file.name for file in tmp_path.iterdir()] == ["state.json"]


def test_an_error_in_the_block_keeps_the_old_content(tmp_path):
    path = tmp_path / "state.json"
    write_atomically(path, b"first")
    with pytest.raises(TypeError), open_atomically(path) as file:
        file.writelines([b"sec", None])
    assert path.read_bytes() == b"first"
    assert [file.name for file in tmp_path.iterdir()] == ["state.json"]


def test_only_the_owner_reads_the_file_unless_the_caller_says_otherwise(tmp_path):
    before = os.umask(0o027)
    try:
        write_atomically(tmp_path / "private", b"")
        write_atomically(tmp_path / "shared", b"", mode=0o666)
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "private").stat().st_mode) == 0o600
    assert stat.S_IMODE((tmp_path / "shared").stat().st_mode) == 0o640


@pytest.mark.parametrize(("fsync", "calls"), [(True, 2), (False, 0)])
def test_fsync_covers_the_file_and_its_folder(tmp_path, monkeypatch, fsync, calls):
    synced = []
    monkeypatch.setattr(os, "fsync", synced.append)
    write_atomically(tmp_path / "file", b"content", fsync=fsync)
    assert len(synced) == calls
