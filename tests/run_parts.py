"""Runs of the tests in parts, and of what failed once more; `./dev test` uses it."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

# So many tests may pass only when they are run again; with so many failures the second run ends.
MOST_UNSTEADY = 2
MOST_FAILURES = 3


def run_parts(pytest: tuple[str, ...], parts: tuple[tuple[str, ...], ...], folder: Path) -> str | None:
    """Run the tests part by part, and what failed once more, alone.

    Other programs may take the machine's time from a test once, but hardly twice. A test that passes only
    when it is run again is a fault all the same, so it is named.

    Returns:
        Why the tests failed, for `sys.exit`; None: they passed.
    """
    cache = folder / ".pytest_cache"
    shutil.rmtree(cache, ignore_errors=True)  # it lists the failures of earlier runs too
    ended = {subprocess.run([*pytest, *part], cwd=folder, check=False).returncode for part in parts}
    if ended == {0}:
        return None
    if ended - {0, 1}:
        return "dev: the tests could not be run; see above"
    first = failed(cache)
    say(f"{len(first)} failed, and are run once more, alone")
    again = (*pytest, "--last-failed", "--last-failed-no-failures=none", f"--maxfail={MOST_FAILURES}")
    status = subprocess.run(again, cwd=folder, check=False).returncode
    # What was not run again, because enough had failed, counts as failed.
    left = failed(cache) if status else set()
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


def failed(cache: Path) -> set[str]:
    """Return the names of the tests that failed last, as pytest keeps them."""
    file = cache / "v" / "cache" / "lastfailed"
    return set(json.loads(file.read_text())) if file.exists() else set()


def say(text: str) -> None:
    """Print a line for the person who waits."""
    print(f"dev: {text}", file=sys.stderr, flush=True)
