"""Runs of the tests in parts, and of what failed once more; `./dev test` uses it."""

import json
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path

# So many tests may pass only when they are run again; with so many failures the second run ends.
MOST_UNSTEADY = 2
MOST_FAILURES = 3
FAILED = "cache/lastfailed"


def run_parts(pytest: tuple[str, ...], parts: tuple[tuple[str, ...], ...], folder: Path) -> str | None:
    """Run the tests part by part, and what failed once more, alone.

    Other programs may take the machine's time from a test once, but hardly twice. A test that passes only
    when it is run again is a fault all the same, so it is named. Skipped tests are listed by reason.

    Returns:
        Why the tests failed, for `sys.exit`; None: they passed.
    """
    cache = folder / ".pytest_cache"
    shutil.rmtree(cache, ignore_errors=True)  # it lists the failures of earlier runs too
    ended, skipped = set(), Counter[str]()
    for part in parts:
        ended.add(subprocess.run([*pytest, *part], cwd=folder, check=False).returncode)
        skipped.update(kept(cache, "robomesh/skipped"))
    for reason, count in skipped.most_common():
        say(f"{count} skipped: {reason}")
    if ended == {0}:
        return None
    if ended - {0, 1}:
        return "dev: the tests could not be run; see above"
    first = set(kept(cache, FAILED))
    say(f"{len(first)} failed, and are run once more, alone")
    again = (*pytest, "--last-failed", "--last-failed-no-failures=none", f"--maxfail={MOST_FAILURES}")
    status = subprocess.run(again, cwd=folder, check=False).returncode
    # What was not run again, because enough had failed, counts as failed.
    left = set(kept(cache, FAILED)) if status else set()
    unsteady = sorted(first - left)
    if unsteady:
        say(f"{len(unsteady)} unsteady, passed only when run again; each is a fault, find it:")
        for name in unsteady:
            say(f"    {name}")
    if status:
        return "dev: tests failed; see above"
    if len(unsteady) > MOST_UNSTEADY:
        return f"dev: tests failed: more than {MOST_UNSTEADY} are unsteady"
    return None


def kept(cache: Path, name: str) -> dict[str, int]:
    """Return what pytest keeps under a name in its cache, by test or reason."""
    file = cache / "v" / name
    return json.loads(file.read_text()) if file.exists() else {}


def say(text: str) -> None:
    """Print a line for the person who waits."""
    print(f"dev: {text}", file=sys.stderr, flush=True)
