"""The program that kills a commanding gateway, a few times; by hand it does so fifty times."""

import pytest

from tests.conftest import run
from tests.soak.audit_kills import kills


@pytest.mark.slow
def test_what_reached_the_controller_is_in_the_log_whenever_the_gateway_is_killed(tmp_path):
    report = run(kills(3, tmp_path, seed=4), timeout_s=180.0)
    assert report.problems == []
    assert report.kills == 3
    assert report.commands > 0
    assert report.entries > report.commands
