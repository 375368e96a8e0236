"""A few runs of the program that kills a commanding gateway; by hand it does fifty."""

import pytest

from tests.conftest import run
from tests.soak.audit_kills import kills


@pytest.mark.slow
def test_every_command_sent_is_in_the_log_after_a_kill(tmp_path):
    report = run(kills(3, tmp_path, seed=4), timeout_s=180.0)
    assert report.problems == []
    assert report.kills == 3
    assert report.commands > 0
    assert report.entries > report.commands
