"""Distribution of the dear tests to workers: those that share a site to one, and the longest first.

A worker that begins a long file when the other has nothing left would work alone. `durations.json` keeps how
long each group took [s]; `./dev test --keep-durations` writes it.
"""

import json
from pathlib import Path, PurePosixPath

import pytest
from xdist.scheduler import LoadFileScheduling

FILE = Path(__file__).with_name("durations.json")
# Groups without a row took less than that.
_LEAST_S = 2.0
_DURATIONS: dict[str, float] = json.loads(FILE.read_text("utf-8"))


def group(test: str) -> str:
    """Return the name of what one worker runs: a file, or a folder whose tests share a site."""
    file = test.partition("::")[0]
    folder = PurePosixPath(file).parent
    return str(folder) if folder.parent.name == "browser" else file


def place(item: pytest.Item) -> tuple[float, str]:
    """Return what orders the tests: the longest groups first."""
    name = group(item.nodeid)
    return -_DURATIONS.get(name, 0.0), name


def keep(took_s: dict[str, float]) -> None:
    """Write the durations of these groups; those of others stay."""
    kept = {name: round(took, 1) for name, took in (_DURATIONS | took_s).items() if took >= _LEAST_S}
    FILE.write_text(json.dumps(dict(sorted(kept.items())), indent=1) + "\n", "utf-8")


class GroupScheduling(LoadFileScheduling):
    """Distribution of groups, in the order of the tests."""

    def _split_scope(self, nodeid: str) -> str:
        return group(nodeid)
