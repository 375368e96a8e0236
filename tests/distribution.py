"""Distribution of the dear tests to workers: those that share a site to one, and the longest first.

A worker that begins a long file when the other has nothing left would work alone.
"""

from pathlib import PurePosixPath

import pytest
from xdist.scheduler import LoadFileScheduling

# By the processor time that they take; all others follow, in their order.
_LONGEST_FIRST = (
    "tests/browser/define",
    "tests/browser/program",
    "tests/services/test_whole_site.py",
    "tests/services/test_define_start.py",
    "tests/browser/test_control_of_two.py",
    "tests/browser/test_what_the_operator_saw.py",
    "tests/browser/test_alarms.py",
    "tests/browser/test_robot_page.py",
    "tests/robomesh/test_wheel.py",
    "tests/compatibility/test_old_services.py",
    "tests/browser/test_embedding.py",
    "tests/browser/test_page_of_processes.py",
    "tests/browser/test_notices.py",
    "tests/browser/test_glance.py",
    "tests/browser/test_nothing_moves.py",
    "tests/browser/test_cell_on_page.py",
    "tests/browser/test_lichtblick.py",
    "tests/browser/test_draws.py",
    "tests/controllers/test_conformance_of_motion.py",
    "tests/controllers/test_conformance.py",
)


def group(test: str) -> str:
    """Return the name of what one worker runs: a file, or a folder whose tests share a site."""
    file = test.partition("::")[0]
    folder = PurePosixPath(file).parent
    return str(folder) if folder.parent.name == "browser" else file


def place(item: pytest.Item) -> int:
    """Return where a test begins: its place in the list of the longest."""
    name = group(item.nodeid)
    return _LONGEST_FIRST.index(name) if name in _LONGEST_FIRST else len(_LONGEST_FIRST)


class GroupScheduling(LoadFileScheduling):
    """Distribution of groups, in the order of the tests."""

    def _split_scope(self, nodeid: str) -> str:
        return group(nodeid)
