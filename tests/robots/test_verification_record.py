"""Files of `robomesh robot verify` that cannot be read."""

import os
from pathlib import Path

import pytest

from robots.kinematics.verification_record import read_record
from robots.schema.errors import VerificationRecordError


def test_a_name_or_file_that_cannot_be_read_is_refused_at_once(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for path, words in ((pipe, "it is a pipe"), (Path("a\0b"), "embedded null"), (tmp_path, "directory")):
        with pytest.raises(VerificationRecordError, match=words):
            read_record(path)
